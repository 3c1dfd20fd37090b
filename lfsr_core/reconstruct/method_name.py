"""Names of methods, parsed once into a value that everything carries.

A name is prefilters and one upscaler joined by "+", as ``oidn+bicubic``; "epi" after
them brings back detail that they lost, as in ``oidn+bicubic+epi``.
"""

from __future__ import annotations

import dataclasses
import hashlib
from collections.abc import Collection, Sequence
from pathlib import Path

from lfsr_core.errors import LfsrError, did_you_mean
from lfsr_core.reconstruct.methods import denoise, epipolar
from lfsr_core.reconstruct.methods.guides import GUIDES
from lfsr_core.reconstruct.networks import catalogue

CLASSICAL = {
    "nearest": "each view repeated",
    "bilinear": "linear inside each elemental image",
    "bicubic": "cubic inside each elemental image",
    "lanczos": "8-tap Lanczos inside each elemental image",
    "bicubic-eia": "cubic over the whole array: shows crosstalk",
    "none": "no upscaling, for renders at scale 1",
}
BOTH = "oidn-both"
PREFILTERS = {
    "oidn": "Open Image Denoise on the whole array",
    "oidn-fast": "the same in half the time, a little less accurate",
    "oidn-guided": "Open Image Denoise with albedo and normal",
    "oidn-half": "the same at half the resolution of views where that shows the same",
    BOTH: "oidn-half and oidn-guided: for a network that mixes them, else their mean",
    "oidn-render": "Open Image Denoise by Cycles, on the device that renders: for GPUs",
}
AS_RENDERED, RECOVERY = "none", "epi"
PANEL_METHODS = ("oidn", "oidn-fast", AS_RENDERED)  # of a render of a panel's subpixels, the default first
GUIDED = ("oidn-guided", "oidn-half", BOTH)
DENOISED = "oidn-render"
DENOISERS = ("oidn", "oidn-fast", "oidn-guided", "oidn-half")  # prefilters that make one picture
UPSCALERS = {**CLASSICAL, **catalogue.NAMES}
METHODS = {**UPSCALERS, **PREFILTERS, RECOVERY: "last: detail that was taken for noise comes back along epipolar lines"}
PLAIN_METHOD = "bilinear"  # after OIDN more accurate than bicubic, see docs/results/measurements.md
# What our networks must beat.
PLAIN_CHAINS = (*(f"{name}+{PLAIN_METHOD}" for name in DENOISERS),
                *(f"{name}+{PLAIN_METHOD}+{RECOVERY}" for name in (DENOISERS[0], BOTH)))
DEFAULT_METHOD = "oidn-both+refine+epi"  # see docs/results/networks.md
HORIZONTAL_METHOD = "oidn+bilinear+epi"  # the default where views differ along one axis only
STEPS_OF_A_NETWORK = 3


