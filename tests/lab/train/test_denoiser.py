"""Crops, losses and training of the denoiser."""

import dataclasses
import json
import os

import numpy as np
import pytest
import torch
from hypothesis import given
from hypothesis import strategies as st

from lfsr_core.base.messages import LfsrError
from lfsr_core.optics.rays import from_elemental_images, to_elemental_images
from lfsr_core.reconstruct.methods import denoise
from lfsr_lab.networks.denoiser import hdr_decode, hdr_encode
from lfsr_lab.train.config import DenoiserConfig
from lfsr_lab.train.denoiser.data import RENDERS, crops, load_scene, load_scenes, mirrored, print_textures, printed
from lfsr_lab.train.denoiser.task import DenoiserTask, losses, rate, window
from lfsr_lab.train.loop import RunOptions, Schedule, Stop, run
from lfsr_lab.train.session import train
from tests.support.told import refuses

LENSES, EI = (8, 6), (5, 6)  # (sx, sy), (h, w)


def write_scene(folder, index, ei=EI, **changes):
    """A scene of smooth elemental images with noise, in the format of training_scenes.py."""
    rng, (height, width) = np.random.default_rng(index), (LENSES[1] * ei[0], LENSES[0] * ei[1])
    clean = np.ones((height, width, 4), np.float32)
    clean[..., :3] = np.linspace(0.1, 0.9, width)[:, None] * rng.uniform(0.2, 1, 3)
    layers = {"color_target": clean}
    for name in RENDERS:
        noise = rng.gamma(samples := int(name[:-2]), 1 / samples, clean.shape[:2])[..., None] ** (1, 1, 1, 0)
        layers |= {f"color_{name}": clean * noise,
                   f"guides_{name}": np.concatenate([clean[..., :3], clean[..., :3] * 2 - 1], -1)}
    meta = {"views": [ei[1] * 4, ei[0] * 4 if ei[0] > 1 else 1], "scale": 4, "is_direct": False,
            "validates": index % 10 == 9} | changes
    layers = {name: layer.astype(np.float16) for name, layer in layers.items()}
    np.savez(folder / f"scene_{index:06d}.npz", **layers, meta=np.array(json.dumps(meta)))


@pytest.fixture(autouse=True, scope="module")
def one_thread():
    """Threads that share busy cores wait for one another: images this small are faster without."""
    before = torch.get_num_threads()
    torch.set_num_threads(1)
    yield
    torch.set_num_threads(before)


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    folder = tmp_path_factory.mktemp("scenes")
    for index in (0, 1, 9):
        write_scene(folder, index)
    write_scene(folder, 2, (1, 6))
    return folder


@pytest.fixture(scope="module")
def scenes(folder):
    return load_scenes(folder)


def config(folder, **changes):
    return DenoiserConfig("denoiser", str(folder), **{
        "size": "small", "start": "", "side": 24, "batch": 2, "epochs": 2, "steps_per_epoch": 2, "validate_every": 1,
        "checkpoint_every": 1} | changes)


@given(st.integers(1, 5), st.integers(1, 5), st.integers(1, 4), st.integers(1, 4))
def test_training_mirrors_as_the_product_does(sy, sx, h, w):
    image = np.random.default_rng(0).random((sy * h, sx * w, 3))
    expected = from_elemental_images(denoise.mirrored(to_elemental_images(image, (sx, sy))))
    np.testing.assert_array_equal(mirrored(image, (h, w)), expected)


def parts(scenes, samples, seed=0, side=30, **more):
    """Crops of each scene alone: together they need elemental images of one size."""
    return [crops([scene], [samples], np.random.default_rng(seed), side, torch.device("cpu"), **more)
            for scene in scenes]


