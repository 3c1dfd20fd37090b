"""The methods of the second stage: one table for command line, panel, plan and laboratory.

A name joins prefilters and one upscaler by "+", as ``denoise+pool``. Text is parsed where it enters the program;
everything else passes a ``MethodName``. A new method is a module and one row of METHODS.
"""

from __future__ import annotations

import dataclasses
import functools
import math
from collections.abc import Callable, Collection, Mapping
from typing import Any

from lfsr_core.base.messages import LfsrError, did_you_mean
from lfsr_core.frames.frame import SUBPIXELS
from lfsr_core.optics.display import DisplayProfile
from lfsr_core.optics.panel.subpixel_rays import rendered_size
from lfsr_core.reconstruct.methods import denoise
from lfsr_core.reconstruct.methods.pooling import Pooling
from lfsr_core.reconstruct.upscaler import Interpolation, LowResEIA, Upscaler

PREFILTER, UPSCALER = "prefilter", "upscaler"


@dataclasses.dataclass(frozen=True)
class Part:
    """A part of methods' names."""

    kind: str  # PREFILTER changes the low-resolution EIA, UPSCALER makes EIs of it
    text: str  # one line for menus
    make: Callable[..., Any]  # a PREFILTER as function of a weights file or None; an UPSCALER
    needs_denoiser: bool = False  # Open Image Denoise
    takes_weights: bool = False
    sees_neighbours: bool = False  # whether an elemental image depends on those beside it
    versions: Mapping[str, int] = dataclasses.field(default_factory=dict)  # of results: figures of others are outdated
    # seconds of two cores per million rendered and finished pixels, besides those of every method
    per_rendered: float = 0.0
    per_finished: float = 0.0


METHODS: dict[str, Part] = {
    "nearest": Part(UPSCALER, "each view repeated", lambda: Interpolation("nearest")),
    "bilinear": Part(UPSCALER, "linear inside each elemental image", lambda: Interpolation("linear")),
    "bicubic": Part(UPSCALER, "cubic inside each elemental image", lambda: Interpolation("cubic")),
    "pool": Part(UPSCALER, "linear along the depth of what is seen, from every lens that sees it", Pooling,
                 sees_neighbours=True, versions={"pool": 13}, per_finished=0.05),
    "none": Part(UPSCALER, "no upscaling, for renders at scale 1", lambda: Interpolation("nearest")),
    "denoise": Part(PREFILTER, "Open Image Denoise with weights for elemental images, and its own in small renders",
                    lambda path: functools.partial(denoise.denoise_low_resolution, weights=path or denoise.WEIGHTS),
                    needs_denoiser=True, takes_weights=True, sees_neighbours=True, versions={"denoiser": 12},
                    per_rendered=0.45),
    "oidn": Part(PREFILTER, "Open Image Denoise with its own weights",
                 lambda _: functools.partial(denoise.denoise_low_resolution, weights=None), needs_denoiser=True,
                 sees_neighbours=True, versions={"denoiser": 11}, per_rendered=0.45)}
# Seconds of every method on two cores: its start; per million finished, rendered and twice denoised pixels.
START, PER_FINISHED, PER_RENDERED, PER_TWICE = 1.2, 0.07, 0.05, 1.4
AS_RENDERED = "none"
# For direct subpixel rendering, the default first: there the library's own weights are as good as ours.
SUBPIXEL_METHODS = ("oidn", AS_RENDERED)
PLAIN_METHOD = "bilinear"  # after a denoiser more accurate than bicubic, see docs/results/measurements.md
FAST_METHOD = f"denoise+{PLAIN_METHOD}"
DEFAULT_METHOD = "denoise+pool"  # see docs/results/pooling.md
# Names in the panel's menu, with a title for a narrow sidebar and a line for the tooltip; and those under More.
MENU = {
    DEFAULT_METHOD: ("Default", "Denoise, then make the missing views from every lens that sees the same point"),
    FAST_METHOD: ("Fast", "Denoise the whole array, then make the missing views by linear interpolation"),
    "denoise": ("Every View", "Render every view, at scale 1×, and denoise")}
MORE = {
    "oidn+bilinear": ("Stock + Bilinear", "Open Image Denoise with its own weights, then linear interpolation"),
    "oidn": ("Stock Only", "Open Image Denoise with its own weights, for scale 1×, where every view is rendered"),
    "pool": ("Pool", "Missing views from every lens that sees the same point; the noise stays"),
    "bilinear": ("Bilinear", "Linear interpolation; the noise stays: fastest"),
    "bicubic": ("Bicubic", "Bicubic interpolation; the noise stays"),
    "nearest": ("Nearest", "Repeat each rendered view, to see what was rendered"),
    "none": ("None", "For scale 1×, where every view is rendered; the noise stays")}


def names(kind: str) -> list[str]:
    """Return the names of the parts of a kind."""
    return [name for name, part in METHODS.items() if part.kind == kind]


