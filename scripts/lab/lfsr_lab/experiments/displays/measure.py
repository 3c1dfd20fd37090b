"""How near a panel's image comes to a reference: on the panel, and for eyes before it.

One reference is a light field of every view, woven; the other is a render of the panel's own subpixels. They differ by
the error of interpolating between views, so each favours some of the ways. The two halves of a reference are
independent, so that its noise cancels.
"""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Callable, Sequence
from pathlib import Path

import numpy as np

from lfsr_core.base.arrays import Array
from lfsr_core.frames.frame import REFERENCE_FILES, SUBPIXELS, read_rendered
from lfsr_core.frames.reference import Reference
from lfsr_core.metrics.split_ssim import mean_of, psnr, split_mse, split_ssim_map
from lfsr_core.optics.display import DisplayProfile
from lfsr_core.optics.eye import eye_view
from lfsr_lab.experiments.displays.ways import USUAL, Way, panel_image, shown, traced
from lfsr_lab.experiments.engine.timing import cpu_seconds

PLACES = ((0.5, 0.5), (0.2, 0.4), (0.8, 0.6), (0.35, 0.75), (0.65, 0.25))  # of eyes, in the viewing zone
Halves = tuple[Array, Array]


@dataclasses.dataclass(frozen=True)
class Accuracy:
    """How near a panel's image comes to the reference's."""

    psnr_panel: float | None  # decibels over all subpixels; None: below what the reference's noise lets see
    psnr_eye: float | None  # of what eyes see
    ssim_eye: float


@dataclasses.dataclass(frozen=True)
class Point:
    """One way at one number of samples."""

    way: str
    samples: int
    render_cpu: float  # seconds on all cores beyond opening the scene
    finish_cpu: float  # seconds on all cores from the render to the panel's image
    accuracy: Accuracy  # against the woven reference, or the EIA where the panel has no lens sheet
    scale: int = 1  # by which views were divided
    # Against the traced reference of a panel with a lens sheet.
    traced: Accuracy | None = dataclasses.field(default=None, metadata={"key": "straight"})

    @property
    def cpu(self) -> float:
        """Seconds in all."""
        return self.render_cpu + self.finish_cpu


@dataclasses.dataclass(frozen=True)
class Target:
    """What panels are compared with."""

    profile: DisplayProfile
    panels: Halves  # (H, W, 3) uint8
    eyes: tuple[Halves, ...]  # what eyes see of them, in [0, 1]

    @classmethod
    def of(cls, folder: Path) -> Target:
        """Read the frame folder of a reference of every view, or of the panel's subpixels."""
        frame = read_rendered(folder)
        if frame.layout == SUBPIXELS:
            a, b = (traced(folder, name) for name in REFERENCE_FILES)
        else:
            reference = Reference.read(folder)
            a, b = (shown(half, frame.display, "all") for half in (reference.half_a, reference.half_b))
        return cls(frame.display, (a, b), tuple(zip(seen(a, frame.display), seen(b, frame.display), strict=True)))

    def accuracy(self, panel: Array, seen: Sequence[Array]) -> Accuracy:
        """Return the accuracy of a panel's image (H, W, 3) uint8 and of what eyes see of it."""
        error = np.mean([split_mse(eye, *halves) for eye, halves in zip(seen, self.eyes, strict=True)])
        ssim = np.mean([mean_of(split_ssim_map(eye, *halves)) for eye, halves in zip(seen, self.eyes, strict=True)])
        on_panel = split_mse(panel / 255, *(half / 255 for half in self.panels))
        return Accuracy(psnr(on_panel), psnr(float(error)), float(ssim))


def measure(way: Way, samples: int, rendered: Path, render_cpu: float, targets: Callable[[], list[Target]]) -> Point:
    """Finish a way's render and compare it with the woven reference and, where there is one, the traced one."""
    for _ in range(1 if way == USUAL else 2):  # the first loads libraries, which hardly counts where OIDN runs per view
        started = cpu_seconds()
        panel = panel_image(rendered, way)
        seconds = cpu_seconds() - started
    woven, *others = targets()
    eyes = seen(panel, woven.profile)
    close, *traced_ = (target.accuracy(panel, eyes) for target in (woven, *others))
    scale = read_rendered(rendered).scale
    return Point(way.name, samples, render_cpu, seconds, close, scale, traced_[0] if traced_ else None)


def seen(panel: Array, profile: DisplayProfile) -> list[Array]:
    """Return what eyes at PLACES see of a panel's image, (rows, columns, 3) in [0, 1] each."""
    wide = 2 * profile.viewing_distance_mm * math.tan(math.radians(profile.viewing_angle_deg) / 2)
    high = profile.camera_spacing_mm * (profile.views[1] if profile.parallax[1] else 0)
    eyes = [((x - 0.5) * wide, (y - 0.5) * high, profile.viewing_distance_mm) for x, y in PLACES]
    return [eye_view(panel, profile, eye, width=1) / 255 for eye in eyes]
