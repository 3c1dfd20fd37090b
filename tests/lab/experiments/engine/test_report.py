"""Tables, and pages: whole, self-contained, nothing in them is taken for markup; the machine is named."""

import dataclasses
import itertools
import json
import math
import platform
import re
import sys
from xml.etree import ElementTree

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from jinja2 import ChoiceLoader, DictLoader, UndefinedError
from matplotlib.text import Text

import lfsr_core
from lfsr_core.base.messages import LfsrError
from lfsr_core.base.records import from_data, to_data
from lfsr_core.frames.folder import FrameFolder
from lfsr_lab.experiments.engine import plots, report
from lfsr_lab.experiments.engine.plots import Curve
from lfsr_lab.experiments.engine.records import Records, Store
from lfsr_lab.experiments.engine.report import Environment, environment, markdown_table, number
from lfsr_lab.experiments.engine.seeds import estimate, interval, replicates
from lfsr_lab.experiments.engine.truth import BIAS, FLIP, MEASURES, RELATIVE, RELMSE, SMAPE, SSIM, VARIANCE, errors
from lfsr_lab.experiments.engine.truth import reference_noise as noise_of
from tests.support.played_blender import played_blender
from tests.support.requests import make_request
from tests.support.synthetic import MINI, fails


@dataclasses.dataclass(frozen=True)
class Kept:
    name: str
    seconds: float


@pytest.fixture
def cells(tmp_path):
    return Records(tmp_path, Kept)


def test_a_record_is_measured_once_per_fingerprint_a_damaged_one_again_and_a_failure_not_kept(cells):
    results = iter([Kept("a", 1.0), Kept("a", 2.0)])
    first = cells.get("one", {"weights": "x"}, lambda: next(results))
    assert first == Kept("a", 1.0) == cells.get("one", {"weights": "x"}, lambda: next(results))
    assert cells.get("one", {"weights": "y"}, lambda: next(results)) == Kept("a", 2.0)
    assert cells.read("one", {"weights": "x"}) is None and cells.read("two", {"weights": "x"}) is None
    for text in ("", "{", "[]", "{}", '{"fingerprint": {"a": 1}, "record": {"name": 3, "seconds": 1.0}}',
                 '{"fingerprint": {"a": 1}, "record": {"name": "n"}}'):
        cells.path("one").write_text(text)
        assert cells.read("one", {"a": 1}) is None
        assert cells.get("one", {"a": 1}, lambda: Kept("n", 2.0)) == cells.read("one", {"a": 1})
    with pytest.raises(ZeroDivisionError):
        cells.get("two", {}, lambda: Kept("a", 1 / 0))
    assert not cells.path("two").exists()


TABLE = """{% extends "base.html" %}{% import "macros.html" as macros %}{% block title %}T{% endblock %}
{% block body %}{{ macros.table(["name", "n"], rows) }}{{ picture }}{% endblock %}"""


@pytest.fixture
def templates(monkeypatch):
    """The package's templates and one of this test."""
    environment = report._templates()
    monkeypatch.setattr(environment, "loader", ChoiceLoader([DictLoader({"test.html": TABLE}), environment.loader]))


@dataclasses.dataclass(frozen=True)
class Results:
    """What was measured."""

    value: float


def test_results_are_written_before_they_are_drawn_and_a_render_asked_for_twice_made_once(tmp_path):
    def draw():
        raise ValueError("no such font\nin this place")

    with pytest.raises(LfsrError, match=r"results.svg cannot be drawn \(no such font in this place\): .*results.json"):
        report.write_report(tmp_path, "results", Results(0.5), {".md": lambda: "# Results\n", ".svg": draw})
    assert json.loads((tmp_path / "results.json").read_text()) == {"value": 0.5}
    assert (tmp_path / "results.md").read_text() == "# Results\n" and len(list(tmp_path.iterdir())) == 2
    (tmp_path / "disc.blend").touch()
    job = make_request(str(tmp_path / "render"), MINI, scene=str(tmp_path / "disc.blend"), scale=2, samples=4)
    store = Store(tmp_path, played_blender(tmp_path / "blender"))
    store.render_all([job, job])
    (tmp_path / "blender").unlink()
    assert store.rendered(job) == tmp_path / "render" and FrameFolder(tmp_path / "render").holds()


def test_text_is_escaped_pictures_are_not_and_what_the_template_wants_must_be_given(templates):
    svg = report.inline_svg('<?xml version="1.0"?>\n<!DOCTYPE svg>\n<svg><title>t</title></svg>', 'a & b')
    html = report.page_html("test.html", rows=[["<b>", 1]], picture=svg)
    assert '<td class="l">&lt;b&gt;</td><td>1</td>' in html
    assert '<svg role="img" aria-label="a &amp; b"><title>t</title></svg>' in html
    assert html.startswith("<!doctype html>") and "<?xml" not in html
    assert not re.search(r"<script|<link|url\(|@import", html)
    with pytest.raises(UndefinedError, match="picture"):
        report.page_html("test.html", rows=[])


