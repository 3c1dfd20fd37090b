"""Documents point to what is there: files, messages, and keys of the JSON files."""

import ast
import json
import re
from pathlib import Path, PurePosixPath
from typing import Any

import pytest

from lfsr_core.base.messages import LfsrError
from lfsr_core.cli import VerbParser, build_parser
from lfsr_core.metrics.eia_metrics import compare_folders
from lfsr_core.reconstruct.second_stage import finish_frame
from tests.support.project_files import ROOT, project_files
from tests.support.synthetic import write_reference, write_render

LINK = re.compile(r"\]\(([^)\s#]*)(?:#([^)]*))?\)")
MENTION = re.compile(r"\bdocs/[\w./-]+\.(?:md|json|svg|png|jpg|webp)\b")
MODULE = re.compile(r"`((?:lfsr_core|blender_addon|scripts|tests)/[\w./-]+\.\w+)`")


def tracked(*patterns):
    return [name for name in project_files() if any(PurePosixPath(name).match(pattern) for pattern in patterns)]


@pytest.mark.parametrize("name", tracked("*.md"))
def test_documents_point_to_what_is_there(name):
    text = (ROOT / name).read_text(encoding="utf-8")
    links = [((ROOT / name).parent / link if link else ROOT / name, anchor) for link, anchor in LINK.findall(text)
             if "://" not in link]
    assert [str(path) for path, _ in links if not path.exists()] == []
    anchors = {path: ["", *(re.sub(r"[^\w\- ]", "", heading.lower()).replace(" ", "-") for heading in
                            re.findall(r"^#+ (.*)$", path.read_text(encoding="utf-8"), re.MULTILINE))]
               for path, anchor in links if anchor and path.suffix == ".md"}  # as GitHub makes them
    assert [f"{path.name}#{anchor}" for path, anchor in links if anchor not in anchors.get(path, [anchor])] == []
    assert [path for path in MODULE.findall(text) if not (ROOT / path).exists()] == []


def test_code_points_to_documents_and_those_are_read_in_an_afternoon():
    mentions = {(name, path) for name in tracked("*.py", "*.sh", "*.toml")
                for path in MENTION.findall((ROOT / name).read_text(encoding="utf-8"))}
    assert len(mentions) > 20 and sorted(pair for pair in mentions if not (ROOT / pair[1]).exists()) == []
    pages = [name for name in tracked("*.md") if not name.startswith("docs/notebook/")]
    assert sum(len((ROOT / name).read_text(encoding="utf-8").split()) for name in pages) <= 30_000
    assert len(messages()) > 40


PAGE = ROOT / "docs" / "guide" / "troubleshooting.md"
OWN = ("… is now …", "Exit code")  # made by argparse or described in words


def messages() -> list[str]:
    """First cells of the tables that list messages."""
    sections = PAGE.read_text(encoding="utf-8").split("\n| message |")[1:]
    return [row.split(" | ")[0].removeprefix("| ") for section in sections
            for row in section.split("\n\n")[0].splitlines()[2:]]


@pytest.fixture(scope="module")
def sources():
    """Every piece of text between values in the sources of the product."""
    trees = [ast.parse(path.read_text(encoding="utf-8")) for package in ("lfsr_core", "blender_addon")
             for path in (ROOT / package).rglob("*.py")]
    return "\n".join(node.value for tree in trees for node in ast.walk(tree)
                     if isinstance(node, ast.Constant) and isinstance(node.value, str))


@pytest.mark.parametrize("message", [text for text in messages() if not text.startswith(OWN)])
def test_a_quoted_message_is_one_of_the_programs(sources, message):
    pieces = [piece.strip(" ,") for piece in re.split("…", message)]
    assert max(map(len, pieces)) > 8 and [piece for piece in pieces if len(piece) > 8 and piece not in sources] == []


