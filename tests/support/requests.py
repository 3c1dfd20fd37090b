"""Render requests for tests, with the fields of their sampling given as options."""

import dataclasses
from typing import Any

from lfsr_core.frames.frame import Request, Sampling
from lfsr_core.optics.display import DisplayProfile

SAMPLING = {field.name for field in dataclasses.fields(Sampling)}


def make_request(output: str, display: DisplayProfile, scene: str = "", **options: Any) -> Request:
    """Return a request; ``options``: fields of ``Sampling`` and of ``Request``."""
    sampling = {name: options.pop(name) for name in list(options) if name in SAMPLING}
    return Request(output, display, scene, sampling=Sampling(**sampling), **options)


def changed(request: Request, **options: Any) -> Request:
    """Return ``request`` with other options, as of ``make_request``."""
    sampling = {name: options.pop(name) for name in list(options) if name in SAMPLING}
    return dataclasses.replace(request.sampled(**sampling), **options)
