"""Build the Blender extension.

    python scripts/build_extension.py --output DIR
    python scripts/build_extension.py --release --website URL --maintainer "NAME <ADDRESS>" --output DIR

The zip is the add-on with lfsr_core as a package inside it: the same files with relative imports, so that an
extension changes nothing in Blender's Python. It contains no other packages, so one zip serves every platform and every
Python from 3.11. The same sources give the same bytes. It is reviewed (review_extension.py) and validated by Blender's
own tool; DIR gets a finished, valid zip or nothing. A release adds checksums and notes.
"""

from __future__ import annotations

import argparse
import ast
import dataclasses
import hashlib
import importlib.util
import json
import re
import shutil
import subprocess
import sys
import tempfile
import tomllib
import zipfile
from collections.abc import Sequence
from pathlib import Path, PurePosixPath

sys.path.extend(str(Path(__file__).resolve().parents[level]) for level in (0, 1))

from review_extension import OF_COMMANDS, review

from lfsr_core import __version__
from lfsr_core.base.errors import LfsrError
from lfsr_core.base.files import atomic_path

ROOT = Path(__file__).resolve().parents[1]
EXTENSION_TOOL = "*/scripts/addons_core/bl_pkg/cli/blender_ext.py"
MANIFEST, CHANGELOG = "blender_manifest.toml", "docs/CHANGELOG.md"
CORE, PACKAGES = "lfsr_core", "packages"  # the second stage's Python finds the first in the second
# The command line, what only it and notebooks reach, and what starts Blender from a clone.
NOT_IN_ZIP = shutil.ignore_patterns("__pycache__", ".*", "py.typed", "cli.py", "api.py", "cluster*.py",
                                    "from_sources.py")
EPOCH = (1980, 1, 1, 0, 0, 0)  # the first date of a zip
TOKEN = re.compile(rf"from\s+({CORE}[\w.]*)")


@dataclasses.dataclass(frozen=True)
class Publisher:
    """Who publishes a release: the manifest gets it."""

    website: str  # address of the documentation
    maintainer: str  # as "NAME <ADDRESS>"

    def check(self) -> None:
        """LfsrError where the website or the address could not be one."""
        if not re.fullmatch(r"https://\S+\.\S+", self.website):
            raise LfsrError(f"website is {self.website!r}, but a release needs the documentation's: "
                            "give --website https://…")
        if not re.fullmatch(r"[^<>]*[^<>\s] <[^<>@\s]+@[^<>@\s]+\.[^<>@\s]+>", self.maintainer):
            raise LfsrError(f"maintainer is {self.maintainer!r}, but a release needs a name and an address: "
                            "give --maintainer 'NAME <ADDRESS>'")


def main(arguments: Sequence[str] | None = None) -> int:
    """Build as the command line asks; the exit code."""
    parser = argparse.ArgumentParser(description="Build the Blender extension.")
    parser.add_argument("--output", type=Path, required=True, metavar="DIR", help="where the zip goes")
    parser.add_argument("--release", action="store_true", help="write checksums and notes too")
    parser.add_argument("--website", default="", help="address of the documentation, for a release")
    parser.add_argument("--maintainer", default="", metavar="'NAME <ADDRESS>'", help="who answers, for a release")
    words = parser.parse_args(arguments)
    publisher = Publisher(words.website, words.maintainer)
    try:
        paths = release(words.output, publisher) if words.release else [build(words.output)]
    except LfsrError as error:
        print(f"build_extension: {error}", file=sys.stderr)
        return 2
    print(f"{paths[0]}: {paths[0].stat().st_size / 1e6:.1f} MB, valid")
    print(*paths[1:], sep="\n", end="\n" if paths[1:] else "")
    return 0


def release(output: Path, publisher: Publisher) -> list[Path]:
    """Build a release; paths of its zip, checksum and notes. LfsrError where a step fails."""
    publisher.check()
    archive = build(output, publisher)
    digest = hashlib.sha256(archive.read_bytes()).hexdigest()
    texts = {".sha256": f"{digest}  {archive.name}\n", ".md": _notes(archive.name, digest, publisher.website)}
    return [archive, *(_write(archive.with_name(archive.stem + ending), text) for ending, text in texts.items())]


def build(output: Path, publisher: Publisher | None = None) -> Path:
    """Build, review and validate the zip in ``output``; its path. LfsrError where a step fails."""
    with tempfile.TemporaryDirectory(prefix="lfsr-extension-") as name:
        staged, archive = Path(name, "staged"), Path(name, f"lfsr-{__version__}.zip")
        stage(staged)
        write_manifest(staged / MANIFEST, publisher)
        pack(staged, archive)
        if found := review(archive, is_release=publisher is not None):
            raise LfsrError(f"the zip would not pass review: {found[0]}: run scripts/review_extension.py for all")
        validate(archive)
        path = output / archive.name
        with atomic_path(path) as temporary:
            shutil.copy(archive, temporary)
    return path


