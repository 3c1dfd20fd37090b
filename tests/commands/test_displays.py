"""``lfsr displays``: importing, patterns, fitting."""

import dataclasses

import pytest

from lfsr_core.cli import main
from lfsr_core.exports import loopback
from lfsr_core.images.image_files import read_png
from lfsr_core.optics.display import load_display, write_profile
from tests.calibration.test_fit import CYLINDERS, GOOD
from tests.calibration.test_makers import CELLS, NEW, new_unit, written
from tests.support.bridge import DEVICES, PORTRAIT, device
from tests.support.synthetic import fails
from tests.support.telephone import jpeg


def test_a_calibration_becomes_a_profile_and_what_is_not_used_of_it_is_said(tmp_path, capsys):
    assert main(["displays", "--import", str(new_unit(tmp_path)), "-o", str(tmp_path / "desk.toml")]) == 0
    shown = capsys.readouterr().out
    assert "600.892 across (P)" in shown and "-0.0818234" in shown and "crosstalk" in shown
    assert load_display(tmp_path / "desk.toml").name == "desk"
    calibration = written(tmp_path, NEW | {"invView": 0, "fringe": 2})
    assert main(["displays", "--import", str(calibration), "-o", str(tmp_path / "desk.toml")]) == 0
    shown = capsys.readouterr().out
    assert "fringe of 2 is ignored" in shown and "invView of 0 is ignored" in shown


def test_a_telephones_photograph_of_the_pattern_fits_the_profile(tmp_path, capsys):
    profile, panel = tmp_path / "large.toml", tmp_path / "phase.png"
    write_profile(profile, CYLINDERS)
    assert main(["displays", str(profile), "--pattern", "phase", "-o", str(panel)]) == 0
    shot = dataclasses.replace(GOOD, orientation=6, flagged=False, bend=(0.05, 0.0), quality=95, rays=1)
    (tmp_path / "photo.jpg").write_bytes(jpeg(read_png(panel), CYLINDERS, shot))
    fitted = tmp_path / "fitted.toml"
    assert main(["displays", str(profile), "--fit", str(tmp_path / "photo.jpg"), "--from", "30,-20,520",
                 "-o", str(fitted)]) == 0
    said = capsys.readouterr().out
    assert "by 1 photograph: pitch ±" in said and "an error of 1 mm" in said
    assert "photo.jpg shows the panel turned by" in said and "distorts by" in said
    assert load_display(fitted).lenticular.pitch_mm == pytest.approx(1.6, rel=2e-5)
    assert read_png(fitted.with_suffix(".png")).shape == (405, 1452, 3)


def test_what_is_missing_is_named_also_of_a_cubevi(tmp_path, capsys):
    assert "no file was given: give -o FILE.toml" in fails(["displays", "--import", str(new_unit(tmp_path))], capsys)
    assert "leave mini out" in fails(["displays", "mini", "--import", "x.json", "-o", "x.toml"], capsys)
    assert "--from is for" in fails(["displays", "mini", "--from", "0,0,1"], capsys)
    assert "nothing to write to x.toml" in fails(["displays", "mini", "-o", "x.toml"], capsys)
    assert "give -o FILE.png" in fails(["displays", "looking-glass-go", "--pattern", "rgb"], capsys)
    assert "a.toml was given: give" in fails(["displays", "mini", "--pattern", "rgb", "-o", "a.toml"], capsys)
    assert "a.png is a photograph" in fails(["displays", "mini", "--fit", "./a.png", "-o", "a.toml"], capsys)
    assert "--pattern and --fit need a display" in fails(["displays", "--fit", "photo.png"], capsys)
    assert "1 photographs and 2 positions were given" in fails(
        ["displays", "looking-glass-go", "--fit", "a.png", "--from", "0,0,1", "--from", "0,0,2"], capsys)
    assert "'mini' has no lens sheet" in fails(["displays", "mini", "--pattern", "grid", "-o", "a.png"], capsys)
    assert main(["displays", "--cubevi", "0.0988", "19.6138", " -1.95", "-o", str(tmp_path / "c1.toml")]) == 0
    assert "19.614" in capsys.readouterr().out and load_display(tmp_path / "c1.toml").views == (40, 1)
    assert "give -o FILE.toml" in fails(["displays", "--cubevi", "0.1", "19", "1"], capsys)
    assert "interval (lineNumber) is 0.0" in fails(
        ["displays", "--cubevi", "0.1", "0", "1", "-o", str(tmp_path / "c2.toml")], capsys)
    assert not (tmp_path / "c2.toml").exists()


def test_connected_displays_are_listed_and_become_the_same_profile_as_their_calibration(bridge, tmp_path, capsys):
    bridge()
    (tmp_path / "imported").mkdir()
    ours, theirs = tmp_path / "desk.toml", tmp_path / "imported" / "desk.toml"
    assert main(["displays", "lkg-j2", "--bridge", "-o", str(ours)]) == 0
    assert "600.892 across (P)" in capsys.readouterr().out
    written(tmp_path, NEW, CellPatternMode=2, subpixelCells=CELLS, serial="LKG-J2")
    assert main(["displays", "--import", str(tmp_path / "visual.json"), "-o", str(theirs)]) == 0
    assert load_display(ours) == load_display(theirs)
    capsys.readouterr()
    bridge(devices=[*DEVICES, device(3, "LKG-X", "go_p", {"pitch": 80})])
    assert main(["displays", "--bridge"]) == 0
    portrait, large, broken = capsys.readouterr().out.splitlines()
    assert portrait == (" 1  LKG-P1 (portrait), at 3840,0: 1536×2048 px, 40° cone, 52.5927 cylinders per inch, "
                        "quilt 8×6 of 3360×3360 px")
    assert "LKG-J2 (16_gen3_landscape)" in large and "50° cone" in large
    assert "the calibration of display 'LKG-X' in Bridge: field 'slope' is missing" in broken


def test_which_connected_display_is_said_or_asked_and_without_bridge_no_profile_is_written(monkeypatch, tmp_path,
                                                                                           capsys, bridge):
    monkeypatch.setenv(loopback.PORT_VARIABLE, "1")
    assert "is not running" in fails(["displays", "--bridge", "-o", str(tmp_path / "desk.toml")], capsys)
    assert not list(tmp_path.iterdir())
    output = ["-o", str(tmp_path / "desk.toml")]
    bridge()
    assert "2 displays are connected, but a profile is of one: name one of 1 (LKG-P1), 2 (LKG-J2)" in fails(
        ["displays", "--bridge", *output], capsys)
    assert "display 'LKG-9' is not among those" in fails(["displays", "LKG-9", "--bridge", *output], capsys)
    bridge(devices=[PORTRAIT])
    assert main(["displays", "--bridge", *output]) == 0
    assert load_display(tmp_path / "desk.toml").panel_pixels == (1536, 2048)
