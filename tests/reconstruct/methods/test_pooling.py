"""Pooling along depth: what it makes of surfaces whose light field is known."""

import dataclasses

import numpy as np
import pytest

from lfsr_core.reconstruct.methods import pooling
from lfsr_core.reconstruct.methods.pooling import Pooling
from lfsr_core.reconstruct.upscaler import Interpolation, LowResEIA, low_resolution
from tests.support.reference_rays import rays
from tests.support.synthetic import frame_of

LENSES, VIEWS, SCALE = (10, 14), (5, 6), 4  # (rows, columns) of lenses, and of rendered views


def texture(across: np.ndarray, down: np.ndarray) -> np.ndarray:
    """Colours of a printed plane at places counted in lenses."""
    waves = (0.5 + 0.4 * np.sin(1.9 * across), 0.5 + 0.3 * np.cos(1.7 * down), 0.4 + 0.3 * np.sin(across + down))
    return np.stack(waves, -1).astype(np.float32)


def views_of(slope: float, ratio: float, factor: int) -> np.ndarray:
    """EIs (sy, sx, h·factor, w·factor, 3) of a plane that moves by ``slope`` lenses per rendered view to the right."""
    row, column, y, x = np.meshgrid(*map(np.arange, (*LENSES, VIEWS[0] * factor, VIEWS[1] * factor)), indexing="ij")
    y, x = ((index + 0.5) / factor - 0.5 for index in (y, x))
    return texture(column - slope * x, row - slope * ratio * y)


def plane(slope: float | np.ndarray, ratio: float = 1.0, samples: int = 16,
          color: np.ndarray | None = None) -> LowResEIA:
    color = views_of(float(np.mean(slope)), ratio, 1) if color is None else color
    slopes = np.broadcast_to(np.float32(slope), (*color.shape[:4], 1)).copy()
    return LowResEIA(color, np.ones_like(color[..., :1]), samples, SCALE, slope=slopes, slope_ratio=ratio)


def finished(low: LowResEIA, upscaler=None) -> np.ndarray:
    upscaler, lenses = upscaler or Pooling(), np.argwhere(np.ones(LENSES, bool))
    images = upscaler(upscaler.prepare(low), lenses)
    return images.reshape(*LENSES, *images.shape[1:])


INNER = np.s_[4:-4, 5:-5]  # lenses whose lines end inside the display


@pytest.mark.parametrize(("slope", "ratio"), [(0.6, 1.0), (-0.9, 1.2), (1.0, 1.0), (1.5, 0.8), (-1.6, 1.0)])
@pytest.mark.parametrize("samples", [1, 16, 64])
def test_a_print_off_the_display_plane_is_nearer_the_truth_than_interpolated(slope, ratio, samples):
    low, truth = plane(slope, ratio, samples), views_of(slope, ratio, SCALE)
    error = {name: np.sqrt(np.mean((finished(low, upscaler)[INNER] - truth[INNER]) ** 2))
             for name, upscaler in (("pool", Pooling()), ("linear", Interpolation("linear")))}
    # With 1 sample more views are pooled, against noise, which this print does not have.
    assert error["pool"] < (0.4 if abs(slope) > 1 else 1.3 if samples == 1 else 0.9) * error["linear"], error


def test_what_a_mirror_shows_at_its_own_depth_is_not_lost():
    """Each lens of a mirror on the display plane shows what lies behind it."""
    color, truth = views_of(0.4, 1.0, 1), views_of(0.4, 1.0, SCALE)
    low = dataclasses.replace(plane(0.0, color=color), noisy=color)
    noise = np.random.default_rng(1).normal(0, 0.4, color.shape).astype(np.float32)
    error = [np.mean((finished(image, upscaler)[INNER] - truth[INNER]) ** 2) for image, upscaler in (
        (low, Interpolation("linear")), (low, Pooling()), (dataclasses.replace(low, noisy=color + noise), Pooling()))]
    assert error[1] < 1.05 * error[0] < 0.5 * error[2], error  # between as much noise it would be noise


@pytest.mark.parametrize("shown", [0.3, 1.2])
def test_the_render_decides_whether_the_end_of_a_ray_s_path_is_seen(shown):
    """It is in mirrors, and is not in curved glass."""
    color = views_of(shown, 1.0, 1)
    noisy = color + np.random.default_rng(2).normal(0, 0.2, color.shape).astype(np.float32).clip(-color)
    one = dataclasses.replace(plane(shown), noisy=noisy)
    both = dataclasses.replace(one, slope=np.concatenate([plane(0.3).slope, plane(1.2).slope], -1))
    np.testing.assert_array_equal(finished(both)[INNER], finished(one)[INNER])
    both.slope[:, :, :, 1:, 1] = 0.3  # in few views: those beside an edge
    np.testing.assert_array_equal(finished(both), finished(dataclasses.replace(one, slope=both.slope[..., 1:])))


