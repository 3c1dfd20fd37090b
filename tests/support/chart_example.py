"""A chart made by formulas, for tests of what is drawn from it: nothing in it was measured."""

from __future__ import annotations

from lfsr_core.metrics.eia_metrics import METRIC_NAMES
from lfsr_lab.experiments.chart.analysis import METRICS, analyse
from lfsr_lab.experiments.chart.records import (
    CEILING,
    DIRECT,
    FORMAT,
    LOW,
    Cell,
    Chart,
    ChartSettings,
    MethodCost,
    SceneRow,
    Spread,
    UsedReference,
)
from lfsr_lab.experiments.engine.accuracy import Figures
from lfsr_lab.experiments.engine.environment import Environment

# name: (accuracy without noise, noise at one sample, seconds of the second stage)
LOW_METHODS = {"oidn+bilinear": (0.96, 0.22, 0.7), "bicubic": (0.97, 0.6, 0.1), "nearest": (0.85, 0.62, 0.08),
               "oidn+bicubic": (0.965, 0.25, 0.7), "oidn+lanczos": (0.962, 0.26, 0.8), "espcn": (0.955, 0.64, 0.2)}
DIRECT_METHODS = {"none": (1.0, 0.7, 0.4), "oidn": (0.99, 0.17, 2.5)}


def example(scenes: int = 6) -> Chart:
    """Chart of so many scenes."""
    rows = tuple(_scene(f"Scene{index + 1}", 1 + 0.7 * index) for index in range(scenes))
    methods = tuple(MethodCost(name, 24_336 if name == "espcn" else None, 24_192.0 if name == "espcn" else None, 1.5)
                    for name in LOW_METHODS)
    settings = ChartSettings(display="small", scale=4, spps=(1, 4, 16, 64), direct_spps=(1, 4, 16),
                             methods=tuple(LOW_METHODS), direct_methods=tuple(DIRECT_METHODS), ours="oidn+bilinear",
                             reference_spp=1024, lenses=None, ceiling_spp=4096, repeats=3, render_repeats=1)
    environment = Environment("Example processor", 2, 24.0, "Linux", "3.11.7", None, {"lfsr": "0.1", "numpy": "1.26.4"})
    skipped = ("paper-gan at scale 4: paper-gan has no weights for it",)
    return Chart(FORMAT, settings, environment, methods, skipped, rows)


def scene_row(name: str, cells: tuple[Cell, ...]) -> SceneRow:
    """A scene of cells, analysed."""
    return SceneRow(name, "5.0.1", 0.3, UsedReference(1024, None, 900.0), cells,
                    tuple(analyse(cells, "oidn+bilinear", metric) for metric in METRICS))


def _scene(name: str, slowness: float) -> SceneRow:
    cells = [_cell(LOW, method, samples, slowness) for samples in (1, 4, 16, 64) for method in LOW_METHODS]
    cells += [_cell(DIRECT, method, samples, slowness) for samples in (1, 4, 16) for method in DIRECT_METHODS]
    cells += [_cell(CEILING, method, 4096, slowness) for method in LOW_METHODS]
    return scene_row(name, tuple(cells))


def _cell(role: str, method: str, samples: int, slowness: float) -> Cell:
    best, noise, second = (DIRECT_METHODS if role == DIRECT else LOW_METHODS)[method]
    value = best - noise * (0.7 + 0.1 * slowness) * samples**-0.5
    render = slowness * (0.8 + 0.09 * samples * (16 if role == DIRECT else 1))
    metrics = dict.fromkeys((*METRIC_NAMES, "recall"), value) | {"flip": (1 - value) / 4, "psnr_fg": 40 * value}
    return measured_cell(role, method, samples, render, (second, second * 1.1, second * 1.2), metrics)


def measured_cell(role: str, method: str, samples: int, render: float, second: tuple[float, ...],
                  metrics: Figures) -> Cell:
    """A cell of these times and metrics."""
    stages = {"load": 0.1, "mask": 0.0, "upscale": second[0] - 0.05, "assemble": 0.0, "color": 0.0, "write": 0.05}
    return Cell(second, stages, (), 0.5, metrics,
                {"ssim_eia_fg": 0.01, "ssim_eia": 0.004, "ssim_lens_fg": 0.01, "psnr_fg": 0.3}, role=role,
                method=method, scale=1 if role == DIRECT else 4, samples=samples, render_seconds=(render,),
                open_seconds=0.9, seconds=Spread.of((render,), second), device="CPU")
