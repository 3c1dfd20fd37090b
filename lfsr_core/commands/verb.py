"""What a verb of ``lfsr`` is."""

from __future__ import annotations

import argparse
from typing import Protocol


class Verb(Protocol):
    """A module with these four names. It imports what is slow in ``run``."""

    NAME: str
    HELP: str

    def add_arguments(self, parser: argparse.ArgumentParser) -> None:
        """Add the verb's arguments to its parser."""

    def run(self, arguments: argparse.Namespace) -> None:
        """Do what the verb says; LfsrError for bad input."""
