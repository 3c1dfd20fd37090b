"""The second stage where a display has a lens sheet: woven, or traced for each subpixel."""

import dataclasses
import json
from pathlib import Path

import numpy as np
import pytest

from lfsr_core.cli import main
from lfsr_core.frames.frame import EIA_FILE, PANEL_FILE, Finish, read_frame, read_rendered, read_report
from lfsr_core.images.image_files import read_layers, read_png, write_layers
from lfsr_core.optics.display import DisplayProfile, write_profile
from lfsr_core.optics.panel.weave import gather_map, weave
from lfsr_core.reconstruct.second_stage import finish_frame
from tests.support.panels import SHEETS, cells, hexagonal, lenticular, psnr
from tests.support.played_blender import played_blender
from tests.support.prerequisites import needs_bpy
from tests.support.synthetic import fails, write_reference, write_render, write_traced
from tests.support.told import refuses

pytestmark = needs_bpy  # for Blender's colour configuration


def small(display: DisplayProfile) -> DisplayProfile:
    """Its light field with fewer lenses and views, the artist's choice."""
    return dataclasses.replace(display, lenses=(20, 16), views=((8, 8) if display.lenslet else (8, 1)))


@pytest.mark.parametrize("display", [small(lenticular()), small(hexagonal())], ids=["lenticular", "hexagonal"])
def test_the_panels_image_is_woven_from_the_finished_eia(tmp_path, display):
    write_render(tmp_path, display=display)
    report = finish_frame(tmp_path, "bilinear")
    assert read_frame(tmp_path).display == display
    eia, panel = read_png(tmp_path / "eia.png"), read_png(tmp_path / PANEL_FILE)
    np.testing.assert_array_equal(panel, weave(eia, gather_map(display, "views")))
    assert panel.shape == (160, 240, 3) and panel.std() > 10
    assert {"map", "weave"} <= report.seconds.keys()


def test_every_verb_that_reads_a_folder_takes_it(tmp_path, capsys):
    display = small(lenticular())
    frame, reference = write_render(tmp_path / "frame", display=display), write_reference(tmp_path / "reference",
                                                                                         display=display)
    assert main(["upscale", str(frame)]) == 0 and PANEL_FILE in capsys.readouterr().out
    assert main(["views", str(frame), "--eye=20,0,300"]) == 0 and read_png(frame / "eye.png").std() > 10
    assert main(["compare", str(frame), str(reference)]) == 0
    assert 0.5 < json.loads((frame / "report.json").read_text())["metrics"]["ssim_eia"] <= 1
    assert json.loads((frame / "report.json").read_text())["method"] == "denoise+pool"


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


def test_noise_goes_from_what_was_traced_and_the_background_shows_where_nothing_is_seen(tmp_path):
    folder = write_traced(tmp_path, cells())
    finish_frame(folder, "none")
    clean, color = read_png(folder / PANEL_FILE), read_layers(folder / "lr_eia.exr")["color"]
    noise = np.random.default_rng(0).normal(0, 0.2, color.shape) * color[..., 3:] * [1, 1, 1, 0]
    write_layers(folder / "lr_eia.exr", {"color": np.maximum(color + noise, 0).astype(np.float32)})
    quality = {}
    for method in ("none", "oidn"):
        report = finish_frame(folder, method)
        assert (report.method, report.layout) == (method, "subpixels") and 0 < report.foreground_fraction < 1
        quality[method] = psnr(read_png(folder / PANEL_FILE), clean)
    assert quality["oidn"] > quality["none"] + 1
    finish_frame(write_traced(tmp_path, hexagonal(background=[0.2, 0.5, 1.0])), "oidn")
    panel = read_png(tmp_path / PANEL_FILE)
    assert (panel[0, 0] == panel[-1, -1]).all() and panel[0, 0].tolist() == [124, 188, 255]
    assert not (tmp_path / EIA_FILE).exists()


