"""Display profiles: what they state, what follows, what they refuse."""

import math

import pytest

from lfsr_core.base.errors import LfsrError
from lfsr_core.optics.display import DisplayProfile, builtin_names, load_display
from tests.support.told import refuses

GOOD = {"name": "test", "panel_pixels": [40, 20], "panel_mm": [80.0, 40.0], "lenses": [10, 5], "views": [4, 4],
        "viewing_distance_mm": 200.0, "viewing_angle_deg": 40.0}


def test_built_in_profiles_are_the_promised_ones():
    plain = {name for name in builtin_names() if not name.startswith("looking-glass-")}
    assert plain == {"bupt-32in-8k", "dense-8k", "fhd", "small", "mini", "cubevi-c1", "litiholo",
                     "first-look"}
    paper = load_display("bupt-32in-8k")
    assert (paper.panel_pixels, paper.lenses, paper.views) == ((7680, 4320), (96, 54), (80, 80))
    assert "assumption" in paper.description
    assert load_display("dense-8k").lenses == (192, 108)
    assert load_display("small").panel_pixels == (960, 560)
    assert math.hypot(*load_display("bupt-32in-8k").panel_mm) == pytest.approx(32 * 25.4, rel=1e-3)


@pytest.mark.parametrize("name", builtin_names())
def test_file_name_is_profile_name_and_diagonal_is_plausible(name):
    profile = load_display(name)
    assert profile.name == name
    assert profile.scales(), "a built-in profile must offer at least one scale factor"


def test_derived_numbers_scales_and_unlimited_depth_for_views_closer_than_lenses():
    profile = DisplayProfile.from_dict(GOOD)
    assert profile.lens_pitch_mm == (8.0, 8.0)
    assert profile.camera_spacing_mm == pytest.approx(2 * 200 * math.tan(math.radians(20)) / 4)
    narrow = DisplayProfile.from_dict(GOOD | {"viewing_angle_deg": 2.0})
    assert narrow.camera_spacing_mm < narrow.lens_pitch_mm[0]
    assert math.isinf(narrow.depth_range_mm()[1])
    profile = load_display("bupt-32in-8k")
    assert profile.low_views(4) == (20, 20)
    assert profile.low_views(1) == (80, 80)
    assert profile.scales() == [2, 4, 5, 8, 10]


def test_depth_range_is_where_neighbouring_views_differ_by_one_lens():
    profile = load_display("bupt-32in-8k")
    front, behind = profile.depth_range_mm(4)
    spacing, distance, pitch = 4 * profile.camera_spacing_mm, profile.viewing_distance_mm, profile.lens_pitch_mm[0]
    # A point at depth z beyond the plane moves by spacing · z / (D + z) on it; z < 0 in front.
    assert spacing * front / (distance - front) == pytest.approx(pitch)
    assert spacing * behind / (distance + behind) == pytest.approx(pitch)
    flat = DisplayProfile.from_dict(GOOD | {"views": [4, 1], "lenses": [10, 20]})
    spacing, (front, _) = flat.camera_spacing_mm, flat.depth_range_mm()
    assert spacing * front / (200 - front) == pytest.approx(flat.lens_pitch_mm[0])


def test_a_scale_divides_only_axes_with_several_views():
    flat = DisplayProfile.from_dict(GOOD | {"views": [4, 1], "lenses": [10, 20]})
    assert (flat.parallax, flat.low_views(2), flat.scales()) == ((True, False), (2, 1), [2, 4])
    assert flat.eia_pixels == (40, 20)
    refuses("scale is 3.*divides them", flat.low_views, 3)
    single = DisplayProfile.from_dict(GOOD | {"views": [1, 1], "lenses": [40, 20]})
    assert (single.low_views(2), single.scales()) == ((1, 1), [])
    for scale in [3, 0, -2, 81]:
        refuses(rf"scale is {scale}, .* divides both: 1, 2, 4, 5, 8", load_display("bupt-32in-8k").low_views, scale)


def test_dict_round_trip():
    profile = load_display("fhd")
    assert DisplayProfile.from_dict(profile.to_dict()) == profile


@pytest.mark.parametrize(("change", "told"), [
    ({"panel_pixels": [41, 20]}, r"panel_pixels is \[41, 20\].*10 × 4 = 40"),
    ({"panel_pixels": [40, 21]}, r"panel_pixels.*height.*5 × 4 = 20"),
    ({"lenses": [0, 5]}, r"lenses is \(0, 5\).*at least 1"), ({"panel_mm": [80.0, 50.0]}, "panel_mm.*square"),
    ({"panel_mm": [80.0, -40.0]}, "panel_mm.*above 0"), ({"viewing_distance_mm": 0}, "viewing_distance_mm is 0"),
    ({"viewing_angle_deg": 170}, "viewing_angle_deg is 170"),
    ({"viewing_angle_deg": float("nan")}, "viewing_angle_deg is nan"),
    ({"ei_order": "mirrored"}, "ei_order is 'mirrored'"), ({"background": [0.0, 2.0, 0.0]}, "background.*0 to 1"),
    ({"background": [0.0, 0.0]}, "background.*list of 3"), ({"name": ""}, "name is ''"),
    ({"name": "n" * 101}, "name is 'nnn"),
    ({"panel_pixels": [65540, 20], "lenses": [16385, 5]}, "panel_pixels.*no more than 65536"),
    ({"panel_pixels": [4 * 10**8, 4 * 10**8], "lenses": [10**8, 10**8]}, "no more than 65536"),
    ({"panel_mm": [80e300, 40e300]}, "panel_mm"), ({"viewing_distanse_mm": 3.0}, "did you mean 'viewing_distance_mm'")])
def test_bad_field_is_named_with_value_and_rule(change, told):
    with pytest.raises(LfsrError, match=told) as caught:
        DisplayProfile.from_dict(GOOD | change, source="x.toml")
    assert str(caught.value).startswith("x.toml: ")


def test_own_files_absent_ones_and_unknown_names(tmp_path):
    file = tmp_path / "own.toml"
    file.write_text("\n".join(f"{key} = {value!r}" for key, value in GOOD.items()), encoding="utf-8")
    assert load_display(file) == DisplayProfile.from_dict(GOOD)
    refuses(r"absent.toml does not exist, expected a display profile", load_display, tmp_path / "absent.toml")
    refuses("unknown display 'smal': did you mean 'small'", load_display, "smal")
    for content in [b"name = ", b"\xff\xfe", b"a = " + b"[" * 5000, b"a = " + b"9" * 5000]:
        file = tmp_path / "broken.toml"
        file.write_bytes(content)
        with pytest.raises(LfsrError, match=r"broken.toml is not valid TOML") as refused:
            load_display(file)
        assert "sys.set" not in str(refused.value), "advice for programmers"
