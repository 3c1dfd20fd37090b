"""The weave: whole numbers change nothing, light goes back the way it came, and maps are kept."""

import dataclasses

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from lfsr_core.optics.display import WEAVES, builtin_names, load_display
from lfsr_core.optics.eye import eye_view, trace, view_spread
from lfsr_core.optics.panel import weave as weaving
from lfsr_core.optics.panel.subpixel_rays import Geometry, PanelLayout, subpixel_rays
from lfsr_core.optics.panel.weave import ONE, gather_map, weave
from lfsr_core.optics.rays import CameraArray, flip_order
from tests.support.panels import SHEETS, hexagonal, lenticular, square, whole
from tests.support.synthetic import MINI
from tests.support.told import refuses


def noise(display, seed=0):
    """EIA of random bytes."""
    columns, rows = display.eia_pixels
    return np.random.default_rng(seed).integers(0, 256, (rows, columns, 3), np.uint8)


@pytest.mark.parametrize(("stripes", "sampling"), [*(("white", sampling) for sampling in WEAVES), ("rgb", "nearest")])
@pytest.mark.parametrize("kind", ["lenslet", "lenticular"])
def test_a_whole_number_of_pixels_behind_each_lens_changes_nothing(kind, stripes, sampling):
    """Coloured stripes are their pixels where the nearest view is taken."""
    display = whole(kind, subpixels={"stripes": stripes})
    eia = noise(display)
    # What the panel of a profile of format 1 shows: the views of each lens in the order of its optics.
    np.testing.assert_array_equal(weave(eia, gather_map(display, sampling)), flip_order(eia, display.lenses))


def taps(mapped):
    """(index, weight in [0, 1]) of every sample of the panel, each (H, W, 3)."""
    first, axes = mapped.first.astype(np.int64), mapped.axes
    for corner in range(2 ** len(axes)):
        index, weight = first.copy(), np.ones(first.shape)
        for bit, (stride, weights) in enumerate(axes):
            fraction = weights / ONE
            index += stride * (corner >> bit & 1)
            weight *= fraction if corner >> bit & 1 else 1 - fraction
        yield np.where(weight > 0, index, first), weight


@pytest.mark.parametrize("sampling", WEAVES)
@pytest.mark.parametrize("sheet", SHEETS)
def test_the_weave_is_the_weighted_sum_of_its_samples_inside_the_eia(sheet, sampling):
    display = SHEETS[sheet]()
    mapped, eia = gather_map(display, sampling), noise(display)
    woven, total = weave(eia, mapped).astype(float), 0.0
    for index, weight in taps(mapped):
        assert index.min() >= 0 and index.max() < eia.size
        assert (index % 3 == np.arange(3)).all(), "red stays red"
        assert weight.min() >= 0
        total = total + eia.reshape(-1)[index] * weight
    np.testing.assert_allclose(woven, total, atol=2.0)  # each level of interpolation rounds once


MIRRORED = dataclasses.replace(lenticular(), lenticular=dataclasses.replace(lenticular().lenticular, flip=(True, True)))


@settings(max_examples=25)
@given(st.sampled_from([make() for make in SHEETS.values()] + [MIRRORED]), st.integers(0, 10**6), st.integers(0, 2))
def test_an_eye_at_the_end_of_a_subpixels_ray_sees_that_subpixel(display, seed, channel):
    random = np.random.default_rng(seed)
    columns, rows = display.panel_pixels
    # Away from the border, where the lens of an eye that looks straight may lie beyond the panel.
    row, column = random.integers(8, rows - 8, 200), random.integers(8, columns - 8, 200)
    rays, geometry = subpixel_rays(display, channel, row, column), Geometry.of(display)
    eye_x, eye_y = ((view - (count - 1) / 2) * geometry.spacing * sign for view, count, sign
                    in zip((rays.view_x, rays.view_y), display.views, (1, -1), strict=True))
    x = ((rays.column + 0.5) / display.lenses[0] - 0.5) * geometry.lens_plane[0]
    y = (0.5 - (rays.row + 0.5) / display.lenses[1]) * geometry.lens_plane[1]
    seen = trace(display, (eye_x, eye_y + 0 * x, geometry.distance), x, y)
    assert (seen.row == row).all() and (seen.column == column).all()
    assert (seen.channel == channel).all()


@pytest.mark.parametrize("change", [lambda eia: eia[1:], lambda eia: eia.astype(float), lambda eia: eia[..., :1]])
def test_another_eia_is_refused(change):
    display = hexagonal()
    refuses("EIA has shape", weave, change(noise(display)), gather_map(display, "nearest"))


WOVEN = [name for name in builtin_names() if load_display(name).is_woven]


@pytest.mark.parametrize("name", WOVEN)
def test_an_eye_sees_the_view_of_its_place(name):
    display = load_display(name)
    spread = view_spread(display)
    assert spread.own + spread.neighbours + spread.others == pytest.approx(1)
    assert abs(spread.error) < 0.25, "in views, on average over the panel and the viewing zone"
    # With as many views as there are subpixels behind a lens, light strays by no more than a subpixel.
    behind = 3 * display.panel_pixels[0] / display.lenticular.lenses_across(display.panel_mm[0])
    coarse = dataclasses.replace(display, views=(round(behind / 2), 1))
    assert view_spread(coarse).own > 0.5 and view_spread(coarse).others < 0.1


