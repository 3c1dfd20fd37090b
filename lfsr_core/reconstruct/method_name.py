"""Names of methods, and what follows from a name.

A name joins prefilters and one upscaler by "+", as ``denoise+bilinear``; "epi" after them adds detail that they lost,
as in ``denoise+bilinear+epi``. Text is parsed where it enters the program; everything else passes a ``MethodName``.
"""

from __future__ import annotations

import dataclasses
import hashlib
from collections.abc import Collection, Sequence
from pathlib import Path

from lfsr_core.base.errors import LfsrError, did_you_mean
from lfsr_core.reconstruct import denoiser
from lfsr_core.reconstruct.contract import Network
from lfsr_core.reconstruct.methods import denoise, epipolar
from lfsr_core.reconstruct.networks import catalogue

CLASSICAL = {
    "nearest": "each view repeated",
    "bilinear": "linear inside each elemental image",
    "bicubic": "cubic inside each elemental image",
    "lanczos": "8-tap Lanczos inside each elemental image",
    "bicubic-eia": "cubic over the whole array: shows crosstalk",
    "none": "no upscaling, for renders at scale 1",
}
DENOISE = "denoise"
PREFILTERS = {
    DENOISE: "Open Image Denoise with weights trained on elemental images",
    "oidn": "Open Image Denoise with its own weights",
}
AS_RENDERED, RECOVERY = "none", "epi"
# For direct subpixel rendering, the default first: there the library's own weights are as good as ours.
PANEL_METHODS = ("oidn", AS_RENDERED)
UPSCALERS = {**CLASSICAL, **catalogue.NAMES}
METHODS = {**UPSCALERS, **PREFILTERS, RECOVERY: "last: restores detail taken for noise, along epipolar lines"}
PLAIN_METHOD = "bilinear"  # after a denoiser more accurate than bicubic, see docs/results/measurements.md
FAST_METHOD = f"{DENOISE}+{PLAIN_METHOD}"
DEFAULT_METHOD = f"{FAST_METHOD}+{RECOVERY}"  # see docs/results/networks.md
# What studies compare the default with.
COMPARED = (f"oidn+{PLAIN_METHOD}", f"oidn+{PLAIN_METHOD}+{RECOVERY}", FAST_METHOD)
# Parts of names that are gone, with what replaced them.
GONE = {**dict.fromkeys(("oidn-fast", "oidn-guided", "oidn-half", "oidn-both", "oidn-render"), DENOISE),
        **dict.fromkeys(("refine", "light"), DEFAULT_METHOD)}
GONE_SINCE = "0.2"


