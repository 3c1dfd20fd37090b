"""``lfsr displays``: importing, patterns, fitting."""

from __future__ import annotations

import numpy as np
import pytest

from lfsr_core.cli import main
from lfsr_core.images.png import read_png, write_png
from lfsr_core.optics.display import load_display
from lfsr_core.optics.profile_file import write_profile
from tests.optics.panel.test_fit import CYLINDERS
from tests.optics.panel.test_visual_json import NEW, new_unit, written
from tests.support.photographs import photograph
from tests.support.synthetic import fails


def test_a_calibration_becomes_a_profile(tmp_path, capsys):
    assert main(["displays", "--import", str(new_unit(tmp_path)), "-o", str(tmp_path / "desk.toml")]) == 0
    shown = capsys.readouterr().out
    assert "600.892 across (P)" in shown and "-0.0818234" in shown and "crosstalk" in shown
    assert load_display(tmp_path / "desk.toml").name == "desk"


def test_what_is_not_used_of_a_calibration_is_said(tmp_path, capsys):
    calibration = written(tmp_path, NEW | {"invView": 0, "fringe": 2})
    assert main(["displays", "--import", str(calibration), "-o", str(tmp_path / "desk.toml")]) == 0
    shown = capsys.readouterr().out
    assert "fringe of 2 is ignored" in shown and "invView of 0 is ignored" in shown


def test_a_pattern_photographed_fits_the_profile(tmp_path, capsys):
    profile, panel = tmp_path / "large.toml", tmp_path / "phase.png"
    write_profile(profile, CYLINDERS)
    assert main(["displays", str(profile), "--pattern", "phase", "-o", str(panel)]) == 0
    photo = photograph(read_png(panel), CYLINDERS, (0.0, 0.0, 500.0))
    write_png(tmp_path / "photo.png", np.rint(photo * 255).astype(np.uint8))
    fitted = tmp_path / "fitted.toml"
    assert main(["displays", str(profile), "--fit", str(tmp_path / "photo.png"), "--from", "0,0,500",
                 "-o", str(fitted)]) == 0
    assert load_display(fitted).lenticular.pitch_mm == pytest.approx(1.6, rel=1e-4)


def test_what_is_missing_is_named(tmp_path, capsys):
    assert "no file was given: add -o FILE.toml" in fails(["displays", "--import", str(new_unit(tmp_path))], capsys)
    assert "add -o FILE.png" in fails(["displays", "looking-glass-go", "--pattern", "rgb"], capsys)
    assert "--pattern and --fit need a display" in fails(["displays", "--fit", "photo.png"], capsys)
    assert "1 photographs and 2 positions were given" in fails(
        ["displays", "looking-glass-go", "--fit", "a.png", "--from", "0,0,1", "--from", "0,0,2"], capsys)
    assert "'mini' has no lens sheet" in fails(["displays", "mini", "--pattern", "grid", "-o", "a.png"], capsys)
