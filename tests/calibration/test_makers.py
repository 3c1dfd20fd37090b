"""Calibrations of real devices: what their makers' programs compute of them, and profiles that weave the same."""

import json

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from lfsr_core.base.messages import LfsrError
from lfsr_core.calibration import makers
from lfsr_core.calibration.makers import profile_from_calibration, profile_of_c1, read_calibration
from lfsr_core.optics.display import builtin_names, cell_of, load_display, write_profile
from lfsr_core.optics.panel.subpixel_rays import subpixel_rays
from tests.support.told import refuses

OLD = {"pitch": 52.59267044067383, "slope": -7.083540916442871, "center": 0.8167931437492371, "DPI": 324,
       "screenW": 1536, "screenH": 2048, "viewCone": 40, "invView": 1, "verticalAngle": 0, "flipImageX": 0,
       "flipImageY": 0, "flipSubp": 0, "fringe": 0}
NEW = {"pitch": 44.75058319896644, "slope": -6.874565686767793, "center": 0.16935753461833172, "DPI": 283,
       "screenW": 3840, "screenH": 2160, "viewCone": 50, "invView": 1}
CELLS = [{"ROffsetX": -0.31, "ROffsetY": 0.25, "GOffsetX": 0.28, "GOffsetY": 0.25, "BOffsetX": 0, "BOffsetY": -0.25},
         {"ROffsetX": -0.31, "ROffsetY": -0.25, "GOffsetX": 0.28, "GOffsetY": -0.25, "BOffsetX": 0, "BOffsetY": 0.25}]


def written(folder, numbers, **plain):
    """A visual.json as devices have it: numbers wrapped."""
    path = folder / "visual.json"
    path.write_text(json.dumps({"configVersion": "3.0", "serial": "LKG-1"} | plain
                               | {name: {"value": value} for name, value in numbers.items()}), encoding="utf-8")
    return path


def new_unit(folder):
    return written(folder, NEW, CellPatternMode=2, subpixelCells=CELLS)


def test_a_third_generation_unit_has_golden_figures_and_its_own_formula(tmp_path):
    profile = profile_from_calibration(read_calibration(new_unit(tmp_path)), "new")
    assert profile.lenticular.lenses_across(profile.panel_mm[0]) == pytest.approx(600.892, abs=5e-4)
    assert profile.lenticular.slant * 2160 / 3840 == pytest.approx(-0.0818233, abs=1e-7)
    assert profile.quilt == (7, 7, 857, 857)
    earlier = profile_from_calibration(read_calibration(written(tmp_path, NEW)), "earlier")
    assert earlier.quilt == (5, 9, 819, 455), "as for panels of its size before the third generation"
    agree(profile, lambda *place: formula(NEW, *place, cells=CELLS))
    assert profile.viewing_angle_deg == 50 and profile.subpixels.cell_rule == "x%2"
    random = np.random.default_rng(0)
    row, column = (random.integers(0, size, 20000) for size in profile.panel_pixels[::-1])
    wrong = [np.mean(np.floor(formula(NEW, channel, row, column) * 49)
                     != np.floor(formula(NEW, channel, row, column, CELLS) * 49)) for channel in range(3)]
    assert np.mean(wrong) > 0.7


def formula(numbers, channel, row, column, cells=None):
    """Views 0 … 1 from the left, as the device's own programs compute them; row from the top."""
    width, height = numbers["screenW"], numbers["screenH"]
    pitch = numbers["pitch"] * width / numbers["DPI"] * np.cos(np.arctan(1 / numbers["slope"]))
    mirrored = -1 if numbers.get("flipImageX", 0) >= 0.5 else 1
    tilt = mirrored * height / (width * numbers["slope"])
    x, y = (column + 0.5) / width, (height - 1 - row + 0.5) / height
    if cells is None:
        subp = mirrored / (3 * width) * (-1 if numbers.get("flipSubp", 0) >= 0.5 else 1)
        a = (x + channel * subp + y * tilt) * pitch - numbers["center"]
    else:
        names = [f"{'RGB'[channel]}Offset{axis}" for axis in "XY"]
        chosen = cell_of(numbers.get("rule", "x%2"), height - 1 - row, column)
        right, up = (np.array([cell[name] for cell in cells])[chosen] for name in names)
        a = (x + right / width + (y + up / height) * tilt) * pitch - numbers["center"]
    return 1 - (a - np.floor(a))  # the vendor's shader knows no invView


