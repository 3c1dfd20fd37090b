"""Networks of others that ours are compared with, by method name; this module does not import PyTorch."""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from lfsr_core.base.messages import LfsrError, did_you_mean

FOLDER = Path(__file__).parent / "weights"
SCALES = (2, 3, 4, 8)  # that every architecture has


@dataclasses.dataclass(frozen=True)
class Comparator:
    description: str  # one line
    weights: Mapping[int, Path]  # files, by the scale that each was trained for
    architecture: str  # its class, a name of ``networks.ARCHITECTURES``
    options: Mapping[str, Any]  # arguments of that class besides the scale
    stem: str  # of its weights' files
    whole: bool = False  # whether it sees the whole EIA as one image, instead of one EI at a time


def spec(name: str) -> Comparator:
    """Network of NETWORKS by name; LfsrError with the nearest name for another."""
    if name not in NETWORKS:
        raise LfsrError(f"there is no network {name!r}: {did_you_mean(name, NETWORKS, cutoff=0).rstrip()}")
    return NETWORKS[name]


def weights_path(name: str, scale: int, folder: str | Path = FOLDER) -> Path:
    """Path of a network's weights at a scale in ``folder``, whether the file exists or not."""
    return Path(folder) / f"{spec(name).stem}-x{scale}.safetensors"


def _comparator(stem: str, description: str, architecture: str, convolutions: int | None = None, *,
                whole: bool = False) -> Comparator:
    files = {scale: path for scale in SCALES if (path := FOLDER / f"{stem}-x{scale}.safetensors").exists()}
    options = {"convolutions": convolutions} if convolutions else {}
    return Comparator(description, files, architecture, options, stem, whole)


NETWORKS: dict[str, Comparator] = {
    "paper": _comparator("paper", "the paper's generator per EI, trained with MSE only", "PaperGenerator", 2),
    "paper-gan": _comparator("paper-gan", "the paper's generator per EI, trained with its discriminator",
                             "PaperGenerator", 2),
    **{f"paper-{n}": _comparator(f"paper-{n}", f"the paper's generator with {n} convolutions, MSE only",
                                 "PaperGenerator", n)
       for n in (3, 4, 5, 6)},
    "espcn": _comparator("espcn", "ESPCN per EI", "ESPCN"),
    "fsrcnn": _comparator("fsrcnn", "FSRCNN(56, 12, 4) per EI", "FSRCNN"),
    "fsrcnn-eia": _comparator("fsrcnn", "FSRCNN over the whole EIA: crosstalk between EIs", "FSRCNN",
                              whole=True),
    "paper-eia": _comparator("paper", "the paper's generator over the whole EIA: crosstalk between EIs",
                             "PaperGenerator", 2, whole=True)}
