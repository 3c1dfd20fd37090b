# PYTHON_ARGCOMPLETE_OK
"""The ``lfsr`` command, whose verbs are in ``lfsr_core.commands``."""

from __future__ import annotations

import _thread
import argparse
import contextlib
import io
import json
import os
import select
import signal
import sys
import threading
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from lfsr_core.base.errors import LfsrError, did_you_mean
from lfsr_core.base.files import check_name, system_errors
from lfsr_core.base.notices import BOLD, RED, accept_all_letters, be_quiet, cleaned, is_openjd, styled, tell_openjd
from lfsr_core.base.records import to_data
from lfsr_core.commands import displays, export, farm, laboratory, plan, reference, render, view
from lfsr_core.commands.arguments import Verb
from lfsr_core.version import __version__

MOST_LETTERS = 2000  # of an error, which may quote files and devices of others

# What a verb is for, an example, and the verbs; those of the laboratory follow.
GROUPS: tuple[tuple[str, str, tuple[Verb, ...]], ...] = (
    ("Make an image", "lfsr render scene.blend -o frame", (render.RENDER, render.UPSCALE)),
    ("Look at it", "lfsr view frame --open", (view.VIEW, view.VIEWS, view.SHOW)),
    ("Hand it on", "lfsr export frame --format quilt", (export.EXPORT, export.IMPORT)),
    ("Measure", "lfsr plan scene.blend --target 0.95", (reference.REFERENCE, reference.COMPARE, plan.PLAN)),
    ("Displays", "lfsr displays looking-glass-portrait", (displays.DISPLAYS,)),
    ("Farms", "lfsr farm openjd", (farm.FARM, farm.MERGE)))
VERBS = tuple(verb for _, _, verbs in GROUPS for verb in verbs)

SECONDS_AFTER = 0.1  # a finalizer was interrupted, until it has ended
EXIT_BAD_INPUT, EXIT_INTERRUPTED, EXIT_UNREAD = 2, 130, 141
ENDINGS = ("SIGTERM", "SIGHUP", "SIGQUIT")  # signals that interrupt like Ctrl-C


def main(argv: Sequence[str] | None = None) -> int:
    """Run one verb; return the exit code: 0, 2 after bad input, 130 after Ctrl-C."""
    if sys.unraisablehook is sys.__unraisablehook__:
        sys.unraisablehook = _unraisable
    sys.stderr = sys.stderr or Path(os.devnull).open("w", encoding="utf-8")  # noqa: SIM115, to the end
    accept_all_letters()
    parser, words = build_parser(), list(sys.argv[1:] if argv is None else argv)
    if "_ARGCOMPLETE" in os.environ:  # a shell asks what can follow
        import argcomplete

        argcomplete.autocomplete(parser)
    if not words:
        parser.print_help()
        return 0
    arguments = parser.parse_args(words)
    output, is_json = sys.stdout, getattr(arguments, "json", False) is True
    try:
        for name in ENDINGS:
            if hasattr(signal, name):
                signal.signal(getattr(signal, name), _interrupt)
        with system_errors():
            _check_output()
            for value in vars(arguments).values():
                for path in value if isinstance(value, list) else [value]:
                    if isinstance(path, Path):
                        check_name(path)
            with contextlib.ExitStack() as stack:
                if getattr(arguments, "quiet", False):
                    stack.enter_context(be_quiet())
                    stack.enter_context(contextlib.redirect_stdout(None))
                elif is_json:  # what is for people goes where progress goes
                    stack.enter_context(contextlib.redirect_stdout(sys.stderr))
                found = arguments.run(arguments)
            if is_json:
                print(json.dumps(to_data(found), default=str), file=output)
            if output:
                output.flush()
    except LfsrError as error:
        name, text = f"lfsr {arguments.verb}:", cleaned(str(error), MOST_LETTERS)
        has_enough = isinstance(error.__context__, BrokenPipeError)  # who reads the output, such as `head`
        if not has_enough:
            print(styled(name, RED, sys.stderr), text, file=sys.stderr)
        if is_json and output:
            with contextlib.suppress(OSError):
                print(json.dumps({"error": text}), file=output)
        if is_openjd():
            with contextlib.suppress(OSError):
                tell_openjd(fail=f"{name} {text}")
        try:
            if sys.stdout:
                sys.stdout.flush()
        except OSError:  # dropped, or Python tries again when it ends
            os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        return EXIT_UNREAD if has_enough else EXIT_BAD_INPUT
    except KeyboardInterrupt:
        print(f"\nlfsr {arguments.verb}: interrupted; no file is left half-written", file=sys.stderr)
        return EXIT_INTERRUPTED
    return 0


def build_parser() -> argparse.ArgumentParser:
    """Parser of all verbs, those of the laboratory included."""
    parser = _Parser(prog="lfsr", description="Light-field images for glasses-free 3D displays.")
    parser.add_argument("--version", action="version", version=f"lfsr {__version__}")
    verbs = parser.add_subparsers(dest="verb", required=True, metavar="VERB", parser_class=argparse.ArgumentParser)
    found = tuple(laboratory.verbs())
    for verb in (*VERBS, *found):
        child = verbs.add_parser(verb.NAME, help=verb.HELP, description=verb.HELP)
        verb.add_arguments(child)
        if verb in VERBS:
            child.add_argument("--json", action="store_true", help="print one JSON object on standard output")
            child.add_argument("--quiet", action="store_true", help="print nothing but errors and what --json asks")
        child.set_defaults(run=verb.run)
    if installed := tuple(verb for verb in found if verb.HELP != laboratory.MISSING):
        parser.groups = (*GROUPS, ("Laboratory", "lfsr study chart -o DIR scene.blend", installed))
    parser.names = [verb.NAME for verb in (*VERBS, *found)]
    return parser


class _Parser(argparse.ArgumentParser):
    """The parser of `lfsr`, whose help shows the verbs in groups, each with an example."""

    groups, names = GROUPS, list[str]()

    def format_help(self) -> str:
        lines = [f"usage: lfsr VERB …    {self.description}"]
        for title, example, verbs in self.groups:
            lines += ["", f"{styled(title, BOLD, sys.stdout)}:  {example}"]
            lines += [f"  {verb.NAME:10} {verb.HELP}" for verb in verbs]
        return "\n".join([*lines, "", "`lfsr VERB --help` lists the options of a verb.", ""])

    def parse_known_args(self, args: Any = None, namespace: Any = None) -> Any:
        """Parse, with a hint where the verb is misspelled."""
        first = next(iter(args or ()), "-")
        if not first.startswith("-") and first not in self.names:
            self.exit(EXIT_BAD_INPUT, f"lfsr: there is no verb {first!r}: {did_you_mean(first, self.names)}"
                                      "`lfsr` alone lists the verbs\n")
        return super().parse_known_args(args, namespace)


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


def _unraisable(found: Any) -> None:
    """Interrupt again where Python has swallowed it, in a finalizer or in a callback of the garbage collector."""
    if found.exc_type is KeyboardInterrupt:
        threading.Timer(SECONDS_AFTER, _interrupt_main).start()
    elif not str(getattr(found.object, "__module__", "")).startswith("distributed"):  # a client that never connected
        sys.__unraisablehook__(found)


def _interrupt_main() -> None:
    if hasattr(signal, "pthread_kill"):  # wakes it where it waits
        signal.pthread_kill(threading.main_thread().ident or 0, signal.SIGINT)
    else:
        _thread.interrupt_main()


def _interrupt(_signal: int, _stack: object) -> None:
    raise KeyboardInterrupt


if __name__ == "__main__":
    sys.exit(main())