def test_crosstalk_of_small_sheets_and_of_whole_numbers_and_what_no_eye_sees():
    spread = view_spread(whole("lenslet", subpixels={"stripes": "white"}))
    assert (spread.own, spread.others) == (pytest.approx(1), pytest.approx(0))
    for sheet in SHEETS:
        spread = view_spread(SHEETS[sheet]())
        assert abs(spread.error) < 0.25 and spread.others < 0.45
    refuses("240×159 pixels.*240×160", eye_view, np.zeros((159, 240, 3), np.uint8), lenticular(), (0, 0, 300))
    refuses("'mini' has no lens sheet", PanelLayout, MINI, CameraArray.for_display(MINI, 2.0))


@pytest.fixture
def cache(tmp_path, monkeypatch):
    monkeypatch.setenv("LFSR_CACHE", str(tmp_path))
    monkeypatch.setattr(weaving, "MIN_SUBPIXELS", 0)
    return tmp_path / "weave"


def same(first, second):
    np.testing.assert_array_equal(first.first, second.first)
    for (stride, weights), (other, others) in zip(first.axes, second.axes, strict=True):
        assert stride == other
        np.testing.assert_array_equal(weights, others)


@pytest.mark.parametrize("damage", [lambda path: path.unlink(), lambda path: path.write_bytes(b"x"),
                                    lambda path: path.write_bytes(path.read_bytes()[:-100])])
@pytest.mark.parametrize("name", ["first.npy", "axis0.npy", "map.json"])
def test_a_damaged_map_is_made_again(cache, name, damage):
    first = weaving.cached_gather_map(lenticular())
    (path,) = cache.glob(f"*/{name}")
    damage(path)
    same(weaving.cached_gather_map(lenticular()), first)


def test_only_the_last_few_stay_and_without_a_place_to_write_it_is_only_slower(cache, monkeypatch, tmp_path):
    for number in range(weaving.MAX_MAPS + 2):
        weaving.cached_gather_map(lenticular(viewing_distance_mm=300.0 + number))
    assert len(list(cache.iterdir())) == weaving.MAX_MAPS
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(weaving, "gather_map", None)  # the newest is read
        assert weaving.cached_gather_map(lenticular(viewing_distance_mm=304.0)).axes
    first = weaving.cached_gather_map(lenticular())
    monkeypatch.setattr(weaving, "gather_map", lambda *_: pytest.fail("it is on disk"))
    same(weaving.cached_gather_map(lenticular(description="another text")), first)
    monkeypatch.undo()
    monkeypatch.setattr(weaving, "MIN_SUBPIXELS", 0)
    (tmp_path / "file").touch()
    monkeypatch.setenv("LFSR_CACHE", str(tmp_path / "file"))
    assert weaving.cached_gather_map(lenticular()).axes


def numbered(display, axis):
    """EIA whose value is the number of the view along ``axis`` (0 across, 1 down), times 8."""
    columns, rows = display.eia_pixels
    size, count = ((columns, rows)[axis], display.views[axis])
    values = (np.arange(size) % count * 8).astype(np.uint8)
    values = values[None, :, None] if axis == 0 else values[:, None, None]
    return np.broadcast_to(values, (rows, columns, 3))


def eye_of_view(display, view_x, view_y=None):
    geometry, (px, py) = Geometry.of(display), display.views
    down = (py - 1) / 2 if view_y is None else view_y
    return ((view_x - (px - 1) / 2) * geometry.spacing, -(down - (py - 1) / 2) * geometry.spacing, geometry.distance)


def looks(display, eia, eye):
    """Without the panel's border, beyond which an eye at the side looks."""
    return eye_view(weave(eia, gather_map(display, "nearest")), display, eye, width=1)[2:-2, 2:-2].astype(float)


@pytest.mark.parametrize("sheet", SHEETS)
def test_an_eye_at_the_centre_of_a_view_sees_that_view(sheet):
    display = SHEETS[sheet]()
    for axis in (0, 1) if display.views[1] > 1 else (0,):
        eia, count = numbered(display, axis), display.views[axis]
        for view in (count // 4, count // 2, 3 * count // 4):
            eye = eye_of_view(display, view) if axis == 0 else eye_of_view(display, (display.views[0] - 1) / 2, view)
            seen = looks(display, eia, eye) / 8
            assert np.median(seen) == pytest.approx(view, abs=0.5) and np.percentile(np.abs(seen - view), 90) < 1.5


def test_whole_numbers_are_seen_as_a_profile_of_format_1_is_and_mirrored_panels_woven_for_it():
    display = whole("lenslet", subpixels={"stripes": "white"})
    eia = np.random.default_rng(0).integers(0, 256, (96, 128, 3), np.uint8)
    panel = weave(eia, gather_map(display, "views"))
    for view in ((0, 0), (2, 5), (7, 7)):
        eye = eye_of_view(display, *view)
        np.testing.assert_array_equal(eye_view(panel, display, eye, width=1), eye_view(panel, MINI, eye, width=1))
    plain = lenticular(subpixels={"stripes": "white"}, weave="nearest")
    mirrored = dataclasses.replace(plain, lenticular=dataclasses.replace(plain.lenticular, flip=(True, True)))
    eia = noise(plain)
    np.testing.assert_array_equal(weave(eia, gather_map(mirrored, "views"))[::-1, ::-1],
                                  weave(eia, gather_map(plain, "views")))
    red = subpixel_rays(lenticular(), 0, np.arange(160)[:, None], np.arange(240))
    blue = subpixel_rays(lenticular(subpixels={"stripes": "bgr"}), 2, np.arange(160)[:, None], np.arange(240))
    np.testing.assert_array_equal(red.view_x, blue.view_x)
    assert Geometry.of(square()).gap == 7.0
