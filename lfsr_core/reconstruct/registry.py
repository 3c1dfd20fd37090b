"""The functions behind a method's name: every prefilter and upscaler."""

from __future__ import annotations

import dataclasses
import functools
from collections.abc import Callable
from pathlib import Path

from lfsr_core.base.errors import LfsrError
from lfsr_core.frames.low_res import LowResEIA
from lfsr_core.reconstruct.contract import Cleaner, Upscaler
from lfsr_core.reconstruct.method_name import DENOISE, RECOVERY, MethodName
from lfsr_core.reconstruct.methods import denoise
from lfsr_core.reconstruct.methods.epipolar import Recovering
from lfsr_core.reconstruct.methods.interpolation import Interpolation, NoUpscaling
from lfsr_core.reconstruct.networks import catalogue

CLASSICAL: dict[str, Upscaler] = {
    "nearest": Interpolation("nearest"),
    "bilinear": Interpolation("linear"),
    "bicubic": Interpolation("cubic"),
    "lanczos": Interpolation("lanczos"),
    "bicubic-eia": Interpolation("cubic", crosstalk=True),
    "none": NoUpscaling("nearest"),
}
PREFILTERS: dict[str, Callable[[LowResEIA], LowResEIA]] = {
    DENOISE: denoise.denoise_low_resolution,
    "oidn": functools.partial(denoise.denoise_low_resolution, weights=None),
}


@dataclasses.dataclass(frozen=True)
class Method:
    """A way to finish frames, ready to run."""

    name: MethodName
    prefilters: tuple[Callable[[LowResEIA], LowResEIA], ...]  # change the whole low-resolution EIA, in this order
    upscaler: Upscaler  # makes each elemental image of the result

    def prepare(self, low: LowResEIA) -> LowResEIA:
        """Apply every prefilter; LfsrError for a network where views differ along one axis."""
        self.name.check_parallax(low.parallax)
        for prefilter in self.prefilters:
            low = prefilter(low)
        return low


def method(name: str | MethodName, weights: str | Path | None = None, *, upscaler: Upscaler | None = None,
           block: int | None = None) -> Method:
    """Load the method of a name such as "denoise+bicubic", see ``MethodName.parse``.

    ``weights``: file for its network, or for the prefilter "denoise", instead of the shipped one. ``upscaler``: instead
    of the one in the name. ``block``: see ``epipolar.Recovering``. LfsrError for a wrong name, weights without a
    network, or "epi" after an upscaler that does more than interpolate.
    """
    name = MethodName.parse(name)
    prefilters = tuple(PREFILTERS[part] for part in name.prefilters)
    if weights and DENOISE in name.prefilters:
        own = functools.partial(denoise.denoise_low_resolution, weights=weights)
        prefilters, weights = tuple(own if part == DENOISE else PREFILTERS[part] for part in name.prefilters), None
    upscaler = upscaler or _load(name, weights)
    if not name.recovers:
        return Method(name, prefilters, upscaler)
    if not isinstance(upscaler, Cleaner) or getattr(upscaler, "crosstalk", False):
        raise LfsrError(f"{RECOVERY!r} cannot follow {name.upscaler!r}, which does more than interpolate each "
                        f"elemental image: leave {RECOVERY!r} out")
    recovering = Recovering(upscaler, block)
    return Method(name, (*prefilters, recovering.prepare), recovering)


def _load(name: MethodName, weights: str | Path | None) -> Upscaler:
    if name.network:
        return catalogue.upscaler(name.upscaler, **({"weights": weights} if weights else {}))
    if weights:
        raise LfsrError(f"weights {weights} were given, but method {name.text!r} has none: choose one with "
                        f"{DENOISE!r}, or leave the weights out")
    return CLASSICAL[name.upscaler]