@dataclasses.dataclass(frozen=True, order=True)
class MethodName:
    """The name of a method and what follows from it; ``MethodName.parse`` makes one."""

    text: str  # the name as written, as in "oidn+bicubic+epi"
    prefilters: tuple[str, ...]  # what is done to the whole low-resolution EIA first, in order
    upscaler: str  # name of the one upscaler; "none" where every view was rendered
    recovers: bool  # whether "epi" brings back lost detail

    @classmethod
    def parse(cls, text: str | MethodName) -> MethodName:
        """Name of a text such as "bicubic" or "oidn+bicubic"; "oidn" alone upscales nothing.

        LfsrError for an unknown part, with the nearest name, or a wrong order.
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
    def network(self) -> catalogue.NetworkSpec | None:
        """The catalogue's entry of the upscaler, None where it is no network."""
        return catalogue.NETWORKS.get(self.upscaler)

    @property
    def networks(self) -> tuple[str, ...]:
        """Parts that are networks."""
        return (self.upscaler,) if self.network else ()

    @property
    def layers(self) -> tuple[str, ...]:
        """Auxiliary layers that some part looks at, sorted."""
        guides = GUIDES if set(GUIDED) & set(self.prefilters) else ()
        denoised = ("denoised",) if DENOISED in self.prefilters else ()
        return tuple(sorted({*guides, *denoised, *(self.network.layers if self.network else ())}))

    @property
    def versions(self) -> dict[str, int]:
        """Versions of what it is made of, weights aside: figures measured with others are out of date."""
        return {**({"denoiser": denoise.VERSION} if self.prefilters else {}),
                **({RECOVERY: epipolar.VERSION} if self.recovers else {})}

    @property
    def steps(self) -> int:
        """How many steps it has, the measure of its simplicity; a network counts for three."""
        upscaling = 0 if self.upscaler == AS_RENDERED else STEPS_OF_A_NETWORK if self.network else 1
        return len(self.prefilters) + upscaling + self.recovers

    @property
    def weights_digest(self) -> str:
        """SHA-256 over the shipped weights that it may use, at any scale; empty where it has none."""
        stem = self.network and (self.network.weights or self.upscaler)
        files = sorted(self.network.folder.glob(f"{stem}-x*.safetensors")) if self.network else []
        return hashlib.sha256(b"".join(map(Path.read_bytes, files))).hexdigest() if files else ""

    def untrained(self, scale: int) -> tuple[str, ...]:
        """Networks that have no weights for ``scale``."""
        return tuple(name for name in self.networks if scale not in catalogue.trained_scales(name))

    def works_at(self, scale: int) -> bool:
        """Whether it upscales by ``scale``, with networks trained for that."""
        return self.upscaler != AS_RENDERED and not self.untrained(scale)

    def works_with(self, parallax: tuple[bool, bool]) -> bool:
        """Whether it works on a display whose views differ along those axes: networks want both."""
        return not self.network or all(parallax)

    def check_parallax(self, parallax: tuple[bool, bool]) -> None:
        """LfsrError where it does not work on a display whose views differ along those axes."""
        if not self.works_with(parallax):
            raise LfsrError(f"method {self.text!r} needs views in two directions, but this display has one: "
                            f"choose a method without a network, as {HORIZONTAL_METHOD!r}")

    def check_scale(self, scale: int) -> None:
        """LfsrError where it upscales nothing, but the render's ``scale`` asks for that."""
        if scale > 1 and self.upscaler == AS_RENDERED:
            other = "+".join((*self.prefilters, PLAIN_METHOD, *((RECOVERY,) if self.recovers else ())))
            raise LfsrError(f"method {self.text!r} upscales nothing, but what is rendered at scale {scale} needs that: "
                            f"add an upscaler, as in {other!r}, or render at scale 1")

    def mixes(self, prefilter: str) -> bool:
        """Whether ``prefilter`` makes two pictures of which its network makes one."""
        return prefilter == BOTH and self.network is not None and self.network.mixes

    def without_upscaler(self) -> MethodName:
        """What is left of it for a render of every view: its denoisers."""
        kept = [part if part in DENOISERS else DENOISERS[0] for part in self.prefilters]
        return MethodName.parse("+".join(kept) or AS_RENDERED)

    def guide_notes(self, layers: Collection[str]) -> list[str]:
        """For the report: a sentence if it would be guided by layers beside ``layers``, those that a frame has."""
        missing = [layer for layer in GUIDES if layer not in layers]
        guided = next((part for part in self.prefilters if part in GUIDED and not self.mixes(part)), None)
        if not guided or not missing:
            return []
        return [f"{guided} is guided by the layers {', '.join(missing)}, which this frame lacks: it was denoised "
                "without them; render it again with --layers albedo,normal"]


def default_method(parallax: tuple[bool, bool]) -> str:
    """The best method there is for a display whose views differ along those axes."""
    return DEFAULT_METHOD if all(parallax) else HORIZONTAL_METHOD


def layers_of(names: Collection[str]) -> tuple[str, ...]:
    """Auxiliary layers to render for several methods, sorted."""
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
        raise LfsrError(f"method {text!r} has nothing before {RECOVERY!r}: use '{PLAIN_METHOD}+{RECOVERY}'")
    before = catalogue.NETWORKS[upscaler].after if upscaler in catalogue.NETWORKS else ()
    if before and not {*before} & {*prefilters}:
        raise LfsrError(f"method {text!r} needs {before[0]!r} before {upscaler!r}: use '{before[0]}+{upscaler}'")
