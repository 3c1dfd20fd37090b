import dataclasses
import json
import re
import sys
import time

import numpy as np
import pytest

from lfsr_core.base.errors import LfsrError
from lfsr_core.base.notices import Notice
from lfsr_core.frames import low_res
from lfsr_core.frames.frame import LOW_RES_FILE, read_frame, write_frame
from lfsr_core.frames.request import Finish, read_report
from lfsr_core.images.color import ColorSettings
from lfsr_core.images.exr import read_layers, write_layers
from lfsr_core.images.png import read_png
from lfsr_core.images.view_transform import ViewTransform
from lfsr_core.optics import eia
from lfsr_core.pipeline.make import finish_frame
from lfsr_core.reconstruct import second_stage
from lfsr_core.reconstruct.methods import METHODS
from lfsr_core.reconstruct.second_stage import STAGES
from lfsr_core.reconstruct.upscaler import Upscaler
from tests.support.prerequisites import needs_bpy
from tests.support.slow_way import expected_linear
from tests.support.small_disk import on_a_small_disk
from tests.support.synthetic import FLAT, MINI, light_field, write_render
from tests.support.told import refuses

pytestmark = needs_bpy  # for Blender's colour configuration


@pytest.mark.parametrize("name", ["bicubic", "nearest", "bicubic-eia"])
def test_finished_eia_is_the_method_on_every_foreground_lens(tmp_path, name):
    write_render(tmp_path)
    result = second_stage.finished_linear(tmp_path, name)
    np.testing.assert_allclose(result, expected_linear(tmp_path, name), atol=1e-6)


@pytest.mark.parametrize(("display", "shape"), [(MINI, (96, 128, 3)), (FLAT, (48, 128, 3))])
def test_upscaling_comes_near_the_true_light_field(tmp_path, display, shape):
    write_render(tmp_path, display=display)
    truth = light_field(display)[..., :3]
    error = {name: np.sqrt(np.mean((second_stage.finished_linear(tmp_path, name) - truth) ** 2))
             for name in ("nearest", "bicubic")}
    assert error["bicubic"] < 0.06 and error["bicubic"] < error["nearest"]
    finish_frame(tmp_path, "oidn+pool")
    assert read_png(tmp_path / "eia.png").shape == shape


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
    expected = eia.flip_order(shown, MINI.lenses) if order == "flipped" else shown
    np.testing.assert_array_equal(read_png(tmp_path / "eia.png"), expected)


def test_linear_exr_is_in_panel_order_and_an_old_one_goes(tmp_path):
    write_render(tmp_path)
    finish_frame(tmp_path, Finish("bicubic", linear_exr=True))
    linear = read_layers(tmp_path / "eia.exr")["color"][..., :3]
    expected = eia.flip_order(second_stage.finished_linear(tmp_path, "bicubic"), MINI.lenses)
    np.testing.assert_allclose(linear, expected, rtol=1e-3, atol=1e-6)
    finish_frame(tmp_path, "nearest")
    assert not (tmp_path / "eia.exr").exists()


def test_broken_pixels_are_counted_and_black(tmp_path):
    write_render(tmp_path)
    layers = read_layers(tmp_path / LOW_RES_FILE)
    layers["color"][20, 30] = np.nan
    layers["color"][21, 30, 0] = np.inf
    write_layers(tmp_path / LOW_RES_FILE, layers)
    assert finish_frame(tmp_path, "nearest").replaced_pixels == 2
    linear = second_stage.finished_linear(tmp_path, "nearest")
    assert np.isfinite(linear).all()
    np.testing.assert_array_equal(linear[40:42, 60:62], 0)


def test_a_picture_with_many_broken_pixels_is_said_and_one_of_nothing_else_refused(tmp_path):
    write_render(tmp_path)
    layers = read_layers(tmp_path / LOW_RES_FILE)
    layers["color"][:2] = np.nan
    write_layers(tmp_path / LOW_RES_FILE, layers)
    (note,) = finish_frame(tmp_path, "nearest").notes
    assert note.code == "pixels-replaced"
    (tmp_path / "eia.png").unlink()
    layers["color"][:] = np.inf
    write_layers(tmp_path / LOW_RES_FILE, layers)
    refuses("pixels that are not finite", finish_frame, tmp_path, "nearest")
    assert not (tmp_path / "eia.png").exists()


