"""denoiser.json: the means of what was measured, by scene, render and method."""

from __future__ import annotations

import dataclasses
from collections.abc import Iterator, Mapping, Sequence
from statistics import fmean

from lfsr_lab.experiments.denoiser.measure import METRICS, Figures
from lfsr_lab.experiments.denoiser.settings import Render, Scene
from lfsr_lab.experiments.engine.environment import Environment
from lfsr_lab.experiments.engine.report import markdown_table, number

Key = tuple[str, Render, str]  # scene, render, method


@dataclasses.dataclass(frozen=True)
class Mean:
    """Means over the lenses of one render, finished by one method."""

    scene: str
    group: str
    scale: int
    samples: int
    seed: int
    method: str
    compared: bool  # whether the render has the scale at which methods are compared
    ssim: float
    flip: float
    relative: float


@dataclasses.dataclass(frozen=True)
class Record:
    """Everything that was measured."""

    environment: Environment | None
    means: tuple[Mean, ...]

    def mean(self, scene: str, samples: int, method: str, metric: str = "ssim") -> float | None:
        """Return the mean over the seeds of a scene, at the scale at which methods are compared."""
        found = [getattr(each, metric) for each in self.means
                 if (each.scene, each.samples, each.method, each.compared) == (scene, samples, method, True)]
        return fmean(found) if found else None

    def group_mean(self, group: str, samples: int, method: str, metric: str = "ssim") -> float | None:
        """Return the mean over the scenes of a group that ``method`` can finish."""
        scenes = dict.fromkeys(each.scene for each in self.means if each.group == group)
        known = [value for scene in scenes if (value := self.mean(scene, samples, method, metric)) is not None]
        return fmean(known) if known else None


def means(scenes: Sequence[Scene], found: Mapping[Key, Figures]) -> Iterator[Mean]:
    """Yield the means of what was found."""
    known = {scene.name: scene for scene in scenes}
    for (name, render, method), figures in found.items():
        scene = known[name]
        yield Mean(name, scene.group, render.scale, render.samples, render.seed, method, render.scale == scene.scale,
                   *(round(fmean(getattr(figures, metric)), 5) for metric in METRICS))


def markdown(record: Record) -> str:
    """Return a table of the means of every group, and one of every scene."""
    methods = list(dict.fromkeys(each.method for each in record.means))
    samples = sorted({each.samples for each in record.means if each.compared})
    groups = list(dict.fromkeys(each.group for each in record.means))
    scenes = list(dict.fromkeys(each.scene for each in record.means))
    tables = [[[count, name, *(" / ".join(number(get(name, count, method, metric)) for metric in METRICS)
                               for method in methods)] for count in samples for name in names]
              for names, get in ((groups, record.group_mean), (scenes, record.mean))]
    header = ["samples", "scenes", *(f"`{method}`" for method in methods)]
    return "\n\n".join([f"Each: {', '.join(METRICS.values())}.",
                        *("\n".join(markdown_table(header, rows, "rlr")) for rows in tables)])
