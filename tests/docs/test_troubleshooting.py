"""docs/guide/troubleshooting.md quotes messages that the program really has."""

import ast
import re
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
PAGE = ROOT / "docs" / "guide" / "troubleshooting.md"
OWN = ("… is now …", "Exit code")  # made by argparse or described in words


def texts() -> str:
    """Every piece of text between values in the sources of the product."""
    found = []
    for package in ("lfsr_core", "blender_addon"):
        for path in (ROOT / package).rglob("*.py"):
            tree = ast.parse(path.read_text(encoding="utf-8"))
            found += [node.value for node in ast.walk(tree)
                      if isinstance(node, ast.Constant) and isinstance(node.value, str)]
    return "\n".join(found)


def messages() -> list[str]:
    """First cells of the tables that list messages."""
    sections = PAGE.read_text(encoding="utf-8").split("\n| message |")[1:]
    return [row.split(" | ")[0].removeprefix("| ") for section in sections
            for row in section.split("\n\n")[0].splitlines()[2:]]


@pytest.fixture(scope="module")
def sources():
    return texts()


@pytest.mark.parametrize("message", [text for text in messages() if not text.startswith(OWN)])
def test_a_quoted_message_is_one_of_the_programs(sources, message):
    pieces = [piece.strip(" ,") for piece in re.split("…", message)]
    assert max(map(len, pieces)) > 8
    assert [piece for piece in pieces if len(piece) > 8 and piece not in sources] == []


def test_messages_are_found():
    assert len(messages()) > 40
