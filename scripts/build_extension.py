"""Build the Blender extension: python scripts/build_extension.py --output DIR

Stages the add-on, its manifest and wheels in a temporary folder, then builds and
validates the zip with Blender's own extension tool, which the bpy wheel carries.
Wheels for every platform are fetched by pip from the index it is configured with;
the extension itself never runs pip and never uses the network. DIR gets finished,
valid zips or nothing.
"""

from __future__ import annotations

import argparse
import dataclasses
import importlib.util
import re
import shutil
import subprocess
import sys
import tempfile
import tomllib
from collections.abc import Sequence
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

from lfsr_core import __version__
from lfsr_core.errors import LfsrError
from lfsr_core.files import atomic_path

ROOT = Path(__file__).resolve().parents[1]
EXTENSION_TOOL = "*/scripts/addons_core/bl_pkg/cli/blender_ext.py"
MANIFEST = "blender_manifest.toml"
NOT_SOURCES = shutil.ignore_patterns("__pycache__", ".*")
CORE_FILES = ("pyproject.toml", "README.md", "LICENSE")
# Blender 4.5 and 5.0 run on Python 3.11, 5.2 on 3.13.
PYTHONS = ("3.11", "3.13")
# Platforms by Blender's name, with the names that wheels for it may have. Blender 4.5 needs glibc 2.28 and macOS 11.
PLATFORMS = {
    "linux-x64": ("manylinux_2_28_x86_64", "manylinux_2_17_x86_64", "manylinux2014_x86_64"),
    "windows-x64": ("win_amd64",),
    "macos-arm64": ("macosx_11_0_arm64",),
}
# One zip for all platforms, unless it would be a burden to download.
LARGEST_SINGLE_ZIP = 100e6


@dataclasses.dataclass(frozen=True)
class Wheel:
    """A package that the second stage imports and Blender's Python does not bring, and what for."""

    name: str
    reason: str


RUNTIME_WHEELS = (
    Wheel("flip-evaluator", "mean FLIP after 'Render reference + SSIM'; 0.4 MB"),
    Wheel("threadpoolctl", "one BLAS thread per worker: cores would wait for each other without it; 0.03 MB"),
)
# Left out, since Blender brings them: NumPy, OpenImageIO, OpenColorIO, Open Image Denoise (libOpenImageDenoise, read
# by lfsr_core/oidn.py; the pyoidn wheel would add 48 to 88 MB per platform). Left out, since our networks run in NumPy:
# ONNX Runtime, 15 to 24 MB per platform and Python. docs/guide/extension.md has the measurements.


def main(arguments: Sequence[str] | None = None) -> int:
    """Build as the command line says; the exit code."""
    parser = argparse.ArgumentParser(description="Build the Blender extension.")
    parser.add_argument("--output", type=Path, required=True, metavar="DIR", help="where the zip goes")
    parser.add_argument("--platform", action="append", choices=PLATFORMS, help="only this one (repeatable)")
    parser.add_argument("--python", action="append", choices=PYTHONS, help="only this version (repeatable)")
    asked = parser.parse_args(arguments)
    try:
        for path in build(asked.output, asked.platform or tuple(PLATFORMS), asked.python or PYTHONS):
            print(f"{path}: {path.stat().st_size / 1e6:.1f} MB, valid")
    except LfsrError as error:
        print(f"build_extension: {error}", file=sys.stderr)
        return 2
    return 0


def build(output: Path, platforms: Sequence[str] = tuple(PLATFORMS), pythons: Sequence[str] = PYTHONS) -> list[Path]:
    """Build and validate the zips of ``platforms`` in ``output``; their paths. LfsrError where a step fails."""
    tool = find_tool()
    with tempfile.TemporaryDirectory(prefix="lfsr-extension-") as name:
        staged, built = Path(name, "staged"), Path(name, "built")
        built.mkdir()
        stage_addon(staged)
        wheels = collect_wheels(staged / "wheels", platforms, pythons)
        write_manifest(staged / MANIFEST, platforms, wheels)
        split = sum(path.stat().st_size for path in wheels) > LARGEST_SINGLE_ZIP
        run("Blender's extension tool", [sys.executable, str(tool), "build", "--source-dir", str(staged),
                                         "--output-dir", str(built), *(["--split-platforms"] if split else [])])
        zips = sorted(built.glob("*.zip"))
        for path in zips:
            run("Blender's extension tool", [sys.executable, str(tool), "validate", str(path)])
        return [publish(path, output) for path in zips]


