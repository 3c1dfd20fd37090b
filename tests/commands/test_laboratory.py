"""The laboratory's verbs: found where it is installed, one clear sentence where it is not."""

import importlib.metadata

import pytest

from lfsr_core.cli import main
from lfsr_core.commands import laboratory
from tests.support.synthetic import fails


@pytest.fixture
def missing(monkeypatch):
    """A Python without the laboratory."""
    monkeypatch.setattr(importlib.metadata, "entry_points", lambda group: ())


@pytest.mark.parametrize("words", [["study"], ["study", "chart", "a.blend", "-o", "out"],
                                   ["train", "--help"], ["train", "paper", "--set", "seed=1"]])
def test_without_the_laboratory_its_verbs_say_how_to_install_it(missing, capsys, words):
    told = fails(words, capsys)
    assert told.startswith(f"lfsr {words[0]}: the verb {words[0]!r} belongs to the laboratory")
    assert "pip install ./scripts/lab" in told


def test_without_the_laboratory_the_help_shows_none_of_its_verbs(missing, capsys):
    with pytest.raises(SystemExit) as caught:
        main(["--help"])
    shown = capsys.readouterr().out
    assert caught.value.code == 0 and "render" in shown
    assert not any(name in shown.split() for name in laboratory.NAMES)


def test_verbs_come_from_the_laboratory():
    found = {verb.NAME: verb for verb in laboratory.verbs()}
    assert tuple(found) == laboratory.NAMES
    assert not any(verb.HELP == laboratory.MISSING for verb in found.values())
