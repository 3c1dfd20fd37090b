"""Training scenes at tiny size: complete, repeatable, resumable files that agree with each other."""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path

import numpy as np
import OpenImageIO as oiio
import pytest

from tests.support.prerequisites import needs_bpy

pytestmark = [needs_bpy, pytest.mark.slow]
SCRIPTS = Path(__file__).parents[3] / "scripts" / "lab" / "lfsr_lab" / "scenes"
SCALE, LENSES, VIEWS = 2, (6, 4), (8, 8)
SPPS, REFERENCE_SPP, SEED = (15, 16), 64, 10
DISPLAY = """
name = "tiny"
panel_pixels = [48, 32]
panel_mm = [88.56, 59.04]
lenses = [6, 4]
views = [8, 8]
viewing_distance_mm = 500.0
viewing_angle_deg = 40.0
"""


@pytest.fixture(scope="module")
def inputs(tmp_path_factory):
    """A display file and two photographs."""
    folder = tmp_path_factory.mktemp("inputs")
    folder.joinpath("tiny.toml").write_text(DISPLAY, encoding="utf-8")
    rng = np.random.default_rng(0)
    for index in range(2):
        write_picture(folder / "photos" / f"{index}.png", rng.random((48, 64, 3), np.float32))
    return folder


def write_picture(path, pixels):
    path.parent.mkdir(exist_ok=True)
    picture = oiio.ImageBuf(oiio.ImageSpec(pixels.shape[1], pixels.shape[0], 3, "uint8"))
    picture.set_pixels(picture.roi, pixels)
    assert picture.write(str(path))


def run(inputs, output, *options):
    """The script in a process of its own: exit code and its messages."""
    command = [sys.executable, SCRIPTS / "training_scenes.py", "--output", output, "--display", inputs / "tiny.toml",
               "--textures", inputs / "photos", "--scale", SCALE, "--spps", ",".join(map(str, SPPS)),
               "--reference-spp", REFERENCE_SPP, "--seed", SEED, "--threads", 2, *options]
    result = subprocess.run([str(part) for part in command], capture_output=True, text=True, check=False)
    lines = [line.removeprefix("LFSR ") for line in result.stdout.splitlines() if line.startswith("LFSR ")]
    return result.returncode, [json.loads(line) for line in lines]


@pytest.fixture(scope="module")
def scenes(inputs, tmp_path_factory):
    """Folder with scenes 0 and 1, and the messages of making them."""
    folder = tmp_path_factory.mktemp("scenes")
    code, messages = run(inputs, folder, "--count", 2)
    assert code == 0, messages
    return folder


@pytest.fixture
def parts(monkeypatch):
    """The script's own modules."""
    monkeypatch.syspath_prepend(str(SCRIPTS))
    from training import produce, textures

    return produce, textures


def load(folder, index):
    with np.load(folder / f"scene_{index:06d}.npz", allow_pickle=False) as file:
        arrays = {name: file[name] for name in file.files}
    return arrays, json.loads(str(arrays.pop("meta")))


