"""Old command-line options, which work for one more version."""

from __future__ import annotations

import argparse
import sys
from collections.abc import Sequence
from typing import Any


def add_old_option(parser: argparse.ArgumentParser, old: str, new: argparse.Action) -> None:
    """Accept ``old`` in place of the option ``new``, without showing it in --help; using it prints one line to stderr.

    ``new`` is what ``parser.add_argument`` returned:

        add_old_option(parser, "--share-frames", parser.add_argument("--temporal-averaging", type=int))
    """
    parser.add_argument(old, action=_OldOption, new=new)


class _OldOption(argparse.Action):
    def __init__(self, option_strings: Sequence[str], dest: str, new: argparse.Action) -> None:
        kind = None if isinstance(new.type, str) else new.type
        super().__init__(option_strings, new.dest, new.nargs, default=argparse.SUPPRESS, type=kind,
                         choices=new.choices, help=argparse.SUPPRESS)
        self.new = new

    def __call__(self, parser: argparse.ArgumentParser, namespace: argparse.Namespace, values: Any,
                 option_string: str | None = None) -> None:
        name = self.new.option_strings[0]
        print(f"{option_string} is now {name}", file=sys.stderr)
        self.new(parser, namespace, values, name)
