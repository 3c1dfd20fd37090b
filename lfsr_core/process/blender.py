"""Find Blender, and build the command lines that start it."""

from __future__ import annotations

import dataclasses
import glob
import importlib.util
import os
import re
import shutil
import sys
from pathlib import Path
from typing import Protocol

from lfsr_core.base.errors import LfsrError
from lfsr_core.process.child import output_of

PACKAGES = Path(__file__).resolve().parents[2]  # folder of lfsr_core
OLDEST_BLENDER, SECONDS_TO_ANSWER = (4, 5), 60
# Where installers and Steam put Blender. What the Microsoft Store and snap install is on PATH.
PLACES = {
    "win32": ("$ProgramFiles/Blender Foundation/Blender */blender.exe",
              "${ProgramFiles(x86)}/Steam/steamapps/common/Blender/blender.exe"),
    "darwin": ("/Applications/Blender*.app/Contents/MacOS/Blender",
               "~/Applications/Blender*.app/Contents/MacOS/Blender",
               "~/Library/Application Support/Steam/steamapps/common/Blender/Blender.app/Contents/MacOS/Blender"),
    "linux": ("~/.steam/steam/steamapps/common/Blender/blender",)}


class Starts(Protocol):
    """Anything that knows how to start Blender."""

    def command(self, *job_files: Path) -> list[str]:
        """Return the command line that runs the render jobs in ``job_files`` one after the other."""


@dataclasses.dataclass(frozen=True)
class Blender:
    """How to start Blender."""

    executable: str | None = None  # path of Blender, None for the bpy wheel of this Python

    def command(self, *job_files: Path) -> list[str]:
        """Return the command line that runs the render jobs in ``job_files`` one after the other."""
        spec = importlib.util.find_spec("blender_addon")  # which is not imported here
        if spec is None or not spec.submodule_search_locations:
            raise LfsrError("the package blender_addon is not installed beside lfsr_core: install LFSR again")
        folder = next(iter(spec.submodule_search_locations))
        return self.script_command(Path(folder, "headless", "from_sources.py"), *map(str, job_files))

    def script_command(self, script: Path, *arguments: str) -> list[str]:
        """Return the command line that runs a Python ``script`` inside Blender."""
        if self.executable is None:
            # -P: modules beside the script must not hide others of the same name.
            return [sys.executable, "-P", str(script), "--", *arguments]
        return [self.executable, "--background", "--factory-startup", "--python-exit-code", "1",
                "--python", str(script), "--", *arguments]


def find_blender(executable: str | None = None) -> Blender:
    """Return the Blender asked for, else the bpy wheel, else ``blender`` on PATH, else the newest that is installed.

    LfsrError if there is none.
    """
    if executable is None and importlib.util.find_spec("bpy") is not None:
        return Blender()
    if executable and executable.rstrip("/").endswith(".app") and os.path.isdir(executable):  # a bundle of macOS
        executable = os.path.join(executable, "Contents", "MacOS", "Blender")
    path = shutil.which(executable or "blender")
    if path is None and not executable:
        patterns = (os.path.expanduser(os.path.expandvars(place)) for place in PLACES.get(sys.platform, ()))
        path = max((path for pattern in patterns for path in glob.glob(pattern)), default=None,
                   key=lambda path: [int(number) for pair in re.findall(r"(\d+)\.(\d+)", path) for number in pair])
    if path is None:
        raise LfsrError(
            f"blender executable {executable!r} was not found: give the path of Blender 4.5 or newer" if executable
            else "Blender was not found, neither the bpy package nor an installed Blender: "
                 "install the 'blender' extra or give --blender PATH")
    try:
        _, answer = output_of([path, "--version"], seconds=SECONDS_TO_ANSWER)
    except OSError as error:
        raise LfsrError(f"{path} cannot be started ({error}): give another with --blender PATH") from None
    version = re.search(r"Blender (\d+)\.(\d+)", answer)
    if version is None:
        raise LfsrError(f"{path} does not say that it is Blender: give the executable with --blender PATH")
    if (int(version[1]), int(version[2])) < OLDEST_BLENDER:
        raise LfsrError(f"{path} is {version[0]}, but 4.5 or newer is needed: "
                        "give another with --blender PATH")
    return Blender(path)