@dataclasses.dataclass(frozen=True, order=True)
class MethodName:
    """The name of a method; make it with ``MethodName.parse``."""

    text: str  # the name as written, such as "denoise+bilinear+epi"
    prefilters: tuple[str, ...]  # applied to the whole low-resolution EIA, in this order
    upscaler: str  # "none" where every view is rendered
    recovers: bool  # whether "epi" restores lost detail

    @classmethod
    def parse(cls, text: str | MethodName) -> MethodName:
        """Parse a name such as "bicubic" or "denoise+bicubic"; "denoise" alone upscales nothing.

        LfsrError for an unknown part, with the nearest known one, for a wrong order, or for a method that is gone.
        """
        if isinstance(text, MethodName):
            return text
        parts = [part.strip() for part in text.split("+")]
        _check_gone(text, parts)
        for part in parts:
            _check_known(part)
        chain = parts[:-1] if len(parts) > 1 and parts[-1] == RECOVERY else parts
        *prefilters, upscaler = chain if chain[-1] not in PREFILTERS else [*chain, AS_RENDERED]
        _check_order(text, prefilters, upscaler)
        return cls("+".join(parts), tuple(prefilters), upscaler, chain is not parts)

    def __str__(self) -> str:
        return self.text

    @property
    def network(self) -> Network | None:
        """The upscaler where it is a network, else None."""
        return catalogue.NETWORKS.get(self.upscaler)

    @property
    def undenoised(self) -> MethodName:
        """Its upscaler alone: what needs no Open Image Denoise."""
        return MethodName.parse(self.upscaler)

    @property
    def versions(self) -> dict[str, int]:
        """Versions of its parts besides weights: figures measured with others are out of date."""
        return {**({"denoiser": denoise.VERSION} if self.prefilters else {}),
                **({RECOVERY: epipolar.VERSION} if self.recovers else {})}

    @property
    def steps(self) -> int:
        """Number of steps, a measure of simplicity."""
        return len(self.prefilters) + (self.upscaler != AS_RENDERED) + self.recovers

    @property
    def weights_digest(self) -> str:
        """SHA-256 of the shipped weights, of a network for all scales; empty without any."""
        files = [path for _, path in sorted(self.network.weights.items())] if self.network else []
        files += [denoiser.WEIGHTS] if DENOISE in self.prefilters and denoiser.WEIGHTS.exists() else []
        return hashlib.sha256(b"".join(map(Path.read_bytes, files))).hexdigest() if files else ""

    def works_at(self, scale: int) -> bool:
        """Whether it can upscale by ``scale``; a network needs weights for it."""
        return self.upscaler != AS_RENDERED and (self.network is None or scale in self.network.weights)

    def scales_of(self, scales: Collection[int]) -> tuple[int, ...]:
        """Those of ``scales`` that it can upscale by, and 1, where its denoisers work alone."""
        return tuple(scale for scale in scales if scale == 1 or self.works_at(scale))

    def at_scale(self, scale: int) -> MethodName:
        """What it does at ``scale``: at 1, where every view is rendered, its denoisers alone."""
        return self if scale > 1 else MethodName.parse("+".join(self.prefilters) or AS_RENDERED)

    def works_with(self, parallax: tuple[bool, bool]) -> bool:
        """Whether it works on a display whose views differ along those axes; networks need both."""
        return self.network is None or all(parallax)

    def check_parallax(self, parallax: tuple[bool, bool]) -> None:
        """LfsrError unless it works on a display whose views differ along those axes."""
        if not self.works_with(parallax):
            raise LfsrError(f"method {self.text!r} needs views in two directions, but this display has one: "
                            f"choose a method without a network, such as {DEFAULT_METHOD!r}")

    def check_scale(self, scale: int) -> None:
        """LfsrError where it upscales nothing, but ``scale`` is above 1."""
        if scale > 1 and self.upscaler == AS_RENDERED:
            other = "+".join((*self.prefilters, PLAIN_METHOD, *((RECOVERY,) if self.recovers else ())))
            raise LfsrError(f"method {self.text!r} upscales nothing, but scale {scale} needs an upscaler: add one, as "
                            f"in {other!r}, or render at scale 1")



def _check_gone(text: str, parts: Sequence[str]) -> None:
    """LfsrError for a method of an older version."""
    if GONE.keys() & {*parts}:
        upscales = any(part in UPSCALERS or GONE.get(part) == DEFAULT_METHOD for part in parts)
        raise LfsrError(f"method {text!r} is gone since version {GONE_SINCE}: "
                        f"{DEFAULT_METHOD if upscales else DENOISE!r} replaced it")


def _check_known(part: str) -> None:
    if part not in METHODS:
        hint = did_you_mean(part, METHODS, cutoff=0.4)
        raise LfsrError(f"unknown method {part!r}: {hint}Choose from {', '.join(METHODS)}, joined by '+'")


def _check_order(text: str, prefilters: Sequence[str], upscaler: str) -> None:
    for part in prefilters:
        if part not in PREFILTERS:
            raise LfsrError(f"method {text!r} has {part!r} before its last part, but only {', '.join(PREFILTERS)} can "
                            f"stand there: put one upscaler last, and {RECOVERY!r} after it")
    if upscaler == RECOVERY:
        raise LfsrError(f"method {text!r} has no upscaler before {RECOVERY!r}: use '{PLAIN_METHOD}+{RECOVERY}'")
