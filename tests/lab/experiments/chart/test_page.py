"""What people read of a chart: well-formed, complete, honest about losses, nothing loaded from elsewhere."""

from __future__ import annotations

import dataclasses
import re
from xml.etree import ElementTree

import numpy as np
import pytest

from lfsr_lab.experiments.chart import findings, panels
from lfsr_lab.experiments.chart.analysis import mean_duels
from lfsr_lab.experiments.chart.findings import RIVAL
from lfsr_lab.experiments.chart.panels import Crops, Row
from lfsr_lab.experiments.engine.truth import MEASURES, SSIM
from tests.support.chart_example import LOW_METHODS, example

SVG = "{http://www.w3.org/2000/svg}"


@pytest.fixture(scope="module")
def chart():
    return example()


@pytest.fixture(scope="module")
def image(chart):
    return panels.image(chart)


@pytest.fixture(scope="module")
def page(chart):
    return panels.page(chart, None)


def texts(svg: str) -> list[str]:
    return ["".join(element.itertext()) for element in ElementTree.fromstring(svg).iter(f"{SVG}text")]


def test_the_image_has_every_error_against_every_cost(image):
    words = " ".join(texts(image))
    assert words.count("Mean of 6 scenes") == 2 * (len(MEASURES) + 1)
    assert words.count("slope −½") == 10 and words.count("slope −1") == 6, "of squares the slope of their root too"
    assert words.count("end to end →") == words.count("rays per finished pixel →") == 5


def test_without_times_there_are_only_rays_and_the_noise_of_the_reference_is_shaded():
    chart = example(2, timed=False)
    scenes = tuple(dataclasses.replace(scene, reference=dataclasses.replace(
        scene.reference, noise=dict.fromkeys(MEASURES, 0.05))) for scene in chart.scenes)
    words = " ".join(texts(panels.image(dataclasses.replace(chart, scenes=scenes))))
    assert words.count("the reference's own noise") == words.count("rays per finished pixel →") == 5
    assert "end to end →" not in words and "of the rays" in findings.headline(chart)


def test_the_name_of_a_scene_is_no_formula():
    chart, name = example(1, timed=False), "$a_b$ do$ll $\\frac$ back\\slash a^b_c{d} %s"
    chart = dataclasses.replace(chart, scenes=(dataclasses.replace(chart.scenes[0], scene=name),),
                                settings=dataclasses.replace(chart.settings, display=f"{name}.toml"))
    words = texts(panels.image(chart))
    assert name in words and f"Display {name}.toml" in " ".join(words) and "Mean" not in " ".join(words)
    assert panels.page(chart, None)


def test_every_text_lies_inside_the_image(image):
    image = ElementTree.fromstring(image)
    width, height = (float(size) for size in image.get("viewBox").split()[2:])
    places = [place(element) for element in image.iter(f"{SVG}text")]
    assert len(places) > 50 and all(0 <= x <= width and 0 <= y <= height for x, y in places)


def place(element) -> tuple[float, float]:
    """Where a text of matplotlib's stands."""
    moved = re.search(r"translate\((\S+) (\S+)\)", element.get("transform"))
    return tuple(map(float, moved.groups() if moved else (element.get("x"), element.get("y"))))


def test_the_page_stands_alone_and_its_tables_are_whole(chart, page):
    assert not re.search(r"<script|<link|src=|url\((?!#)|@import", page)
    for table in re.findall(r"<table>.*?</table>", page):
        rows = ElementTree.fromstring(table).iter("tr")
        assert len({len(row) for row in rows}) == 1
    assert all(name in page for name in LOW_METHODS) and all(scene.scene in page for scene in chart.scenes)
    assert chart.skipped[0] in page and "Example processor" in page


def test_losses_are_named_as_wins_are(chart, page):
    duels = [duel for scene in chart.scenes for duel in scene.duels]
    lost = sum(map(findings.is_lost, duels))
    assert 0 < lost < len(duels)
    assert page.count("✘ ") == lost and page.count("✔ ") == len(duels) - lost
    told = [int(count) for line in findings.losses(chart) for count in re.findall(r"(\d+) of \d+ times", line)]
    assert sum(told) == lost


def test_a_tie_at_less_error_is_no_loss(chart):
    duel = chart.scenes[0].duels[0]
    tie = dataclasses.replace(duel, seconds=dataclasses.replace(duel.rays, value=1.0, bound=False))
    assert findings.is_lost(tie)
    assert not findings.is_lost(dataclasses.replace(tie, seconds=dataclasses.replace(tie.seconds, bound=True)))
    assert findings.is_lost(dataclasses.replace(tie, seconds=dataclasses.replace(tie.seconds, value=None)))


def test_the_headline_has_the_geometric_mean_and_the_scenes(chart):
    found = [duel for duel in mean_duels(chart.scenes) if (duel.measure, duel.role, duel.method) == (SSIM, *RIVAL)]
    ratios = [duel.seconds.value for scene in chart.scenes for duel in scene.duels
              if (duel.measure, duel.key, duel.samples) == (SSIM, RIVAL, 1)]
    assert found[0].seconds.value == pytest.approx(np.exp(np.mean(np.log(ratios))), rel=1e-3)
    words = findings.headline(chart)
    assert findings.percent(found[0].seconds.value) in words and "of the time" in words
    assert f"{findings.percent(min(ratios))} to {findings.percent(max(ratios))}" in words


def test_the_tables_have_every_cell_with_interval_and_spread(chart):
    table = findings.markdown(chart)
    rows = [line for line in table.splitlines() if line.startswith("| espcn | 16 | 4 | 1 |")]
    assert len(rows) == 7, "one per scene and one of the mean"
    assert all(row.count("–") == row.count("(") == 6 and row.count("±") == 4 for row in rows), rows


def test_a_chart_without_direct_rendering_is_still_a_page_and_crops_stand_in_it():
    images = np.random.default_rng(0).random((3, 24, 24, 3))
    row = Row("equal time", ("ours 4", "theirs 1"), (0.1, 0.2), images[0], (images[1], images[2]))
    page = panels.page(example(1, direct=False, timed=False), Crops((row, row)))
    assert "was not measured" in page and 'src="data:image/png;base64,iVBORw' in page