def test_cells_are_written_by_what_they_are_and_this_machine_described():
    assert markdown_table(["name", "value"], [["a", 0.12345], [1, None], [True, False]]) == [
        "| name | value |", "| --- | --- |", "| a | 0.123 |", "| 1 | – |", "| yes | no |"]
    assert markdown_table("abc", [], "lr")[1] == "| --- | ---: | ---: |"
    assert markdown_table("abc", [], "lrlr")[1] == "| --- | ---: | --- |"
    assert (number(None), number(2, 0.25, 2), number(2.0)) == ("–", "2.00 ± 0.25", "2.000")
    described = environment()
    assert described.python == platform.python_version() and described.cores >= 1 and described.cpu
    assert described.versions["lfsr"] == lfsr_core.__version__ and described.versions["numpy"] == np.__version__
    assert from_data(Environment, to_data(described), "the environment") == described
    described = dataclasses.replace(described, cpu="Example", cores=2, gpu=None)
    assert described.machine == "2 cores of Example"
    assert dataclasses.replace(described, gpu="Card").machine == "2 cores of Example and Card"


def test_a_study_is_refused_before_it_is_measured_where_its_report_could_not_be_written(tmp_path, monkeypatch, capsys):
    monkeypatch.setitem(sys.modules, "jinja2", None)
    for words in (["study", "chart", "vase.blend"], ["study", "stress"]):
        assert "'Jinja2', which is not installed" in fails([*words, "-o", str(tmp_path / "out")], capsys)
    assert not (tmp_path / "out").exists()


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


def test_the_same_figures_make_the_same_picture_whose_names_do_not_lie_on_each_other():
    (figure, axes), (again, _) = drawn(), drawn()
    names = [Text.get_window_extent(text) for text in axes.texts if text.get_weight() == "bold"]
    assert len(names) == len(CURVES) and not any(one.overlaps(other) for one, other in itertools.combinations(names, 2))
    assert all(name.x0 >= 0 and name.x1 <= axes.figure.bbox.x1 for name in names)
    picture = plots.svg(figure)
    assert picture == plots.svg(again)
    words = ["".join(element.itertext()) for element in ElementTree.fromstring(picture).iter(f"{SVG}text")]
    assert {"Below", "method0+part", "(ours)", "10 s"} <= set(words)


@pytest.mark.parametrize("count", [1, 3])
def test_a_long_footer_is_broken_and_lies_below_the_panels(count):
    figure, grid = plots.panel_sheet(count, footer="Words of a footer " * 20)
    box = figure.texts[0].get_window_extent()
    assert box.x0 >= 0 and box.x1 <= figure.bbox.x1 and box.y0 >= 0
    assert box.y1 < min(axes.bbox.y0 for axes in grid) - 30 * figure.dpi / 72, "an axis has its words there"


def test_points_wear_what_is_known_of_them_and_long_names_break_where_a_part_begins():
    figure, axes = plots.sheet(3, 2)
    axes = axes[0, 0]
    plots.draw_curve(axes, Curve("a", plots.INK, "o", (1, 2), (3, 4), spans=((0.5, 1), (2, 2.5)),
                                 bars=((2.9, 3.1), (4, 4))))
    sides, ups = (collection.get_segments() for collection in axes.collections)
    assert np.allclose(sides, [[(0.5, 3), (1, 3)], [(2, 4), (2.5, 4)]])
    assert np.allclose(ups, [[(1, 2.9), (1, 3.1)], [(2, 4), (2, 4)]])
    assert list(map(plots.broken, ("every view +OIDN", "bicubic", "denoise+bilinear+epi (ours)"))) == [
        "every view\n+OIDN", "bicubic", "denoise\n+bilinear+epi\n(ours)"]


@given(st.floats(1e-3, 1e5), st.floats(1.01, 1e4))
def test_time_ticks_lie_inside_and_are_few(low, factor):
    ticks = plots.time_ticks(low, low * factor)
    assert 2 <= len(ticks) <= 12 and all(low * (1 - 1e-9) <= tick <= low * factor * (1 + 1e-9) for tick in ticks)


@given(st.floats(-0.9, 0.99), st.floats(0.001, 0.9))
def test_heights_rise_with_values(value, gain):
    assert plots.height(value + gain) >= plots.height(value) and math.isfinite(plots.height(1.2))


LENSES, SIZE = 12, 24


