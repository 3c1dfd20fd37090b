"""A chart made by formulas, for tests of what is drawn from it: nothing in it was measured."""

import numpy as np

from lfsr_lab.experiments.chart import analysis
from lfsr_lab.experiments.chart.analysis import DIRECT, LOW, Chart, Point
from lfsr_lab.experiments.engine.report import Environment
from lfsr_lab.experiments.engine.truth import MEASURES, PARTS

# name: (error without noise, noise at one sample, seconds of the second stage)
LOW_METHODS = {"oidn+bilinear": (0.02, 0.22, 0.7), "bicubic": (0.01, 0.6, 0.1), "nearest": (0.05, 0.62, 0.08),
               "oidn+bicubic": (0.03, 0.25, 0.7), "espcn": (0.045, 0.64, 0.2)}
DIRECT_METHODS = {"none": (0.001, 0.7, 0.4), "oidn": (0.01, 0.17, 2.5)}
SEEDS, LENSES = 3, 8


def example(scenes: int = 6, timed: bool = True, direct: bool = True) -> Chart:
    """Chart of so many scenes."""
    every = [_points(1 + 0.7 * index, timed, direct) for index in range(scenes)]
    reference = analysis.UsedReference(1024, 22, LENSES, 900.0, dict.fromkeys(MEASURES, 0.01))
    rows = tuple(
        analysis.SceneRow(f"Scene{index + 1}", "5.0.1", reference, tuple(point.cell for point in points),
                          tuple(analysis.duels(points, (LOW, "oidn+bilinear"))),
                          tuple(analysis.reaches(points, analysis.FIXED)))
        for index, points in enumerate(every))
    settings = analysis.ChartSettings(
        display="small", scale=4, spps=(1, 4, 16, 64), direct_spps=(1, 4, 16) if direct else (),
        methods=tuple(LOW_METHODS), direct_methods=tuple(DIRECT_METHODS), ours="oidn+bilinear",
        reference_spp=1024, lenses=22, seeds=SEEDS, repeats=3)
    environment = Environment("Example processor", 2, 24.0, "Linux", "3.11.7", None, {"lfsr": "0.1", "numpy": "1.26.4"})
    skipped = ("paper-gan at scale 4: paper-gan has no weights for it",)
    return Chart(analysis.FORMAT, settings, environment, skipped, rows)


def _points(slowness: float, timed: bool, direct: bool) -> list[Point]:
    points = [point(LOW, method, samples, slowness, timed) for samples in (1, 4, 16, 64) for method in LOW_METHODS]
    return points + [point(DIRECT, method, samples, slowness, timed) for samples in (1, 4, 16)
                     for method in DIRECT_METHODS if direct]


def point(role: str, method: str, samples: int, slowness: float = 1.0, timed: bool = True) -> Point:
    """One point by the formulas above."""
    best, noise, second = (DIRECT_METHODS if role == DIRECT else LOW_METHODS)[method]
    render = slowness * (0.8 + 0.09 * samples * (16 if role == DIRECT else 1))
    factors = (1 + 0.1 * np.arange(LENSES)) * (1 + 0.02 * np.arange(SEEDS)[:, None])
    error = factors * (best + noise * (0.7 + 0.1 * slowness) * samples**-0.5)
    values = {name: error.tolist() for name in MEASURES} | dict.fromkeys(PARTS, (error[0] / 2).tolist())
    rows = {name: tuple(map(tuple, np.atleast_2d(value).tolist())) for name, value in values.items()}
    times = analysis.Times((render, 1.1 * render), (second, second * 1.1, second * 1.2), 0.5) if timed else None
    measured = analysis.Measured(rows)
    return Point.of(role, method, 1 if role == DIRECT else 4, samples, measured, times, np.arange(LENSES))
