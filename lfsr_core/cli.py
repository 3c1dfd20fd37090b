"""The ``lfsr`` command: one verb per module of ``lfsr_core.commands``."""

from __future__ import annotations

import argparse
import contextlib
import io
import os
import select
import signal
import sys
from collections.abc import Sequence
from pathlib import Path

from lfsr_core.base.errors import LfsrError
from lfsr_core.base.files import check_name, system_errors
from lfsr_core.base.notices import accept_all_letters, is_openjd, tell_openjd
from lfsr_core.commands import (
    compare,
    displays,
    export,
    farm,
    import_views,
    laboratory,
    merge,
    plan,
    reference,
    render,
    show,
    upscale,
    view,
    views,
)
from lfsr_core.commands.sentences import cleaned
from lfsr_core.version import __version__

MOST_LETTERS = 2000  # of an error, which may quote files and devices of others

VERBS: tuple[laboratory.Verb, ...] = (
    displays, render, merge, upscale, view, show, export, import_views, views, farm, plan, reference, compare)

EXIT_BAD_INPUT, EXIT_INTERRUPTED = 2, 130
ENDINGS = ("SIGTERM", "SIGHUP", "SIGQUIT")  # signals that interrupt like Ctrl-C


def main(argv: Sequence[str] | None = None) -> int:
    """Run one verb; return the exit code: 0, 2 after bad input, 130 after Ctrl-C."""
    sys.stderr = sys.stderr or Path(os.devnull).open("w", encoding="utf-8")  # noqa: SIM115, to the end
    accept_all_letters()
    arguments = build_parser().parse_args(argv)
    try:
        for name in ENDINGS:
            if hasattr(signal, name):
                signal.signal(getattr(signal, name), _interrupt)
        with system_errors():
            _check_output()
            _check_paths(arguments)
            arguments.run(arguments)
            sys.stdout.flush()
    except LfsrError as error:
        said = f"lfsr {arguments.verb}: {cleaned(str(error), MOST_LETTERS)}"
        print(said, file=sys.stderr)
        _tell_farm(said)
        _drop_output()
        return EXIT_BAD_INPUT
    except KeyboardInterrupt:
        print(f"\nlfsr {arguments.verb}: interrupted; no file is left half-written", file=sys.stderr)
        return EXIT_INTERRUPTED
    return 0


def build_parser() -> argparse.ArgumentParser:
    """Parser of all verbs, those of the laboratory included."""
    parser = argparse.ArgumentParser(prog="lfsr", description="Light-field images for integral-imaging displays.")
    parser.add_argument("--version", action="version", version=f"lfsr {__version__}")
    verbs = parser.add_subparsers(dest="verb", required=True, metavar="VERB")
    for verb in (*VERBS, *laboratory.verbs()):
        child = verbs.add_parser(verb.NAME, help=verb.HELP, description=verb.HELP)
        verb.add_arguments(child)
        child.set_defaults(run=verb.run)
    return parser


def _check_output() -> None:
    """LfsrError or OSError if standard output cannot be written, as far as that is known before printing."""
    if sys.stdout is None:
        raise LfsrError("standard output is closed: send it to a file or a terminal")
    try:
        output = sys.stdout.fileno()
    except io.UnsupportedOperation:  # another Python program reads it
        return
    os.write(output, b"")
    if sys.platform != "win32" and hasattr(select, "poll"):
        poll = select.poll()
        poll.register(output, 0)
        if any(event & select.POLLERR for _, event in poll.poll(0)):
            raise LfsrError("the reader of standard output has ended: send it to a file or a terminal")


def _tell_farm(sentence: str) -> None:
    """Tell a render farm why its task failed."""
    if is_openjd():
        with contextlib.suppress(OSError):
            tell_openjd(fail=sentence)


def _drop_output() -> None:
    """Discard what cannot be printed, or Python tries again when it ends."""
    try:
        if sys.stdout:
            sys.stdout.flush()
    except OSError:
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())


def _check_paths(arguments: argparse.Namespace) -> None:
    """LfsrError for an impossible path, before any work is done."""
    for value in vars(arguments).values():
        for path in value if isinstance(value, list) else [value]:
            if isinstance(path, Path):
                check_name(path)


def _interrupt(_signal: int, _stack: object) -> None:
    raise KeyboardInterrupt


if __name__ == "__main__":
    sys.exit(main())