def test_what_is_bright_in_some_lenses_leaves_others_black():
    """Pooled along slopes of a black wall, light of other slopes would spread over it."""
    color = np.zeros((*LENSES, *VIEWS, 3), np.float32)
    color[:, :7] = 0.5
    assert finished(dataclasses.replace(plane(0.8, color=color), noisy=color))[INNER][:, 2:].max() < 0.02
    far = np.where(np.arange(LENSES[1])[:, None, None, None] < 7, 0, 3 + 0.8 * np.arange(VIEWS[1])[:, None])
    assert finished(plane(far, color=color))[:, 8:].max() < 0.02, "nor what lies before it"


def body(slope: float, factor: int) -> np.ndarray:
    """A white body before black; its soft edge moves by ``slope`` lenses per rendered view."""
    x = (np.arange(VIEWS[1] * factor) + 0.5) / factor - 0.5
    shown = np.clip(7 - np.arange(LENSES[1])[:, None] + slope * x, 0, 1).astype(np.float32)
    return np.array(np.broadcast_to(shown[:, None, :, None], (*LENSES, VIEWS[0] * factor, len(x), 3)))


def test_with_one_sample_what_lies_beside_an_edge_moves_with_it():
    """Each sample has one of the depths of the body and of the wall behind it."""
    slopes = np.where(body(0.2, 1)[..., :1] > 0.5, 0.2, 0.8)
    error = [np.mean((finished(plane(slopes, 1.0, samples, body(0.2, 1)))[INNER] - body(0.2, SCALE)[INNER]) ** 2)
             for samples in (1, 2)]
    assert error[0] < 0.5 * error[1], error


@pytest.mark.parametrize("slope", [0.8, 1.5, 2.5])
def test_an_edge_before_nothing_is_made_from_other_lenses_too(slope, monkeypatch):
    """Samples that show a part of it have no depth, or one that is wrong."""
    shown = np.random.default_rng(1).binomial(4, body(slope, 1)) / np.float32(4)
    slopes = np.where(shown < 0.5, np.nan, np.where(shown < 1, 0.3, slope))[..., :1]
    low, truth = plane(slopes, 1.0, 4, shown), body(slope, SCALE)
    error = [np.mean((finished(image)[INNER] - truth[INNER]) ** 2)
             for image in (dataclasses.replace(low, alpha=shown[..., :1]), low)]
    monkeypatch.setattr(pooling, "BEFORE_NOTHING", pooling.STEEP)
    assert error[0] < 0.8 * min(error[1], np.mean((finished(low)[INNER] - truth[INNER]) ** 2)), error


def test_what_a_silhouette_leaves_free_moves_with_it(monkeypatch):
    """Gaps that a denoiser has filled come back, and with few samples they lose noise as what is seen does."""
    def bars(factor: int) -> np.ndarray:
        x = (np.arange(VIEWS[1] * factor) + 0.5) / factor - 0.5
        shown = 0.5 * (np.sin(2.1 * (np.arange(LENSES[1])[:, None] - 0.9 * x)) > 0.3).astype(np.float32)
        return np.broadcast_to(shown[:, None, :, None], (*LENSES, VIEWS[0] * factor, len(x), 3))
    body = np.broadcast_to(np.arange(VIEWS[1])[:, None] < 2, (*LENSES, *VIEWS, 1))
    noise = np.random.default_rng(2).normal(0.2, 0.05, (*LENSES, *VIEWS, 3)).astype(np.float32)
    gaps = plane(np.where(bars(1)[..., :1] > 0, 0.9, np.nan), color=0.2 * bars(1) + 0.2)
    few = plane(np.where(body, 0.1, np.nan), samples=4, color=noise + np.float32(0.4) * body)
    left, spread = [], []
    for reach in (0, pooling.VOID_REACH):
        monkeypatch.setattr(pooling, "VOID_REACH", reach)
        left.append(finished(dataclasses.replace(gaps, noisy=bars(1)))[INNER][bars(SCALE)[INNER] == 0].mean())
        spread.append(finished(few)[INNER][..., 4 * SCALE:, :].std())
    assert left[1] < 0.6 * left[0] and spread[1] < 0.7 * spread[0], (left, spread)


