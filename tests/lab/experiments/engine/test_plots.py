"""Charts: the same bytes for the same figures, ticks that can be read, names beside what they name."""

from __future__ import annotations

import itertools
import math
from xml.etree import ElementTree

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from matplotlib.text import Text

from lfsr_lab.experiments.engine import plots
from lfsr_lab.experiments.engine.plots import Curve

SVG = "{http://www.w3.org/2000/svg}"
CURVES = [Curve(f"method{index}+part (ours)", color, marker, (1, 4, 16), (0.5, 0.8 + index / 1000, 0.9 + index / 1000),
                notes="abc")
          for index, (color, marker) in enumerate(zip(plots.COLORS, plots.MARKERS, strict=True))]


def drawn():
    figure, (axes,) = plots.panel_sheet(1, footer="Below")
    plots.time_axis(axes, 0.9, 20)
    plots.value_axis(axes, 0.8, 4)
    for curve in CURVES:
        plots.draw_curve(axes, curve)
    plots.name_curves(axes, CURVES)
    figure.draw_without_rendering()
    return figure, axes


def test_the_same_figures_make_the_same_picture():
    first, second = (plots.svg(drawn()[0]) for _ in range(2))
    assert first == second
    words = ["".join(element.itertext()) for element in ElementTree.fromstring(first).iter(f"{SVG}text")]
    assert {"Below", "method0+part", "(ours)", "10 s"} <= set(words)


def test_names_of_curves_that_end_together_do_not_lie_on_each_other():
    axes = drawn()[1]
    names = [Text.get_window_extent(text) for text in axes.texts if text.get_weight() == "bold"]
    assert len(names) == len(CURVES)
    assert not any(one.overlaps(other) for one, other in itertools.combinations(names, 2))
    assert all(name.x0 >= 0 and name.x1 <= axes.figure.bbox.x1 for name in names)


@pytest.mark.parametrize("count", [1, 3])
def test_a_long_footer_is_broken_and_lies_below_the_panels(count):
    figure, grid = plots.panel_sheet(count, footer="Words of a footer " * 20)
    box = figure.texts[0].get_window_extent()
    assert box.x0 >= 0 and box.x1 <= figure.bbox.x1 and box.y0 >= 0
    assert box.y1 < min(axes.bbox.y0 for axes in grid) - 30 * figure.dpi / 72, "an axis has its words there"


def test_points_wear_what_is_known_of_them():
    figure, axes = plots.sheet(3, 2)
    axes = axes[0, 0]
    plots.draw_curve(axes, Curve("a", plots.INK, "o", (1, 2), (3, 4), spans=((0.5, 1), (2, 2.5)),
                                 bars=((2.9, 3.1), (4, 4))))
    sides, ups = (collection.get_segments() for collection in axes.collections)
    assert np.allclose(sides, [[(0.5, 3), (1, 3)], [(2, 4), (2.5, 4)]])
    assert np.allclose(ups, [[(1, 2.9), (1, 3.1)], [(2, 4), (2, 4)]])


@given(st.floats(1e-3, 1e5), st.floats(1.01, 1e4))
def test_time_ticks_lie_inside_and_are_few(low, factor):
    ticks = plots.time_ticks(low, low * factor)
    assert 2 <= len(ticks) <= 12
    assert all(low * (1 - 1e-9) <= tick <= low * factor * (1 + 1e-9) for tick in ticks)


@given(st.floats(-0.9, 0.99), st.floats(0.001, 0.9))
def test_heights_rise_with_values(value, gain):
    assert plots.height(value + gain) >= plots.height(value)
    assert math.isfinite(plots.height(1.2))


@pytest.mark.parametrize(("name", "lines"), [("every view +OIDN", "every view\n+OIDN"), ("bicubic", "bicubic"),
                                             ("denoise+bilinear+epi (ours)", "denoise\n+bilinear+epi\n(ours)")])
def test_long_names_break_where_a_part_begins(name, lines):
    assert plots.broken(name) == lines
