"""Review the extension's zip by the rules of extensions.blender.org, as far as a program can.

    python scripts/review_extension.py lfsr-VERSION.zip [--release]

docs/guide/extension.md quotes the rules. Each check yields a sentence for what breaks its rule.
"""

from __future__ import annotations

import argparse
import ast
import functools
import re
import sys
import tomllib
import zipfile
from collections.abc import Callable, Iterator, Mapping
from pathlib import Path, PurePosixPath

Files = Mapping[str, bytes]  # content by path in the zip
MANIFEST = "blender_manifest.toml"
# What Blender's Python has in every version, beside the standard library.
BLENDER_BRINGS = {"aud", "bl_math", "bl_operators", "bl_ui", "blf", "bmesh", "bpy", "bpy_extras", "gpu", "gpu_extras",
                  "imbuf", "mathutils", "numpy", "OpenImageIO", "PyOpenColorIO", "_cycles"}
# What a Python of the user's choice may have: imported inside functions, and done without where it is missing.
OPTIONAL = {"PIL", "av", "flip_evaluator", "threadpoolctl"}
NETWORK = {"aiohttp", "asyncio", "ftplib", "http", "imaplib", "poplib", "requests", "smtplib", "socket", "socketserver",
           "ssl", "telnetlib", "urllib", "urllib3", "webbrowser", "websockets", "xmlrpc"}
# The module that calls a program on this computer, and the addresses that it may call.
LOOPBACK, ADDRESSES = "packages/lfsr_core/exports/loopback.py", {"127.0.0.1", "::1"}
SEARCH_PATH = {"sys.path", "sys.modules", "sys.meta_path", "sys.path_hooks", "site.addsitedir"}
OF_OTHERS = {"addon_utils", "addon_disable", "addon_enable", "addon_install", "addon_remove", "package_install",
             "package_install_files", "package_uninstall"}
HIDDEN = {"eval", "exec", "compile", "__import__", "marshal", "pickle", "zlib.decompress", "base64.b64decode"}
INSTALLERS = {"pip", "ensurepip", "venv"}
# Modules that read data beside them; a new one is to be looked at, because an add-on's folder may be read-only.
READS_ITS_FOLDER = {"jobs/runtime.py", "headless/entry.py", "render/frame_folder.py", "render/cycles.py",
                    "packages/lfsr_core/exports/page.py", "packages/lfsr_core/optics/display.py",
                    "packages/lfsr_core/reconstruct/methods/denoise.py", "packages/lfsr_core/process/child.py",
                    "packages/lfsr_core/pipeline/farms.py", "packages/lfsr_core/exports/show.py"}
KINDS = {".css", ".glsl", ".html", ".js", ".json", ".osl", ".py", ".toml", ".txt", ".tza", ".yaml"}
OF_COMMANDS = ("__init__.py", "sentences.py")  # of the command line, which the panel words notices with too
DEVELOPERS = {"docs", "lfsr_lab", "scripts", "tests"}
PERMISSIONS = {"files", "clipboard"}
# Of our own code, and of the weights that ours began from; where the text of each is, and words of it.
LICENCES = {"GPL-3.0-or-later": ("LICENSE", "TERMS AND CONDITIONS"),
            "Apache-2.0": ("packages/lfsr_core/reconstruct/weights/LICENSE-Apache-2.0.txt",
                           "TERMS AND CONDITIONS FOR USE, REPRODUCTION, AND DISTRIBUTION")}
LONGEST_LINE = 300  # of a reviewable file


def check_manifest(files: Files) -> Iterator[str]:
    """Permissions with reasons, copyright, licences with their texts, and a name without Blender's."""
    manifest = tomllib.loads(files[MANIFEST].decode())
    if manifest.get("permissions", {}).keys() != PERMISSIONS:
        yield f"{MANIFEST}: permissions are not {' and '.join(sorted(PERMISSIONS))}"
    if not manifest.get("copyright"):
        yield f"{MANIFEST}: copyright is missing"
    if manifest.get("license") != [f"SPDX:{name}" for name in LICENCES]:
        yield f"{MANIFEST}: the licences are not {' and '.join(LICENCES)}"
    for name, (path, words) in LICENCES.items():
        if words not in files.get(path, b"").decode(errors="replace"):
            yield f"{path}: the text of {name} is missing"
    if "blender" in manifest["name"].lower():
        yield f"{MANIFEST}: the name must not contain Blender's"


def check_publisher(files: Files) -> Iterator[str]:
    """A website, and a maintainer with an address: of a release only, the repository names nobody."""
    manifest = tomllib.loads(files[MANIFEST].decode())
    if not manifest.get("website", "").startswith("https://"):
        yield f"{MANIFEST}: website is missing"
    if not re.search(r"<\S+@\S+>$", manifest["maintainer"]):
        yield f"{MANIFEST}: maintainer has no address"


def check_search_path(files: Files) -> Iterator[str]:
    """Nothing changes where Python finds modules, or reads it."""
    for path, node in _nodes(files):
        names = [alias.name for alias in node.names] if isinstance(node, ast.ImportFrom) else []
        if uses := {_dotted(node), *(f"{getattr(node, 'module', '')}.{name}" for name in names)} & SEARCH_PATH:
            yield f"{path}, line {getattr(node, 'lineno', 0)} uses {uses.pop()}"


def check_imports(files: Files) -> Iterator[str]:
    """Modules of the zip are imported by relative names; others are in every Blender, or optional."""
    for path, nodes in _modules(files):
        top = {id(node) for node in ast.iter_child_nodes(nodes[0])}
        for node in nodes:
            for name in _imported(node):
                is_known = name in sys.stdlib_module_names or name in BLENDER_BRINGS
                if not is_known and (name not in OPTIONAL or id(node) in top):
                    yield f"{path}, line {getattr(node, 'lineno', 0)} imports {name}"