def test_a_wrong_slope_no_depth_and_the_mirrored_light_field():
    low, truth = plane(0.9), views_of(0.9, 1.0, SCALE)
    wrong = dataclasses.replace(low, slope=-low.slope)
    right, mistaken = (np.mean((finished(image)[INNER] - truth[INNER]) ** 2) for image in (low, wrong))
    assert right < 0.5 * mistaken
    low = plane(0.7, samples=4)
    linear = finished(low, Interpolation("linear"))
    for slope in (None, np.full_like(low.slope, np.nan), np.full_like(low.slope, 50)):
        np.testing.assert_allclose(finished(dataclasses.replace(low, slope=slope)), linear, atol=1e-5)
    rng = np.random.default_rng(5)
    slope = rng.uniform(-1.8, 1.8, (*LENSES, *VIEWS, 1)).round(1)
    low = plane(slope, color=rng.random((*LENSES, *VIEWS, 3), np.float32))
    turned = low.each(lambda array: array[::-1, ::-1, ::-1, ::-1])
    np.testing.assert_allclose(finished(turned)[::-1, ::-1, ::-1, ::-1], finished(low), atol=1e-4)


@pytest.mark.parametrize("samples", [1, 16])
def test_one_colour_stays_one_colour(samples):
    slope = np.random.default_rng(3).uniform(-2, 2, (*LENSES, *VIEWS, 1))
    slope[slope > 1.5] = np.nan
    low = plane(slope, samples=samples, color=np.full((*LENSES, *VIEWS, 3), 0.3, np.float32))
    np.testing.assert_allclose(finished(low), 0.3, rtol=1e-4)


@pytest.mark.parametrize("slope", [0.9, 1.7])
def test_the_edge_of_a_lamp_leaves_no_light_around_it(slope):
    """A sample that is partly of a lamp before a wall has the wall's depth: that light does not lie there."""
    color = np.full((*LENSES, *VIEWS, 3), 0.3, np.float32)
    row, column, view = LENSES[0] // 2, LENSES[1] // 2, VIEWS[1] // 2
    color[row, column, :, view] = 20.0
    around = finished(plane(slope, color=color)).max((2, 4))
    around[row, column] = 0.3
    np.testing.assert_allclose(around, 0.3, rtol=1e-4)


def test_blocks_do_not_see_each_other_and_a_flat_display_pools_along_its_one_axis():
    low = plane(0.9)
    changed = low.each(lambda array: np.concatenate([array[:, :7], array[:, 7:][:, ::-1]], 1))
    lenses = np.argwhere(np.ones(LENSES, bool)[:, :7])
    images = [Pooling()(Pooling().prepare(dataclasses.replace(image, block=block)), lenses)
              for image in (low, changed) for block in (7, None)]
    np.testing.assert_array_equal(images[0], images[2])
    assert np.abs(images[1] - images[3]).max() > 1e-3
    low = plane(0.8)
    one = low.each(lambda array: array[:, :, :1])
    one = dataclasses.replace(one, parallax=(True, False))
    upscaler, lenses = Pooling(), np.argwhere(np.ones(LENSES, bool))
    images = upscaler(upscaler.prepare(one), lenses)
    assert images.shape == (len(lenses), 1, VIEWS[1] * SCALE, 3)
    moved = 0.8 * ((np.arange(VIEWS[1] * SCALE) + 0.5) / SCALE - 0.5)
    truth = np.stack([texture(column - moved, np.full(moved.shape, row)) for row, column in lenses])[:, None]
    inner, linear = np.all((lenses >= 3) & (lenses < np.array(LENSES) - 3), 1), Interpolation("linear")(one, lenses)
    assert np.mean((images - truth)[inner] ** 2) < np.mean((linear - truth)[inner] ** 2)


def test_slopes_follow_from_the_rendered_positions():
    """The ray of the next view through the lens that the slope names meets the same point."""
    frame = frame_of(2)
    layout = frame.rays
    width, height = layout.size
    x, y = np.meshgrid((np.arange(width) + 0.5) / width, 1 - (np.arange(height) + 0.5) / height)
    origin, direction = rays(layout, x, y)
    for depth in (0.7, 1.0, 1.9):
        points = origin + direction * (depth * frame.array.distance / direction[..., 2:])
        layers = {"color": np.ones((height, width, 4), np.float32), "position": points.astype(np.float32)}
        low = low_resolution(layers, frame)
        slope, (sx, sy) = low.slope[3, 3, 0, 0, 0], layout.tiles
        for axis, (lenses, ratio) in enumerate([(sx, 1.0), (sy, low.slope_ratio)]):
            pitch = 2 * frame.array.half_size[axis] / lenses
            assert slope * ratio == pytest.approx(layout.spacing * (1 - 1 / depth) / pitch, abs=1e-5)
        assert np.isnan(low_resolution(dict(layers, color=np.zeros((height, width, 4), np.float32)), frame).slope).all()