def test_more_samples_are_less_noise_and_the_target_itself_has_the_least_loss(scenes):
    for samples in (1, 2, 4, 8, 16, 32, 64, 256):
        part = parts(scenes[:1], samples, side=100, augment=False)[0]
        noise = hdr_decode(part.inputs[:, :3][(..., *part.inside)]) / part.target - 1
        assert noise.std() == pytest.approx(samples ** -0.5, rel=0.15), samples
    for part in parts(scenes, 1):
        perfect = hdr_encode(torch.zeros(1, 3, *part.inputs.shape[2:]))
        perfect[(..., *part.inside)] = hdr_encode(part.target)
        least, noise = losses(perfect, part), losses(part.inputs[:, :3], part)
        assert least[0] < 1e-3 and least[1] < 0.05
        assert noise[0] > 10 * least[0] and noise[1] > 2 * least[1]


def test_each_crop_of_a_batch_has_the_loss_that_it_has_alone(scenes):
    together = crops(scenes[:2], [1, 16], np.random.default_rng(3), 24, torch.device("cpu"))
    both = losses(together.inputs[:, :3], together)
    for index in range(2):
        tensors = {name: getattr(together, name)[index:index + 1] for name in ("inputs", "target", "shown")}
        alone = dataclasses.replace(together, **tensors, scales=together.scales[index:index + 1])
        torch.testing.assert_close(torch.cat(losses(alone.inputs[:, :3], alone)), torch.stack(both)[:, index])


@given(st.integers(0, 10_000), st.sampled_from((8, 24, 100)))
def test_crops_hold_whole_elemental_images_of_the_scene(scenes, seed, side):
    for part in parts(scenes, 4, seed, side):
        height, width = part.target.shape[2:]
        assert height % part.ei[0] == width % part.ei[1] == 0 and part.shown.min() == 1
        assert part.inputs[(..., *part.inside)].shape == (1, 9, *part.target.shape[2:])
        # One of its colours at least is the noisy target: what the network sees there is near it.
        seen, target = part.inputs[:, :3][(..., *part.inside)], hdr_encode(part.target)
        assert (seen - target).abs().mean() < 0.15


def test_some_crops_have_no_guides_and_the_rate_rises_and_falls(scenes):
    inputs = [parts(scenes[:1], 16, seed, 24)[0].inputs for seed in range(100)]
    assert 2 <= sum(bool((crop[:, 3:6] == 0).all() and (crop[:, 6:] == 0.5).all()) for crop in inputs) <= 35
    settings = dataclasses.replace(config("x"), epochs=10, steps_per_epoch=100)
    course = [rate(settings, step) for step in range(1000)]
    assert max(course) == pytest.approx(settings.rate, rel=0.05) and course[0] < settings.rate / 50
    assert course[-1] == pytest.approx(settings.rate * 0.02, rel=0.05)


@given(st.integers(0, 500), st.sampled_from([(1, 1), (5, 5), (1, 8)]))
def test_a_printed_texture_is_the_same_in_every_crop_and_in_all_that_a_crop_holds(scenes, seed, ei):
    whole, part = (printed(axes, ei, 4, np.random.default_rng(seed), torch.device("cpu"))
                   for axes in ([(0, 20), (0, 40)], [(5, 5), (16, 10)]))
    assert 0 <= whole[0].min() < whole[0].max() <= 1 + 1e-6 and whole[1].min() >= 0 and whole[1].max() <= 0.5 + 1e-6
    torch.testing.assert_close(part[0], whole[0][5:10, 16:26])
    rendered, target, guides = images = [torch.ones(40, channels, 30, 48) for channels in (3, 3, 6)]
    print_textures(images, [10**8] * 40, [[0] * 40] * 2, [(0, 0)] * 2, scenes[:1] * 40, np.random.default_rng(seed))
    torch.testing.assert_close(rendered, target, atol=1e-3, rtol=0)
    torch.testing.assert_close(guides, torch.cat([rendered, torch.ones_like(target)], 1))
    assert 1 <= (target.std((1, 2, 3)) > 0).sum() <= 25


