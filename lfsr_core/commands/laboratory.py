"""Verbs of the laboratory, the package ``lfsr_lab``: found through entry points, since the core never imports it."""

from __future__ import annotations

import argparse
import importlib.metadata
from collections.abc import Iterator

from lfsr_core.base.errors import LfsrError
from lfsr_core.commands.arguments import Verb

GROUP = "lfsr.verbs"
NAMES = ("study", "train")
MISSING = "needs the laboratory (lfsr-lab), which is not installed"


def _missing(name: str) -> Verb:
    """A verb of the laboratory where that is not installed."""
    def add_arguments(parser: argparse.ArgumentParser) -> None:
        parser.prefix_chars = "\0"  # so that options, too, are ordinary words
        parser.add_argument("rest", nargs="*", help=argparse.SUPPRESS)

    def run(_arguments: argparse.Namespace) -> None:
        raise LfsrError(f"the verb {name!r} belongs to the laboratory, which is not installed: "
                        "run 'pip install ./scripts/lab' in a clone of LFSR")
    return Verb(name, MISSING, add_arguments, run)


def verbs() -> Iterator[Verb]:
    """Verbs of the laboratory, in the order of NAMES."""
    found = {point.name: point for point in importlib.metadata.entry_points(group=GROUP)}
    for name in NAMES:
        yield found[name].load() if name in found else _missing(name)