DOCUMENT = Path(__file__).parents[2] / "docs" / "reference" / "frame-folder.md"
TYPES = {"text": str, "integer": int, "number": (int, float), "boolean": bool, "array": list, "object": dict,
         "null": type(None)}


def documented(section: str, reference: str = "any") -> dict[str, tuple[str, ...]]:
    """Key -> names of allowed types, from the table of one section; ``reference``: which metrics, whole or list."""
    text = DOCUMENT.read_text(encoding="utf-8").split(f"\n## {section}\n")[1].split("\n## ")[0]
    rows = re.findall(r"^\| `(\w+)` \| ([\w ]+) \| (?:(any|whole|list) \|)?", text, re.M)
    return {key: tuple(types.split(" or ")) for key, types, kind in rows if kind in ("", "any", reference)}


def check(data: dict[str, Any], section: str, reference: str = "any") -> None:
    table = documented(section, reference)
    assert set(data) - {"lenses", "ci95"} == set(table)
    for key, types in table.items():
        assert any(isinstance(data[key], TYPES[name]) for name in types), (key, data[key])
        assert isinstance(data[key], bool) <= ("boolean" in types), key


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    folder = write_render(tmp_path_factory.mktemp("frame"))
    finish_frame(folder, "bicubic")
    return folder


@pytest.mark.parametrize(("lenses", "kind"), [(None, "whole"), (((3, 5), (4, 6), (5, 7), (0, 0), (1, 1)), "list")])
def test_frame_report_and_metrics(folder, tmp_path, lenses, kind):
    for name in ("frame.json", "report.json"):
        check(json.loads((folder / name).read_bytes()), name)
    compare_folders(folder, write_reference(tmp_path, lens_list=lenses))
    metrics = json.loads((folder / "report.json").read_bytes())["metrics"]
    check(metrics, "metrics", kind)
    assert metrics.get("lenses") == (5 if lenses else None)
    assert set(metrics.get("ci95", ())) <= set(documented("metrics", kind))


LINE = re.compile(r"^ *(?=lfsr )((?:.*\\\n)*.*)$", re.MULTILINE)
PIECE = re.compile(r"`(lfsr [^`]+)`")
WORDS = {"NAME": "chart", "VERB": "render", "N": "1", "X,Y,Z": "0,0,600", "SLOPE": "0.1", "INTERVAL": "19.6", "X0": "9"}
OLD = {"fit", "--ceiling-spp", "--weights", "--between"}  # what only the notebook tells of, as it was


def commands(text: str) -> list[tuple[list[str], bool]]:
    """Words after `lfsr` of each command, and whether it is a line of its own, not a piece of a sentence."""
    lines = [(line, True) for line in LINE.findall(text)] + [(line, False) for line in PIECE.findall(text)]
    pieces = []
    for line, is_line in lines:
        for command in re.split(r"&&|; |\|", re.sub(r"\s#.*", "", line.replace("\\\n", " "))):
            program, *words = (WORDS.get(word, word) for word in command.replace("=X,Y,Z", "=0,0,600").split())
            if program == "lfsr" and words[0] != "…":
                pieces.append((words, is_line))
    return pieces


@pytest.mark.parametrize("name", [name for name in project_files() if name.endswith(".md")])
def test_commands_are_accepted(name, monkeypatch):
    def error(_parser, message):
        if is_line or not message.startswith("the following arguments are required"):
            raise LfsrError(message)

    monkeypatch.setattr(VerbParser, "error", error)
    monkeypatch.setattr(VerbParser, "exit", lambda *_: None)  # of --help
    problems = []
    for words, is_line in commands((ROOT / name).read_text(encoding="utf-8")):
        try:
            build_parser().parse_args(words)
        except LfsrError as wrong:  # a sentence may end with an option, without its value
            is_old = name.startswith("docs/notebook/") and OLD.intersection(words)
            if not is_old and (is_line or "expected one argument" not in str(wrong)):
                problems.append((" ".join(words), str(wrong)))
    assert problems == []
