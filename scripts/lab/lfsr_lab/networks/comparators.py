"""Networks of others that ours are compared with, by method name; this module does not import PyTorch."""

from __future__ import annotations

from pathlib import Path

from lfsr_core.reconstruct.networks.spec import NetworkSpec

FOLDER = Path(__file__).parent / "weights"
PER_IMAGE = "lfsr_lab.networks.upscalers:PhotographUpscaler"
WHOLE_EIA = "lfsr_lab.networks.upscalers:WholeEIAUpscaler"


def _comparator(description: str, architecture: str, convolutions: int | None = None, *, upscaler: str = PER_IMAGE,
                weights: str | None = None) -> NetworkSpec:
    options = {"convolutions": convolutions} if convolutions else {}
    return NetworkSpec(description, architecture, options, upscaler=upscaler, weights=weights, folder=FOLDER)


NETWORKS: dict[str, NetworkSpec] = {
    "paper": _comparator("the paper's generator per EI, trained with MSE only", "PaperGenerator", 2),
    "paper-gan": _comparator("the paper's generator per EI, trained with its discriminator", "PaperGenerator", 2),
    **{f"paper-{n}": _comparator(f"the paper's generator with {n} convolutions, MSE only", "PaperGenerator", n)
       for n in (3, 4, 5, 6)},
    "espcn": _comparator("ESPCN per EI", "ESPCN"),
    "fsrcnn": _comparator("FSRCNN(56, 12, 4) per EI", "FSRCNN"),
    "fsrcnn-eia": _comparator("FSRCNN over the whole EIA: crosstalk between EIs", "FSRCNN", upscaler=WHOLE_EIA,
                              weights="fsrcnn"),
    "paper-eia": _comparator("the paper's generator over the whole EIA: crosstalk between EIs", "PaperGenerator", 2,
                             upscaler=WHOLE_EIA, weights="paper"),
}
