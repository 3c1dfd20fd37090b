"""The ``lfsr`` command, whose verbs are in ``lfsr_core.commands``."""

import argparse
import contextlib
import importlib.metadata
import io
import json
import os
import select
import signal
import sys
import threading
from collections.abc import Sequence
from pathlib import Path
from typing import Any, NoReturn, TextIO

from lfsr_core.base.messages import LfsrError, cleaned, did_you_mean
from lfsr_core.base.records import to_data
from lfsr_core.base.system import check_name, system_errors
from lfsr_core.process.child import interrupt_main
from lfsr_core.version import __version__

MOST_LETTERS = 2000  # of an error, which may quote files and devices of others

# What verbs are for, an example, and the verbs, each with its module and one line of text. The module is loaded when
# its verb is used: ``VERB_arguments`` adds arguments; ``run_VERB`` prints what people want to know and returns it as a
# record or JSON-ready data for ``--json``, or raises LfsrError for bad input; it imports slow packages itself.
GROUPS: tuple[tuple[str, str, dict[str, tuple[str, str]]], ...] = (
    ("Make an image", "lfsr render scene.blend -o frame", {
        "render": ("render", "render a scene's low-resolution EIA with Blender and upscale it to eia.png"),
        "upscale": ("render", "repeat the second stage of a rendered frame folder")}),
    ("Look at it", "lfsr view frame --open", {
        "view": ("export", "write one HTML file that shows finished EIAs as an eye in front of the display sees them"),
        "views": ("export", "write a contact sheet of decoded views, a pair of EPIs, and what an eye would see"),
        "show": ("export", "show a frame, an animation or a quilt on a display: through Looking Glass Bridge, or full "
                           "screen in a browser")}),
    ("Hand it on", "lfsr export frame --format quilt", {
        "export": ("export", "write a finished frame or an animation as quilt, stereo pair, film or folder of views"),
        "import": ("export", "make a frame folder from a quilt or a folder of views (HCI, Stanford, JPEG Pleno), or "
                             "several from a quilt film")}),
    ("Measure", "lfsr plan scene.blend --target 0.95", {
        "reference": ("measure", "render the full-resolution reference as two independent halves"),
        "compare": ("measure", "measure a finished frame against a reference: print a table, write report.json"),
        "plan": ("measure", "find the cheapest scale, samples and method that reach an accuracy, from a small sample "
                            "of lenses")}),
    ("Displays", "lfsr displays looking-glass-portrait", {
        "displays": ("displays", "list the display profiles, show one with its derived numbers, import or calibrate "
                                 "one")}),
    ("Farms", "lfsr farm openjd", {
        "farm": ("render", "write the job template of a render farm: openjd, or flamenco"),
        "merge": ("render", "join parts of `lfsr render --rows` or `lfsr reference --rows`, or average references of "
                          "other seeds")}))
VERBS = {name: verb for _, _, verbs in GROUPS for name, verb in verbs.items()}
LABORATORY = ("study", "train")  # verbs of the package ``lfsr_lab``, found through entry points: the core imports none

EXIT_BAD_INPUT, EXIT_INTERRUPTED, EXIT_UNREAD = 2, 130, 141
ENDINGS = ("SIGINT", "SIGTERM", "SIGHUP", "SIGQUIT")  # signals that interrupt: Ctrl-C, and others that do the same
BOLD, RED = "1", "31"  # styles of terminals
_interrupted = False


def main(argv: Sequence[str] | None = None) -> int:
    """Run one verb; return the exit code: 0, 2 after bad input, 130 after Ctrl-C, 141 if the output's reader ended."""
    global _interrupted
    _interrupted, words = False, list(sys.argv[1:] if argv is None else argv)
    try:
        for name in ENDINGS:
            if hasattr(signal, name):
                signal.signal(getattr(signal, name), _interrupt)
        return _run(words)
    except BaseException as error:  # an import that is interrupted may raise another error
        if not _interrupted and not isinstance(error, KeyboardInterrupt):
            raise
        print(f"\n{' '.join(['lfsr', *words[:1]])}: interrupted; no file is left half-written", file=sys.stderr)
        return EXIT_INTERRUPTED


def _run(words: list[str]) -> int:
    if sys.unraisablehook is sys.__unraisablehook__:
        sys.unraisablehook = _unraisable
    sys.stderr = sys.stderr or Path(os.devnull).open("w", encoding="utf-8")  # noqa: SIM115, to the end
    for stream in (sys.stdout, sys.stderr):  # "?" for letters that they lack, instead of an error
        if isinstance(stream, io.TextIOWrapper):
            with contextlib.suppress(OSError):  # a file that became a pipe
                stream.reconfigure(errors="replace")
    is_asked = "_ARGCOMPLETE" in os.environ
    parser = build_parser(None if is_asked else words)
    if is_asked:  # a shell asks what can follow
        import argcomplete

        argcomplete.autocomplete(parser)
    if not words:
        parser.print_help()
        return 0
    output, is_json = sys.stdout, "--json" in words
    try:
        arguments = parser.parse_args(words)
        is_json = getattr(arguments, "json", False) is True
        with system_errors():
            _check_output()
            for value in vars(arguments).values():
                for path in value if isinstance(value, list) else [value]:
                    if isinstance(path, Path):
                        check_name(path)
            with contextlib.ExitStack() as stack:
                if getattr(arguments, "quiet", False):  # progress is not shown either then
                    stack.enter_context(contextlib.redirect_stdout(None))
                elif is_json:  # what is for people goes where progress goes
                    stack.enter_context(contextlib.redirect_stdout(sys.stderr))
                result = arguments.run(arguments)
            if is_json:
                print(json.dumps(to_data(result), default=str), file=output)
            if output:
                output.flush()
    except LfsrError as error:
        if _interrupted:
            raise
        from lfsr_core.commands.common import is_openjd, tell_openjd  # loads NumPy, which --help does not need

        verb = [word for word in words[:1] if word in (*VERBS, *LABORATORY)]
        name, text = f"{' '.join(['lfsr', *verb])}:", cleaned(str(error), MOST_LETTERS)
        has_enough = isinstance(error.__context__, BrokenPipeError)  # the reader of the output, such as `head`
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
        except OSError:  # drop the output, else Python tries again at its end
            os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        return EXIT_UNREAD if has_enough else EXIT_BAD_INPUT
    return 0