@pytest.fixture(scope="module")
def truth():
    """Elemental images (n, py, px, 3) of waves."""
    y, x = np.mgrid[:SIZE, :SIZE] / SIZE
    return np.array([[0.4 + 0.3 * np.sin(6 * x + lens + channel) * np.cos(5 * y + lens) for channel in range(3)]
                     for lens in range(LENSES)]).transpose(0, 2, 3, 1)


def noisy(image, sigma, seed):
    return image + np.random.default_rng(seed).normal(0, sigma, image.shape)


def halves(truth, sigma):
    return noisy(truth, sigma, 100), noisy(truth, sigma, 101)


def relative(squares, truth):
    return float((squares / (truth.mean(-1, keepdims=True)**2 + RELATIVE)).mean())


@pytest.mark.parametrize(("seeds", "bias", "sigma"), [(2, 0.05, 0.1), (4, 0.0, 0.1), (4, 0.05, 0.0), (4, 0.05, 0.1)])
def test_bias_and_variance_are_those_that_were_put_in_whatever_the_noise_of_the_reference(truth, seeds, bias, sigma):
    measured = errors(np.array([noisy(truth + bias, sigma, seed) for seed in range(seeds)]), *halves(truth, 0.02))
    one = relative(np.full(truth.shape, 1.0), truth)
    assert measured[BIAS].mean() == pytest.approx(one * bias**2, abs=0.03 * one * (bias**2 + sigma**2))
    assert measured[VARIANCE].mean() == pytest.approx(one * sigma**2, abs=0.03 * one * (bias**2 + sigma**2))
    assert np.allclose(measured[RELMSE].mean(0), measured[BIAS] + measured[VARIANCE], rtol=1e-9)


def test_a_perfect_image_has_no_error_a_few_fireflies_do_not_count_and_pixels_are_left_out_alike(truth):
    better, worse = (errors(np.array([truth + shift]), truth, truth) for shift in (0.0, 0.1))
    assert better.keys() == {*MEASURES}, "one seed has no parts"
    for name in MEASURES:
        assert np.allclose(better[name], 0, atol=1e-6) and worse[name].min() > 1e-3, name
    assert worse[SMAPE].mean() == pytest.approx(np.mean(0.2 / (2 * truth + 0.1 + 0.01)), rel=1e-6)
    assert worse[RELMSE].mean() == pytest.approx(relative(np.full(truth.shape, 0.01), truth), rel=0.01)
    a, b = halves(truth, 0.04)
    exact, told = errors(np.array([(a + b) / 2]), truth, truth), noise_of(a, b)
    for name, tolerance in ((SSIM, 0.25), (RELMSE, 0.1), (SMAPE, 0.15), (FLIP, 0.35)):
        assert told[name] == pytest.approx(exact[name].mean(), rel=tolerance), name
    for share, counts in ((5e-4, False), (1e-2, True)):
        image = truth.copy().reshape(-1, 3)
        image[np.random.default_rng(3).choice(len(image), int(share * len(image)), replace=False)] = 1e4
        error = errors(image.reshape(1, *truth.shape), truth, truth)[RELMSE].mean()
        assert (error > 1) == counts, error
    images = np.array([truth] * 3)
    images[1, 0, 0, 0] = 1e4
    measured = errors(images, truth, truth)
    assert np.allclose(measured[RELMSE], 0, atol=1e-12) and np.allclose(measured[VARIANCE], 0, atol=1e-12)


@pytest.mark.parametrize(("lens_sd", "seed_sd", "rest_sd"), [(1.0, 0.0, 0.1), (0.0, 1.0, 0.1), (1.0, 1.0, 0.1)])
def test_intervals_hold_the_truth_about_as_often_as_they_say(lens_sd, seed_sd, rest_sd):
    """Whether seeds, lenses or both make the difference."""
    random, inside, runs = np.random.default_rng(7), 0, 400
    for _ in range(runs):
        values = (random.normal(0, lens_sd, (1, 20)) + random.normal(0, seed_sd, (10, 1))
                  + random.normal(0, rest_sd, (10, 20)))
        estimated = estimate(values)
        inside += estimated.low < 0 < estimated.high
    assert 0.87 < inside / runs < 0.99


def test_the_spread_is_that_of_the_means_of_seeds_and_methods_are_compared_in_pairs():
    values = np.array([[1.0, 3.0], [2.0, 4.0], [3.0, 5.0]])
    estimated = estimate(values)
    assert (estimated.mean, estimated.spread) == (3.0, pytest.approx(1.0))
    assert estimated.low <= 2.5 and estimated.high >= 3.5
    assert estimate(values[:1]).spread is None
    random = np.random.default_rng(1)
    hard = random.normal(10, 5, (1, 20))
    ours, theirs = (hard + random.normal(shift, 0.1, (10, 20)) for shift in (0.0, 1.0))
    low, high = interval(replicates(theirs) - replicates(ours))
    assert 0.8 < low < 1 < high < 1.2
