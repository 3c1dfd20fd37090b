"""Configs of training runs: TOML files with known keys."""

from __future__ import annotations

import dataclasses
import math
import sys
import tomllib
from collections.abc import Sequence
from pathlib import Path
from typing import get_type_hints

from lfsr_core.base.messages import LfsrError, did_you_mean
from lfsr_core.base.system import read_bytes, without_advice

CONFIG_FOLDER = Path(__file__).parent / "configs"
DENOISER = "denoiser"
MAX_BYTES = 100_000  # of a config's file
MOST = 10**9
RANGES: dict[str, tuple[float, float]] = {
    "scale": (1, 16), "seed": (0, 2**32 - 1), "crop": (1, 8192), "crops_per_photograph": (1, MOST), "epochs": (1, MOST),
    "steps_per_epoch": (1, MOST), "batch": (1, MOST), "rate": (1e-12, 10), "adversarial": (0, 1e6),
    "validate_every": (1, MOST), "checkpoint_every": (1, MOST), "count": (0, MOST), "side": (1, 8192),
    "error_weight": (0, 1e6)}


@dataclasses.dataclass(frozen=True)
class TrainConfig:
    """Training of a comparator on photographs."""

    network: str
    photographs: str  # folder of images
    validation: str = ""  # the same, for validation
    scale: int = 4
    seed: int = 0
    crop: int = 256  # side of a high-resolution crop in pixels
    crops_per_photograph: int = 16  # in an epoch
    epochs: int = 100
    batch: int = 8
    rate: float = 1e-4  # Adam's
    schedule: str = "constant"  # or "cosine" to 0
    adversarial: float = 0.0  # weight of the adversarial term; 0 trains without a discriminator
    validate_every: int = 10  # epochs
    checkpoint_every: int = 10  # epochs
    # Initial weights of the same architecture, as for a generator before adversarial training (SRGAN, arXiv
    # 1609.04802, section 3.2); empty: random ones.
    start: str = ""

    def __post_init__(self) -> None:
        _check_numbers(self)
        if self.crop % self.scale:
            raise LfsrError(f"training: crop {self.crop} is not a multiple of scale {self.scale}: choose one that is")
        if self.schedule not in ("constant", "cosine"):
            raise LfsrError(f"training: schedule {self.schedule!r} is unknown: choose constant or cosine")


@dataclasses.dataclass(frozen=True)
class DenoiserConfig:
    """Training of the denoiser that Open Image Denoise runs, on rendered scenes."""

    network: str
    scenes: str  # folder of training_scenes.py
    count: int = 0  # of scenes to train on, 0 for all
    size: str = "base"  # or "small"
    start: str = "stock"  # the library's own weights, a TZA file, or "" for random ones
    error_weight: float = 2.0  # of the absolute error beside 1 - SSIM
    side: int = 192  # of a crop in pixels
    batch: int = 1  # crops of a step; 32 keep a GPU busy
    seed: int = 1
    epochs: int = 150
    steps_per_epoch: int = 100
    rate: float = 2e-4  # Adam's
    validate_every: int = 5  # epochs
    checkpoint_every: int = 5  # epochs

    def __post_init__(self) -> None:
        if self.size not in ("base", "small"):
            raise LfsrError(f"training: size {self.size!r} is unknown: choose base or small")
        _check_numbers(self)


def _check_numbers(config: TrainConfig | DenoiserConfig) -> None:
    """LfsrError for a number that nothing can be trained with."""
    for name, (least, most) in RANGES.items():
        value = getattr(config, name, least)
        if not least <= value <= most:
            raise LfsrError(f"training: {name} is {value!r}, but it must be between {least} and {most}")


def load_config(name: str, settings: Sequence[str] = ()) -> TrainConfig | DenoiserConfig:
    """Read the config of a TOML file or of a built-in name such as "paper"; ``settings`` are "key=value".

    LfsrError for a missing file, an unknown key (with the nearest) or a wrong type.
    """
    path = CONFIG_FOLDER / f"{name}.toml"
    path = path if path.exists() else Path(name)
    if not path.exists():
        raise LfsrError(f"there is no training config {name!r}: give a TOML file or one of "
                        f"{', '.join(builtin_configs())}")
    content = read_bytes(path, "a training config", MAX_BYTES)
    try:
        values = tomllib.loads(content.decode("utf-8"))
    except (ValueError, RecursionError) as error:
        raise LfsrError(f"training config {path} cannot be read ({without_advice(error)}): correct it") from None
    for setting in settings:
        key, separator, text = setting.partition("=")
        if not separator:
            raise LfsrError(f"setting {setting!r} is not of the form key=value: write for example epochs=10")
        try:
            values[key.strip()] = tomllib.loads(f"value = {text.strip()}")["value"]
        except (ValueError, RecursionError):  # no TOML: the text itself
            values[key.strip()] = text.strip()
    kind = DenoiserConfig if values.get("network") == DENOISER else TrainConfig
    hints = get_type_hints(kind)
    for key, value in values.items():
        if key not in hints:
            raise LfsrError(f"{name} has the unknown key {key!r}: {did_you_mean(key, hints, cutoff=0).rstrip()}")
        if hints[key] is float and type(value) is int:
            values[key] = float(value) if abs(value) < sys.float_info.max else math.inf
        elif type(value) is not hints[key]:
            raise LfsrError(f"{name} has {key} = {value!r}, expected a value of type {hints[key].__name__}")
    for field in dataclasses.fields(kind):
        if field.default is dataclasses.MISSING and field.name not in values:
            raise LfsrError(f"{name} has no {field.name!r}: add it or pass --set {field.name}=…")
    return kind(**values)


def builtin_configs() -> list[str]:
    return sorted(path.stem for path in CONFIG_FOLDER.glob("*.toml"))