@dataclasses.dataclass(frozen=True, order=True)
class MethodName:
    """The name of a method; make it with ``MethodName.parse``."""

    text: str  # the name as written, such as "denoise+pool"
    prefilters: tuple[str, ...]  # applied to the whole low-resolution EIA, in this order
    upscaler: str  # "none" where every view is rendered

    @classmethod
    def parse(cls, text: str | MethodName) -> MethodName:
        """Parse a name such as "bicubic" or "denoise+bicubic"; "denoise" alone upscales nothing.

        LfsrError for an unknown part, with the nearest known one, or for a wrong order.
        """
        if isinstance(text, MethodName):
            return text
        parts = [part.strip() for part in text.split("+")]
        for part in parts:
            if part not in METHODS:
                hint = did_you_mean(part, METHODS, cutoff=0.4)
                raise LfsrError(f"unknown method {part!r}: {hint}Choose from {', '.join(METHODS)}, joined by '+'")
        *prefilters, upscaler = parts if METHODS[parts[-1]].kind != PREFILTER else [*parts, AS_RENDERED]
        for part in prefilters:
            if METHODS[part].kind != PREFILTER:
                raise LfsrError(f"method {text!r} has {part!r} before its last part, but only "
                                f"{', '.join(names(PREFILTER))} can stand there: put one upscaler last")
        return cls("+".join(parts), tuple(prefilters), upscaler)

    def __str__(self) -> str:
        return self.text

    @property
    def parts(self) -> list[Part]:
        """Rows of the table that it is made of."""
        return [METHODS[part] for part in (*self.prefilters, self.upscaler)]

    @property
    def needs_denoiser(self) -> bool:
        """Whether it needs Open Image Denoise."""
        return any(part.needs_denoiser for part in self.parts)

    @property
    def sees_neighbours(self) -> bool:
        """Whether an elemental image depends on those beside it."""
        return any(part.sees_neighbours for part in self.parts)

    @property
    def undenoised(self) -> MethodName:
        """Its upscaler alone: what needs no Open Image Denoise."""
        return MethodName.parse(self.upscaler)

    @property
    def versions(self) -> dict[str, int]:
        """Versions of its parts: figures measured with others are out of date."""
        return {name: version for part in self.parts for name, version in part.versions.items()}

    @property
    def steps(self) -> int:
        """Number of steps, a measure of simplicity."""
        return len(self.prefilters) + (self.upscaler != AS_RENDERED)

    def works_at(self, scale: int) -> bool:
        """Whether it can finish a render at ``scale``."""
        return scale == 1 or self.upscaler != AS_RENDERED

    def scales_of(self, scales: Collection[int]) -> tuple[int, ...]:
        """Those of ``scales`` at which it can finish a render."""
        return tuple(scale for scale in scales if self.works_at(scale))

    def at_scale(self, scale: int) -> MethodName:
        """What it does at ``scale``: at 1, where every view is rendered, its denoisers alone."""
        return self if scale > 1 else MethodName.parse("+".join(self.prefilters) or AS_RENDERED)

    def check_scale(self, scale: int) -> None:
        """LfsrError where it upscales nothing, but ``scale`` is above 1."""
        if not self.works_at(scale):
            other = "+".join((*self.prefilters, PLAIN_METHOD))
            raise LfsrError(f"method {self.text!r} upscales nothing, but scale {scale} needs an upscaler: add one, as "
                            f"in {other!r}, or render at scale 1")


@dataclasses.dataclass(frozen=True)
class Method:
    """A way to finish frames, ready to run."""

    name: MethodName
    prefilters: tuple[Callable[[LowResEIA], LowResEIA], ...]  # change the whole low-resolution EIA, in this order
    upscaler: Upscaler  # makes each elemental image of the result

    def prepare(self, low: LowResEIA) -> LowResEIA:
        """Apply every prefilter; where these denoise, the opacity before a world is denoised too.

        LfsrError where there is a world, but no opacity.
        """
        low = low if self.upscaler.follows_depth else dataclasses.replace(low, slope=None)
        ready = low
        for prefilter in self.prefilters:
            ready = prefilter(ready)
        ready = self.upscaler.prepare(ready)
        if low.world is None:
            return ready
        if low.opacity is None or low.places is None:
            raise LfsrError("the world is known, but not the subject's opacity: render the frame again")
        cover = dataclasses.replace(low, color=low.opacity, guides=None, exposure=0.0, world=None)
        cover = dataclasses.replace(denoise.denoised_opacity(cover) if self.prefilters else cover, slope=ready.slope)
        return dataclasses.replace(ready, cover=self.upscaler.prepare(cover))


def load_method(name: str | MethodName, weights: str | None = None, *, upscaler: Upscaler | None = None) -> Method:
    """Load the method of a name such as "denoise+bicubic", see ``MethodName.parse``.

    ``weights``: file for its denoiser instead of the shipped one. ``upscaler``: instead of the one in the name.
    LfsrError for a wrong name, or weights without a denoiser that takes them.
    """
    name = MethodName.parse(name)
    if weights and not any(part.takes_weights for part in name.parts):
        raise LfsrError(f"weights {weights} were given, but method {name.text!r} has none: choose one with "
                        "'denoise', or leave the weights out")
    upscaler = upscaler or METHODS[name.upscaler].make()
    assert upscaler is not None, "the table makes one"
    return Method(name, tuple(METHODS[part].make(weights) for part in name.prefilters), upscaler)


def check_runs(name: str | MethodName, weights: str | None = None) -> None:
    """LfsrError where this machine cannot run a method, as of ``load_method``, and by weights or Open Image Denoise."""
    if load_method(name, weights).name.needs_denoiser:
        denoise.check_library()
    if weights:
        denoise.load(weights)


def seconds(display: DisplayProfile, scale: int, method: str, layout: str = "one-pass") -> float:
    """Estimate the seconds of the second stage of a frame on two cores."""
    finished = math.prod(rendered_size(display) if layout == SUBPIXELS else display.eia_pixels) / 1e6
    rendered, name = finished / display.finished_pixels(scale), MethodName.parse(method)
    twice = PER_TWICE * ("denoise" in name.prefilters and rendered * 1e6 <= denoise.MOST_TWICE)
    return (START + (PER_FINISHED + sum(part.per_finished for part in name.parts)) * finished
            + (PER_RENDERED + twice + sum(part.per_rendered for part in name.parts)) * rendered)
