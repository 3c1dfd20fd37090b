"""The second stage of a folder: which lenses the method makes, what stands behind them, and what is written."""

import dataclasses
import json
import re
import sys
import time

import numpy as np
import pytest

from lfsr_core.base.messages import LfsrError, Notice
from lfsr_core.frames.frame import LOW_RES_FILE, WORLD_FILE, Finish, read_frame, read_report, write_frame
from lfsr_core.images.color import ColorSettings, ViewTransform
from lfsr_core.images.image_files import read_layers, read_mask, read_png, write_layers
from lfsr_core.optics.rays import flip_order, from_elemental_images, to_elemental_images
from lfsr_core.reconstruct import second_stage
from lfsr_core.reconstruct.methods import METHODS, PLAIN_METHOD, load_method
from lfsr_core.reconstruct.second_stage import STAGES, finish_frame, finished_lenses, finished_linear
from lfsr_core.reconstruct.upscaler import Upscaler, foreground_mask, low_resolution, over_background, read_world
from tests.support.prerequisites import needs_bpy
from tests.support.small_disk import on_a_small_disk
from tests.support.synthetic import MINI, light_field, write_apart, write_render
from tests.support.told import refuses

pytestmark = needs_bpy  # for Blender's colour configuration


def expected_linear(folder, name):
    """The finished EIA the slow way: every lens through the method, then the background put in by hand."""
    low = low_resolution(read_layers(folder / LOW_RES_FILE), read_frame(folder))
    sx, sy = MINI.lenses
    images = load_method(name).upscaler(low, np.argwhere(np.ones((sy, sx), bool))).reshape(sy, sx, 8, 8, 3)
    images[~low.alpha.any((2, 3, 4))] = MINI.background
    return from_elemental_images(images)


def test_a_frame_of_a_device_that_is_not_here_is_denoised_on_the_cpu_and_says_so(tmp_path):
    """The same image as a frame that the CPU rendered, with a notice in the report."""
    refused = "HIP" if sys.platform == "darwin" else "METAL"
    images = {}
    for device in ("CPU", f"CPU+{refused}"):
        folder = tmp_path / device
        folder.mkdir()
        write_render(folder)
        write_frame(folder, dataclasses.replace(read_frame(folder), device=device, gpus=("0000:65:00",)))
        images[device] = second_stage.finished_linear(folder, "denoise+bilinear")
        report = finish_frame(folder, "denoise+bilinear")
        said = [note for note in report.notes if note.code == "denoised-on-cpu"]
        assert (len(said), report.device) == (device != "CPU", device)
        assert all(note.values["device"] == refused and note.values["error"] for note in said)
    np.testing.assert_array_equal(*images.values())


@pytest.mark.parametrize(("view", "order"), [("Standard", "flipped"), ("AgX", "flipped"), ("Standard", "direct")])
def test_png_is_the_linear_eia_as_blender_shows_it_in_the_displays_order(tmp_path, view, order):
    color = ColorSettings(view_transform=view, exposure=0.5)
    write_render(tmp_path, color=color, display=dataclasses.replace(MINI, ei_order=order))
    finish_frame(tmp_path, "bicubic")
    shown = ViewTransform(color).to_uint8(second_stage.finished_linear(tmp_path, "bicubic"))
    expected = flip_order(shown, MINI.lenses) if order == "flipped" else shown
    np.testing.assert_array_equal(read_png(tmp_path / "eia.png"), expected)


def test_linear_exr_is_in_panel_order_and_an_old_one_goes(tmp_path):
    write_render(tmp_path)
    finish_frame(tmp_path, Finish("bicubic", linear_exr=True))
    linear = read_layers(tmp_path / "eia.exr")["color"][..., :3]
    expected = flip_order(second_stage.finished_linear(tmp_path, "bicubic"), MINI.lenses)
    np.testing.assert_allclose(linear, expected, rtol=1e-3, atol=1e-6)
    finish_frame(tmp_path, "nearest")
    assert not (tmp_path / "eia.exr").exists()


