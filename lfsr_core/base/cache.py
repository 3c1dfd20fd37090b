"""The user's cache folder, or the folder LFSR_CACHE."""

from __future__ import annotations

import os
import sys
from pathlib import Path


def cache_folder() -> Path:
    """Folder in which this user's programs store data that they can compute again."""
    if "LFSR_CACHE" in os.environ:
        return Path(os.environ["LFSR_CACHE"])
    if sys.platform == "win32":
        return Path(os.environ.get("LOCALAPPDATA", Path.home())) / "lfsr"
    if sys.platform == "darwin":
        return Path.home() / "Library/Caches/lfsr"
    return Path(os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache") / "lfsr"
