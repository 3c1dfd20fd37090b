"""Names of methods, and what follows from a name.

A name joins prefilters and one upscaler by "+", as ``oidn+bicubic``; "epi" after them adds detail that they lost, as
in ``oidn+bicubic+epi``. Text is parsed where it enters the program; everything else passes a ``MethodName``.
"""

from __future__ import annotations

import dataclasses
import hashlib
from collections.abc import Collection, Sequence
from pathlib import Path

from lfsr_core.errors import LfsrError, did_you_mean
from lfsr_core.reconstruct import denoiser
from lfsr_core.reconstruct.methods import denoise, epipolar
from lfsr_core.reconstruct.methods.guides import GUIDES
from lfsr_core.reconstruct.networks import catalogue
from lfsr_core.reconstruct.networks.spec import NetworkSpec

CLASSICAL = {
    "nearest": "each view repeated",
    "bilinear": "linear inside each elemental image",
    "bicubic": "cubic inside each elemental image",
    "lanczos": "8-tap Lanczos inside each elemental image",
    "bicubic-eia": "cubic over the whole array: shows crosstalk",
    "none": "no upscaling, for renders at scale 1",
}
BOTH, OURS = "oidn-both", "ours"
PREFILTERS = {
    "oidn": "Open Image Denoise on the whole array",
    "oidn-fast": "the same in half the time, a little less accurate",
    "oidn-guided": "Open Image Denoise with albedo and normal",
    "oidn-half": "the same at half the view resolution, except where that loses detail",
    BOTH: "oidn-half and oidn-guided: for a network that mixes them, else their mean",
    OURS: "Open Image Denoise with weights of ours, from colour alone",
    "oidn-render": "Open Image Denoise in Cycles, on the device that renders: for GPUs",
}
AS_RENDERED, RECOVERY = "none", "epi"
PANEL_METHODS = ("oidn", "oidn-fast", AS_RENDERED)  # for direct subpixel rendering, the default first
GUIDED = ("oidn-guided", "oidn-half", BOTH)
DENOISED = "oidn-render"
DENOISERS = ("oidn", "oidn-fast", "oidn-guided", "oidn-half")  # prefilters that make one image
UPSCALERS = {**CLASSICAL, **catalogue.NAMES}
METHODS = {**UPSCALERS, **PREFILTERS, RECOVERY: "last: restores detail taken for noise, along epipolar lines"}
PLAIN_METHOD = "bilinear"  # after OIDN more accurate than bicubic, see docs/results/measurements.md
# Methods that our networks must beat.
PLAIN_CHAINS = (*(f"{name}+{PLAIN_METHOD}" for name in DENOISERS),
                *(f"{name}+{PLAIN_METHOD}+{RECOVERY}" for name in (DENOISERS[0], BOTH)))
DEFAULT_METHOD = "oidn-both+refine+epi"  # see docs/results/networks.md
HORIZONTAL_METHOD = "oidn+bilinear+epi"  # the default where views differ along one axis only
STEPS_OF_A_NETWORK = 3


