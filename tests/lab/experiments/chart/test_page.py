"""What people read of a chart: well-formed, complete, honest about losses, nothing loaded from elsewhere."""

from __future__ import annotations

import dataclasses
import re
from xml.etree import ElementTree

import pytest

from lfsr_lab.experiments.chart import findings, panels
from lfsr_lab.experiments.chart.records import LOW, Point
from tests.support.chart_example import LOW_METHODS, example, scene_row

SVG = "{http://www.w3.org/2000/svg}"


@pytest.fixture(scope="module")
def chart():
    return example()


def texts(svg: str) -> list[str]:
    return ["".join(element.itertext()) for element in ElementTree.fromstring(svg).iter(f"{SVG}text")]


def test_the_image_has_a_panel_per_scene_and_one_of_the_mean(chart):
    words = texts(panels.image(chart))
    assert {scene.scene for scene in chart.scenes} | {"Mean of 6 scenes"} <= set(words)
    assert sum("without noise" in word for word in words) == 7
    assert "Mean" not in " ".join(texts(panels.image(example(1))))


@pytest.mark.parametrize("name", ["$a_b$", "do$ll", "$\\frac$", "back\\slash", "a^b_c{d}", "%s"])
def test_the_name_of_a_scene_is_no_formula(name):
    chart = example(1)
    chart = dataclasses.replace(chart, scenes=(dataclasses.replace(chart.scenes[0], scene=name),),
                                settings=dataclasses.replace(chart.settings, display=f"{name}.toml"))
    words = texts(panels.image(chart))
    assert name in words and any(f"Display {name}.toml" in word for word in words)
    assert panels.page(chart)


def test_every_text_lies_inside_the_image(chart):
    image = ElementTree.fromstring(panels.image(chart))
    width, height = (float(size) for size in image.get("viewBox").split()[2:])
    places = [place(element) for element in image.iter(f"{SVG}text")]
    assert len(places) > 50 and all(0 <= x <= width and 0 <= y <= height for x, y in places)


def place(element) -> tuple[float, float]:
    """Where a text of matplotlib's stands."""
    moved = re.search(r"translate\((\S+) (\S+)\)", element.get("transform"))
    return tuple(map(float, moved.groups() if moved else (element.get("x"), element.get("y"))))


def test_the_page_stands_alone_and_its_tables_are_whole(chart):
    page = panels.page(chart)
    assert not re.search(r"<script|<link|src=|url\((?!#)|@import", page)
    for table in re.findall(r"<table>.*?</table>", page):
        rows = ElementTree.fromstring(table).iter("tr")
        assert len({len(row) for row in rows}) == 1
    assert all(name in page for name in LOW_METHODS)
    assert chart.skipped[0] in page and "Example processor" in page


def test_losses_are_named_as_wins_are(chart):
    page = panels.page(chart)
    duels = [duel for scene in chart.scenes for duel in scene.by(chart.metric).versus]
    for outcome, mark in (("win", "✔ win"), ("loss", "✘ loss")):
        count = sum(duel.outcome == outcome for duel in duels)
        assert count > 0 and page.count(mark) == count
    assert findings.losses(chart)[0] == "every view +OIDN: wins 6 of 18 times"


def test_the_headline_counts_what_the_analysis_found(chart):
    ratios = [scene.by(chart.metric).target.worst_ratio for scene in chart.scenes]
    assert f"{min(ratios):.0%} to {max(ratios):.0%}" in findings.headline(chart)
    assert f"A quarter or less: {sum(ratio <= 0.25 for ratio in ratios)} of 6 scenes" in findings.headline(chart)


def test_where_a_reference_shows_only_some_lenses_all_scenes_are_judged_lens_by_lens(chart):
    whole, sampled = chart.scenes[:2]
    known = ("p", "ssim_lens", "ssim_lens_fg", "psnr_fg", "flip")
    cells = tuple(dataclasses.replace(cell, metrics={name: cell.metrics[name] for name in known})
                  for cell in sampled.cells)
    mixed = dataclasses.replace(chart, scenes=(whole, scene_row("Sampled", cells)))
    assert (chart.metric, mixed.metric) == ("ssim_eia_fg", "ssim_lens_fg")
    assert "lens by lens" in " ".join(texts(panels.image(mixed)))
    assert "each lens on its own" in panels.page(mixed) and "on the whole image" in panels.page(chart)
    tables_of = findings.markdown(mixed).split("## Sampled: subject")
    assert "ssim_eia_fg" not in tables_of[1] and "ssim_eia_fg" in tables_of[0]


def test_a_chart_without_direct_rendering_or_ceiling_is_still_a_page():
    chart = example(2)
    scenes = (scene_row(scene.scene, tuple(cell for cell in scene.cells if cell.role == LOW)) for scene in chart.scenes)
    chart = dataclasses.replace(chart, scenes=tuple(scenes))
    assert "was not measured" in panels.page(chart)
    assert "without noise" not in panels.image(chart)


def test_advice_rises_and_skips_what_is_not_worth_a_line(chart):
    front = [Point(LOW, "a", 1, 1.0, 0.5), Point(LOW, "b", 1, 1.1, 0.6), Point(LOW, "c", 1, 2.0, 0.602),
             Point(LOW, "d", 1, 4.0, 0.7)]
    assert [point.method for point in findings.worth_a_step(front)] == ["b", "d"]
    assert len(findings.advice(chart).rows) >= 2


def test_the_table_has_every_cell_with_its_metrics(chart):
    table = findings.markdown(chart)
    rows = [line for line in table.splitlines() if line.startswith("| espcn | 16 | 4 |")]
    assert len(rows) == 7, "one per scene and one of the mean"
    assert "±" in rows[1] and "±" not in rows[0]
    assert "| espcn | 24,192 | 24,336 | 1.5 |" in table
