"""Display profiles: what they state, what follows, what they refuse."""

import dataclasses
import math

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st

from lfsr_core.base.messages import LfsrError
from lfsr_core.frames.frame import Sampling, samples_at, scales_up_to, usual_rays
from lfsr_core.optics.depth_scale import LEAST_SAMPLES, MODEL, choose_scale, disparities
from lfsr_core.optics.display import DisplayProfile, builtin_names, load_display
from lfsr_core.optics.eye import LiveRegion
from lfsr_core.optics.rays import CameraArray, check_cover, choose_lenses, parse_rows, pixel_rows
from tests.support.synthetic import FLAT, MINI
from tests.support.told import refuses

GOOD = {"name": "test", "panel_pixels": [40, 20], "panel_mm": [80.0, 40.0], "lenses": [10, 5], "views": [4, 4],
        "viewing_distance_mm": 200.0, "viewing_angle_deg": 40.0}


def test_built_in_profiles_are_the_promised_ones_and_own_files_and_unknown_names_said(tmp_path):
    for name in builtin_names():
        assert load_display(name).name == name and load_display(name).scales(), "one must offer a scale factor"
    plain = {name for name in builtin_names() if not name.startswith("looking-glass-")}
    assert plain == {"bupt-32in-8k", "dense-8k", "fhd", "small", "mini", "cubevi-c1", "litiholo", "first-look"}
    paper = load_display("bupt-32in-8k")
    assert (paper.panel_pixels, paper.lenses, paper.views) == ((7680, 4320), (96, 54), (80, 80))
    assert "assumption" in paper.description and load_display("dense-8k").lenses == (192, 108)
    assert load_display("small").panel_pixels == (960, 560)
    assert math.hypot(*load_display("bupt-32in-8k").panel_mm) == pytest.approx(32 * 25.4, rel=1e-3)
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


def test_derived_numbers_and_scales_that_divide_only_axes_with_several_views():
    profile = DisplayProfile.from_dict(GOOD)
    assert profile.lens_pitch_mm == (8.0, 8.0)
    assert profile.camera_spacing_mm == pytest.approx(2 * 200 * math.tan(math.radians(20)) / 4)
    narrow = DisplayProfile.from_dict(GOOD | {"viewing_angle_deg": 2.0})
    assert narrow.camera_spacing_mm < narrow.lens_pitch_mm[0] and math.isinf(narrow.depth_range_mm()[1])
    profile = load_display("bupt-32in-8k")
    assert profile.low_views(4) == (20, 20) and profile.low_views(1) == (80, 80)
    assert profile.scales() == [2, 4, 5, 8, 10]
    flat = DisplayProfile.from_dict(GOOD | {"views": [4, 1], "lenses": [10, 20]})
    assert (flat.parallax, flat.low_views(2), flat.scales()) == ((True, False), (2, 1), [2, 4])
    assert flat.eia_pixels == (40, 20)
    refuses("scale is 3.*divides them", flat.low_views, 3)
    single = DisplayProfile.from_dict(GOOD | {"views": [1, 1], "lenses": [40, 20]})
    assert (single.low_views(2), single.scales()) == ((1, 1), [])
    for scale in [3, 0, -2, 81]:
        refuses(rf"scale is {scale}, .* divides both: 1, 2, 4, 5, 8", load_display("bupt-32in-8k").low_views, scale)