def test_another_size_and_what_needs_elemental_images_are_refused(tmp_path):
    folder = write_traced(tmp_path, cells())
    write_layers(folder / "lr_eia.exr", {"color": np.zeros((4, 4, 4), np.float32)})
    refuses("4×4 pixels, but frame.json says 720×160", finish_frame, folder, "none")
    for method, options, message in [
        ("oidn+bicubic", {}, "'oidn.bicubic' needs elemental images.*choose one of oidn, none"),
        ("none", {"linear_exr": True}, "--linear-exr is for"), ("none", {"dilate": 1}, "--dilate is for"),
        ("none", {"temporal_averaging": 2}, "--temporal-averaging is for")]:
        folder = write_traced(tmp_path, cells())
        refuses(message, finish_frame, folder, Finish(method, **options))
        assert not (folder / PANEL_FILE).exists()


def test_verbs_finish_it_show_it_to_an_eye_or_say_why_not(tmp_path, capsys):
    folder = write_traced(tmp_path / "frame", cells())
    reference = write_reference(tmp_path / "reference", display=cells(lenses=(20, 16), views=(8, 1)))
    assert main(["upscale", str(folder)]) == 0 and f"{PANEL_FILE}: the panel's image, traced" in capsys.readouterr().out
    assert read_report(folder).method == "oidn" and read_rendered(folder).subpixels.size == (720, 160)
    assert main(["views", str(folder), "--eye=20,0,300"]) == 0
    assert read_png(folder / "eye.png").std() > 5 and not (folder / "views.png").exists()
    capsys.readouterr()
    for command in (["views"], ["compare", str(reference)], ["view"],
                    ["export", "-o", str(tmp_path / "out"), "--format", "quilt"]):
        told = fails([command[0], str(folder), *command[1:]], capsys)
        assert "holds the panel image alone" in told or "no frame folder" in told
    refuses("need a render with another layout", read_frame, folder)


# ``--layout subpixels`` on the command line, with a played Blender.
@pytest.fixture
def command(tmp_path, monkeypatch):
    """Renders a scene for a small lenticular display."""
    monkeypatch.chdir(tmp_path)
    Path("scene.blend").touch()
    write_profile(Path("own.toml"), cells())
    return ["render", "scene.blend", "-o", "frame", "--display", "own.toml", "--layout", "subpixels", "--spp", "4",
            "--blender", played_blender(tmp_path / "blender")]


def test_a_scene_is_rendered_and_finished_and_frames_of_an_animation_once(command, capsys):
    assert main(command) == 0
    assert f"frame/{PANEL_FILE}: the panel's image, traced for its subpixels; oidn" in capsys.readouterr().out
    frame, report = read_rendered("frame"), json.loads(Path("frame/report.json").read_text())
    assert (frame.scale, frame.layers, frame.samples) == (1, (), 4)
    assert (report["method"], report["layout"], report["scale"]) == ("oidn", "subpixels", 1)
    assert read_png(Path("frame", PANEL_FILE)).std() > 10 and not Path("frame", EIA_FILE).exists()
    for told in ("2 made, 0 kept", "0 made, 2 kept"):
        assert main([*command, "-o", "film", "--frames", "1-2", "--method", "none"]) == 0
        assert told in capsys.readouterr().out
    assert all(read_png(Path("film", name, PANEL_FILE)).std() > 10 for name in ("0001", "0002"))
    light_field = [word for word in command if word not in ("--layout", "subpixels")]
    said = fails([*light_field, "-o", "film", "--frames", "1-2", "--scale", "1", "--method", "none"], capsys)
    assert "layout subpixels, but layout one-pass" in said, "not taken for frames of a light field"


@pytest.mark.parametrize(("options", "message"), [(["--display", "mini"], "display 'mini' has no lens sheet"),
    (["--scale", "2"], "scale is 2"), (["--rows", "1/2"], "rows is (1, 40), but the layout subpixels"),
    (["--view-aperture", "0.5"], "view aperture is 0.5"), (["--method", "oidn+bilinear"], "needs elemental images")])
def test_what_it_cannot_have_is_refused_before_blender_starts(command, capsys, options, message):
    assert message in fails([*command, *options], capsys) and not Path("frame").exists()


@pytest.mark.parametrize(("verb", "message"), [
    (["reference", "-o", "frame"], "a reference is a light field"), (["plan"], "a plan renders single lenses")])
def test_other_verbs_that_render_refuse_it(command, capsys, verb, message):
    assert message in fails([verb[0], "scene.blend", *verb[1:], *command[4:8], *command[10:]], capsys)
