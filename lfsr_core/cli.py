"""The ``lfsr`` command: one verb per module of ``lfsr_core.commands``."""

from __future__ import annotations

import argparse
import signal
import sys
from collections.abc import Sequence

from lfsr_core import __version__
from lfsr_core.commands import chart, compare, displays, fit, plan, reference, render, stress, train, upscale, views
from lfsr_core.errors import LfsrError

# A verb is a module with NAME, HELP, add_arguments(parser) and run(args); it imports what is slow inside run.
VERBS = (displays, render, upscale, plan, reference, compare, chart, views, stress, train, fit)

EXIT_BAD_INPUT, EXIT_INTERRUPTED = 2, 130
ENDINGS = ("SIGTERM", "SIGHUP", "SIGQUIT")  # as Ctrl-C: a closed terminal too


def main(argv: Sequence[str] | None = None) -> int:
    """Run one verb; returns the exit code: 0, 2 after bad input, 130 after Ctrl-C."""
    arguments = build_parser().parse_args(argv)
    try:
        for name in ENDINGS:
            if hasattr(signal, name):
                signal.signal(getattr(signal, name), _interrupt)
        arguments.run(arguments)
    except LfsrError as error:
        print(f"lfsr {arguments.verb}: {error}", file=sys.stderr)
        return EXIT_BAD_INPUT
    except KeyboardInterrupt:
        print(f"\nlfsr {arguments.verb}: interrupted, nothing half-written is left", file=sys.stderr)
        return EXIT_INTERRUPTED
    return 0


def build_parser() -> argparse.ArgumentParser:
    """Parser of every verb in VERBS."""
    parser = argparse.ArgumentParser(prog="lfsr", description="Light-field images for integral-imaging displays.")
    parser.add_argument("--version", action="version", version=f"lfsr {__version__}")
    verbs = parser.add_subparsers(dest="verb", required=True, metavar="VERB")
    for verb in VERBS:
        child = verbs.add_parser(verb.NAME, help=verb.HELP, description=verb.HELP)
        verb.add_arguments(child)
        child.set_defaults(run=verb.run)
    return parser


def _interrupt(_signal: int, _stack: object) -> None:
    raise KeyboardInterrupt


if __name__ == "__main__":
    sys.exit(main())
