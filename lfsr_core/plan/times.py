"""Prediction of a whole frame's time from the times of a sample."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Mapping

import numpy as np

from lfsr_core.frames.frame import Frame
from lfsr_core.optics.display import DisplayProfile
from lfsr_core.plan.candidates import Candidate, low_pixels


@dataclasses.dataclass(frozen=True)
class StageTime:
    """Seconds of a method in the second stage."""

    fixed: float = 0.0  # per frame
    per_pixel: float = 0.0  # per low-resolution pixel that is denoised
    per_lens: float = 0.0  # per lens of the foreground


@dataclasses.dataclass(frozen=True)
class TimeModel:
    """Measured costs of one scene on one display, in seconds."""

    open: float  # loading the scene
    setup: float  # of a render, whatever its size
    per_sample: float  # one sample of one pixel, mean over the whole frame
    load: float  # reading one low-resolution pixel
    finish: float  # mask, assembly, colour and writing of a frame
    foreground: int  # number of lenses that the method works on
    shown: float = 1.0  # fraction of the frame that is denoised (denoise.shown_part)
    stages: Mapping[tuple[int, str], StageTime] = dataclasses.field(default_factory=dict)  # by scale and method
    world: float = 0.0  # of a visible world that is rendered apart, as for every scale but 1

    def seconds(self, candidate: Candidate, display: DisplayProfile) -> float:
        """Predicted seconds of a whole frame; those of the render alone where the second stage was not measured."""
        low = low_pixels(display, candidate.scale)
        stage = self.stages.get((candidate.scale, candidate.method), StageTime())
        world = self.world if candidate.scale > 1 else 0.0
        return (self.open + self.setup + self.per_sample * low * candidate.spp + world + self.load * low + self.finish
                + stage.fixed + stage.per_pixel * low * self.shown + stage.per_lens * self.foreground)

    def refined(self, quick: Frame, sampled: list[Frame], fraction: float) -> TimeModel:
        """Separate the set-up of a render from the cost of its samples, by ``sampled`` renders of several sizes.

        Those show foreground, whose samples cost more than others. The cost of a mean sample comes from ``quick``, the
        render of every lens. If that took hardly longer than its set-up, bounds apply: the foreground's cost above,
        below that of a frame whose other lenses cost nothing. ``fraction``: of the lenses, the foreground.
        """
        samples = np.array([path_samples(frame) for frame in sampled], float)
        if len(set(samples)) < 2:
            return self
        seconds = np.array([render_seconds(frame) for frame in sampled])
        slope = max(float(np.polyfit(samples, seconds, 1)[0]), 0.0)
        setup = min(max(float(np.mean(seconds) - slope * np.mean(samples)), 0.0), float(seconds.min()))
        mean = (render_seconds(quick) - setup) / path_samples(quick)
        return dataclasses.replace(self, setup=setup, per_sample=min(max(mean, fraction * slope), slope))


def path_samples(frame: Frame) -> int:
    """Path samples of a render."""
    return math.prod(frame.rays.size) * frame.samples


def render_seconds(frame: Frame) -> float:
    """Seconds of a render, without a world that was rendered apart."""
    return frame.seconds["render"] - frame.seconds.get("world", 0.0)
