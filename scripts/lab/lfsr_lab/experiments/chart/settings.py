"""What one chart measures."""

from __future__ import annotations

import dataclasses
import importlib.util
from pathlib import Path

from lfsr_core.base.errors import LfsrError
from lfsr_core.optics.display import DisplayProfile, load_display
from lfsr_core.reconstruct.methods import COMPARED, DEFAULT_METHOD, UPSCALER, names
from lfsr_lab.experiments.chart.records import ChartSettings
from lfsr_lab.networks.comparators import NETWORKS

AS_RENDERED = "none"
DIRECT_METHODS = (AS_RENDERED, "oidn")


@dataclasses.dataclass(frozen=True, kw_only=True)
class Settings(ChartSettings):
    """One chart: what decides its figures, and how it is run. LfsrError for numbers that cannot be."""

    folder: Path  # output folder, with a folder per scene
    only_measure: bool = False  # new renders are refused
    times: bool = False  # what is not timed is timed
    device: str = "CPU"  # what Cycles renders on
    blender: str | None = None  # executable used instead of the one found

    def __post_init__(self) -> None:
        for name in ("spps", "direct_spps"):
            _check_samples(name, getattr(self, name))
        for name, least in (("seeds", 1), ("repeats", 1), ("render_repeats", 0), ("reference_spp", 2)):
            if getattr(self, name) < least:
                raise LfsrError(f"{name} is {getattr(self, name)}, but it must be {least} or more")
        if self.ours not in self.methods:
            raise LfsrError(f"our method {self.ours!r} is not among those measured, {', '.join(self.methods)}: "
                            "add it to --methods or choose another with --ours")
        self.profile.low_views(self.scale)  # refuses a scale that does not divide them

    @property
    def profile(self) -> DisplayProfile:
        """The display."""
        return load_display(self.display)

    @property
    def steps(self) -> int:
        """Renders and cells of a scene, with its reference."""
        return 1 + len(self.spps) * (1 + len(self.methods)) + len(self.direct_spps) * (1 + len(self.direct_methods))

    @property
    def figures(self) -> ChartSettings:
        """Return the part that decides the figures."""
        return ChartSettings(**{field.name: getattr(self, field.name) for field in dataclasses.fields(ChartSettings)})


def _check_samples(name: str, samples: tuple[int, ...]) -> None:
    if name == "spps" and not samples:
        raise LfsrError("there are no samples per pixel to measure at: give some with --spps, as in 1,4,16,64")
    if min(samples, default=1) < 1 or len(set(samples)) < len(samples):
        raise LfsrError(f"{name} are {', '.join(map(str, samples))}, but they must be different whole numbers from 1")


def default_methods() -> tuple[str, ...]:
    """Return the default, what it is compared with, and every upscaler alone and after the denoiser.

    Networks are among them where PyTorch is installed.
    """
    upscalers = [*names(UPSCALER), *(NETWORKS if importlib.util.find_spec("torch") else ())]
    found = [name for upscaler in upscalers if upscaler != AS_RENDERED for name in (upscaler, f"denoise+{upscaler}")]
    return tuple(dict.fromkeys([DEFAULT_METHOD, *COMPARED, *found]))
