"""Old options of the command line: they do what the new ones do, and print one line."""

from __future__ import annotations

import argparse

import pytest

from lfsr_core.cli import build_parser
from lfsr_core.commands.renamed import add_old_option


@pytest.mark.parametrize(("words", "name", "value", "notice"), [
    (["render", "a.blend", "-o", "out", "--frames", "1-3", "--share-frames", "2"], "temporal_averaging", 2,
     "--share-frames is now --temporal-averaging\n"),
    (["upscale", "out", "--share-frames=1"], "temporal_averaging", 1, "--share-frames is now --temporal-averaging\n"),
    (["reference", "a.blend", "-o", "out", "--shares", "3"], "parts", 3, "--shares is now --parts\n"),
    (["upscale", "out"], "temporal_averaging", 0, "")])
def test_an_old_option_works_with_one_line_of_notice(words, name, value, notice, capsys):
    assert getattr(build_parser().parse_args(words), name) == value
    assert capsys.readouterr().err == notice


def test_old_options_are_not_in_the_help(capsys):
    for verb in ("render", "upscale", "reference"):
        with pytest.raises(SystemExit):
            build_parser().parse_args([verb, "--help"])
    shown = capsys.readouterr().out
    assert "--temporal-averaging" in shown and "--share" not in shown


def test_a_switch_may_be_renamed_too(capsys):
    parser = argparse.ArgumentParser()
    add_old_option(parser, "--old", parser.add_argument("--new", action="store_true"))
    assert parser.parse_args(["--old"]).new and not parser.parse_args([]).new
    assert capsys.readouterr().err == "--old is now --new\n"