def stage(staged: Path) -> None:
    """Copy what the zip has: the folder is the extension's package."""
    shutil.copytree(ROOT / "blender_addon", staged, ignore=NOT_IN_ZIP)
    shutil.copytree(ROOT / CORE, staged / PACKAGES / CORE, ignore=lambda folder, names: (
        {*names} - {*OF_COMMANDS} if Path(folder).name == "commands" else NOT_IN_ZIP(folder, names)))
    (staged / PACKAGES / "__init__.py").touch()
    shutil.copy(ROOT / "LICENSE", staged)
    for path in staged.rglob("*.py"):
        place = PurePosixPath(path.relative_to(staged).as_posix())
        path.write_text(with_relative_imports(path.read_text(encoding="utf-8"), place), encoding="utf-8", newline="\n")


def with_relative_imports(source: str, place: PurePosixPath) -> str:
    """A module at ``place`` in the zip with its imports of lfsr_core made relative; LfsrError where that cannot be."""
    lines = source.splitlines(keepends=True)
    for node in ast.walk(ast.parse(source)):
        if isinstance(node, ast.Import) and any(alias.name.split(".")[0] == CORE for alias in node.names):
            raise LfsrError(f"{place}, line {node.lineno} imports {CORE} itself: write `from {CORE}.… import …`")
        if isinstance(node, ast.ImportFrom) and not node.level and (node.module or "").split(".")[0] == CORE:
            lines[node.lineno - 1] = TOKEN.sub(lambda found: f"from {relative_name(found[1], place)}",
                                               lines[node.lineno - 1], count=1)
    return "".join(lines)


def relative_name(module: str, place: PurePosixPath) -> str:
    """``module`` of lfsr_core as a module at ``place`` in the zip names it: ``..packages.lfsr_core.errors``."""
    package, wanted, shared = place.parent.parts, (PACKAGES, *module.split(".")), 0
    while shared < min(len(package), len(wanted)) and package[shared] == wanted[shared]:
        shared += 1
    return "." * (len(package) - shared + 1) + ".".join(wanted[shared:])


def write_manifest(path: Path, publisher: Publisher | None) -> None:
    """The manifest of the repository, with the publisher. LfsrError where it is of another version."""
    text = (ROOT / MANIFEST).read_text(encoding="utf-8")
    if (version := tomllib.loads(text)["version"]) != __version__:
        raise LfsrError(f"{MANIFEST} has version {version}, but lfsr_core is {__version__}: make them equal")
    if publisher:
        lines = "".join(f"{name} = {json.dumps(value, ensure_ascii=False)}\n"
                        for name, value in dataclasses.asdict(publisher).items())
        text = re.sub(r"^maintainer = .*\n", lambda _: lines, text, flags=re.MULTILINE)
    path.write_text(text, encoding="utf-8", newline="\n")


def pack(folder: Path, archive: Path) -> None:
    """Zip a folder: the same files give the same bytes, whatever their dates, owners and order."""
    with zipfile.ZipFile(archive, "w") as content:
        for path in sorted(path.relative_to(folder).as_posix() for path in folder.rglob("*") if path.is_file()):
            entry = zipfile.ZipInfo(path, EPOCH)
            entry.create_system, entry.external_attr = 3, 0o644 << 16  # as on Linux, readable files
            content.writestr(entry, (folder / path).read_bytes(), zipfile.ZIP_DEFLATED, 9)


def validate(archive: Path) -> None:
    """LfsrError where Blender's own extension tool finds the zip invalid, or where there is no tool."""
    command = [sys.executable, str(find_tool()), "validate", str(archive)]
    done = subprocess.run(command, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True, errors="replace",
                          check=False)
    if done.returncode:
        lines = [line.strip() for line in done.stdout.splitlines() if line.strip()] or ["nothing"]
        raise LfsrError(f"Blender's extension tool failed with {lines[-1]!r}: run {' '.join(command)} for more")


def find_tool() -> Path:
    """Blender's extension tool in the bpy wheel, which is not imported; LfsrError without one."""
    spec = importlib.util.find_spec("bpy")
    for folder in spec.submodule_search_locations or () if spec else ():
        for path in Path(folder).glob(EXTENSION_TOOL):
            return path
    raise LfsrError("Blender's extension tool was not found, it comes with the package bpy: install lfsr[blender]")


def _notes(name: str, digest: str, website: str) -> str:
    """What a release says: the changelog's newest heading, how to install it, its checksum."""
    changes = (ROOT / CHANGELOG).read_text(encoding="utf-8").split("\n## ")[1].partition("\n")[2].strip()
    return (f"# LFSR {__version__}\n\n{changes}\n\nInstall: drag {name} onto Blender 4.5 or newer.\n"
            f"Documentation: {website}\nSHA-256: `{digest}`\n")


def _write(path: Path, text: str) -> Path:
    with atomic_path(path) as temporary:
        temporary.write_text(text, encoding="utf-8", newline="\n")
    return path


if __name__ == "__main__":
    sys.exit(main())
