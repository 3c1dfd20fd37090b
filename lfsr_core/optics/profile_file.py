"""Write display profiles as TOML files."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

from lfsr_core.base.errors import LfsrError
from lfsr_core.base.files import atomic_path
from lfsr_core.optics.display import DisplayProfile, load_display


def write_profile(path: str | Path, profile: DisplayProfile) -> None:
    """Write ``profile`` as TOML, completely or not at all; LfsrError if ``load_display`` would not read it back."""
    path = Path(path)
    if path.suffix != ".toml":
        raise LfsrError(f"{path} cannot be a display profile, because its name does not end in .toml: add the ending")
    with atomic_path(path) as temporary:
        data = profile.to_dict()
        lines = _lines({"format": data.pop("format", 1), **data}, "")
        temporary.write_text("\n".join(lines) + "\n", encoding="utf-8")
        if load_display(temporary) != profile:
            raise LfsrError(f"display {profile.name!r} cannot be written so that it reads back the same: choose a "
                            "plainer name")


def _lines(data: dict[str, Any], table: str) -> list[str]:
    """Lines of TOML: the plain values of ``data``, then a table for each nested record."""
    plain = {key: value for key, value in data.items() if not isinstance(value, dict) and value is not None}
    lines = [f"{key} = {_value(value)}" for key, value in plain.items()]
    for key, value in data.items():
        if isinstance(value, dict):
            lines += ["", f"[{table}{key}]", *_lines(value, f"{table}{key}.")]
    return lines


def _value(value: Any) -> str:
    if isinstance(value, (list, tuple)):
        return f"[{', '.join(map(_value, value))}]"
    if isinstance(value, str):
        return json.dumps(value, ensure_ascii=False)  # TOML's basic strings have the same escapes
    return str(value).lower() if isinstance(value, bool) else repr(value)