def build_parser(words: Sequence[str] | None = None) -> argparse.ArgumentParser:
    """Return the parser of all verbs; if ``words`` of a command line are given, only verbs in it get arguments."""
    parser = _Parser(prog="lfsr", description="Light-field images for glasses-free 3D displays.")
    parser.add_argument("--version", action="version", version=f"lfsr {__version__}")
    verbs = parser.add_subparsers(dest="verb", required=True, metavar="VERB", parser_class=VerbParser)
    for name, (module, text) in VERBS.items():
        child = verbs.add_parser(name, description=text)
        if words is None or name in words:
            verbs_of = importlib.import_module(f"lfsr_core.commands.{module}")
            getattr(verbs_of, f"{name}_arguments")(child)
            child.add_argument("--json", action="store_true", help="print one JSON object on standard output")
            child.add_argument("--quiet", action="store_true", help="print nothing but errors and what --json asks")
            child.set_defaults(run=getattr(verbs_of, f"run_{name}"))
    for name in LABORATORY:
        child = verbs.add_parser(name)
        if words is None or name in words:
            if verb := laboratory().get(name):
                child.description = verb.HELP
                verb.add_arguments(child)
            else:
                child.prefix_chars = "\0"  # so that options, too, are ordinary words
                child.add_argument("rest", nargs="*", help=argparse.SUPPRESS)
            child.set_defaults(run=verb.run if verb else _no_laboratory)
    return parser


def laboratory() -> dict[str, Any]:
    """Verbs of the laboratory by name, modules with HELP, ``add_arguments`` and ``run``; none where it is missing."""
    points = {point.name: point for point in importlib.metadata.entry_points(group="lfsr.verbs")}
    return {name: points[name].load() for name in LABORATORY if name in points}


def _no_laboratory(arguments: argparse.Namespace) -> None:
    raise LfsrError(f"the verb {arguments.verb!r} belongs to the laboratory, which is not installed: "
                    "run 'pip install ./scripts/lab' in a clone of LFSR")


class VerbParser(argparse.ArgumentParser):
    """A parser whose errors are sentences, as all others."""

    def error(self, message: str) -> NoReturn:
        """LfsrError instead of the usage and an exit."""
        raise LfsrError(f"{message}: `{self.prog} --help` says what there is")


class _Parser(VerbParser):
    """The parser of `lfsr`, whose help shows the verbs in groups, each with an example."""

    def format_help(self) -> str:
        lines = [f"usage: lfsr VERB …    {self.description}"]
        studies = {name: (name, verb.HELP) for name, verb in laboratory().items()}
        for title, example, verbs in (*GROUPS, ("Laboratory", "lfsr study chart -o DIR scene.blend", studies)):
            if verbs:
                lines += ["", f"{styled(title, BOLD, sys.stdout)}:  {example}"]
                lines += [f"  {name:10} {text}" for name, (_, text) in verbs.items()]
        return "\n".join([*lines, "", "`lfsr VERB --help` lists the options of a verb.", ""])

    def parse_known_args(self, args: Any = None, namespace: Any = None) -> Any:
        """Parse, with a hint where the verb is misspelled."""
        first, names = next(iter(args or ()), "-"), (*VERBS, *LABORATORY)
        if not first.startswith("-") and first not in names:
            raise LfsrError(f"there is no verb {first!r}: {did_you_mean(first, names)}`lfsr` alone lists the verbs")
        return super().parse_known_args(args, namespace)


def styled(text: str, style: str, stream: TextIO | None) -> str:
    """Return a text in BOLD or RED where ``stream`` is a terminal and NO_COLOR (no-color.org) is not set."""
    is_plain = os.environ.get("NO_COLOR") or os.environ.get("TERM") == "dumb" or not (stream and stream.isatty())
    return text if is_plain else f"\x1b[{style}m{text}\x1b[0m"


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


def _unraisable(failure: Any) -> None:
    """Repeat an interrupt that Python has swallowed in a finalizer or in a callback of the garbage collector."""
    if failure.exc_type is KeyboardInterrupt:
        threading.Timer(0.1, interrupt_main, (signal.SIGINT,)).start()
    elif not str(getattr(failure.object, "__module__", "")).startswith("distributed"):  # a client that never connected
        sys.__unraisablehook__(failure)


def _interrupt(_signal: int, _stack: object) -> None:
    global _interrupted
    _interrupted = True
    raise KeyboardInterrupt