def test_broken_pixels_are_counted_and_black_many_said_and_a_picture_of_nothing_else_refused(tmp_path):
    write_render(tmp_path)
    layers = read_layers(tmp_path / LOW_RES_FILE)
    layers["color"][20, 30] = np.nan
    layers["color"][21, 30, 0] = np.inf
    write_layers(tmp_path / LOW_RES_FILE, layers)
    assert finish_frame(tmp_path, "nearest").replaced_pixels == 2
    linear = second_stage.finished_linear(tmp_path, "nearest")
    assert np.isfinite(linear).all()
    np.testing.assert_array_equal(linear[40:42, 60:62], 0)
    layers["color"][:2] = np.nan
    write_layers(tmp_path / LOW_RES_FILE, layers)
    (note,) = finish_frame(tmp_path, "nearest").notes
    assert note.code == "pixels-replaced"
    (tmp_path / "eia.png").unlink()
    layers["color"][:] = np.inf
    write_layers(tmp_path / LOW_RES_FILE, layers)
    refuses("pixels that are not finite", finish_frame, tmp_path, "nearest")
    assert not (tmp_path / "eia.png").exists()


def test_report_has_what_the_documentation_says_and_progress_rises_to_the_end(tmp_path):
    write_render(tmp_path, seconds={"open": 0.5, "render": 2.0})
    seen = []
    finish_frame(tmp_path, "oidn+bicubic", seen.append)
    report = json.loads((tmp_path / "report.json").read_text())
    assert report["method"] == "oidn+bicubic" and tuple(report["seconds"]) == STAGES
    assert report["seconds"]["render"] == 2.5 and all(report["seconds"][stage] > 0 for stage in STAGES)
    assert report["peak_bytes"] > 50_000_000 and report["metrics"] == {}
    assert (report["replaced_pixels"], report["finish"]["dilate"], report["notes"]) == (0, 0, [])
    assert list(dict.fromkeys(told.stage for told in seen)) == ["load", "upscale", "write"]
    fractions = [told.fraction for told in seen if told.stage == "upscale"]
    assert fractions == sorted(fractions) and fractions[-1] == 1
    assert (seen[-1].stage, seen[-1].fraction) == ("write", 1.0)


DEEP = Notice("scale-unseen", {"scale": 2})
LIT = Notice("render-note", {"text": "the scene was lit"})


def test_bad_methods_and_sizes_are_errors(tmp_path):
    write_render(tmp_path)
    write_layers(tmp_path / LOW_RES_FILE, {"color": np.zeros((48, 60, 4), np.float32)})
    refuses("60×48 pixels, but frame.json says 64×48", finish_frame, tmp_path, "bicubic")
    for scale, name, message in [(2, "bicubik", "did you mean 'bicubic'"), (2, "none", "scale 2 needs an upscaler")]:
        write_render(tmp_path, scale)
        before = {path.name for path in tmp_path.iterdir()}
        refuses(message, finish_frame, tmp_path, name)
        assert {path.name for path in tmp_path.iterdir()} == before