def find_tool() -> Path:
    """Blender's extension tool in the bpy wheel, which is not imported; LfsrError without one."""
    spec = importlib.util.find_spec("bpy")
    for folder in spec.submodule_search_locations or () if spec else ():
        for path in Path(folder).glob(EXTENSION_TOOL):
            return path
    raise LfsrError("Blender's extension tool was not found, it comes with the package bpy: install lfsr[blender]")


def stage_addon(staged: Path) -> None:
    """Copy the add-on's own files: the folder is the extension's package."""
    shutil.copytree(ROOT / "blender_addon", staged, ignore=NOT_SOURCES)
    shutil.copy(ROOT / "LICENSE", staged)


def collect_wheels(folder: Path, platforms: Sequence[str], pythons: Sequence[str]) -> list[Path]:
    """lfsr_core's wheel and RUNTIME_WHEELS for every platform and Python, in ``folder``."""
    folder.mkdir()
    build_core(folder)
    for platform in platforms:
        for python in pythons:
            download(folder, platform, python)
    return sorted(folder.glob("*.whl"))


def build_core(folder: Path) -> None:
    """Build lfsr_core's wheel from a copy: building in place would leave files here, and pack stale ones."""
    with tempfile.TemporaryDirectory(prefix="lfsr-core-") as name:
        for file in CORE_FILES:
            shutil.copy(ROOT / file, name)
        project = Path(name, "pyproject.toml")
        project.write_text(only_core(project.read_text(encoding="utf-8")), encoding="utf-8")
        shutil.copytree(ROOT / "lfsr_core", Path(name, "lfsr_core"), ignore=NOT_SOURCES)
        run("pip", [sys.executable, "-m", "pip", "wheel", "-q", "--no-deps", "--wheel-dir", str(folder), name])


def only_core(project: str) -> str:
    """pyproject.toml without the packages that lie beside lfsr_core: the add-on is the zip itself."""
    project = re.sub(r'"(blender_addon|lfsr_scenes)[\w.]*",\s*', "", project)
    return re.sub(r"\[tool\.setuptools\.package-dir\]\n.*\n", "", project)


def download(folder: Path, platform: str, python: str) -> None:
    """Fetch RUNTIME_WHEELS, in the versions that the tests run with, for one platform and Python."""
    tags = [part for tag in PLATFORMS[platform] for part in ("--platform", tag)]
    run(f"pip for {platform} and Python {python}",
        [sys.executable, "-m", "pip", "download", "-q", "--no-deps", "--only-binary=:all:", "--implementation", "cp",
         "--python-version", python, *tags, "--constraint", str(ROOT / "scripts" / "constraints.txt"),
         "--dest", str(folder), *(wheel.name for wheel in RUNTIME_WHEELS)])


def write_manifest(path: Path, platforms: Sequence[str], wheels: Sequence[Path]) -> None:
    """The manifest of the repository, with its platforms narrowed and its wheels listed."""
    text = (ROOT / MANIFEST).read_text(encoding="utf-8")
    if (version := tomllib.loads(text)["version"]) != __version__:
        raise LfsrError(f"{MANIFEST} says version {version}, but lfsr_core is {__version__}: make them equal")
    listed = "".join(f'    "./wheels/{wheel.name}",\n' for wheel in wheels)
    names = ", ".join(f'"{name}"' for name in platforms)
    text = re.sub(r"^platforms = .*$", f"platforms = [{names}]\nwheels = [\n{listed}]", text, flags=re.MULTILINE)
    path.write_text(text, encoding="utf-8")


def run(what: str, command: Sequence[str]) -> None:
    """Run a tool silently; LfsrError with the last line it said if it fails."""
    done = subprocess.run(command, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True, errors="replace",
                          check=False)
    if done.returncode:
        said = [line for line in done.stdout.splitlines() if line.strip()] or ["nothing"]
        raise LfsrError(f"{what} failed, saying {said[-1].strip()!r}: {' '.join(command)} says more")


def publish(built: Path, output: Path) -> Path:
    """Move a finished zip to ``output``, whole or not at all."""
    path = output / built.name
    with atomic_path(path) as temporary:
        shutil.copy(built, temporary)
    return path


if __name__ == "__main__":
    sys.exit(main())
