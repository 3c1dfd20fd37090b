"""Build the Blender extension: python scripts/build_extension.py --output DIR

Stages the add-on, its manifest and wheels in a temporary folder, then builds and
validates the zip with Blender's own extension tool, which the bpy wheel carries.
Every wheel is pure Python, so one zip serves every platform and every Python from
3.11. pip fetches them from the index it is configured with; the extension itself
never runs pip and never uses the network. DIR gets a finished, valid zip or nothing.
"""

from __future__ import annotations

import argparse
import importlib.util
import shutil
import subprocess
import sys
import tempfile
import tomllib
from collections.abc import Iterable, Sequence
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
# What the second stage imports and Blender's Python does not bring everywhere; pip adds what these need themselves.
RUNTIME_WHEELS = {
    "threadpoolctl": "one BLAS thread per worker: cores would wait for each other without it",
}
# Left out, since Blender brings them: NumPy, OpenImageIO, OpenColorIO, Open Image Denoise (libOpenImageDenoise, read by
# lfsr_core/reconstruct/methods/oidn.py). Left out, since bound to one Python version each: flip-evaluator, without
# which the report says that FLIP was not computed. docs/guide/extension.md has the measurements.
PURE = ("--platform", "any", "--implementation", "py", "--abi", "none", "--python-version", "3.11")


def main(arguments: Sequence[str] | None = None) -> int:
    """Build as the command line asks; the exit code."""
    parser = argparse.ArgumentParser(description="Build the Blender extension.")
    parser.add_argument("--output", type=Path, required=True, metavar="DIR", help="where the zip goes")
    try:
        path = build(parser.parse_args(arguments).output)
    except LfsrError as error:
        print(f"build_extension: {error}", file=sys.stderr)
        return 2
    print(f"{path}: {path.stat().st_size / 1e6:.1f} MB, valid")
    return 0


def build(output: Path) -> Path:
    """Build and validate the zip in ``output``; its path. LfsrError where a step fails."""
    tool = [sys.executable, str(find_tool())]
    with tempfile.TemporaryDirectory(prefix="lfsr-extension-") as name:
        staged, built = Path(name, "staged"), Path(name, "built")
        built.mkdir()
        stage_addon(staged)
        write_manifest(staged / MANIFEST, collect_wheels(staged / "wheels"))
        run("Blender's extension tool", [*tool, "build", "--source-dir", str(staged), "--output-dir", str(built)])
        [archive] = built.glob("*.zip")
        run("Blender's extension tool", [*tool, "validate", str(archive)])
        return publish(archive, output)


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


def collect_wheels(folder: Path) -> list[Path]:
    """lfsr_core's wheel and RUNTIME_WHEELS, in ``folder``."""
    folder.mkdir()
    build_core(folder)
    download(folder, RUNTIME_WHEELS)
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
    return project.replace('"blender_addon*", ', "")


def download(folder: Path, names: Iterable[str]) -> None:
    """Fetch the pure Python wheels of packages and of what they need, in the versions that the tests run with."""
    run("pip", [sys.executable, "-m", "pip", "download", "-q", "--only-binary=:all:", *PURE,
                "--constraint", str(ROOT / "scripts" / "constraints.txt"), "--dest", str(folder), *names])


def write_manifest(path: Path, wheels: Sequence[Path]) -> None:
    """The manifest of the repository, with its wheels listed. LfsrError where it is of another version."""
    text = (ROOT / MANIFEST).read_text(encoding="utf-8")
    if (version := tomllib.loads(text)["version"]) != __version__:
        raise LfsrError(f"{MANIFEST} has version {version}, but lfsr_core is {__version__}: make them equal")
    listed = "".join(f'    "./wheels/{wheel.name}",\n' for wheel in wheels)
    path.write_text(text.replace("[permissions]", f"wheels = [\n{listed}]\n\n[permissions]"), encoding="utf-8")


def run(what: str, command: Sequence[str]) -> None:
    """Run a tool silently; LfsrError with the last line of its output if it fails."""
    done = subprocess.run(command, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True, errors="replace",
                          check=False)
    if done.returncode:
        lines = [line.strip() for line in done.stdout.splitlines() if line.strip()] or ["nothing"]
        raise LfsrError(f"{what} failed with {lines[-1]!r}: run {' '.join(command)} for more")


def publish(built: Path, output: Path) -> Path:
    """Move a finished zip to ``output``, whole or not at all."""
    path = output / built.name
    with atomic_path(path) as temporary:
        shutil.copy(built, temporary)
    return path


if __name__ == "__main__":
    sys.exit(main())
