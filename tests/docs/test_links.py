"""Documents, files and keys that documents and code point to are there."""

import re
import subprocess
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
LINK = re.compile(r"\]\(([^)\s#]+)(?:#[^)]*)?\)")
MENTION = re.compile(r"\bdocs/[\w./-]+\.(?:md|json|svg|png|jpg|webp)\b")
MODULE = re.compile(r"`((?:lfsr_core|blender_addon|scripts|tests)/[\w./-]+\.\w+)`")


def tracked(*patterns):
    listed = subprocess.run(["git", "ls-files", *patterns], cwd=ROOT, capture_output=True, text=True, check=True)
    return [name for name in listed.stdout.split() if (ROOT / name).is_file()]


@pytest.mark.parametrize("name", tracked("*.md"))
def test_documents_point_to_what_is_there(name):
    text = (ROOT / name).read_text(encoding="utf-8")
    links = [link for link in LINK.findall(text) if "://" not in link]
    assert [link for link in links if not ((ROOT / name).parent / link).exists()] == []
    assert [path for path in MODULE.findall(text) if not (ROOT / path).exists()] == []


def test_code_points_to_documents_that_are_there():
    mentions = {(name, path) for name in tracked("*.py", "*.sh", "*.toml")
                for path in MENTION.findall((ROOT / name).read_text(encoding="utf-8"))}
    assert len(mentions) > 20
    assert sorted(pair for pair in mentions if not (ROOT / pair[1]).exists()) == []


def test_documents_outside_the_notebook_can_be_read_in_an_afternoon():
    pages = [name for name in tracked("*.md") if not name.startswith("docs/notebook/")]
    assert sum(len((ROOT / name).read_text(encoding="utf-8").split()) for name in pages) <= 30_000
