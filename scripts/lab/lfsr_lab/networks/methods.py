"""Names of methods whose upscaler may be a network of ``comparators.NETWORKS``, as "oidn+fsrcnn"."""

from __future__ import annotations

import dataclasses
import hashlib
from pathlib import Path

import numpy as np

from lfsr_core.base.arrays import Array
from lfsr_core.base.messages import LfsrError, did_you_mean
from lfsr_core.frames.frame import Finish
from lfsr_core.optics.rays import from_elemental_images
from lfsr_core.reconstruct.methods import FAST_METHOD, METHODS, PLAIN_METHOD, MethodName, load_method
from lfsr_core.reconstruct.methods.denoise import WEIGHTS
from lfsr_core.reconstruct.upscaler import LowResEIA, Upscaler, decode, encode, interpolated
from lfsr_lab.networks.comparators import NETWORKS, Comparator

WHOLE_CUBIC, MARGIN = "bicubic-eia", 4  # cubic interpolation of the whole EIA; half the widest kernel
COMPARED = (f"oidn+{PLAIN_METHOD}", "oidn+pool", FAST_METHOD)  # what studies compare the default with

class WholeInterpolation(Upscaler):
    """Cubic over the whole EIA as one photograph: it shows the crosstalk that per-EI methods avoid."""

    kernel = "cubic"

    def __call__(self, low: LowResEIA, lenses: Array) -> Array:
        across, down = (MARGIN * factor for factor in low.factors)
        whole = np.pad(from_elemental_images(low.color), ((MARGIN, MARGIN), (MARGIN, MARGIN), (0, 0)), mode="edge")
        height, width = low.color.shape[2:4]
        around = np.lib.stride_tricks.sliding_window_view(whole, (height + 2 * MARGIN, width + 2 * MARGIN, 3))
        rows, columns = np.asarray(lenses).T
        seen = encode(around[rows * height, columns * width, 0])
        return decode(interpolated(seen, self.kernel, low.factors))[:, down:-down, across:-across]


@dataclasses.dataclass(frozen=True)
class LabMethod:
    """A method of the product, or one with a network as its upscaler."""

    text: str  # as written
    name: MethodName  # of the product's part; plain interpolation stands for a network
    network: str | None  # a name of NETWORKS

    @classmethod
    def parse(cls, text: str) -> LabMethod:
        """Parse a name; LfsrError for an unknown or impossible one."""
        *parts, last = (part.strip() for part in text.split("+"))
        own = (*NETWORKS, WHOLE_CUBIC)
        for part in (*parts, last):
            if part not in METHODS and part not in own:
                hint = did_you_mean(part, [*METHODS, *own], cutoff=0.4)
                raise LfsrError(f"unknown method {part!r}: {hint}Choose from {', '.join([*METHODS, *own])}, "
                                "joined by '+'")
        network = last if last in NETWORKS else None
        if any(part in own for part in parts):
            raise LfsrError(f"method {text!r} has a network before its last part: put it last")
        name = MethodName.parse("+".join([*parts, PLAIN_METHOD]) if last in own else text)
        load_method(name)  # refuses what cannot be put together
        return cls(text, name, network)

    @property
    def comparator(self) -> Comparator | None:
        return NETWORKS[self.network] if self.network else None

    @property
    def weights_digest(self) -> str:
        """SHA-256 of the shipped weights, of a network for all scales; empty without any."""
        files = [path for _, path in sorted(self.comparator.weights.items())] if self.comparator else []
        files += [WEIGHTS] if "denoise" in self.name.prefilters and WEIGHTS.exists() else []
        return hashlib.sha256(b"".join(map(Path.read_bytes, files))).hexdigest() if files else ""

    def works_at(self, scale: int) -> bool:
        """Whether it can finish a render at ``scale``; a network needs weights for it."""
        return scale in self.comparator.weights if self.comparator else self.name.works_at(scale)

    def works_with(self, parallax: tuple[bool, bool]) -> bool:
        """Whether it works on a display whose views differ along those axes; networks need both."""
        return self.network is None or all(parallax)

    def check_parallax(self, parallax: tuple[bool, bool]) -> None:
        """LfsrError unless it works on a display whose views differ along those axes."""
        if not self.works_with(parallax):
            raise LfsrError(f"method {self.text!r} needs views in two directions, but this display has one: choose a "
                            "method without a network")

    def ready(self, weights: Path | None = None, device: str = "auto") -> Ready:
        """Return how to finish, and the network where it has one, which loads at its first call.

        ``weights``: of the network, None for the shipped ones. LfsrError where a package is missing.
        """
        if self.comparator is None or self.network is None:
            return Finish(self.name.text), WholeInterpolation() if self.text.strip().endswith(WHOLE_CUBIC) else None
        try:
            from lfsr_lab.networks.upscalers import PhotographUpscaler, WholeEIAUpscaler
        except ModuleNotFoundError as error:
            if (error.name or "").startswith("lfsr_"):
                raise
            raise LfsrError(f"networks need the Python package {error.name!r}, which is not installed: install "
                            "lfsr-lab[training] or choose a method without a network") from None
        kind = WholeEIAUpscaler if self.comparator.whole else PhotographUpscaler
        return Finish(self.name.text), kind(self.network, weights=weights, device=device)


Ready = tuple[Finish, Upscaler | None]  # a method's finish, and its network where it has one


def ready(text: str) -> Ready:
    """Return how to finish by the method of a name, see ``LabMethod.ready``."""
    return LabMethod.parse(text).ready()
