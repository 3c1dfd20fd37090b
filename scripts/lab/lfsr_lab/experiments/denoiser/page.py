"""Tables of what was measured: each scene, means of groups, differences in pairs, and scales at equal rays."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Mapping, Sequence

import numpy as np

from lfsr_core.base.arrays import Array
from lfsr_core.metrics.intervals import student_95
from lfsr_lab.experiments.denoiser.measure import METRICS, Figures
from lfsr_lab.experiments.denoiser.settings import Render, Scene, Settings
from lfsr_lab.experiments.engine.report import markdown_table, number

Key = tuple[str, Render, str]  # scene, render, method
Estimate = tuple[float, float]  # mean and half-width of its 95 % interval
Rows = list[tuple[str, list[Scene]]]


@dataclasses.dataclass(frozen=True)
class Page:
    """Everything measured of some methods."""

    settings: Settings
    scenes: Sequence[Scene]
    methods: Sequence[str]
    baselines: Sequence[str]  # those of ``methods`` that the others are compared with
    found: Mapping[Key, Figures]

    def markdown(self) -> str:
        """Return all tables."""
        lines, judged = ["# Denoisers"], [name for name in self.methods if name not in self.baselines]
        for samples in sorted({*self.settings.repeated, *self.settings.once}):
            rows = self._rows(samples)
            if rows:
                lines += ["", f"## {samples} samples", "", *self._accuracy(samples, rows)]
            for name in judged if rows else ():
                lines += ["", f"`ssim_lens_fg` of `{name}` minus that of each, 95 % intervals over lenses and seeds:",
                          "", *self._differences(name, samples, rows)]
        for name in self.methods:
            lines += self._scales(name)
        return "\n".join(lines) + "\n"

    def _rows(self, samples: int) -> Rows:
        """Return the measured scenes one by one, then by group, where every method has figures."""
        scenes = [scene for scene in self.scenes
                  if any(self._values(scene, samples, name).size for name in self.methods)]
        whole = [scene for scene in scenes if all(self._values(scene, samples, name).size for name in self.methods)]
        groups = [(f"**{group}**", [scene for scene in whole if scene.group == group])
                  for group in dict.fromkeys(scene.group for scene in whole)]
        return [*((scene.name, [scene]) for scene in scenes), *groups, ("**all**", whole)] if whole else []

    def _accuracy(self, samples: int, rows: Rows) -> list[str]:
        """Return the table of all metrics."""
        def cell(scenes: list[Scene], name: str) -> str:
            means = [[self._values(scene, samples, name, metric).mean() for metric in (*METRICS, "cpu_seconds")]
                     for scene in scenes if self._values(scene, samples, name).size]
            return " ".join(number(value, digits=4) for value in np.mean(means, 0)) if means else number(None)

        return [f"Each: {', '.join(METRICS.values())}, CPU seconds.", "", *markdown_table(
            ["scene", *(f"`{name}`" for name in self.methods)],
            [[title, *(cell(scenes, name) for name in self.methods)] for title, scenes in rows], "lr")]

    def _differences(self, method: str, samples: int, rows: Rows) -> list[str]:
        """Return the table of differences from every baseline, and from the best of them in each scene."""
        cells: list[list[object]] = []
        for title, scenes in rows:
            each = {other: [difference(self._values(scene, samples, method), values) for scene in scenes
                            if (values := self._values(scene, samples, other)).size] for other in self.baselines}
            worst = np.mean([min(value for value, _ in found) for found in zip(*filter(None, each.values()),
                                                                              strict=True)])
            cells.append([title, *(_text(mean(found)) if found else number(None) for found in each.values()),
                          f"{worst:+.4f}"])
        return markdown_table(["scene", *(f"`{name}`" for name in self.baselines), "the best of them"], cells, "lr")

    def _values(self, scene: Scene, samples: int, method: str, metric: str = "ssim") -> Array:
        """Return what was measured at the scene's scale, (seeds, lenses); empty where nothing was."""
        return np.array([getattr(figures, metric) for (name, render, label), figures in self.found.items()
                         if (name, label, render.scale, render.samples) == (scene.name, method, scene.scale, samples)])

    def _scales(self, method: str) -> list[str]:
        """Return the tables of scales at equal rays."""
        lines: list[str] = []
        for rays in self.settings.rays:
            found = {scene.name: {render.scale: np.array([self.found[key].ssim])
                                  for render in self.settings.at_rays(scene)[rays]
                                  if (key := (scene.name, render, method)) in self.found} for scene in self.scenes}
            found = {name: each for name, each in found.items() if len(each) > 1}
            scales = sorted({scale for each in found.values() for scale in each})
            rows = [[name, *(number(each[scale].mean(), digits=4) if scale in each else number(None)
                             for scale in scales), max(each, key=lambda scale: each[scale].mean()),
                     _text(difference(each[2], each[4])) if {2, 4} <= each.keys() else number(None)]
                    for name, each in found.items()]
            if rows:
                lines += ["", f"## Scales with equal rays ({rays}), `{method}`", "", *markdown_table(
                    ["scene", *(f"scale {scale}" for scale in scales), "best", "2 minus 4"], rows, "lr")]
        return lines


def difference(values: Array, others: Array) -> Estimate:
    """Return the mean of differences (seeds, lenses) in pairs: a lens counts once, with the mean of its seeds."""
    lenses = (values - others).mean(0)
    half = student_95(len(lenses) - 1) * lenses.std(ddof=1) / math.sqrt(len(lenses)) if len(lenses) > 1 else 0.0
    return float(lenses.mean()), float(half)


def mean(estimates: Sequence[Estimate]) -> Estimate:
    """Return the mean over these very scenes."""
    values, halves = np.transpose(estimates)
    return float(values.mean()), math.sqrt(halves @ halves) / len(halves)


def _text(estimate: Estimate) -> str:
    return f"{estimate[0]:+.4f} ± {estimate[1]:.4f}"
