"""The sentences beside the paper's figures follow the numbers, whatever these are."""

from __future__ import annotations

import math

import pytest

from lfsr_lab.experiments.seed_paper import figure, study
from lfsr_lab.experiments.seed_paper.figure import LENS_SSIM, Difference, Results, Row
from lfsr_lab.experiments.seed_paper.figures import frames, images, networks
from lfsr_lab.experiments.seed_paper.measuring import RENDER, TOTAL, timed_rows

SEEDS = (0.01, -0.02, 0.015, -0.005, 0.0, 0.012)


def accurate(method, level, **values):
    return Row(scene="toy", method=method, samples=8, series={LENS_SSIM: tuple(level + seed for seed in SEEDS)},
               values={"ssim_eia_fg": level, "ssim_eia_plain": level, "ssim_ceiling": 0.99, **values})


def seconds(level):
    return tuple(level * (1 + seed) for seed in SEEDS)


def fig9(gap):
    return [accurate(name, 0.9 + gap * index) for index, name in enumerate(images.METHODS)]


def fig10a(gap):
    slow = tuple(value + gap + seed / 5 for value, seed in zip(seconds(1.0), SEEDS, strict=True))
    return timed_rows({"8": seconds(1.0), "208": slow}).rows


def fig10b(gap):
    return [row for p in (0.2, 0.8) for row in timed_rows(
        {frames.WITH: seconds(1.0), frames.WITHOUT: tuple(1.0 + gap * (2 - p) + 3 * seed * gap for seed in SEEDS)},
        scene=f"distance {p}", facts={"p": p}).rows]


def fig10c(gap):
    times = {"paper": seconds(1.0)} | {f"paper-{n}": seconds(1 + n * gap) for n in (3, 4, 5, 6)}
    return [*timed_rows(times).rows,
            *(accurate(name, 0.9 + (0.005 - gap / 20) * (name != "paper")) for name in times)]


def fig10d(gap):
    times = {name: seconds(1 + (name != "paper") * gap) for name in ("paper", "espcn", "fsrcnn")}
    return [*timed_rows(times).rows, *(accurate(name, 0.9 - gap * (name != "paper")) for name in (*times, "bicubic"))]


def fig11(gap):
    errors = {name: tuple(0.01 + (gap / 100 + seed / 1000) * name.endswith("-eia") for seed in SEEDS)
              for name in images.EPI_METHODS}
    return [Row(scene="toy", method=name, series={images.EPI: found}) for name, found in errors.items()]


def frame(render, second_stage=0.0):
    return {RENDER: render, TOTAL: render + second_stage}


def fig12a(gap):
    return [Row(scene="7680×4320", method=f"s = {scale}" if scale > 1 else "direct",
                values={"width": 7680, "scale": scale,
                        **frame(0.01 * 2 ** (-math.copysign(scale, gap)), 0.001 if gap > 0 else 0.1)})
            for scale in (1, 2, 4)]


def table2(gap):
    names = ("direct", "view by view + fsrcnn", "1 sample + oidn", "this project", "paper (adversary)")
    return [accurate(name, 0.9 + gap, **frame(1 - gap * name.startswith("paper"))) for name in names]


def table3(gap):
    costs = {"paper": 100.0, "paper-3": 120.0, "espcn": 100 + 100 * gap, "fsrcnn": 100 + 90 * gap}
    return [Row(method=name, values={networks.PER_PIXEL: value}) for name, value in costs.items()]


MADE_UP = {"fig9": fig9, "fig10a": fig10a, "fig10b": fig10b, "fig10c": fig10c, "fig10d": fig10d, "fig11": fig11,
           "fig12a": fig12a, "fig12b": lambda gap: fig10b(gap)[:2], "table2": table2, "table3": table3}


def line(name, gap):
    """Return the sentence of numbers that favour the claim, or with a ``gap`` below zero speak against it."""
    return study.FIGURES[name].line(Results(tuple(MADE_UP[name](gap))))


@pytest.mark.parametrize("name", MADE_UP)
def test_sentences_flip_with_the_numbers(name):
    assert line(name, 0.4).startswith("**Holds.**"), line(name, 0.4)
    if name != "fig10a":  # whichever step is slower, the step matters
        assert line(name, -0.4).startswith("**Does not hold.**"), line(name, -0.4)


@pytest.mark.parametrize("name", ["fig9", "fig10a", "fig11", "table3"])
def test_without_a_difference_nothing_is_claimed(name):
    assert line(name, 0.0).startswith("**Cannot be told.**")


def test_verdicts():
    above, below, neither, unknown = (Difference(*pair) for pair in ((1, 0.5), (-1, 0.5), (1, 2), (1, math.inf)))
    assert [d.sign for d in (above, below, neither, unknown)] == [1, -1, 0, 0]
    assert figure.overall({"a": above}, {}) == "**Holds; not all of it was measured.**"
    assert figure.overall({"a": above, "b": below}) == "**Holds in part.**"
    assert figure.overall({"a": below, "b": neither}) == "**Does not hold.**"
    assert figure.overall({}) == "**Not measured.**"
    assert figure.holds({"a": above, "b": below}) == "holds in 1 of 2 (a); the other way round in 1 of 2 (b)"
    assert figure.paired([1.0, 1.1], [0.0, 0.0]).half == math.inf
    # Student's t for 3 degrees of freedom is 3.182; the standard error of 1, 2, 3, 4 is 0.6455.
    assert figure.paired([1.0, 2.0, 3.0, 4.0], [0.0] * 4).half == pytest.approx(2.054, rel=0.01)


def test_a_rival_wins_only_with_both():
    for faster, better, sign in ((1, 1, -1), (1, -1, 1), (-1, 1, 1), (-1, 0, 1), (1, 0, 0), (0, 0, 0)):
        assert networks.worst(Difference(faster, 0.5), Difference(better, 0.5)).sign == sign


def test_networks_trained_differently_are_called_so():
    alike = "9 epochs of 4 96-pixel crops per photograph, rate 0.001 cosine"

    def found(label):
        schedules = {"paper": f"{alike}, 60 s on CPU", "paper-gan": label}
        return study.FIGURES["fig9"].line(Results(tuple(fig9(0.4)), schedules=schedules))

    assert "trained" not in found(f"{alike}, 900 s on CPU") and "trained" not in found("no weights")
    assert "not trained alike" in found(f"{alike.replace('9 epochs', '2 epochs')}, 60 s on CPU")
    assert "not trained alike" in found("schedule not recorded")
