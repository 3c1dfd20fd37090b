"""Build the Blender extension.

    python scripts/build_extension.py              # dist/lfsr-VERSION.zip; makes the environment if it is not there
    python scripts/build_extension.py --release    # with its checksum and notes, see docs/releasing.md

The zip is the add-on with lfsr_core as a package inside it: the same files with relative imports, so that an
extension changes nothing in Blender's Python. It contains no other packages, so one zip serves every platform and every
Python from 3.11. The same sources give the same bytes. It is reviewed (review_extension.py) and validated by Blender's
own tool; DIR gets a finished, valid zip or nothing.
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

import setup
from review_extension import OF_COMMANDS, review

from lfsr_core.base.messages import LfsrError
from lfsr_core.base.system import atomic_path
from lfsr_core.version import __version__

ROOT = setup.ROOT
EXTENSION_TOOL = "*/scripts/addons_core/bl_pkg/cli/blender_ext.py"
MANIFEST, CHANGELOG, PROJECT = "blender_manifest.toml", "docs/CHANGELOG.md", "pyproject.toml"
CORE, PACKAGES = "lfsr_core", "packages"  # the second stage's Python finds the first in the second
# The command line, what only it and notebooks reach, and what starts Blender from a clone.
NOT_IN_ZIP = shutil.ignore_patterns("__pycache__", ".*", "py.typed", "__main__.py", "cli.py", "api.py",
                                    "cluster*.py", "from_sources.py")
EPOCH = (1980, 1, 1, 0, 0, 0)  # the first date of a zip
TOKEN = re.compile(rf"from\s+({CORE}[\w.]*)")


@dataclasses.dataclass(frozen=True)
class Publisher:
    """Who publishes a release: the manifest gets it."""

    website: str  # address of the documentation
    maintainer: str  # as "NAME <ADDRESS>"

    @classmethod
    def read(cls, path: Path) -> Publisher:
        """Read the addresses of a pyproject.toml, their one place; LfsrError where one is missing."""
        project = tomllib.loads(path.read_text(encoding="utf-8"))["project"]
        website = project.get("urls", {}).get("Documentation", "")
        if not re.fullmatch(r"https://\S+\.\S+", website):
            raise LfsrError(f"the documentation's address in {PROJECT} is {website!r}, but a release needs one: write "
                            "Documentation = \"https://…\" below [project.urls]")
        who = {"name": "", "email": ""} | project.get("maintainers", [{}])[0]
        if not who["name"].strip() or not re.fullmatch(r"[^<>@\s]+@[^<>@\s]+\.[^<>@\s]+", who["email"]):
            raise LfsrError(f"the maintainer in {PROJECT} is {who['name']!r} with the address {who['email']!r}, but a "
                            "release needs both: write maintainers = [{name = \"…\", email = \"…\"}] below [project]")
        return cls(website, f"{who['name']} <{who['email']}>")


def main(arguments: Sequence[str] | None = None) -> int:
    """Build as the command line asks; the exit code."""
    parser = argparse.ArgumentParser(description="Build the Blender extension.")
    parser.add_argument("--output", type=Path, default=ROOT / "dist", metavar="DIR",
                        help="where the zip goes, default: dist in the clone")
    parser.add_argument("--release", action="store_true", help="write checksum and notes too")
    words = parser.parse_args(arguments)
    try:
        paths = release(words.output) if words.release else [build(words.output)]
    except LfsrError as error:
        print(f"build_extension: {error}", file=sys.stderr)
        return 2
    print(f"{paths[0]}: {paths[0].stat().st_size / 1e6:.1f} MB, valid")
    print(*paths[1:], sep="\n", end="\n" if paths[1:] else "")
    return 0


def release(output: Path, project: Path = ROOT / PROJECT, changelog: Path = ROOT / CHANGELOG) -> list[Path]:
    """Build a release; paths of its zip, checksum and notes.

    LfsrError where a step fails, where the changelog has no section of this version or more than one, and where
    another zip was published under it: the section's own SHA-256, or the checksum in ``output``, is another.
    """
    publisher, changes = Publisher.read(project), _section(changelog.read_text(encoding="utf-8"))
    with tempfile.TemporaryDirectory(prefix="lfsr-release-") as name:
        archive = build(Path(name), publisher)
        digest, checksum = hashlib.sha256(archive.read_bytes()).hexdigest(), output / f"{archive.stem}.sha256"
        published = re.findall(r"\b[0-9a-f]{64}\b", changes + (checksum.read_text() if checksum.is_file() else ""))
        if other := [one for one in published if one != digest]:
            raise LfsrError(f"another zip was published as {__version__} (SHA-256 {other[0][:12]}…, this one is "
                            f"{digest[:12]}…): raise the version in lfsr_core/version.py and {MANIFEST}")
        # Links of the changelog lead to files beside it, which the notes do not have.
        changes = re.sub(r"\[([^]]*)\]\((?!https?://)[^)]*\)", r"\1", changes)
        notes = (f"# LFSR {__version__}\n\n{changes}\n\nInstall: drag {archive.name} onto Blender 4.5 or newer.\n"
                 f"Documentation: {publisher.website}\nSHA-256: `{digest}`\n")
        paths = [output / archive.name, checksum, output / f"{archive.stem}.md"]
        contents = (archive.read_bytes(), f"{digest}  {archive.name}\n".encode(), notes.encode())
        for path, content in zip(paths, contents, strict=True):
            with atomic_path(path) as temporary:
                temporary.write_bytes(content)
    return paths


def _section(text: str) -> str:
    """The changelog's section of this version; LfsrError where there is none, or more than one."""
    sections = re.findall(rf"^## {re.escape(__version__)}(?: .*)?\n((?:(?!## ).*\n?)*)", text, re.MULTILINE)
    if len(sections) != 1:
        raise LfsrError(f"{CHANGELOG} has {len(sections)} sections '## {__version__}', but a release needs one: write "
                        "what it changes below that heading")
    return str(sections[0]).strip()


def build(output: Path, publisher: Publisher | None = None) -> Path:
    """Build, review and validate the zip in ``output``; its path. LfsrError where a step fails."""
    with tempfile.TemporaryDirectory(prefix="lfsr-extension-") as name:
        staged, archive = Path(name, "staged"), Path(name, f"lfsr-{__version__}.zip")
        stage(staged)
        write_manifest(staged / MANIFEST, publisher)
        pack(staged, archive)
        if findings := review(archive, is_release=publisher is not None):
            raise LfsrError(f"the zip would not pass review: {findings[0]}: run scripts/review_extension.py for all")
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
            lines[node.lineno - 1] = TOKEN.sub(lambda match: f"from {relative_name(match[1], place)}",
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


if __name__ == "__main__":
    if importlib.util.find_spec("bpy") is None:  # of the environment: Blender's own tool comes with it
        setup.run([setup.program(setup.ready(setup.USUAL), "python"), *sys.argv])
        sys.exit()
    sys.exit(main())
