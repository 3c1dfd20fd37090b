"""The one contract that every upscaling method obeys, and the classical methods.

A method name is prefilters and one upscaler joined by "+", as ``oidn+bicubic``; "epi" after
them brings back detail that they lost, as in ``oidn+bicubic+epi``.
Low view k' covers high views s·k' … s·k' + s - 1, so pixels are sampled at
half-pixel centres.
"""

from __future__ import annotations

import functools
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path

import numpy as np

from lfsr_core.errors import LfsrError, did_you_mean
from lfsr_core.frames.low_res import LowResEIA
from lfsr_core.reconstruct.contract import Cleaner, Method, Upscaler
from lfsr_core.reconstruct.methods import denoise, epipolar
from lfsr_core.reconstruct.methods.denoise import GUIDES, denoise_both_ways, denoise_low_resolution
from lfsr_core.reconstruct.methods.epipolar import Recovering
from lfsr_core.reconstruct.methods.interpolation import Interpolation, NoUpscaling
from lfsr_core.reconstruct.networks import catalogue

CLASSICAL: dict[str, tuple[str, Upscaler]] = {
    "nearest": ("each view repeated", Interpolation("nearest", "nearest")),
    "bilinear": ("linear inside each elemental image", Interpolation("bilinear", "linear")),
    "bicubic": ("cubic inside each elemental image", Interpolation("bicubic", "cubic")),
    "lanczos": ("8-tap Lanczos inside each elemental image", Interpolation("lanczos", "lanczos")),
    "bicubic-eia": ("cubic over the whole array: shows crosstalk",
                    Interpolation("bicubic-eia", "cubic", crosstalk=True)),
    "none": ("no upscaling, for renders at scale 1", NoUpscaling()),
}
PREFILTERS: dict[str, tuple[str, Callable[[LowResEIA], LowResEIA]]] = {
    "oidn": ("Open Image Denoise on the whole array", denoise_low_resolution),
    "oidn-fast": ("the same in half the time, a little less accurate",
                  functools.partial(denoise_low_resolution, fast=True)),
    "oidn-guided": ("Open Image Denoise with albedo and normal, cleaned first: for plain surfaces",
                    functools.partial(denoise_low_resolution, guided=True)),
    "oidn-both": ("oidn and oidn-guided, for a network that mixes them", denoise_both_ways),
}
GUIDED = ("oidn-guided", "oidn-both")
DENOISERS = ("oidn", "oidn-fast", "oidn-guided")  # prefilters that make sense before an interpolation
RECOVERY = "epi"
UPSCALERS: dict[str, str] = {**{name: entry[0] for name, entry in CLASSICAL.items()}, **catalogue.NAMES}
METHODS: dict[str, str] = {**UPSCALERS, **{name: entry[0] for name, entry in PREFILTERS.items()},
                           RECOVERY: "last: detail that was taken for noise comes back along epipolar lines"}
PLAIN_METHOD = "bilinear"  # after OIDN more accurate than bicubic, see docs/results/measurements.md
# What our networks must beat.
PLAIN_CHAINS = (*(f"{name}+{PLAIN_METHOD}" for name in DENOISERS), f"{DENOISERS[0]}+{PLAIN_METHOD}+{RECOVERY}")
DEFAULT_METHOD = "oidn-both+refine+epi"  # see docs/results/networks.md


def method(name: str, weights: str | Path | None = None) -> Method:
    """Method of a name such as "bicubic" or "oidn+bicubic"; "oidn" alone upscales nothing.

    ``weights``: a file for its network instead of the shipped one. LfsrError for
    an unknown part, with the nearest name, a wrong order, or weights without a network.
    """
    parts = [part.strip() for part in name.split("+")]
    for part in parts:
        _check_known(part)
    recovers = len(parts) > 1 and parts[-1] == RECOVERY
    parts = parts[:-1] if recovers else parts
    if parts[-1] in PREFILTERS:
        parts.append("none")
    _check_order(name, parts)
    prefilters, upscaler = tuple(PREFILTERS[part][1] for part in parts[:-1]), _load(parts[-1], weights)
    if recovers:
        upscaler = Recovering(_cleaner(upscaler))
        prefilters += (upscaler.prepare,)
    return Method(name, prefilters, upscaler)


def layers_of(name: str) -> tuple[str, ...]:
    """Auxiliary layers that some part of method ``name`` looks at, sorted."""
    parts = name.split("+")
    asked = {layer for part in parts if part in catalogue.NETWORKS for layer in catalogue.NETWORKS[part].layers}
    return tuple(sorted(asked | (set(GUIDES) if set(GUIDED) & set(parts) else set())))


def versions_of(name: str) -> dict[str, int]:
    """Versions of what method ``name`` is made of, weights aside: figures measured with others are out of date."""
    parts = set(name.split("+"))
    return {**({"denoiser": denoise.VERSION} if parts & PREFILTERS.keys() else {}),
            **({RECOVERY: epipolar.VERSION} if RECOVERY in parts else {})}


def guide_notes(name: str, aux: Mapping[str, np.ndarray]) -> list[str]:
    """For the report: a sentence if method ``name`` would be guided by layers that ``aux`` lacks."""
    missing = [layer for layer in GUIDES if layer not in aux]
    if "oidn-guided" not in name.split("+") or not missing:
        return []
    return [f"oidn-guided is guided by the layers {', '.join(missing)}, which this frame lacks: it was denoised "
            "without them; render it again with --layers albedo,normal"]


def _check_order(name: str, parts: Sequence[str]) -> None:
    for part in parts[:-1]:
        if part not in PREFILTERS:
            raise LfsrError(f"method {name!r} has {part!r} before its last part, but only {', '.join(PREFILTERS)} can "
                            f"stand there: put one upscaler last, and {RECOVERY!r} after it")
    if parts[-1] == RECOVERY:
        raise LfsrError(f"method {name!r} has nothing before {RECOVERY!r}: use '{PLAIN_METHOD}+{RECOVERY}'")
    before = catalogue.NETWORKS[parts[-1]].after if parts[-1] in catalogue.NETWORKS else None
    if before and before not in parts:
        raise LfsrError(f"method {name!r} needs {before!r} before {parts[-1]!r}: use '{before}+{parts[-1]}'")


def _cleaner(upscaler: Upscaler) -> Cleaner:
    if not hasattr(upscaler, "clean") or getattr(upscaler, "crosstalk", False):
        raise LfsrError(f"{RECOVERY!r} cannot follow {upscaler.name!r}, which does more than interpolate each "
                        f"elemental image: leave {RECOVERY!r} out")
    return upscaler


def _check_known(part: str) -> None:
    if part not in METHODS:
        hint = did_you_mean(part, METHODS, cutoff=0.4)
        raise LfsrError(f"unknown method {part!r}: {hint}Choose from {', '.join(METHODS)}, joined by '+'")


def _load(name: str, weights: str | Path | None) -> Upscaler:
    if name in catalogue.NETWORKS:
        return catalogue.upscaler(name, **({"weights": weights} if weights else {}))
    if weights:
        raise LfsrError(f"weights {weights} were given, but {name!r} is no network: choose one of "
                        f"{', '.join(catalogue.NETWORKS)} or leave them out")
    return CLASSICAL[name][1]