def check_wheels(files: Files) -> Iterator[str]:
    """No wheels: what other extensions bring in other versions is left alone."""
    if tomllib.loads(files[MANIFEST].decode()).get("wheels"):
        yield f"{MANIFEST}: wheels are listed"
    yield from (f"{path} is a package" for path in files if path.endswith((".whl", ".so", ".pyd", ".dll", ".dylib")))


def check_contents(files: Files) -> Iterator[str]:
    """Sources that can be read, and nothing of the developers' tools."""
    for path, content in files.items():
        place = PurePosixPath(path)
        if path != "LICENSE" and place.suffix not in KINDS:
            yield f"{path} is of no known kind"
        is_verb = place.parent.name == "commands" and place.name not in OF_COMMANDS
        if DEVELOPERS & {*place.parts} or is_verb or place.name.startswith((".", "test_")):
            yield f"{path} is for developers"
        if place.suffix in KINDS - {".tza"} and max(map(len, content.splitlines()), default=0) > LONGEST_LINE:
            yield f"{path} has lines of more than {LONGEST_LINE} letters"


def check_hidden_code(files: Files) -> Iterator[str]:
    """No code that is made or unpacked while it runs."""
    for path, node in _nodes(files):
        for name in {_dotted(node), *_imported(node)} & HIDDEN:
            yield f"{path}, line {getattr(node, 'lineno', 0)} uses {name}"


def check_network(files: Files) -> Iterator[str]:
    """No connection but from one module to this computer."""
    for path, node in _nodes(files):
        if path != LOOPBACK:
            yield from (f"{path}, line {getattr(node, 'lineno', 0)} imports {name}"
                        for name in _imported(node) & NETWORK)
        elif isinstance(node, ast.Assign) and any(_dotted(target) == "ADDRESSES" for target in node.targets) \
                and not {*ast.literal_eval(node.value)} <= ADDRESSES:
            yield f"{path}, line {node.lineno} names other addresses than this computer's"


def check_self_contained(files: Files) -> Iterator[str]:
    """Nothing is installed, and other add-ons are left alone."""
    for path, node in _nodes(files):
        names = _imported(node) | ({node.attr} if isinstance(node, ast.Attribute) else set())
        if isinstance(node, ast.Constant) and isinstance(node.value, str):
            names |= {node.value}
        for name in names & (OF_OTHERS | INSTALLERS):
            yield f"{path}, line {getattr(node, 'lineno', 0)} uses {name}"


def check_own_folder(files: Files) -> Iterator[str]:
    """Only modules that read data beside them know where they lie."""
    for path, node in _nodes(files):
        if isinstance(node, ast.Name) and node.id == "__file__" and path not in READS_ITS_FOLDER:
            yield f"{path}, line {node.lineno} uses __file__"


CHECKS: tuple[Callable[[Files], Iterator[str]], ...] = (
    check_manifest, check_search_path, check_imports, check_wheels, check_contents, check_hidden_code, check_network,
    check_self_contained, check_own_folder)


def review(archive: Path, is_release: bool = False) -> list[str]:
    """Sentences on what breaks a rule, in the order of the checks."""
    with zipfile.ZipFile(archive) as content:
        files = {name: content.read(name) for name in content.namelist()}
    checks = (*CHECKS, check_publisher) if is_release else CHECKS
    return [sentence for check in checks for sentence in check(files)]


def _modules(files: Files) -> Iterator[tuple[str, tuple[ast.AST, ...]]]:
    return ((path, _parsed(content)) for path, content in files.items() if path.endswith(".py"))


@functools.lru_cache(maxsize=1000)
def _parsed(content: bytes) -> tuple[ast.AST, ...]:
    return tuple(ast.walk(ast.parse(content)))


def _nodes(files: Files) -> Iterator[tuple[str, ast.AST]]:
    return ((path, node) for path, nodes in _modules(files) for node in nodes)


def _dotted(node: ast.AST) -> str:
    """A name, or an attribute of one, as it is written; "" for any other node."""
    if isinstance(node, ast.Attribute) and isinstance(node.value, ast.Name):
        return f"{node.value.id}.{node.attr}"
    return node.id if isinstance(node, ast.Name) else ""


def _imported(node: ast.AST) -> set[str]:
    """Top-level packages that a node imports by absolute names, also by ``import_module("name")``."""
    names: set[str] = set()
    if isinstance(node, ast.Import):
        names = {alias.name for alias in node.names}
    elif isinstance(node, ast.ImportFrom) and not node.level:
        names = {node.module or ""}
    elif isinstance(node, ast.Call) and _dotted(node.func).endswith("import_module"):
        names = {argument.value for argument in node.args[:1]
                 if isinstance(argument, ast.Constant) and isinstance(argument.value, str)}
    return {name.split(".")[0] for name in names}


def main() -> int:
    """Print what breaks a rule; the exit code."""
    parser = argparse.ArgumentParser(description="Review the extension's zip.")
    parser.add_argument("archive", type=Path, metavar="ZIP")
    parser.add_argument("--release", action="store_true", help="ask for website and maintainer too")
    words = parser.parse_args()
    findings = review(words.archive, words.release)
    print(*findings or [f"{words.archive}: {len(CHECKS) + words.release} checks passed"], sep="\n")
    return 1 if findings else 0


if __name__ == "__main__":
    sys.exit(main())