def agree(profile, wanted, flipped=False):
    """A place in the views against the formula's, upside down as in the vendor's shader; the cone's ends are one."""
    for channel in range(3):
        random = np.random.default_rng(channel)
        row, column = (random.integers(0, size, 2000) for size in profile.panel_pixels[::-1])
        rays = subpixel_rays(profile, channel, row, column)
        assert np.corrcoef(row, rays.row)[0, 1] * (-1 if flipped else 1) > 0.9999
        off = np.abs((rays.view_x + 0.5) / profile.views[0] - wanted(channel, row, column))
        assert np.minimum(off, 1 - off).max() < 1e-9


@settings(max_examples=20)
@given(st.fixed_dictionaries({name: st.sampled_from([0, 1])
                               for name in ("flipImageX", "flipImageY", "flipSubp", "invView")}))
def test_the_first_generations_formula(tmp_path_factory, flips):
    numbers = OLD | flips
    profile = profile_from_calibration(read_calibration(written(tmp_path_factory.mktemp("device"), numbers)), "old")
    agree(profile, lambda *place: formula(numbers, *place), flipped=bool(flips["flipImageY"]))


@pytest.mark.parametrize(("mode", "count"), [(1, 2), (2, 2), (3, 4), (4, 2)])
def test_cells_of_a_panel_that_is_upside_down(tmp_path, mode, count):
    cells = [{name: value + 0.02 * number for name, value in CELLS[number % 2].items()} for number in range(count)]
    path = written(tmp_path, NEW | {"flipImageY": 1}, CellPatternMode=mode, subpixelCells=cells)
    profile = profile_from_calibration(read_calibration(path), "new")
    agree(profile, lambda *place: formula(NEW | {"rule": makers.RULES[mode]}, *place, cells=cells), flipped=True)


def test_a_byte_order_mark_and_what_bridge_puts_round_a_calibration(tmp_path):
    plain, text = read_calibration(new_unit(tmp_path)), (tmp_path / "visual.json").read_text(encoding="utf-8")
    wrapped = {"payload": {"value": {"0": {"value": {"hwid": {"value": "LKG-J"}, "calibration": {"value": text}}}}}}
    for content in ("\ufeff" + text, json.dumps({"calibration": json.loads(text)}), json.dumps(wrapped)):
        (tmp_path / "other.json").write_text(content, encoding="utf-8")
        assert read_calibration(tmp_path / "other.json") == plain
    (tmp_path / "two.json").write_text(json.dumps([wrapped, {"calibration": text}]), encoding="utf-8")
    with pytest.raises(LfsrError, match="two.json holds the calibrations of 2 displays, expected one: keep one of"):
        read_calibration(tmp_path / "two.json")


@pytest.mark.parametrize("changes", [
    {"flipImageY": True, "invView": False}, {"flipImageY": {"value": True}, "invView": {"value": False}},
    {"flipImageY": {"value": 1.0}, "invView": 0, "viewCone": None, "subpixelCells": {"value": []}},
    {"flipImageY": 1, "invView": {"value": 0.0}, "viewCone": {"value": 0.0}, "subpixelCells": None}])
def test_switches_and_empty_fields_as_other_programs_write_them(tmp_path, changes):
    wanted = profile_from_calibration(read_calibration(written(tmp_path, OLD | {"flipImageY": 1, "invView": 0})), "d")
    data = {name: {"value": value} for name, value in OLD.items()} | {"serial": "LKG-1"} | changes
    (tmp_path / "visual.json").write_bytes(json.dumps(data).encode("utf-16"))
    assert profile_from_calibration(read_calibration(tmp_path / "visual.json"), "d") == wanted
    assert wanted.flip == (False, True) and wanted.viewing_angle_deg == 40


def test_imported_and_built_in_profiles_are_read_back_as_written(tmp_path):
    for number, path in enumerate((written(tmp_path, OLD), new_unit(tmp_path))):
        profile = profile_from_calibration(read_calibration(path), f"my {number}")
        write_profile(tmp_path / "my.toml", profile)
        assert load_display(tmp_path / "my.toml") == profile
    refuses(r"does not end in \.toml", write_profile, tmp_path / "my.txt", load_display("mini"))
    for name in builtin_names():
        profile = load_display(name)
        write_profile(tmp_path / "own.toml", profile)
        again = load_display(tmp_path / "own.toml")
        assert (again, again.title, again.quilt) == (profile, profile.title, profile.quilt)


