"""``--layout subpixels`` on the command line, with a played Blender: images, an animation, and what is refused."""

import json
from pathlib import Path

import pytest

from lfsr_core.cli import main
from lfsr_core.frames.frame import EIA_FILE, PANEL_FILE, read_rendered
from lfsr_core.images.png import read_png
from lfsr_core.optics.display import write_profile
from tests.support.panels import cells
from tests.support.played_blender import played_blender
from tests.support.prerequisites import needs_bpy
from tests.support.synthetic import fails

pytestmark = needs_bpy  # for Blender's colour configuration


@pytest.fixture
def command(tmp_path, monkeypatch):
    """Renders a scene for a small lenticular display."""
    monkeypatch.chdir(tmp_path)
    Path("scene.blend").touch()
    write_profile(Path("own.toml"), cells())
    return ["render", "scene.blend", "-o", "frame", "--display", "own.toml", "--layout", "subpixels", "--spp", "4",
            "--blender", played_blender(tmp_path / "blender")]


def test_a_scene_is_rendered_and_finished(command, capsys):
    assert main(command) == 0
    assert f"frame/{PANEL_FILE}: the panel's image, traced for its subpixels; oidn" in capsys.readouterr().out
    frame, report = read_rendered("frame"), json.loads(Path("frame/report.json").read_text())
    assert (frame.scale, frame.layers, frame.samples) == (1, (), 4)
    assert (report["method"], report["layout"], report["scale"]) == ("oidn", "subpixels", 1)
    assert read_png(Path("frame", PANEL_FILE)).std() > 10 and not Path("frame", EIA_FILE).exists()


def test_frames_of_an_animation_are_finished_once(command, capsys):
    for told in ("2 made, 0 kept", "0 made, 2 kept"):
        assert main([*command, "--frames", "1-2", "--method", "none"]) == 0
        assert told in capsys.readouterr().out
    assert all(read_png(Path("frame", name, PANEL_FILE)).std() > 10 for name in ("0001", "0002"))
    light_field = [word for word in command if word not in ("--layout", "subpixels")]
    said = fails([*light_field, "--frames", "1-2", "--scale", "1", "--method", "none"], capsys)
    assert "layout subpixels, but layout one-pass" in said, "not taken for frames of a light field"


@pytest.mark.parametrize(("options", "message"), [
    (["--display", "mini"], "display 'mini' has no lens sheet"), (["--scale", "2"], "scale is 2"),
    (["--rows", "1/2"], "rows is (1, 40), but the layout subpixels"),
    (["--view-aperture", "0.5"], "view aperture is 0.5"), (["--method", "oidn+bilinear"], "needs elemental images"),
    (["--linear-exr"], "--linear-exr is for elemental images"),
    (["--dilate", "1"], "--dilate is for elemental images")])
def test_what_it_cannot_have_is_refused_before_blender_starts(command, capsys, options, message):
    assert message in fails([*command, *options], capsys)
    assert not Path("frame").exists()


@pytest.mark.parametrize(("verb", "message"), [
    (["reference", "-o", "frame"], "a reference is a light field"), (["plan"], "a plan renders single lenses")])
def test_other_verbs_that_render_refuse_it(command, capsys, verb, message):
    assert message in fails([verb[0], "scene.blend", *verb[1:], *command[4:8], *command[10:]], capsys)
