"""Times to equal error: exact on power laws, never too short, with intervals that hold the truth."""

import dataclasses
import json
import re
from xml.etree import ElementTree

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from lfsr_core.base.messages import LfsrError
from lfsr_core.base.records import to_data, write_record
from lfsr_lab.experiments.chart import analysis, findings, panels
from lfsr_lab.experiments.chart.analysis import mean_duels
from lfsr_lab.experiments.chart.findings import RIVAL
from lfsr_lab.experiments.chart.panels import Crops, Row
from lfsr_lab.experiments.engine.truth import MEASURES, SSIM
from tests.support.chart_example import LOW_METHODS, example

SAMPLES, OURS = (1, 4, 16, 64), (analysis.LOW, "ours")
COSTS = np.array(SAMPLES, float)[:, None]


def column(values):
    return np.array(values, float)[:, None]


@pytest.mark.parametrize("target", [0.9, 0.5, 0.3, 0.125])
def test_the_cost_on_a_power_law_is_exact(target):
    costs, bound = analysis.reach(COSTS, COSTS**-0.5, np.array([target]))
    assert costs[0] == pytest.approx(target**-2) and not bound[0]


def test_what_is_never_reached_is_infinite_and_what_is_reached_at_once_is_a_bound():
    costs, bound = analysis.reach(COSTS, np.tile(COSTS**-0.5, 3), np.array([0.01, 1.0, 2.0]))
    assert costs.tolist() == [np.inf, 1.0, 1.0] and bound.tolist() == [False, False, True]
    every = points("ours", 4, 1.0) + points("worse", 4, 9.0)
    reaches = {(reach.method, reach.measure): reach for reach in analysis.reaches(every, {SSIM: 0.75})}
    hard = np.exp(np.random.default_rng(5).normal(0, 0.5, 20)).mean()
    assert reaches["ours", SSIM].rays.value == pytest.approx((hard / 0.75)**2, rel=1e-4)
    assert reaches["worse", SSIM].rays.value is None


DEARER_IS_WORSE, BUSY = column([0.5, 0.8, 0.4, 0.2]), column([2.0, 1.0, 4.0])  # as times of a busy machine are


@pytest.mark.parametrize(("costs", "errors", "target", "low", "high"), [
    (COSTS, DEARER_IS_WORSE, 0.6, 1.0, 1.0), (COSTS, DEARER_IS_WORSE, 0.45, 4.0001, 15.9999),
    # What costs more and is worse does not count, and what costs more than one with less error costs no more.
    (BUSY, column([0.5, 0.25, 0.1]), 0.5, 1.0, 1.0), (BUSY, column([0.5, 0.25, 0.1]), 0.3, 1.0, 1.0),
    # Split errors of nearly perfect images can come out negative: they are reached like the least there is.
    (COSTS, column([0.5, 0.1, 0.01, -0.001]), -0.002, 64 - 1e-6, 64 + 1e-6)])
def test_what_costs_more_is_never_worse(costs, errors, target, low, high):
    assert low <= analysis.reach(costs, errors, np.array([target]))[0][0] <= high


@given(st.lists(st.floats(1e-4, 1), min_size=4, max_size=4), st.floats(1e-4, 1), st.floats(0.5, 1))
def test_less_error_never_costs_less(errors, target, part):
    both = analysis.reach(COSTS, np.tile(column(errors), 2), np.array([target, part * target]))[0]
    assert both[0] <= both[1] * (1 + 1e-12)


def points(method, scale, factor, random=None, role=analysis.LOW, samples=SAMPLES, lenses=20, seeds=10):
    """A method whose error is factor / √rays, on lenses that are hard or easy for all alike."""
    hard, curve = np.exp(np.random.default_rng(5).normal(0, 0.5, lenses)), []
    for count in samples:
        noise = random.normal(1, 0.1, (seeds, lenses)) if random else np.ones((seeds, lenses))
        rows = tuple(map(tuple, (factor * (count / scale**2)**-0.5 * hard * noise).tolist()))
        times = analysis.Times((0.2 + count / scale**2,), (0.1,), None)
        measured = analysis.Measured(dict.fromkeys(MEASURES, rows))
        curve.append(analysis.Point.of(role, method, scale, count, measured, times, np.arange(lenses)))
    return curve


def rivals(factor=1.0, random=None):
    """Points of ours, and one of the others with twice the error of factor 1."""
    return points("ours", 4, factor, random) + points("theirs", 1, 2.0, random, analysis.DIRECT, (1,))


