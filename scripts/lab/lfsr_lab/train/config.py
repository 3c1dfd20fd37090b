"""Configs of training runs: TOML files with known keys."""

from __future__ import annotations

import dataclasses
import tomllib
from collections.abc import Sequence
from pathlib import Path
from typing import Any, get_type_hints

from lfsr_core.errors import LfsrError, did_you_mean
from lfsr_core.files import read_bytes

CONFIG_FOLDER = Path(__file__).parent / "configs"
MAX_BYTES = 100_000  # of a config's file


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
        problems = (
            (self.crop % self.scale or self.crop <= 0, f"crop {self.crop} is not a multiple of scale {self.scale}",
             "choose one that is"),
            (self.schedule not in ("constant", "cosine"), f"schedule {self.schedule!r} is unknown",
             "choose constant or cosine"),
            (min(self.epochs, self.batch, self.crops_per_photograph) < 1, "epochs, batch and crops_per_photograph",
             "must be at least 1"),
            (not self.rate > 0 or self.adversarial < 0, f"rate {self.rate} or adversarial {self.adversarial}",
             "must be positive"),
        )
        for wrong, what, advice in problems:
            if wrong:
                raise LfsrError(f"training: {what}: {advice}")


def load_config(name: str, settings: Sequence[str] = ()) -> TrainConfig:
    """Read the config of a TOML file or of a built-in name such as "paper"; ``settings`` are "key=value".

    LfsrError for a missing file, an unknown key (with the nearest) or a wrong type.
    """
    values = _read_toml(name)
    for setting in settings:
        key, separator, text = setting.partition("=")
        if not separator:
            raise LfsrError(f"setting {setting!r} is not of the form key=value: write for example epochs=10")
        values[key.strip()] = _parse(text.strip())
    return _checked(values, name)


def _checked(values: dict[str, Any], name: str) -> TrainConfig:
    """Return the config of plain values; LfsrError for an unknown, missing or mistyped key."""
    hints = get_type_hints(TrainConfig)
    for key, value in values.items():
        if key not in hints:
            raise LfsrError(f"{name} has the unknown key {key!r}: {did_you_mean(key, hints, cutoff=0).rstrip()}")
        if hints[key] is float and type(value) is int:
            values[key] = float(value)
        elif type(value) is not hints[key]:
            raise LfsrError(f"{name} has {key} = {value!r}, expected a value of type {hints[key].__name__}")
    for field in dataclasses.fields(TrainConfig):
        if field.default is dataclasses.MISSING and field.name not in values:
            raise LfsrError(f"{name} has no {field.name!r}: add it or pass --set {field.name}=…")
    return TrainConfig(**values)


def builtin_configs() -> list[str]:
    """Names of the configs that ship with the package."""
    return sorted(path.stem for path in CONFIG_FOLDER.glob("*.toml"))


def _read_toml(name: str) -> dict[str, Any]:
    path = CONFIG_FOLDER / f"{name}.toml"
    path = path if path.exists() else Path(name)
    if not path.exists():
        raise LfsrError(f"there is no training config {name!r}: give a TOML file or one of "
                        f"{', '.join(builtin_configs())}")
    content = read_bytes(path, "a training config", MAX_BYTES)
    try:
        return tomllib.loads(content.decode("utf-8"))
    except (ValueError, RecursionError) as error:
        raise LfsrError(f"training config {path} cannot be read ({error}): correct it") from None


def _parse(text: str) -> Any:
    """Value of a command-line setting: parsed if it is TOML, else the text itself."""
    try:
        return tomllib.loads(f"value = {text}")["value"]
    except (ValueError, RecursionError):
        return text