def test_lenses_of_a_list_or_a_sample_are_finished_as_those_of_a_frame(tmp_path):
    chosen = ((5, 5), (6, 7), (4, 9))
    write_render(tmp_path)
    whole = to_elemental_images(read_layers(tmp_path / LOW_RES_FILE)["color"], MINI.lenses)
    expected = to_elemental_images(second_stage.finished_linear(tmp_path, "bicubic"), MINI.lenses)
    write_render(tmp_path, lens_list=chosen)
    across, down = read_frame(tmp_path).rays.tiles
    tiles = np.stack([whole[lens] for lens in chosen]).reshape(down, across, 4, 4, 4)
    write_layers(tmp_path / LOW_RES_FILE, {"color": from_elemental_images(tiles)})
    result = to_elemental_images(second_stage.finished_linear(tmp_path, "bicubic"), (across, down))
    for tile, lens in enumerate(chosen):
        np.testing.assert_allclose(result[tile // across, tile % across], expected[lens], atol=1e-6)
    frame = read_frame(write_apart(tmp_path))
    layers, lenses = read_layers(tmp_path / LOW_RES_FILE), np.array([(3, 5), (6, 9), (0, 0), (6, 8)])
    low, mask = low_resolution(layers, frame, read_world(tmp_path, frame)), foreground_mask(layers, MINI.lenses)
    sample = low.each(lambda layer: layer[lenses[:, 0], lenses[:, 1]][None])
    assert sample.pixels == low.alpha.size, "of the whole render"
    images = finished_lenses(sample, mask[tuple(lenses.T)], "bicubic", np.array([(0, n) for n in range(4)]))
    whole = to_elemental_images(finished_linear(tmp_path, "bicubic"), MINI.lenses)
    np.testing.assert_allclose(images, whole[tuple(lenses.T)], atol=1e-6)


class OneAtATime(Upscaler):
    """An upscaler that notices a second call while the first runs."""

    def __init__(self):
        self.running, self.calls, self.overlapped = 0, [], False

    def __call__(self, low, lenses):
        self.running += 1
        time.sleep(0.002)
        self.overlapped |= self.running > 1
        self.calls.append(len(lenses))
        self.running -= 1
        return np.full((len(lenses), 8, 8, 3), 0.5, np.float32)


def test_prefilters_see_the_eia_before_an_upscaler_that_may_run_alone_in_steps(tmp_path, monkeypatch):
    write_render(tmp_path)
    upscaler = OneAtATime()
    second_stage.finished_panel(tmp_path, "bilinear", upscaler=upscaler)
    assert not upscaler.overlapped and max(upscaler.calls) == MINI.lenses[0]
    assert sum(upscaler.calls) == foreground_mask(read_layers(tmp_path / LOW_RES_FILE), MINI.lenses).sum()
    write_render(tmp_path)
    expected = 2 * second_stage.finished_linear(tmp_path, "nearest")
    monkeypatch.setitem(METHODS, "oidn", dataclasses.replace(
        METHODS["oidn"], make=lambda _: lambda low: dataclasses.replace(low, color=2 * low.color)))
    np.testing.assert_allclose(second_stage.finished_linear(tmp_path, "oidn+nearest"), expected, rtol=1e-6)


FINISH = """from lfsr_core.frames.frame import Finish
from lfsr_core.reconstruct.second_stage import finish_frame
finish_frame(sys.argv[2], Finish("bicubic", linear_exr=True))"""


@pytest.mark.skipif(sys.platform == "win32", reason="needs a POSIX limit on file size")
def test_a_full_disk_leaves_all_files_of_the_finish_before(tmp_path):
    folder = write_render(tmp_path / "frame")
    finish_frame(folder, Finish("bicubic", linear_exr=True))
    most = (folder / "eia.exr").stat().st_size - 1
    assert all(path.stat().st_size < most for path in folder.glob("*.png"))
    finish_frame(folder, "nearest")
    before = {path.name: path.read_bytes() for path in folder.iterdir()}
    said = on_a_small_disk(most, FINISH, folder)
    assert re.search(r"eia\.exr (cannot be written|was not written completely) .*free some", said), said
    assert {path.name: path.read_bytes() for path in folder.iterdir()} == before
    assert [path.name for path in tmp_path.iterdir()] == ["frame"]


def test_only_one_process_finishes_a_folder_at_a_time(tmp_path):
    folder, messages = write_render(tmp_path / "frame"), []

    def again(*_state):
        if not messages:
            with pytest.raises(LfsrError) as refused:
                finish_frame(folder, "nearest")
            messages.append(str(refused.value))

    assert finish_frame(folder, "bicubic", tell=again).method == "bicubic"
    assert messages == [f"another process is writing {folder}: wait for it, or choose another folder"]
    assert read_report(folder).method == "bicubic" and [path.name for path in tmp_path.iterdir()] == ["frame"]


def test_what_is_written_can_be_had_without_writing_and_a_folder_finished_from_inside(tmp_path, monkeypatch):
    folder = write_render(tmp_path / "frame")
    image = second_stage.finished_panel(folder, "bicubic")
    assert not (folder / "eia.png").exists()
    monkeypatch.chdir(folder)
    finish_frame(".", "bicubic")
    np.testing.assert_array_equal(image, read_png(folder / "eia.png"))
    assert [path.name for path in tmp_path.iterdir()] == ["frame"]


@pytest.mark.parametrize(("exposure", "tone"), [(-12, "black"), (0, ""), (12, "white")])
def test_almost_black_and_almost_white_images_say_so_and_plain_frames_nothing(tmp_path, exposure, tone):
    folder = write_render(tmp_path, color=ColorSettings(exposure=exposure))
    notes = finish_frame(folder, "bilinear" if tone else "denoise+bilinear").notes
    assert notes == ((Notice("image-extreme", {"tone": tone}),) if tone else ())


def test_visible_world_fills_the_background_lenses(tmp_path):
    """Cycles weighs the environment by what shows of it: it is added, never weighted twice."""
    write_render(tmp_path, world_visible=True)
    color = read_layers(tmp_path / LOW_RES_FILE)["color"]
    sky = np.linspace(0.2, 0.9, color.shape[1])[None, :, None] * np.ones_like(color[..., :3])
    write_layers(tmp_path / LOW_RES_FILE, {"color": color, "environment": sky * (1 - color[..., 3:])})
    low = over_background(read_layers(tmp_path / LOW_RES_FILE), read_frame(tmp_path))
    np.testing.assert_allclose(low, color[..., :3] + sky * (1 - color[..., 3:]), atol=1e-6)
    result = to_elemental_images(second_stage.finished_linear(tmp_path, "bicubic"), MINI.lenses)
    mask = np.asarray(to_elemental_images(color[..., 3:], MINI.lenses).any((2, 3, 4)))
    assert 0 < mask.mean() < 1
    sky_lenses = to_elemental_images(sky, MINI.lenses)
    np.testing.assert_allclose(result[~mask].mean((1, 2)), sky_lenses[~mask].mean((1, 2)), atol=2e-3)


def test_display_background_shows_around_and_through_and_a_world_needs_its_layer(tmp_path):
    write_render(tmp_path, world_visible=True)
    refuses("no environment layer", finish_frame, tmp_path, "bicubic")
    assert not (tmp_path / "eia.png").exists()
    write_render(tmp_path, scale=1, display=dataclasses.replace(MINI, background=(0.0, 0.5, 0.0)))
    truth = light_field()
    expected = truth[..., :3] + (1 - truth[..., 3:]) * np.float32([0, 0.5, 0])
    np.testing.assert_allclose(second_stage.finished_linear(tmp_path, "none"), expected, atol=1e-6)
    finish_frame(tmp_path, "none")
    np.testing.assert_array_equal(read_png(tmp_path / "eia.png")[0, 0], [0, 188, 0])


def test_background_meshes_are_filled_cheaply_and_objects_by_the_method(tmp_path):
    write_render(tmp_path)
    color = read_layers(tmp_path / LOW_RES_FILE)["color"]
    color[..., 3] = 1
    color[..., :3] += 0.3
    index = np.full_like(color[..., :1], 2)
    index[:8, :8] = 1  # lenses (0..1, 0..1)
    write_layers(tmp_path / LOW_RES_FILE, {"color": color, "index": index})
    result, method_, cheap = (to_elemental_images(x, MINI.lenses) for x in (
        second_stage.finished_linear(tmp_path, "nearest"), expected_linear(tmp_path, "nearest"),
        expected_linear(tmp_path, PLAIN_METHOD)))
    np.testing.assert_allclose(result[:2, :2], method_[:2, :2], atol=1e-6)
    np.testing.assert_allclose(result[2:], cheap[2:], atol=1e-6)
    np.testing.assert_allclose(result[:2, 2:], cheap[:2, 2:], atol=1e-6)
    every = second_stage.finished_linear(tmp_path, "nearest", selection=False)
    np.testing.assert_allclose(every, expected_linear(tmp_path, "nearest"), atol=1e-6)


def test_mask_and_dilation_are_written_and_edges_of_background_meshes_no_foreground(tmp_path):
    write_render(tmp_path)
    report, plain = finish_frame(tmp_path, "bicubic"), read_mask(tmp_path / "mask.png")
    alpha = to_elemental_images(read_layers(tmp_path / LOW_RES_FILE)["color"][..., 3:], MINI.lenses)
    np.testing.assert_array_equal(plain, alpha.any((2, 3, 4)))
    assert report.foreground_fraction == pytest.approx(plain.mean())
    assert finish_frame(tmp_path, Finish("bicubic", dilate=1)).foreground_fraction > plain.mean()
    assert (read_mask(tmp_path / "mask.png") >= plain).all()
    write_render(tmp_path)
    layers = read_layers(tmp_path / LOW_RES_FILE)
    layers["index"] = np.where(layers["color"][..., 3:] == 1, np.float32(2), np.float32(0))
    write_layers(tmp_path / LOW_RES_FILE, layers)
    report = finish_frame(tmp_path, "nearest")
    assert report.foreground_fraction == 0 and report.notes[0].code == "subject-unseen"
    write_render(tmp_path, notes=(LIT,), scale_reason=DEEP)
    assert finish_frame(tmp_path, "bicubic").notes == (DEEP, LIT)


@pytest.mark.parametrize("name", ["bilinear", "oidn+pool"])
def test_lenses_without_subject_see_the_world_alone(tmp_path, name):
    write_apart(tmp_path)
    result = to_elemental_images(finished_linear(tmp_path, name), MINI.lenses)
    empty = ~to_elemental_images(read_layers(tmp_path / LOW_RES_FILE)["color"][..., 3:], MINI.lenses).any((2, 3, 4))
    assert 0.1 < empty.mean() < 0.9
    world = read_world(tmp_path, read_frame(tmp_path)).elemental_images(np.argwhere(empty))
    # A denoiser leaves next to nothing where there was nothing.
    np.testing.assert_allclose(result[empty], world, atol=1e-6 if name == "bilinear" else 2e-3)


def test_an_opaque_subject_hides_the_world_and_one_that_is_gone_is_refused(tmp_path):
    def opaque(color):
        return np.concatenate([color[..., :3] + 0.1, np.ones_like(color[..., 3:])], -1)
    write_apart(tmp_path / "apart", paint=opaque)
    write_apart(tmp_path / "bright", world=5.0, paint=opaque)
    np.testing.assert_array_equal(*(finished_linear(tmp_path / name, "bicubic") for name in ("apart", "bright")))
    frame = read_frame(write_apart(tmp_path))
    write_layers(tmp_path / WORLD_FILE, {"color": np.ones((9, 7, 3), np.float32)})
    refuses("7×9 pixels, but its frame.json asks for", finished_linear, tmp_path, "bilinear")
    (tmp_path / WORLD_FILE).unlink()
    refuses(r"world\.exr", finished_linear, tmp_path, "bilinear")
    assert read_world(tmp_path, dataclasses.replace(frame, world_apart=False)) is None


@pytest.mark.parametrize("name", ["nearest", "bilinear", "pool"])
def test_a_subject_of_the_worlds_colour_is_not_seen(tmp_path, name):
    """Colour and what it hides are upscaled alike: no seam is left where they meet."""
    frame = read_frame(write_apart(tmp_path, world=1.0, paint=lambda color: np.repeat(color[..., 3:], 4, -1)))
    low = low_resolution(read_layers(tmp_path / LOW_RES_FILE), frame, read_world(tmp_path, frame))
    low = dataclasses.replace(low, slope=np.where(low.alpha > 0, np.float32(0.4), np.nan))
    lenses = np.argwhere(np.ones(low.alpha.shape[:2], bool))
    np.testing.assert_allclose(finished_lenses(low, np.ones(len(lenses), bool), name, lenses), 1.0, atol=1e-5)


def test_guides_do_not_show_the_world(tmp_path):
    """Cycles adds to the albedo what shows of a world that is rendered apart; opacity is denoised without guides."""
    frame, layers = read_frame(write_apart(tmp_path)), read_layers(tmp_path / LOW_RES_FILE)
    world = layers["environment"]
    guided = layers | {"albedo": 0.5 * (1 - world) + world, "normal": np.zeros_like(world)}
    low = low_resolution(guided, frame, read_world(tmp_path, frame))
    np.testing.assert_allclose(low.guides[..., :3], 0.5 * low.opacity, atol=1e-6)
    assert low.guides.shape == (*low.color.shape[:4], 6)
    prepared, plain = (load_method("denoise+bilinear").prepare(image)
                       for image in (low, dataclasses.replace(low, guides=None)))
    np.testing.assert_array_equal(prepared.cover.color, plain.cover.color)
    assert not np.array_equal(prepared.color, plain.color)
