"""`lfsr plan` from its arguments to its table, with Blender played by a script."""

from __future__ import annotations

import json
import shlex

import pytest

from lfsr_core.cli import build_parser, main
from tests.support.played_blender import played_blender
from tests.support.synthetic import fails

FEW = ["--display", "mini", "--scales", "2", "--spps", "4", "--methods", "nearest,bilinear", "--lenses", "24",
       "--reference-spp", "256"]

@pytest.fixture
def blender(tmp_path):
    return played_blender(tmp_path / "blender")


@pytest.fixture
def scene(tmp_path):
    path = tmp_path / "my scene.glb"
    path.touch()
    return str(path)


def test_plan_ends_with_the_command_that_renders_the_choice(scene, blender, tmp_path, capsys):
    file = tmp_path / "plan.json"
    assert main(["plan", scene, "--target", "0.5", *FEW, "--frame", "3", "--no-world-visible", "--blender", blender,
                 "--json", str(file), "--work", str(tmp_path / "work")]) == 0
    *_, command = capsys.readouterr().out.splitlines()
    words = shlex.split(command)
    data = json.loads(file.read_text())
    chosen = data["chosen"]
    arguments = build_parser().parse_args(words[1:])
    assert words[0] == "lfsr" and str(arguments.scene) == scene
    assert (arguments.scale, arguments.spp, arguments.method) == (chosen["scale"], chosen["spp"], chosen["method"])
    assert (arguments.display, arguments.frame, arguments.world_visible) == ("mini", 3, False)
    assert chosen["estimate"]["low"] >= 0.5 and data["options"]["most_seconds"] is None
    assert (tmp_path / "work" / "quick" / "frame.json").exists()


def test_plan_that_finds_nothing_says_why_and_names_no_command(scene, blender, capsys):
    assert main(["plan", scene, "--target", "0.999", *FEW, "--blender", blender]) == 0
    out = capsys.readouterr().out
    assert "nothing reaches ssim_eia_fg 0.999" in out and "Limit: " in out and "lfsr render" not in out


@pytest.mark.parametrize(("options", "message"), [
    (["--target", "1.5"], "target is 1.5"), (["--metric", "psnr"], "metric is 'psnr'"),
    (["--methods", "bilinaer"], "did you mean 'bilinear'"), (["--scales", "3"], "scale is 3"),
    (["--budget", "0"], "budget is 0"), (["--lenses", "2"], "number of lenses is 2"),
    (["--layout", "view-by-view"], "view-by-view"), (["--blender", "/no/blender"], "'/no/blender' was not found")])
def test_bad_option_is_refused_before_blender_starts(scene, blender, tmp_path, capsys, options, message):
    work = tmp_path / "work"
    assert message in fails(["plan", scene, *FEW, "--blender", blender, "--work", str(work), *options], capsys)
    assert not work.exists()


def test_scales_that_are_no_numbers_are_refused(scene):
    with pytest.raises(SystemExit):
        main(["plan", scene, "--scales", "two"])
