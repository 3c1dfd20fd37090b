"""The sentences beside the paper's figures follow the numbers, whatever these are."""

from __future__ import annotations

import dataclasses
import math

import pytest

from lfsr_core.reconstruct.networks import catalogue
from lfsr_core.records import from_data
from lfsr_lab.experiments.paper import figure, page, verdict, weights
from lfsr_lab.experiments.paper.figures import figure9, figure10, figure11
from lfsr_lab.experiments.paper.records import Row, Rows
from lfsr_lab.experiments.paper.verdict import Difference

SEEDS = (0.01, -0.02, 0.015, -0.005, 0.0, 0.012)


def lenses(level):
    return [level + seed for seed in SEEDS]


def quality_row(method, level, scene="toy", **more):
    return {"scene": scene, "method": method, "samples": 8, "lens_ssim_fg": lenses(level), "ci95": {},
            "metrics": {"ssim_eia_fg": level, "ssim_eia_plain": level, "ssim_ceiling": 0.99}, **more}


def seconds(level):
    return [level * (1 + seed) for seed in SEEDS]


def fig9(gap):
    rows = [quality_row(name, 0.9 + gap * index, error={"border": 0.01 - gap / 20 * index, "centre": 0.01,
                                                        "border_pixels": 0.4})
            for index, name in enumerate(figure9.METHODS)]
    return {"rows": rows, "samples": [8], "schedules": {}}


def fig10a(gap):
    return {"seconds": {"8": seconds(1.0), "208": [value + gap + seed / 5 for value, seed in
                                                   zip(seconds(1.0), SEEDS, strict=True)]},
            "engine": "onnx", "device": "CPU"}


def fig10b(gap):
    return {"rows": [{"p": p, "seconds": {"with": seconds(1.0), "without": [1.0 + gap * (2 - p) + 3 * seed * gap
                                                                            for seed in SEEDS]}} for p in (0.2, 0.8)]}


def fig10c(gap):
    times = {f"paper-{n}": seconds(1 + n * gap) for n in (3, 4, 5, 6)} | {"paper": seconds(1.0)}
    rows = [quality_row(name, 0.9 + (0.005 - gap / 20) * (name != "paper")) for name in times]
    return {"times": {"seconds": times, "engine": "torch", "device": "CPU"}, "rows": rows, "schedules": {}}


def fig10d(gap):
    times = {name: seconds(1 + (name != "paper") * gap) for name in ("paper", "espcn", "fsrcnn")}
    rows = [quality_row(name, 0.9 - gap * (name != "paper")) for name in (*times, "bicubic")]
    return {"times": {"seconds": times, "engine": "torch", "device": "CPU"}, "rows": rows, "schedules": {}}


def fig11(gap):
    rows = []
    for name in figure11.methods():
        errors = [0.01 + (gap / 100 + seed / 1000) * name.endswith("-eia") for seed in SEEDS]
        rows.append({"scene": "toy", "method": name, "epi": errors, "epi_border": errors})
    return {"rows": rows, "schedules": {}}


def fig12a(gap):
    rows = [{"pixels": [7680, 4320], "scale": scale, "render": 0.01 * 2 ** (-math.copysign(scale, gap)),
             "second_stage": 0.001 if gap > 0 else 0.1} for scale in (1, 2, 4)]
    return {"rows": rows, "render_device": "CPU"}


def fig12b(gap):
    return {"rows": [{"scene": "toy", "render": 1.0, **fig10b(gap)["rows"][0]}]}


def table2(gap):
    names = ("direct", "view by view + fsrcnn", "1 sample + oidn", "this project", "paper (adversary)")
    return {"rows": [quality_row(name, 0.9 + gap, render=1 - gap * name.startswith("paper"), second_stage=0.0)
                     for name in names], "schedules": {}}


def table3(gap):
    return {"rows": [{"method": name, "per_low_pixel": value} for name, value in
                     (("paper", 100.0), ("paper-3", 120.0), ("espcn", 100 + 100 * gap), ("fsrcnn", 100 + 90 * gap))]}


MADE_UP = {"fig9": fig9, "fig10a": fig10a, "fig10b": fig10b, "fig10c": fig10c, "fig10d": fig10d, "fig11": fig11,
           "fig12a": fig12a, "fig12b": fig12b, "table2": table2, "table3": table3}


