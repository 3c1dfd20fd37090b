"""One value of one dial: its reference and render read once, every figure of each method."""

from __future__ import annotations

import dataclasses
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from lfsr_core.bench.stress import metrics as stress_metrics
from lfsr_core.bench.stress.dials import EYE, MOTION, Dial
from lfsr_core.bench.stress.space import Space, card_centre, card_of_motion
from lfsr_core.frames.foreground import foreground_mask, recall
from lfsr_core.frames.frame import LOW_RES_FILE
from lfsr_core.frames.reference import Reference
from lfsr_core.images.exr import clean, read_layers
from lfsr_core.images.srgb import srgb_encode
from lfsr_core.metrics.eia_metrics import compare
from lfsr_core.reconstruct.second_stage import finished_linear

if TYPE_CHECKING:
    from lfsr_core.bench.stress.folder import Bench

Metrics = dict[str, Any]


@dataclasses.dataclass(frozen=True)
class Scene:
    """A dial's scene at one value with its reference: linear halves ``a``, ``b`` (H, W, 3) and ``mask`` (sy, sx).

    ``found``: the mask of the low-resolution ``render``.
    """

    bench: Bench
    dial: Dial
    value: float
    a: np.ndarray
    b: np.ndarray
    mask: np.ndarray
    render: Path
    found: np.ndarray

    @classmethod
    def load(cls, bench: Bench, dial: Dial, value: float) -> Scene:
        """Read the scene's folders, rendering what is missing."""
        known = Reference.read(bench.reference(dial, value))
        render = bench.render(dial, value)
        found = foreground_mask(clean(read_layers(render / LOW_RES_FILE))[0], bench.settings.display.lenses)
        return cls(bench, dial, value, known.half_a, known.half_b, known.hits, render, found)

    @property
    def lenses(self) -> tuple[int, int]:
        """(sx, sy)."""
        return self.bench.settings.display.lenses

    @property
    def space(self) -> Space:
        """The display in lens pitches."""
        return Space.of(self.bench.settings.display, self.bench.settings.scale)

    def measure(self, method: str) -> tuple[Metrics, list[int] | None]:
        """Every figure of ``method`` here, and (row, column) of its worst lens."""
        image = finished_linear(self.render, method)
        x, a, b = (srgb_encode(values) for values in (image, self.a, self.b))
        metrics = compare(image, self.a, self.b, self.lenses, self.mask)
        metrics |= {"recall": recall(self.found, self.mask)}
        metrics |= stress_metrics.border_and_centre(x, a, b, self.lenses, self.mask, self.bench.settings.scale)
        metrics["neighbour_error"] = stress_metrics.neighbour_view_error(x, a, b, self.lenses, self.mask)
        if self.dial.name == EYE:
            metrics |= self._straightness(x, a, b)
        if self.dial.name == MOTION:
            metrics |= self._flicker(method)
        worst = stress_metrics.worst_lens(x, a, b, self.lenses, self.mask)
        return metrics, None if worst is None else list(worst)

    def _straightness(self, x: np.ndarray, a: np.ndarray, b: np.ndarray) -> Metrics:
        step = self.space.scale / self.value
        names = ("epi_straightness", "epi_straightness_reference")
        if not step.is_integer():  # no two views that see the same points
            return dict.fromkeys(names)
        pairs = ((x, None), (a, b))
        return {name: stress_metrics.epi_straightness(image, self.lenses, int(step), other)
                for name, (image, other) in zip(names, pairs, strict=True)}

    def _flicker(self, method: str) -> Metrics:
        """Flicker with the same seed in every frame and with a seed of its own in each."""
        count = self.bench.settings.frames
        y, half, path = card_of_motion(self.space, int(self.value), count)
        cards = [stress_metrics.card_pixels(self.space, y, card_centre(self.space, y, place, path), half)
                 for place in path]
        found = {}
        for name, seed_of in (("fixed", lambda frame: 0), ("changing", lambda frame: frame)):
            folders = [self.bench.render(self.dial, self.value, frame, seed_of(frame)) for frame in range(1, count + 1)]
            images = [srgb_encode(finished_linear(folder, method)) for folder in folders]
            found[f"flicker_{name}"] = stress_metrics.flicker(images, self.lenses, path, cards)
        told = [value for value in found.values() if value is not None]
        return found | {"steadiness": 1 - max(told) if told else None}
