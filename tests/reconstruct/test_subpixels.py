"""The second stage after direct subpixel rendering."""

import numpy as np
import pytest

from lfsr_core.cli import main
from lfsr_core.frames.finish import Finish, read_report
from lfsr_core.frames.frame import EIA_FILE, PANEL_FILE, read_frame, read_rendered
from lfsr_core.images.exr import read_layers, write_layers
from lfsr_core.images.png import read_png
from lfsr_core.pipeline.make import finish_frame
from tests.support.panels import SHEETS, cells, hexagonal
from tests.support.prerequisites import needs_bpy
from tests.support.synthetic import fails, write_reference, write_render, write_traced
from tests.support.told import refuses

pytestmark = needs_bpy  # for Blender's colour configuration


def psnr(first, second):
    return -10 * np.log10((((first.astype(float) - second) / 255) ** 2).mean())


@pytest.mark.parametrize("sheet", ["cells", "hexagonal"])
def test_direct_subpixel_rendering_is_the_image_woven_of_every_view(tmp_path, sheet):
    display = SHEETS[sheet](weave="all")
    finish_frame(write_traced(tmp_path / "direct", display), "none")
    finish_frame(write_render(tmp_path / "woven", 1, display), "none")
    direct, woven = (read_png(tmp_path / name / PANEL_FILE) for name in ("direct", "woven"))
    assert direct.shape == woven.shape and direct.std() > 10
    # The least is what interpolation costs at the edge of the disc and in its waves; the rest, that this can tell.
    assert psnr(direct, woven) > 22
    others = direct[:, ::-1], direct[::-1], np.roll(direct, 1, 1), direct[..., ::-1]
    assert max(psnr(other, woven) for other in others) < 17


def test_the_background_shows_where_a_subpixel_sees_nothing(tmp_path):
    display = hexagonal(background=[0.2, 0.5, 1.0])
    finish_frame(write_traced(tmp_path, display), "oidn")
    panel = read_png(tmp_path / PANEL_FILE)
    assert (panel[0, 0] == panel[-1, -1]).all() and panel[0, 0].tolist() == [124, 188, 255]
    assert not (tmp_path / EIA_FILE).exists()


def test_noise_goes_from_what_was_traced(tmp_path):
    folder = write_traced(tmp_path, cells())
    finish_frame(folder, "none")
    clean, color = read_png(folder / PANEL_FILE), read_layers(folder / "lr_eia.exr")["color"]
    noise = np.random.default_rng(0).normal(0, 0.2, color.shape) * color[..., 3:] * [1, 1, 1, 0]
    write_layers(folder / "lr_eia.exr", {"color": np.maximum(color + noise, 0).astype(np.float32)})
    found = {}
    for method in ("none", "oidn"):
        report = finish_frame(folder, method)
        assert (report.method, report.layout) == (method, "subpixels") and 0 < report.foreground_fraction < 1
        found[method] = psnr(read_png(folder / PANEL_FILE), clean)
    assert found["oidn"] > found["none"] + 1


@pytest.mark.parametrize(("method", "options", "message"), [
    ("oidn+bicubic", {}, "'oidn.bicubic' needs elemental images.*choose one of oidn, none"),
    ("none", {"linear_exr": True}, "--linear-exr is for elemental images"), ("none", {"dilate": 1}, "--dilate is for"),
    ("none", {"temporal_averaging": 2}, "--temporal-averaging is for")])
def test_what_needs_elemental_images_is_refused(tmp_path, method, options, message):
    folder = write_traced(tmp_path, cells())
    refuses(message, finish_frame, folder, Finish(method, **options))
    assert not (folder / PANEL_FILE).exists()


def test_a_render_of_another_size_is_refused(tmp_path):
    folder = write_traced(tmp_path, cells())
    write_layers(folder / "lr_eia.exr", {"color": np.zeros((4, 4, 4), np.float32)})
    refuses("4×4 pixels, but frame.json says 720×160", finish_frame, folder, "none")


def test_verbs_finish_it_show_it_to_an_eye_or_say_why_not(tmp_path, capsys):
    folder = write_traced(tmp_path / "frame", cells())
    reference = write_reference(tmp_path / "reference", display=cells(lenses=(20, 16), views=(8, 1)))
    assert main(["upscale", str(folder)]) == 0
    assert f"{PANEL_FILE}: the panel's image, traced" in capsys.readouterr().out
    assert read_report(folder).method == "oidn" and read_rendered(folder).subpixels.size == (720, 160)
    assert main(["views", str(folder), "--eye=20,0,300"]) == 0
    assert read_png(folder / "eye.png").std() > 5 and not (folder / "views.png").exists()
    capsys.readouterr()
    for command in (["views"], ["compare", str(reference)], ["view"],
                    ["export", "-o", str(tmp_path / "out"), "--format", "quilt"]):
        told = fails([command[0], str(folder), *command[1:]], capsys)
        assert "holds the panel image alone" in told or "no frame folder" in told
    refuses("need a render with another layout", read_frame, folder)
