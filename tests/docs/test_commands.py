"""Every `lfsr …` of the documents is one that the command line accepts."""

import argparse
import re

import pytest

from lfsr_core.cli import build_parser
from tests.support.project_files import ROOT, project_files

LINE = re.compile(r"^ *(?=lfsr )((?:.*\\\n)*.*)$", re.MULTILINE)
PIECE = re.compile(r"`(lfsr [^`]+)`")
WORDS = {"NAME": "chart", "VERB": "render", "N": "1", "X,Y,Z": "0,0,600", "SLOPE": "0.1", "INTERVAL": "19.6", "X0": "9"}
OLD = {"fit", "--ceiling-spp", "--weights", "--between"}  # what only the notebook tells of, as it was


def commands(text: str) -> list[tuple[list[str], bool]]:
    """Words after `lfsr` of each command, and whether it is a line of its own, not a piece of a sentence."""
    found = [(line, True) for line in LINE.findall(text)] + [(line, False) for line in PIECE.findall(text)]
    pieces = []
    for line, is_line in found:
        for command in re.split(r"&&|; |\|", re.sub(r"\s#.*", "", line.replace("\\\n", " "))):
            program, *words = (WORDS.get(word, word) for word in command.replace("=X,Y,Z", "=0,0,600").split())
            if program == "lfsr" and words[0] != "…":
                pieces.append((words, is_line))
    return pieces


@pytest.mark.parametrize("name", [name for name in project_files() if name.endswith(".md")])
def test_commands_are_accepted(name, monkeypatch):
    def error(_parser, message):
        if is_line or not message.startswith("the following arguments are required"):
            raise ValueError(message)

    def stop(parser, status=0, message=""):
        if status:
            error(parser, message)

    monkeypatch.setattr(argparse.ArgumentParser, "error", error)
    monkeypatch.setattr(argparse.ArgumentParser, "exit", stop)
    problems = []
    for words, is_line in commands((ROOT / name).read_text(encoding="utf-8")):
        try:
            build_parser().parse_args(words)
        except ValueError as wrong:  # a sentence may end with an option, without its value
            is_old = name.startswith("docs/notebook/") and OLD.intersection(words)
            if not is_old and (is_line or "expected one argument" not in str(wrong)):
                problems.append((" ".join(words), str(wrong)))
    assert problems == []