@given(st.sampled_from(sorted({*OLD} & {*makers.REQUIRED, *makers.OPTIONAL})),
       st.floats() | st.sampled_from([1e-308, 5e-324, 1e9]))
def test_a_number_of_any_size_is_a_profile_or_a_sentence(tmp_path_factory, name, value):
    """Whatever passes the ranges makes a display; nothing divides by what is nearly 0."""
    path = tmp_path_factory.mktemp("visual") / "visual.json"
    try:
        calibration = read_calibration(written(path.parent, OLD | {name: value}))
    except LfsrError as error:
        assert name in str(error) or "cannot be read" in str(error)
        return
    try:
        assert profile_from_calibration(calibration, "any").lenses[0] > 0
    except LfsrError as error:
        assert str(error)


def test_wrong_and_missing_fields_and_files_are_named(tmp_path):
    with pytest.raises(LfsrError, match="'center' is missing"):
        read_calibration(written(tmp_path, {key: value for key, value in OLD.items() if key != "center"}))
    (tmp_path / "list.json").write_text("[]")
    refuses("holds no JSON object", read_calibration, tmp_path / "list.json")
    with pytest.raises(LfsrError) as refused:
        read_calibration(tmp_path)
    assert str(refused.value).count("cannot be read") == 1
    for change, told in [({"pitch": "wide"}, "pitch is 'wide'"), ({"pitch": -3}, "pitch is -3"), ({"DPI": True}, "DPI"),
                         ({"screenW": 12.5}, "screenW is 12.5"), ({"slope": 0}, "slope is 0.0")]:
        refuses(told, read_calibration, written(tmp_path, OLD | change))
    for plain, told in [
        ({"CellPatternMode": 9}, "CellPatternMode is 9"), ({"subpixelCells": [3]}, "subpixelCells is"),
        ({"subpixelCells": [{"ROffsetX": 1}]}, "'ROffsetY' is missing"), ({"CellPatternMode": []}, "CellPatternMode")]:
        refuses(told, read_calibration, written(tmp_path, NEW, **plain))


# CubeVi C1: the three numbers of its shader, and a printer's hologram.
TYPICAL = (0.1057, 19.625, 8.89)


def off_the_formula(profile, slope, interval, x0):
    """Greatest distance of our views from the shader's, as a fraction of all views; 0 and 1 are one border."""
    random, worst = np.random.default_rng(0), 0.0
    for channel in range(3):
        row, column = (random.integers(0, size, 3000) for size in profile.panel_pixels[::-1])
        x1 = ((column + 1) + (row + 1) * slope) * 3 + channel
        from_right = np.mod(x1 + x0, interval) / interval  # its right end is seen from the left
        off = np.abs((subpixel_rays(profile, channel, row, column).view_x + 0.5) / profile.views[0] - (1 - from_right))
        worst = max(worst, float(np.minimum(off, 1 - off).max()))
    return worst


@settings(max_examples=20)
@given(st.floats(-0.5, 0.5), st.floats(10, 40), st.floats(-50, 50))
def test_the_shaders_formula(slope, interval, x0):
    profile = profile_of_c1(slope, interval, x0)
    assert profile.views == (40, 1) and off_the_formula(profile, slope, interval, x0) < 1e-9


def test_the_built_in_profiles_have_typical_numbers_and_the_views_of_a_hologram_printer():
    profile = load_display("cubevi-c1")
    assert off_the_formula(profile, *TYPICAL) < 1e-3
    typed = profile_of_c1(*TYPICAL)
    assert (profile.lenses, profile.panel_mm) == (typed.lenses, pytest.approx(typed.panel_mm))
    for numbers in [(3, 19.6, 8.9), (0.1, 0, 8.9), (0.1, 19.6, float("nan")), (float("inf"), 19, 1)]:
        refuses("must be between", profile_of_c1, *numbers)
    # Behind each hogel are the 23 views, each in the middle of four, the leftmost at its right end.
    profile = load_display("litiholo")
    rays = subpixel_rays(profile, 0, np.full(46, 100), np.arange(46))
    np.testing.assert_allclose(rays.view_x, [4 * view + 1.5 for view in range(22, -1, -1)] * 2, atol=1e-6)