@dataclasses.dataclass(frozen=True, order=True)
class MethodName:
    """The name of a method; make it with ``MethodName.parse``."""

    text: str  # the name as written, such as "oidn+bicubic+epi"
    prefilters: tuple[str, ...]  # applied to the whole low-resolution EIA, in this order
    upscaler: str  # "none" where every view is rendered
    recovers: bool  # whether "epi" restores lost detail

    @classmethod
    def parse(cls, text: str | MethodName) -> MethodName:
        """Parse a name such as "bicubic" or "oidn+bicubic"; "oidn" alone upscales nothing.

        LfsrError for an unknown part, with the nearest known one, or a wrong order.
        """
        if isinstance(text, MethodName):
            return text
        parts = [part.strip() for part in text.split("+")]
        for part in parts:
            _check_known(part)
        chain = parts[:-1] if len(parts) > 1 and parts[-1] == RECOVERY else parts
        *prefilters, upscaler = chain if chain[-1] not in PREFILTERS else [*chain, AS_RENDERED]
        _check_order(text, prefilters, upscaler)
        return cls("+".join(parts), tuple(prefilters), upscaler, chain is not parts)

    def __str__(self) -> str:
        return self.text

    @property
    def network(self) -> NetworkSpec | None:
        """The upscaler's entry in the catalogue; None where it is no network."""
        return catalogue.NETWORKS.get(self.upscaler)

    @property
    def networks(self) -> tuple[str, ...]:
        """The upscaler where it is a network, else empty."""
        return (self.upscaler,) if self.network else ()

    @property
    def layers(self) -> tuple[str, ...]:
        """Auxiliary layers that it uses, sorted."""
        guides = GUIDES if set(GUIDED) & set(self.prefilters) else ()
        denoised = ("denoised",) if DENOISED in self.prefilters else ()
        return tuple(sorted({*guides, *denoised, *(self.network.layers if self.network else ())}))

    @property
    def versions(self) -> dict[str, int]:
        """Versions of its parts besides weights: figures measured with others are out of date."""
        return {**({"denoiser": denoise.VERSION} if self.prefilters else {}),
                **({RECOVERY: epipolar.VERSION} if self.recovers else {})}

    @property
    def steps(self) -> int:
        """Number of steps, a measure of simplicity; a network counts as three."""
        upscaling = 0 if self.upscaler == AS_RENDERED else STEPS_OF_A_NETWORK if self.network else 1
        return len(self.prefilters) + upscaling + self.recovers

    @property
    def weights_digest(self) -> str:
        """SHA-256 of the shipped weights of its networks, for all scales; empty without a network."""
        stem = self.network and (self.network.weights or self.upscaler)
        files = sorted(self.network.folder.glob(f"{stem}-x*.safetensors")) if self.network else []
        files += [denoiser.WEIGHTS] if OURS in self.prefilters and denoiser.WEIGHTS.exists() else []
        return hashlib.sha256(b"".join(map(Path.read_bytes, files))).hexdigest() if files else ""

    def untrained(self, scale: int) -> tuple[str, ...]:
        """Networks that have no weights for ``scale``."""
        return tuple(name for name in self.networks if scale not in catalogue.trained_scales(name))

    def works_at(self, scale: int) -> bool:
        """Whether it can upscale by ``scale``."""
        return self.upscaler != AS_RENDERED and not self.untrained(scale)

    def scales_of(self, scales: Collection[int]) -> tuple[int, ...]:
        """Those of ``scales`` that it can upscale by, and 1, where its denoisers work alone."""
        return tuple(scale for scale in scales if scale == 1 or self.works_at(scale))

    def at_scale(self, scale: int) -> MethodName:
        """What it does at ``scale``: at 1, where every view is rendered, its denoisers alone."""
        if scale > 1:
            return self
        kept = [part if part in (*DENOISERS, OURS) else DENOISERS[0] for part in self.prefilters]
        return MethodName.parse("+".join(kept) or AS_RENDERED)

    def works_with(self, parallax: tuple[bool, bool]) -> bool:
        """Whether it works on a display whose views differ along those axes; networks need both."""
        return not self.network or all(parallax)

    def check_parallax(self, parallax: tuple[bool, bool]) -> None:
        """LfsrError unless it works on a display whose views differ along those axes."""
        if not self.works_with(parallax):
            raise LfsrError(f"method {self.text!r} needs views in two directions, but this display has one: "
                            f"choose a method without a network, such as {HORIZONTAL_METHOD!r}")

    def check_scale(self, scale: int) -> None:
        """LfsrError where it upscales nothing, but ``scale`` is above 1."""
        if scale > 1 and self.upscaler == AS_RENDERED:
            other = "+".join((*self.prefilters, PLAIN_METHOD, *((RECOVERY,) if self.recovers else ())))
            raise LfsrError(f"method {self.text!r} upscales nothing, but scale {scale} needs an upscaler: add one, as "
                            f"in {other!r}, or render at scale 1")

    def mixes(self, prefilter: str) -> bool:
        """Whether ``prefilter`` makes two images that its network mixes."""
        return prefilter == BOTH and self.network is not None and "second_base" in self.network.options

    def guide_notes(self, layers: Collection[str]) -> list[str]:
        """A sentence for the report if a denoiser lacks guides; ``layers``: those of the frame."""
        missing = [layer for layer in GUIDES if layer not in layers]
        guided = next((part for part in self.prefilters if part in GUIDED and not self.mixes(part)), None)
        if not guided or not missing:
            return []
        return [f"{guided} denoised without the layers {', '.join(missing)}, which this frame lacks: render it again "
                "with --layers albedo,normal"]


def default_method(parallax: tuple[bool, bool]) -> str:
    """The best method for a display whose views differ along those axes."""
    return DEFAULT_METHOD if all(parallax) else HORIZONTAL_METHOD


def layers_of(names: Collection[str]) -> tuple[str, ...]:
    """Auxiliary layers that several methods use, sorted."""
    return tuple(sorted({layer for name in names for layer in MethodName.parse(name).layers}))


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
    before = catalogue.NETWORKS[upscaler].after if upscaler in catalogue.NETWORKS else ()
    if before and not {*before} & {*prefilters}:
        raise LfsrError(f"method {text!r} needs {before[0]!r} before {upscaler!r}: use '{before[0]}+{upscaler}'")