def test_edges_of_background_meshes_alone_are_no_foreground(tmp_path):
    write_render(tmp_path)
    layers = read_layers(tmp_path / LOW_RES_FILE)
    layers["index"] = np.where(layers["color"][..., 3:] == 1, np.float32(2), np.float32(0))
    write_layers(tmp_path / LOW_RES_FILE, layers)
    report = finish_frame(tmp_path, "nearest")
    assert report.foreground_fraction == 0 and report.notes[0].code == "subject-unseen"
    write_render(tmp_path, notes=(LIT,), scale_reason=DEEP)
    assert finish_frame(tmp_path, "bicubic").notes == (DEEP, LIT)


def test_report_has_what_the_documentation_says_and_progress_rises_to_the_end(tmp_path):
    write_render(tmp_path, seconds={"open": 0.5, "render": 2.0})
    seen = []
    finish_frame(tmp_path, "oidn+bicubic", seen.append)
    report = json.loads((tmp_path / "report.json").read_text())
    assert report["method"] == "oidn+bicubic"
    assert tuple(report["seconds"]) == STAGES
    assert report["seconds"]["render"] == 2.5
    assert all(report["seconds"][stage] > 0 for stage in STAGES)
    assert report["peak_bytes"] > 50_000_000
    assert report["metrics"] == {}
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
    for scale, name, message in [
        (2, "bicubik", "did you mean 'bicubic'"),
        (2, "none", "scale 2 needs an upscaler"),
    ]:
        write_render(tmp_path, scale)
        before = {path.name for path in tmp_path.iterdir()}
        refuses(message, finish_frame, tmp_path, name)
        assert {path.name for path in tmp_path.iterdir()} == before


def test_lens_list_is_finished_as_tiles(tmp_path):
    chosen = ((5, 5), (6, 7), (4, 9))
    write_render(tmp_path)
    whole = eia.to_elemental_images(read_layers(tmp_path / LOW_RES_FILE)["color"], MINI.lenses)
    expected = eia.to_elemental_images(second_stage.finished_linear(tmp_path, "bicubic"), MINI.lenses)
    write_render(tmp_path, lens_list=chosen)
    across, down = read_frame(tmp_path).rays.tiles
    tiles = np.stack([whole[lens] for lens in chosen]).reshape(down, across, 4, 4, 4)
    write_layers(tmp_path / LOW_RES_FILE, {"color": eia.from_elemental_images(tiles)})
    result = eia.to_elemental_images(second_stage.finished_linear(tmp_path, "bicubic"), (across, down))
    for tile, lens in enumerate(chosen):
        np.testing.assert_allclose(result[tile // across, tile % across], expected[lens], atol=1e-6)


def test_prefilters_see_the_low_resolution_eia_before_the_upscaler(tmp_path, monkeypatch):
    write_render(tmp_path)
    expected = 2 * second_stage.finished_linear(tmp_path, "nearest")

    def doubled(low):
        return dataclasses.replace(low, color=2 * low.color)

    monkeypatch.setitem(METHODS, "oidn", dataclasses.replace(METHODS["oidn"], make=lambda _: doubled))
    np.testing.assert_allclose(second_stage.finished_linear(tmp_path, "oidn+nearest"), expected, rtol=1e-6)


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


def test_an_upscaler_that_is_not_thread_safe_runs_alone_in_steps(tmp_path):
    write_render(tmp_path)
    upscaler = OneAtATime()
    second_stage.finished_panel(tmp_path, "bilinear", upscaler=upscaler)
    assert not upscaler.overlapped
    assert max(upscaler.calls) == MINI.lenses[0]
    assert sum(upscaler.calls) == low_res.foreground_mask(read_layers(tmp_path / LOW_RES_FILE), MINI.lenses).sum()


FINISH = """from lfsr_core.frames.request import Finish
from lfsr_core.pipeline.make import finish_frame
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
    folder = write_render(tmp_path / "frame")
    messages = []

    def again(*_state):
        if not messages:
            with pytest.raises(LfsrError) as refused:
                finish_frame(folder, "nearest")
            messages.append(str(refused.value))

    assert finish_frame(folder, "bicubic", tell=again).method == "bicubic"
    assert messages == [f"another process is writing {folder}: wait for it, or choose another folder"]
    assert read_report(folder).method == "bicubic"
    assert [path.name for path in tmp_path.iterdir()] == ["frame"]


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