def test_a_duel_of_power_laws_has_the_ratio_of_their_squares_and_intervals_hold_it_as_they_say():
    duels = analysis.duels(rivals(), OURS)
    assert len(duels) == len(MEASURES)
    duel = duels[0]
    assert (duel.role, duel.method, duel.samples) == (analysis.DIRECT, "theirs", 1)
    assert duel.rays.value == pytest.approx(0.25, rel=1e-4) and not duel.rays.bound
    assert duel.seconds.value == pytest.approx((0.3 + 0.25) / 1.3, rel=0.1)
    random, inside, runs = np.random.default_rng(3), 0, 40
    for _ in range(runs):
        rays = next(noisy.rays for noisy in analysis.duels(rivals(random=random), OURS) if noisy.measure == SSIM)
        inside += rays.low < 0.25 < rays.high
    assert inside / runs > 0.85 and rays.high - rays.low < 0.05


def scene(every):
    reference = analysis.UsedReference(1024, None, 20, 1.0, {})
    return analysis.SceneRow("a", "5.0", reference, tuple(point.cell for point in every),
                             tuple(analysis.duels(every, OURS)), ())


def test_the_geometric_mean_has_an_interval_over_scenes_and_repeated_times_are_drawn_anew():
    sharp = [analysis.Cost(ratio, ratio, ratio, False) for ratio in (0.1, 0.2, 0.4, 0.8)]
    mean = analysis.geometric_mean(sharp)
    assert mean.value == pytest.approx((0.1 * 0.2 * 0.4 * 0.8)**0.25, rel=1e-4)
    assert 0.1 <= mean.low < 0.2 and 0.4 < mean.high <= 0.8
    wide = analysis.geometric_mean([analysis.Cost(cost.value, cost.value / 2, cost.value * 2, False) for cost in sharp])
    assert wide.value == mean.value and wide.low < mean.low and wide.high > mean.high
    assert analysis.geometric_mean([*sharp, analysis.Cost(0.3, 0.2, None, True)]).high is None
    assert analysis.geometric_mean([]).value is None and analysis.geometric_mean(sharp[:1]) == sharp[0]
    drawn = analysis.drawn_seconds(analysis.Times((1.0, 2.0, 9.0), (0.5,), None))
    assert drawn[0] == 2.5 and set(np.unique(drawn)) == {1.5, 2.5, 9.5}


def test_means_are_of_scenes_where_ours_gets_there_and_of_cells_that_all_have():
    duel = analysis.mean_duels([scene(rivals(factor)) for factor in (1.0, 0.5, 50.0)])[0]
    assert duel.scenes == 2 and duel.rays.value == pytest.approx((0.25 * 0.0625)**0.5, rel=1e-4)
    assert duel.seconds.value is not None
    first, second = scene(points("ours", 4, 1.0)), scene(points("ours", 4, 3.0, samples=SAMPLES[:2]))
    cells, one = analysis.mean_cells([first, second]), first.cells[0]
    assert [cell.samples for cell in cells] == [1, 4]
    assert cells[0].errors[SSIM].mean == pytest.approx(2 * one.errors[SSIM].mean, rel=1e-4)
    half = one.errors[SSIM].high - one.errors[SSIM].mean
    assert cells[0].errors[SSIM].high - cells[0].errors[SSIM].mean == pytest.approx(half * 10**0.5 / 2, rel=1e-3)
    assert cells[0].seconds.mean == pytest.approx(one.seconds.mean, rel=1e-4)


@pytest.mark.parametrize(("change", "message"), [
    (lambda chart: {name: value for name, value in chart.items() if name != "environment"}, "'environment'"),
    (lambda chart: chart | {"format": 1}, "has format 1"), (lambda chart: [], "format None"),
    (lambda chart: chart["scenes"][0]["cells"][0].update(role="high") or chart,
     "scenes[0].cells[0].role is 'high', but")])
def test_a_chart_is_read_back_as_it_was_and_what_is_broken_in_one_is_named(tmp_path, change, message):
    chart, path = example(2), tmp_path / "chart.json"
    write_record(path, chart)
    assert analysis.read_chart(path) == chart
    path.write_text(json.dumps(change(to_data(chart))))
    with pytest.raises(LfsrError) as error:
        analysis.read_chart(path)
    assert message in str(error.value)


SVG = "{http://www.w3.org/2000/svg}"


@pytest.fixture(scope="module")
def chart():
    return example(2)


@pytest.fixture(scope="module")
def image(chart):
    return panels.image(chart)


@pytest.fixture(scope="module")
def page(chart):
    return panels.page(chart, None)


def texts(svg: str) -> list[str]:
    return ["".join(element.itertext()) for element in ElementTree.fromstring(svg).iter(f"{SVG}text")]


