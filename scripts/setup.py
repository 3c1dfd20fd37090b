"""Make the Python environment of this clone, once: python scripts/setup.py [EXTRA,EXTRA...]

The extra "lab" is the laboratory. The environment is .venv at the root, or $LFSR_VENV; its folder is printed on
standard output. Needs Python 3.11 on the machine, for which the bpy wheel is made.
"""

from __future__ import annotations

import hashlib
import os
import shutil
import subprocess
import sys
from collections.abc import Sequence
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
INPUTS = ("pyproject.toml", "scripts/lab/pyproject.toml", "scripts/constraints.txt")
VERSION = (3, 11)
USUAL = "blender,flip"  # extras of someone who makes images
# Asked of each candidate: can it make environments, and is it of that version?
SUITS = f"import sys, venv, ensurepip; ensurepip.version(); sys.exit(sys.version_info[:2] != {VERSION})"
LOADS = "import ctypes, sys; ctypes.CDLL(sys.argv[1])"
# What the bpy wheel links against on Linux and does not bring (ldd bpy/__init__.so), with the Debian 12 packages.
LIBRARIES = {"libGL.so.1": "libgl1", "libX11.so.6": "libx11-6", "libXext.so.6": "libxext6",
             "libXfixes.so.3": "libxfixes3", "libXi.so.6": "libxi6", "libXrender.so.1": "libxrender1",
             "libxkbcommon.so.0": "libxkbcommon0", "libSM.so.6": "libsm6", "libICE.so.6": "libice6"}
GET_PYTHON = {"win32": "winget install Python.Python.3.11", "darwin": "brew install python@3.11"}


class SetupError(Exception):
    """What is missing, with the command that installs it."""


def environment(extras: str = "blender") -> Path:
    """Make the environment with ``extras`` if it is not there; its folder. SetupError where something is missing."""
    folder = Path(os.environ.get("LFSR_VENV", ROOT / ".venv"))
    python = find_python()
    packages = missing_packages(python) if "blender" in extras.split(",") else []
    if python is None:
        raise SetupError("Python 3.11 is missing. Install it with\n  " + GET_PYTHON.get(
            sys.platform, _apt(["python3.11", "python3.11-venv", *packages])))
    if packages:
        raise SetupError(f"System libraries are missing. Install them on Debian 12 with\n  {_apt(packages)}")
    stamp = folder / f".lfsr-{_state(extras)}"
    if not stamp.exists():
        install(python, folder, extras)
        stamp.touch()
    return folder


def find_python() -> list[str] | None:
    """Command of the first Python 3.11 that can make environments; None without one."""
    candidates = ([sys.executable], ["python3.11"], ["/usr/bin/python3.11"], ["python3"], ["py", "-3.11"])
    return next((command for command in candidates if _works([*command, "-c", SUITS])), None)


def missing_packages(python: Sequence[str] | None) -> list[str]:
    """Debian packages of the libraries that the loader does not find; none on other systems."""
    if not sys.platform.startswith("linux"):
        return []
    asked = python or [sys.executable]
    return [package for name, package in LIBRARIES.items() if not _works([*asked, "-c", LOADS, name])]


def install(python: Sequence[str], folder: Path, extras: str) -> None:
    """Make the environment and install the clone into it; CalledProcessError where a step fails."""
    print(f"Making the environment in {folder} (once; the Blender wheel is about 350 MB)", file=sys.stderr, flush=True)
    if not program(folder, "python").exists():
        _run([*python, "-m", "venv", str(folder)])
        # A new pip takes four fifths of the time; without it the one that came with Python does the same.
        subprocess.run([program(folder, "python"), "-m", "pip", "install", "-qq", "--upgrade", "pip"],
                       stdout=sys.stderr, stderr=subprocess.DEVNULL, check=False)
    product = ",".join(extra for extra in extras.split(",") if extra != "lab")
    sources = ["--editable", f"{ROOT}[{product}]"]
    if "lab" in extras.split(","):
        sources += ["--editable", f"{ROOT / 'scripts' / 'lab'}[training]"]
    # Python compiles what it imports, unless told to keep nothing: compiling all takes two fifths of the time.
    lazily = [] if sys.dont_write_bytecode else ["--no-compile"]
    _run([str(program(folder, "python")), "-m", "pip", "install", "-qq", "--disable-pip-version-check", *lazily,
          "--constraint", str(ROOT / "scripts" / "constraints.txt"), *sources])


def program(folder: Path, name: str) -> Path:
    """Path of a program of the environment in ``folder``."""
    return folder / "Scripts" / f"{name}.exe" if os.name == "nt" else folder / "bin" / name


def ready(extras: str) -> Path:
    """As ``environment``, for the other scripts: what is missing ends the program with exit code 2."""
    try:
        return environment(extras)
    except SetupError as error:
        print(error, file=sys.stderr)
        sys.exit(2)
    except subprocess.CalledProcessError as error:
        sys.exit(error.returncode)


def run(command: Sequence[object]) -> None:
    """Run a command in the clone; a failure ends the program with its exit code, Ctrl-C with 130."""
    sys.stdout.flush()
    try:
        code = subprocess.run(list(map(str, command)), cwd=ROOT, check=False).returncode
    except KeyboardInterrupt:
        code = 130
    if code:
        sys.exit(code)


def _state(extras: str) -> str:
    """Digest of what says what to install, and where: installed once per state."""
    content = b"".join((ROOT / name).read_bytes() for name in INPUTS) + f"{extras} {ROOT}\n".encode()
    return hashlib.sha256(content).hexdigest()[:16]


def _apt(packages: Sequence[str]) -> str:
    return f"sudo apt-get update && sudo apt-get install -y {' '.join(packages)}"


def _works(command: Sequence[str]) -> bool:
    if shutil.which(command[0]) is None:
        return False
    return subprocess.run(command, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL, check=False).returncode == 0


def _run(command: Sequence[str]) -> None:
    """Run a step with its output on standard error: standard output is the folder's."""
    subprocess.run(command, stdout=sys.stderr, check=True)


if __name__ == "__main__":
    print(ready(sys.argv[1] if len(sys.argv) > 1 else USUAL))