@pytest.mark.parametrize("index", [0, 1])
def test_a_file_holds_every_render_and_how_it_was_made(scenes, index):
    arrays, meta = load(scenes, index)
    width, height = (lens * view for lens, view in zip(LENSES, VIEWS, strict=True))
    low = (height // SCALE, width // SCALE)
    denoised = {f"{kind}_{n}": (*low, 3) for n in SPPS for kind in ("oidn", "guided")}
    expected = {f"lr_{n}": (*low, 10) for n in SPPS} | denoised
    expected |= {"ref_a": (height, width, 4), "ref_b": (height, width, 4)}
    assert {name: array.shape for name, array in arrays.items()} == expected
    assert all(array.dtype == np.float16 and np.isfinite(array).all() for array in arrays.values())
    assert (meta["lenses"], meta["views"], meta["scale"]) == (list(LENSES), list(VIEWS), SCALE)
    assert (meta["spps"], meta["reference_spp"]) == (list(SPPS), REFERENCE_SPP)
    assert (meta["seed"], meta["index"]) == (SEED, index)
    assert len(set(meta["seeds"].values())) == len(SPPS) + 2


@pytest.mark.parametrize("index", [0, 1])
def test_layers_hold_what_their_names_say(scenes, index):
    arrays, meta = load(scenes, index)
    for samples in SPPS:
        low = arrays[f"lr_{samples}"].astype(np.float32)
        alpha, albedo, normal = low[..., 3], low[..., 4:7], low[..., 7:]
        assert alpha.min() >= 0 and alpha.max() <= 1.001 and alpha.max() > 0.3
        assert albedo.min() >= 0 and albedo.max() > 0.02
        length = np.linalg.norm(normal, axis=-1)
        assert length.max() <= 1.01 and normal.min() < 0 < normal.max()
        assert np.abs(low[alpha == 0]).max(initial=0) < 1e-3
    lit = arrays["ref_a"].astype(np.float32)
    sees = (lit[..., 3].reshape(LENSES[1], VIEWS[1], LENSES[0], VIEWS[0]).max((1, 3)) > 0).mean()
    assert meta["p"] == pytest.approx(sees) and meta["p"] >= 0.1


@pytest.mark.parametrize("index", [0, 1])
@pytest.mark.parametrize("channels", [slice(3, 4), slice(0, 3)], ids=["alpha", "color"])
def test_low_resolution_is_the_box_downsampled_reference_within_noise(scenes, index, channels):
    arrays, _ = load(scenes, index)
    first, second = (arrays[f"lr_{n}"][..., channels].astype(np.float64) for n in SPPS)
    half_a, half_b = (downsampled(arrays[name][..., channels].astype(np.float64)) for name in ("ref_a", "ref_b"))
    # Means of two independent renders: their differences tell both noises.
    noise = ((first - second) / 2) ** 2 + ((half_a - half_b) / 2) ** 2
    error = ((first + second) / 2 - (half_a + half_b) / 2) ** 2
    kept = error <= np.quantile(error, 0.98)  # clamped highlights apart
    assert error[kept].mean() < 2 * noise[kept].mean() + 1e-6
    shifted = ((first + second) / 2 - np.roll((half_a + half_b) / 2, 1, axis=1)) ** 2
    assert shifted[kept].mean() >= error[kept].mean()


def downsampled(image):
    height, width, channels = image.shape
    return image.reshape(height // SCALE, SCALE, width // SCALE, SCALE, channels).mean((1, 3))


def test_denoising_keeps_the_picture_and_lowers_its_noise(scenes):
    arrays, _ = load(scenes, 0)
    clean = arrays["oidn_16"].astype(np.float64)
    noisy = arrays["lr_16"][..., :3].astype(np.float64)
    assert clean.min() >= 0
    assert np.clip(clean, 0, 2).mean() == pytest.approx(np.clip(noisy, 0, 2).mean(), rel=0.25)
    assert not np.array_equal(clean, noisy)


def test_a_scene_does_not_depend_on_order_workers_or_place(inputs, scenes, tmp_path):
    code, messages = run(inputs, tmp_path, "--first", 1, "--count", 2, "--workers", 2)
    assert code == 0, messages
    (arrays, meta), (again, meta_again) = load(scenes, 1), load(tmp_path, 1)
    assert meta_again["scene"] == meta["scene"] and meta_again["seeds"] == meta["seeds"]
    for name in arrays:
        close = np.isclose(arrays[name].astype(np.float32), again[name].astype(np.float32), rtol=0.02, atol=0.02)
        assert close.mean() > 0.98, name


def test_other_numbers_and_other_seeds_are_other_scenes(inputs, scenes, tmp_path):
    code, messages = run(inputs, tmp_path, "--seed", SEED + 1)
    assert code == 0, messages
    described = [load(*where)[1]["scene"] for where in ((scenes, 0), (scenes, 1), (tmp_path, 0))]
    assert described[0] != described[1] and described[0] != described[2]


def test_a_second_run_makes_only_what_is_missing(inputs, scenes):
    kept, lost = (scenes / f"scene_{index:06d}.npz" for index in (0, 1))
    before = kept.stat().st_mtime_ns
    lost.unlink()
    remains = scenes / ".scene_000001-killed.npz"
    remains.write_bytes(b"half")
    code, messages = run(inputs, scenes, "--count", 2)
    assert code == 0
    assert messages[0] == {"stage": "start", "scenes": 1, "complete": 1}
    assert kept.stat().st_mtime_ns == before and lost.is_file() and not remains.exists()


@pytest.mark.filterwarnings("ignore::pytest.PytestUnraisableExceptionWarning")  # the zip file that was cut short
def test_a_write_that_breaks_leaves_nothing(parts, tmp_path):
    produce, _ = parts
    unwritable = np.array([lambda: 0], object)
    with pytest.raises(Exception, match="pickle"):
        produce._save(tmp_path / "scene_000000.npz", {"lr_1": np.zeros(9), "meta": unwritable}, compress=False)
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize(("options", "message"), [
    (("--spps", "1,x"), "'1,x'"), (("--reference-spp", 7), "is 7"), (("--scale", 3), "scale is 3"),
    (("--textures", "nowhere"), "nowhere"), (("--spps", "4"), "other settings")])
def test_bad_input_is_one_sentence(inputs, scenes, options, message):
    code, messages = run(inputs, scenes, "--first", 7, *options)
    assert code == 2 and messages[-1]["stage"] == "error"
    assert message in messages[-1]["message"] and "\n" not in messages[-1]["message"]
    assert not (scenes / "scene_000007.npz").exists()


def test_photographs_are_made_small(parts, tmp_path):
    _, textures = parts
    write_picture(tmp_path / "big" / "photo.png", np.full((60, 120, 3), [0.2, 0.5, 0.8], np.float32))
    assert textures.prepare_textures(tmp_path / "big", tmp_path / "small", 40) == 1
    small = oiio.ImageBuf(str(tmp_path / "small" / "photo.jpg"))
    assert (small.spec().width, small.spec().height) == (40, 20)
    assert small.get_pixels(oiio.FLOAT).mean((0, 1)) == pytest.approx([0.2, 0.5, 0.8], abs=0.02)