@pytest.mark.parametrize(("change", "told"), [({"panel_pixels": [41, 20]}, r"panel_pixels is \[41, 20\].*10 × 4 = 40"),
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


MASK = np.zeros((12, 16), bool)
MASK[2:10, 4:14] = True  # 80 of 192


@given(st.integers(1, 192), st.integers(0, 2**32))
def test_count_is_kept_and_no_lens_comes_twice(count, seed):
    lenses = choose_lenses(MASK, count, seed)
    assert len(lenses) == len(set(lenses)) == count and list(lenses) == sorted(lenses)


@pytest.mark.parametrize(("count", "background"), [(1, 0), (7, 0), (8, 2), (16, 2), (23, 2), (24, 3), (80, 10)])
def test_one_in_eight_is_background(count, background):
    for seed in range(5):
        assert sum(MASK[lens] for lens in choose_lenses(MASK, count, seed)) == count - background


def test_same_seed_same_lenses_and_each_foreground_lens_is_equally_likely():
    assert choose_lenses(MASK, 20, 1) == choose_lenses(MASK, 20, 1)
    assert choose_lenses(MASK, 20, 1) != choose_lenses(MASK, 20, 2)
    assert {type(number) for lens in choose_lenses(MASK, 5) for number in lens} == {int}
    for mask in [np.ones((3, 4), bool), np.zeros((3, 4), bool)]:
        assert len(choose_lenses(mask, 12)) == 12 and len(set(choose_lenses(mask, 9))) == 9
    for count in [0, -1, 193]:
        refuses(f"number of lenses is {count}, .*192", choose_lenses, MASK, count)
    hits = np.zeros(MASK.shape)
    for seed in range(2000):
        for lens in choose_lenses(MASK, 9, seed):
            hits[lens] += 1
    expected = 2000 * 7 / 80
    assert np.abs(hits[MASK] - expected).max() < 5 * expected**0.5


@given(st.integers(0, 1000))
def test_draw_is_spread_over_the_foreground(seed):
    lenses = np.array([lens for lens in choose_lenses(MASK, 40, seed) if MASK[lens]])
    left, top = lenses[:, 1] < 9, lenses[:, 0] < 6
    corners = [int((left == a).astype(int) @ (top == b)) for a in (False, True) for b in (False, True)]
    assert sum(corners) == 35
    # Chance alone would leave this band in one draw of six.
    assert all(6 <= corner <= 12 for corner in corners), corners


@given(st.integers(1, 200), st.data())
def test_shares_are_the_whole_and_of_one_size(count, data):
    count_of_parts = data.draw(st.integers(1, count))
    parts = [parse_rows(f"{number}/{count_of_parts}", count) for number in range(1, count_of_parts + 1)]
    check_cover(data.draw(st.permutations(parts)), count)
    sizes = {last - first + 1 for first, last in parts}
    assert max(sizes) - min(sizes) <= 1 and min(sizes) >= 1


def test_rows_as_people_write_them_parts_that_are_not_the_whole_and_a_region_of_another_size():
    assert pixel_rows((1, 3), 4) == (0, 12) and pixel_rows((4, 4), 4) == (12, 16)
    for text, rows in [("3-7", (3, 7)), (" 4 ", (4, 4)), ("12-12", (12, 12)), ("1/1", (1, 12))]:
        assert parse_rows(text, 12) == rows
    for text in ["", "0-3", "5-4", "9-13", "a-b", "1/13", "0/2", "3/2", "-3", "1-2-3", "1-", "1" * 99]:
        refuses("rows are ", parse_rows, text, 12)
    for parts, sentence in [
        ([(1, 4), (6, 12)], "rows 5 are in none"), ([(2, 12)], "rows 1 are in none"), ([(1, 9)], "rows 10-12 are in"),
        ([(1, 6), (5, 12)], "rows 5-6 are in more than one"), ([(1, 12), (3, 4)], "rows 3-4 are in more than one")]:
        refuses(sentence, check_cover, parts, 12)
    region = LiveRegion(SMALL, SMALL.panel_pixels, 4)
    assert region.sentence() is None
    assert region.corner == (0, 0) and region.shift == (0, 0) and region.drawn == SMALL.panel_pixels
    for size, words in [((960, 540), "centred part"), ((640, 480), "centred part"), ((1281, 1000), "views mix"),
                        ((1920, 1080), "in the middle of a border"), ((640, 479), "views mix")]:
        sentence = LiveRegion(SMALL, size, 4).sentence()
        assert words in sentence and f"{size[0]}×{size[1]}" in sentence and "960×560" in sentence
        assert len(sentence) < 300


SMALL = load_display("small")
sides = st.integers(1, 2000)


@given(width=sides, height=sides, scale=st.sampled_from((1, 2, 4, 8)))
def test_panel_is_in_the_middle_of_whole_rendered_pixels(width, height, scale):
    region = LiveRegion(SMALL, (width, height), scale)
    for axis, side in enumerate((width, height)):
        corner, panel = region.corner[axis], SMALL.panel_pixels[axis]
        assert corner % scale == 0 and region.drawn[axis] % scale == 0
        assert side - scale < region.drawn[axis] <= side
        assert abs(side - panel - 2 * corner) < 3 * scale, "as much on both sides"
        assert region.shift[axis] == corner + panel / 2 - side / 2


LENTICULAR = load_display("looking-glass-go")

DISPLAYS = st.sampled_from([SMALL, MINI, FLAT, LENTICULAR, load_display("looking-glass-16")])
MOVES = st.lists(st.floats(0, 1e6), min_size=1, max_size=20).map(np.array)
RAYS = st.floats(1 / 64, 256)


def array_of(display):
    return CameraArray.for_display(display, 2.0)


@pytest.mark.parametrize("display", [SMALL, MINI, FLAT], ids=lambda display: display.name)
@pytest.mark.parametrize("scale", [1, 2, 4])
def test_points_at_the_usable_depth_move_by_one_lens(display, scale):
    array = array_of(display)
    front, behind = display.depth_range_mm(scale)
    unit = array.distance / display.viewing_distance_mm
    depths = np.array([array.distance - front * unit, array.distance + behind * unit])
    assert (disparities(display, array, depths) * scale)[np.isfinite(depths)] == pytest.approx(1)
    assert disparities(display, array, np.array([array.distance]))[0] == 0


@given(DISPLAYS, MOVES, RAYS, st.floats(1, 1000))
def test_the_more_rays_the_smaller(display, moves, rays, factor):
    few, many = (choose_scale(display, moves, scales_up_to(display), count) for count in (rays, rays * factor))
    assert many.scale <= few.scale


@given(DISPLAYS, MOVES, RAYS, st.sets(st.integers(1, 10), min_size=1))
def test_the_choice_loses_least_of_the_scales_that_get_a_sample(display, moves, rays, some):
    scales = some & {1, *display.scales()}
    assume(scales)
    choice = choose_scale(display, moves, scales, rays)
    assert choice.scale in scales and choice.reason.code == "scale-chosen"
    assert (choice.reason.values["scale"], choice.reason.values["largest"]) == (choice.scale, max(scales))
    enough = [scale for scale in scales if rays * display.finished_pixels(scale) >= LEAST_SAMPLES] or [max(scales)]
    losses = {scale: MODEL.loss(moves, scale, rays * display.finished_pixels(scale)) for scale in enough}
    assert losses[choice.scale] == min(losses.values())


def test_every_scale_is_chosen_at_some_depth():
    moves = disparities(SMALL, array_of(SMALL), array_of(SMALL).distance * (1 + np.geomspace(0.001, 100, 400)))
    scales = [choose_scale(SMALL, np.full(5, move), (5, 4, 2, 1), 4).scale for move in moves * 4]
    assert scales == sorted(scales, reverse=True) and set(scales) == {5, 4, 2, 1}
    moves = np.zeros(200)
    moves[:4] = 1e6
    assert choose_scale(SMALL, moves, (4, 2, 1), 1).scale == 4
    assert choose_scale(SMALL, np.empty(0), (2, 4), 1).scale == 4
    assert choose_scale(SMALL, np.empty(0), (2, 4), 1).reason.code == "scale-unseen"
    assert choose_scale(SMALL, np.full(3, 1e9), (3,), 1).scale == 3
    beside = disparities(SMALL, array_of(SMALL), np.full(3, -1.0))
    assert choose_scale(SMALL, beside, (4, 1), 4).scale == 1, "beside the viewer is very near"


@given(st.sampled_from([1, 4, 16, 64]))
def test_rays_are_samples_times_rendered_pixels(rays):
    for display, scale in ((SMALL, 4), (SMALL, 5), (MINI, 2), (LENTICULAR, 3), (LENTICULAR, 2)):
        rendered = math.prod(display.low_views(scale)) / math.prod(display.views)
        assert samples_at(display, scale, rays) * rendered == pytest.approx(rays)


def test_usual_rays_are_sixteen_samples_at_scale_4():
    assert [usual_rays(display) for display in (SMALL, LENTICULAR)] == [1, 4]
    assert [samples_at(SMALL, scale, 1) for scale in (1, 2, 4, 5)] == [1, 4, 16, 25]
    assert samples_at(SMALL, 1, 0.1) == 1, "never fewer"
    assert usual_rays(SMALL, 64) == 4 and Sampling.of(LENTICULAR, (1,), None, None, direct=True).samples == 16
    for rays in [0.0, -1.0, math.nan, math.inf, 2**22]:
        refuses(r"rays per finished pixel are .* above 0, and at most 1048", samples_at, SMALL, 4, rays)
    for views, scales in [(8, (2, 1)), (12, (2, 1)), (20, (4, 2, 1)), (15, (3, 1)), (9, (3, 1)), (25, (5, 1)),
                          (40, (5, 4, 2, 1)), (60, (5, 4, 3, 2, 1))]:
        pixels = tuple(count * views for count in SMALL.lenses)
        assert scales_up_to(dataclasses.replace(SMALL, views=(views, views), panel_pixels=pixels)) == scales