def test_the_image_has_every_error_against_every_cost_and_every_text_inside(image):
    words = " ".join(texts(image))
    assert words.count("Mean of 2 scenes") == 2 * (len(MEASURES) + 1)
    assert words.count("slope −½") == 10 and words.count("slope −1") == 6, "of squares the slope of their root too"
    assert words.count("end to end →") == words.count("rays per finished pixel →") == 5
    image = ElementTree.fromstring(image)
    width, height = (float(size) for size in image.get("viewBox").split()[2:])
    places = []
    for element in image.iter(f"{SVG}text"):
        moved = re.search(r"translate\((\S+) (\S+)\)", element.get("transform"))
        places.append(tuple(map(float, moved.groups() if moved else (element.get("x"), element.get("y")))))
    assert len(places) > 50 and all(0 <= x <= width and 0 <= y <= height for x, y in places)


def test_without_times_there_are_only_rays_the_name_of_a_scene_is_no_formula_and_a_page_needs_no_direct_ones():
    chart = example(2, timed=False)
    scenes = tuple(dataclasses.replace(scene, reference=dataclasses.replace(
        scene.reference, noise=dict.fromkeys(MEASURES, 0.05))) for scene in chart.scenes)
    words = " ".join(texts(panels.image(dataclasses.replace(chart, scenes=scenes))))
    assert words.count("the reference's own noise") == words.count("rays per finished pixel →") == 5
    assert "end to end →" not in words and "of the rays" in findings.headline(chart)
    images = np.random.default_rng(0).random((3, 24, 24, 3))
    row = Row("equal time", ("ours 4", "theirs 1"), (0.1, 0.2), images[0], (images[1], images[2]))
    page = panels.page(example(1, direct=False, timed=False), Crops((row, row)))
    assert "was not measured" in page and 'src="data:image/png;base64,iVBORw' in page
    chart, name = example(1, timed=False), "$a_b$ do$ll $\\frac$ back\\slash a^b_c{d} %s"
    chart = dataclasses.replace(chart, scenes=(dataclasses.replace(chart.scenes[0], scene=name),),
                                settings=dataclasses.replace(chart.settings, display=f"{name}.toml"))
    words = texts(panels.image(chart))
    assert name in words and f"Display {name}.toml" in " ".join(words) and "Mean" not in " ".join(words)
    assert panels.page(chart, None)


def test_the_page_stands_alone_its_tables_are_whole_and_losses_named_as_wins_are(chart, page):
    assert not re.search(r"<script|<link|src=|url\((?!#)|@import", page)
    for table in re.findall(r"<table>.*?</table>", page):
        assert len({len(row) for row in ElementTree.fromstring(table).iter("tr")}) == 1
    assert all(name in page for name in LOW_METHODS) and all(scene.scene in page for scene in chart.scenes)
    assert chart.skipped[0] in page and "Example processor" in page
    duels = [duel for scene in chart.scenes for duel in scene.duels]
    lost = sum(map(findings.is_lost, duels))
    assert 0 < lost < len(duels)
    assert page.count("✘ ") == lost and page.count("✔ ") == len(duels) - lost
    told = [int(count) for line in findings.losses(chart) for count in re.findall(r"(\d+) of \d+ times", line)]
    assert sum(told) == lost


def test_a_tie_at_less_error_is_no_loss_and_headline_and_tables_are_whole(chart):
    duel = chart.scenes[0].duels[0]
    tie = dataclasses.replace(duel, seconds=dataclasses.replace(duel.rays, value=1.0, bound=False))
    assert findings.is_lost(tie)
    assert not findings.is_lost(dataclasses.replace(tie, seconds=dataclasses.replace(tie.seconds, bound=True)))
    assert findings.is_lost(dataclasses.replace(tie, seconds=dataclasses.replace(tie.seconds, value=None)))
    means = [duel for duel in mean_duels(chart.scenes) if (duel.measure, duel.role, duel.method) == (SSIM, *RIVAL)]
    ratios = [duel.seconds.value for scene in chart.scenes for duel in scene.duels
              if (duel.measure, duel.key, duel.samples) == (SSIM, RIVAL, 1)]
    assert means[0].seconds.value == pytest.approx(np.exp(np.mean(np.log(ratios))), rel=1e-3)
    words = findings.headline(chart)
    assert findings.percent(means[0].seconds.value) in words and "of the time" in words
    assert f"{findings.percent(min(ratios))} to {findings.percent(max(ratios))}" in words
    rows = [line for line in findings.markdown(chart).splitlines() if line.startswith("| espcn | 16 | 4 | 1 |")]
    assert len(rows) == 3, "one per scene and one of the mean"
    assert all(row.count("–") == row.count("(") == 6 and row.count("±") == 4 for row in rows), rows