def results(name, gap):
    """Results of a figure whose numbers favour its claim, or with a ``gap`` below zero speak against it."""
    return from_data(page.FIGURES[name].kind, MADE_UP[name](gap), name)


def line(name, gap):
    return page.FIGURES[name].line(results(name, gap))


@pytest.mark.parametrize("name", MADE_UP)
def test_sentences_flip_with_the_numbers(name):
    assert line(name, 0.4).startswith("**Holds.**"), line(name, 0.4)
    if name != "fig10a":  # whichever step is slower, the step matters
        assert line(name, -0.4).startswith("**Does not hold.**"), line(name, -0.4)


def test_scenes_without_epipolar_images_leave_the_others():
    whole = results("fig11", 0.4)
    other = Row(scene="other", method="bicubic", reason="sampled lenses have none")
    found = figure11.line(dataclasses.replace(whole, rows=(*whole.rows, other)))
    assert found.startswith("**Holds.**") and "other was not measured: sampled lenses have none." in found


@pytest.mark.parametrize("name", ["fig9", "fig10a", "fig11", "table3"])
def test_without_a_difference_nothing_is_claimed(name):
    assert line(name, 0.0).startswith("**Cannot be told.**")


@pytest.mark.parametrize(("share", "words"), [
    (None, "All of its additional squared error lies in the outermost views"),
    (1.5, "1.0 times as large in the outermost views of the elemental images as in the others: borders are not"),
    (0.5, "3.0 times as large in the outermost views of the elemental images as in the others: borders, where")])
def test_the_reason_follows_where_the_error_lies(share, words):
    data = fig9(-0.4)
    for row in data["rows"]:
        row["error"]["centre"] = row["error"]["border"] * share if share else row["error"]["centre"]
    assert words in figure9.line(from_data(Rows, data, "fig9"))
    assert "squared error" not in line("fig9", 0.4)


def test_verdicts():
    above, below, neither, unknown = (Difference(*pair) for pair in ((1, 0.5), (-1, 0.5), (1, 2), (1, math.inf)))
    assert [d.sign for d in (above, below, neither, unknown)] == [1, -1, 0, 0]
    assert verdict.overall({"a": above}, {}) == "**Holds; not all of it was measured.**"
    assert verdict.overall({"a": above, "b": below}) == "**Holds in part.**"
    assert verdict.overall({"a": below, "b": neither}) == "**Does not hold where it can be told.**"
    assert verdict.overall({}) == "**Not measured.**"
    assert verdict.holds({"a": above, "b": below}) == "holds in 1 of 2 (a); the other way round in 1 of 2 (b)"
    assert verdict.mean_interval([1.0, 1.1]).half == math.inf
    # Student's t for 3 degrees of freedom is 3.182; the standard error of 1, 2, 3, 4 is 0.6455.
    assert verdict.mean_interval([1.0, 2.0, 3.0, 4.0]).half == pytest.approx(2.054, rel=0.01)


@pytest.mark.parametrize(("faster", "better", "sign"), [(1, 1, -1), (1, -1, 1), (-1, 1, 1), (-1, 0, 1), (1, 0, 0),
                                                        (0, 0, 0)])
def test_a_rival_wins_only_with_both(faster, better, sign):
    assert figure10.worst(Difference(faster, 0.5), Difference(better, 0.5)).sign == sign


def test_networks_trained_differently_are_called_so():
    alike = "short schedule: 9 epochs of 4 96-pixel crops per photograph, rate 0.001 cosine"

    def found(label):
        schedules = {"paper": f"{alike}, 60 s on CPU", "paper-gan": label}
        return figure9.line(dataclasses.replace(results("fig9", 0.4), schedules=schedules))

    assert "trained" not in found(f"{alike}, 900 s on CPU")
    for ours, other in (("9 epochs", "2 epochs"), ("0.001 cosine", "0.0001 constant"), ("short", "the paper's")):
        assert "The networks were not trained alike" in found(f"{alike}, 60 s on CPU".replace(ours, other))
    assert "not known of all" in found("schedule not recorded")


def test_the_label_is_one_that_comparisons_understand():
    label = weights.schedule(catalogue.weights_path("paper", 4))
    assert figure.CROPS_SEEN.search(label)