@given(st.integers(1, 30), st.floats(0.2, 3))
def test_windows_add_up_to_one(length, sigma):
    torch.testing.assert_close(window(length, sigma).sum(0), torch.ones(length))


def test_training_lowers_the_loss_and_writes_weights_that_the_library_runs(folder, tmp_path, scenes):
    outcome = train(config(folder), tmp_path / "weights")
    content = denoise.load(outcome.weights)
    image = np.random.default_rng(0).gamma(4, 0.1, (32, 32, 3)).astype(np.float32)
    assert np.isfinite(denoise.denoise_eia(image, weights=content)).all()
    facts = json.loads(outcome.weights.with_suffix(".json").read_text())
    assert facts["data"]["scenes"] == 3 and facts["data"]["validating"] == 1
    assert 0 < facts["validation"]["validation.ssim_4"] < 1
    task = DenoiserTask(config(folder, epochs=1, steps_per_epoch=25, rate=2e-3), scenes, torch.device("cpu"))
    before = task.validate()
    run(task, Schedule(1, 1, 1), tmp_path)
    after = task.validate()
    assert all(after[name] > value for name, value in before.items())


def test_a_resumed_training_ends_as_an_uninterrupted_one(folder, scenes, tmp_path):
    def task():
        return DenoiserTask(config(folder), scenes, torch.device("cpu"))

    whole = task()
    run(whole, Schedule(2, 1, 1), tmp_path / "whole")
    stop, first = Stop(), task()
    step = first.step

    def stopping(index):
        stop.asked = first.epoch == 1
        return step(index)

    first.step = stopping
    assert run(first, Schedule(2, 1, 1), tmp_path / "parts", RunOptions(stop=stop)).stopped
    second = task()
    run(second, Schedule(2, 1, 1), tmp_path / "parts", RunOptions(resume=True))
    for name, value in whole.average.items():
        torch.testing.assert_close(second.average[name], value)


@pytest.mark.parametrize(("write", "message"), [(lambda path: None, "holds 0 training scenes and 0 that validate"),
    (lambda path: path.write_bytes(b"PK"), "scene_000000.npz cannot be read as a scene of training_scenes.py"),
    (os.mkfifo, "not a regular file")])
def test_damaged_and_missing_scenes_are_one_sentence(tmp_path, write, message):
    write(tmp_path / "scene_000000.npz")
    refuses(message, load_scenes, tmp_path)


@pytest.mark.parametrize("change", [{"meta": "[]"}, {"meta": '{"scale": 4}'}, {"scale": 0}, {"scale": 4.0},
    {"views": [24]}, {"views": [24, "20"]}, {"views": [24, 2]}, {"views": [20, 20]}, {"is_direct": 1},
    {"validates": "no"}, {"scale": 10**30}, {"meta": np.array([{}], object)}, {"color_target": None}, {"color_4": None},
    {"color_1_0": np.zeros((30, 48, 3), np.float16)}, {"color_1_0": np.zeros((30, 47, 4), np.float16)},
    {"color_1_0": np.array(3.0)}, {"color_target": np.zeros((30, 48, 4), "U3")},
    {"color_16_0": np.full((30, 48, 4), np.nan, np.float16)}, {"guides_1_0": np.zeros((30, 48, 4), np.float16)}])
def test_a_scene_of_other_content_is_one_sentence(tmp_path, change):
    path, of_meta = tmp_path / "scene_000000.npz", ("scale", "views", "is_direct", "validates")
    write_scene(tmp_path, 0, **{name: value for name, value in change.items() if name in of_meta})
    gone = tuple(name for name, value in change.items() if value is None)
    with np.load(path) as file:
        content = {name: array for name, array in file.items() if not name.startswith(gone)}
    np.savez(path, **content | {name: value for name, value in change.items()
                                if value is not None and name not in of_meta})
    with pytest.raises(LfsrError, match=r"000.npz cannot be read as a scene .*: make it again") as told:
        load_scene(path)
    assert "pickle" not in str(told.value)
