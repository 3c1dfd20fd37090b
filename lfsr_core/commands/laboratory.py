"""Verbs of the laboratory, the package ``lfsr_lab``: found through entry points, since the core never imports it."""

from __future__ import annotations

import argparse
import dataclasses
import importlib.metadata
from collections.abc import Iterator

from lfsr_core.commands.verb import Verb
from lfsr_core.errors import LfsrError

GROUP = "lfsr.verbs"
NAMES = ("chart", "stress", "train", "fit")


@dataclasses.dataclass(frozen=True)
class MissingVerb:
    """A verb of the laboratory where that is not installed."""

    NAME: str
    HELP: str = "needs the laboratory (lfsr-lab), which is not installed"

    def add_arguments(self, parser: argparse.ArgumentParser) -> None:
        """Accept anything: ``run`` says what is missing."""
        parser.add_argument("rest", nargs=argparse.REMAINDER, help=argparse.SUPPRESS)

    def run(self, _arguments: argparse.Namespace) -> None:
        """LfsrError that says how to install the laboratory."""
        raise LfsrError(f"the verb {self.NAME!r} belongs to the laboratory, which is not installed: "
                        "run 'pip install ./scripts/lab' in a clone of LFSR")


def verbs() -> Iterator[Verb]:
    """Every verb of the laboratory, in the order of NAMES."""
    found = {point.name: point for point in importlib.metadata.entry_points(group=GROUP)}
    for name in NAMES:
        yield found[name].load() if name in found else MissingVerb(name)
