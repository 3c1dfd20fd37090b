"""Verbs of the laboratory, the package ``lfsr_lab``: found through entry points, since the core never imports it."""

from __future__ import annotations

import argparse
import dataclasses
import importlib.metadata
from collections.abc import Iterator
from typing import Any, Protocol

from lfsr_core.base.errors import LfsrError

GROUP = "lfsr.verbs"
NAMES = ("study", "train")


class Verb(Protocol):
    """A verb of ``lfsr``: a module with these four names. It imports slow packages in ``run``."""

    @property
    def NAME(self) -> str: ...

    @property
    def HELP(self) -> str: ...

    def add_arguments(self, parser: argparse.ArgumentParser) -> None:
        """Add the verb's arguments to its parser."""

    def run(self, arguments: argparse.Namespace) -> Any:
        """Run the verb, print what people want to know, and return it as a record or JSON-ready data for ``--json``.

        LfsrError for bad input.
        """


@dataclasses.dataclass(frozen=True)
class MissingVerb:
    """A verb of the laboratory where that is not installed."""

    NAME: str
    HELP: str = "needs the laboratory (lfsr-lab), which is not installed"

    def add_arguments(self, parser: argparse.ArgumentParser) -> None:
        """Accept anything, options too: without prefix characters they are ordinary words."""
        parser.prefix_chars = "\0"
        parser.add_argument("rest", nargs="*", help=argparse.SUPPRESS)

    def run(self, _arguments: argparse.Namespace) -> None:
        """Raise an LfsrError that says how to install the laboratory."""
        raise LfsrError(f"the verb {self.NAME!r} belongs to the laboratory, which is not installed: "
                        "run 'pip install ./scripts/lab' in a clone of LFSR")


def verbs() -> Iterator[Verb]:
    """Verbs of the laboratory, in the order of NAMES."""
    found = {point.name: point for point in importlib.metadata.entry_points(group=GROUP)}
    for name in NAMES:
        yield found[name].load() if name in found else MissingVerb(name)
