"""One value of one dial: its reference and render read once, every figure of each method."""

from __future__ import annotations

import dataclasses
import math
from pathlib import Path

from lfsr_core.arrays import Array
from lfsr_core.frames.foreground import foreground_mask, recall
from lfsr_core.frames.frame import LOW_RES_FILE
from lfsr_core.frames.reference import Reference
from lfsr_core.images.exr import clean, read_layers
from lfsr_core.images.srgb import srgb_encode
from lfsr_core.metrics.eia_metrics import METRIC_NAMES, compare
from lfsr_core.reconstruct.second_stage import finished_linear
from lfsr_lab.experiments.stress import metrics
from lfsr_lab.experiments.stress.dials import EYE, MOTION, Dial
from lfsr_lab.experiments.stress.folder import Bench, fingerprint
from lfsr_lab.experiments.stress.records import Cell
from lfsr_lab.scenes.stress.space import Space, card_centre, card_of_motion

Metrics = dict[str, float | None]


@dataclasses.dataclass(frozen=True)
class Scene:
    """A dial's scene at one value, its folders read."""

    bench: Bench  # the folder that it is in
    dial: Dial  # whose scene
    value: float  # whose scene
    reference: Reference  # of all lenses
    render: Path  # the low-resolution frame folder
    found: Array  # (sy, sx) bool, the foreground that the render found

    @classmethod
    def load(cls, bench: Bench, dial: Dial, value: float) -> Scene:
        """Read the scene's folders, rendering what is missing."""
        reference, render = Reference.read(bench.reference(dial, value)), bench.render(dial, value)
        found = foreground_mask(clean(read_layers(render / LOW_RES_FILE))[0], bench.settings.display.lenses)
        return cls(bench, dial, value, reference, render, found)

    @property
    def lenses(self) -> tuple[int, int]:
        """(sx, sy)."""
        return self.bench.settings.display.lenses

    @property
    def space(self) -> Space:
        """The display in lens pitches."""
        return Space.of(self.bench.settings.display, self.bench.settings.scale)

    def measure(self, method: str) -> Cell:
        """Every figure of ``method`` here."""
        image, halves = finished_linear(self.render, method), (self.reference.half_a, self.reference.half_b)
        mask, images = self.reference.hits, [srgb_encode(values) for values in (image, *halves)]
        compared, of = compare(image, halves, self.lenses, mask), metrics.Compared(*images, self.lenses, mask)
        found: Metrics = {name: compared[name] for name in METRIC_NAMES} | {"recall": recall(self.found, mask)}
        found |= metrics.border_and_centre(of, width=self.bench.settings.scale)
        found["neighbour_error"] = metrics.neighbour_view_error(of)
        if self.dial.name == EYE:
            found |= self._straightness(*images)
        if self.dial.name == MOTION:
            found |= self._flicker(method)
        finite = {name: value if value is not None and math.isfinite(value) else None for name, value in found.items()}
        return Cell(self.value, self.dial.scene_name(self.value), self.dial.samples(self.value), method, finite,
                    metrics.worst_lens(of), **fingerprint(method))

    def _straightness(self, x: Array, a: Array, b: Array) -> Metrics:
        step = self.space.scale / self.value
        names = ("epi_straightness", "epi_straightness_reference")
        if not step.is_integer():  # no two views that see the same points
            return dict.fromkeys(names)
        pairs = ((x, None), (a, b))
        # A point does not move by whole rows where they are not as high as columns are wide.
        axes = (0, 1) if self.space.row == 1 and self.space.views[1] > 1 else (1,)
        return {name: metrics.epi_straightness(image, self.lenses, int(step), other, axes)
                for name, (image, other) in zip(names, pairs, strict=True)}

    def _flicker(self, method: str) -> Metrics:
        """Flicker with the same seed in every frame and with a seed of its own in each."""
        count = self.bench.settings.frames
        y, half, path = card_of_motion(self.space, int(self.value), count)
        cards = [metrics.card_pixels(self.space, y, card_centre(self.space, y, place, path), half) for place in path]
        found = {}
        for name, seed_of in (("fixed", lambda frame: 0), ("changing", lambda frame: frame)):
            folders = [self.bench.render(self.dial, self.value, frame, seed_of(frame)) for frame in range(1, count + 1)]
            images = [srgb_encode(finished_linear(folder, method)) for folder in folders]
            found[f"flicker_{name}"] = metrics.flicker(images, self.lenses, path, cards)
        changes = [value for value in found.values() if value is not None]
        return found | {"steadiness": 1 - max(changes) if changes else None}
