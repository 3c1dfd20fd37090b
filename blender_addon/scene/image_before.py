"""The test image: the same array with fewer lenses and views, rendered in seconds before an image that takes longer."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Iterable
from typing import TypeVar

from lfsr_core.optics.depth_scale import samples_at, scales_up_to
from lfsr_core.optics.display import DisplayProfile

from .settings import Resolved

Number = TypeVar("Number", int, float)
MOST_LENSES, LEAST_VIEWS = 6000, 8
LEAST_PATHS = 10**6  # of an image, below which it needs no test image


def reduced(settings: Resolved) -> Resolved | None:
    """Return the settings of the test image of an image; None where the image itself is small, or has no lenses."""
    if settings.subpixels or paths_of(settings) < LEAST_PATHS:
        return None
    display, sampling = reduced_display(settings.display), settings.sampling
    scales = settings.method.scales_of(scales_up_to(display))
    scale = scales[0] if sampling.scales else max(scale for scale in scales if scale <= sampling.scale)
    samples = sampling.samples if settings.rays is None else samples_at(display, scale, settings.rays)
    sampling = dataclasses.replace(sampling, scale=scale, scales=scales if sampling.scales else (), samples=samples)
    request = dataclasses.replace(settings.request, display=display, sampling=sampling)
    return dataclasses.replace(settings, request=request)


def reduced_display(display: DisplayProfile) -> DisplayProfile:
    """Return a display that shows the same with at most about MOST_LENSES lenses, and few views of each."""
    step = math.ceil(math.sqrt(math.prod(display.lenses) / MOST_LENSES))
    lenses = _pair(max(1, count // step) for count in display.lenses)
    many = [count for count in display.views if count > 1]
    every = max((n for n in range(1, max(many, default=1) + 1)
                 if not any(count % n or count // n < LEAST_VIEWS for count in many)), default=1)
    views = _pair(count // every if count > 1 else 1 for count in display.views)
    if display.is_woven:  # its panel stays, and is woven from fewer lenses
        return dataclasses.replace(display, lenses=lenses, views=views)
    # Lenses that the step leaves over are cut off, so that pixels stay square.
    size = _pair(mm * step * few / count for mm, few, count in
                 zip(display.panel_mm, lenses, display.lenses, strict=True))
    pixels = _pair(few * count for few, count in zip(lenses, views, strict=True))
    return dataclasses.replace(display, lenses=lenses, views=views, panel_mm=size, panel_pixels=pixels)


def _pair(values: Iterable[Number]) -> tuple[Number, Number]:
    across, down = values
    return across, down


def paths_of(settings: Resolved) -> float:
    """Return the paths of a finished image, about."""
    pixels = math.prod(settings.display.eia_pixels)
    if settings.rays is not None:
        return pixels * settings.rays
    return pixels / settings.display.finished_pixels(settings.sampling.scale) * settings.sampling.samples
