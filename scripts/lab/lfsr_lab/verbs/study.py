"""``lfsr study NAME …``: one study of the laboratory. STUDIES is the one table of them.

A study is a module of ``lfsr_lab.experiments`` with ``add_arguments(parser)`` and ``run(arguments)``; its docstring is
its help. What is complete in its output folder is not made again, so that the same command continues it.
"""

import argparse
import importlib
import shlex
from collections.abc import Sequence
from pathlib import Path
from typing import Any

NAME, HELP = "study", "measure one study of the laboratory, or all of them as one report"
STUDIES = {  # module, and what it measures
    "chart": ("chart.study", "errors and end-to-end times of every method on scenes"),
    "stress": ("sweeps.study", "scenes that grow harder, every method to its breaking point"),
    "displays": ("displays.study", "three kinds of displays, this way of making their images against the usual one"),
    "animations": ("animations.study", "temporal averaging: accuracy, flicker and lag"),
    "denoiser": ("denoiser.study", "denoisers on known and unprepared scenes"),
    "scales": ("scales.study", "fit the model of `--scale auto`, and show what its choices lose"),
    "plans": ("plan_validation.study", "plans of `lfsr plan` against whole renders"),
    "stress-plans": ("sweeps.plans", "plans where methods break"),
    "rivals": ("rivals.study", "methods of others with their own weights"),
    "gpu-budget": ("gpu_budget.study", "what a frame at 8K asks of a GPU"),
    "paper": ("seed_paper.study", "the figures of the paper behind the method"),
    "report": ("document.study", "every study, as one report with a manifest")}


def add_arguments(parser: argparse.ArgumentParser) -> None:
    parser.formatter_class = argparse.RawDescriptionHelpFormatter
    width = max(map(len, STUDIES))
    parser.epilog = "\n".join(["studies:", *(f"  {name:{width}}  {text}" for name, (_, text) in STUDIES.items())])
    parser.add_argument("study", nargs=argparse.PARSER, action=_Study, metavar="NAME",
                        help="`lfsr study NAME --help` lists its arguments")


class _Study(argparse.Action):
    """Parse what follows the name of a study with the arguments of its module."""

    def __call__(self, parser: argparse.ArgumentParser, namespace: argparse.Namespace,
                 values: str | Sequence[Any] | None, option_string: str | None = None) -> None:
        name, *words = list(values or ())
        if name not in STUDIES:
            parser.error(f"there is no study {name!r}: choose from {', '.join(STUDIES)}")
        module = importlib.import_module(f"lfsr_lab.experiments.{STUDIES[name][0]}")
        own = type(parser)(prog=f"lfsr study {name}", description=module.__doc__,
                           formatter_class=argparse.RawDescriptionHelpFormatter)
        module.add_arguments(own)
        own.add_argument("-o", "--output", type=Path, required=getattr(module, "NEEDS_OUTPUT", True), metavar="OUT",
                         help="folder of everything that is made; what is complete in it is not made again")
        own.add_argument("--blender", metavar="PATH", help="Blender 4.5 or newer; default: the bpy package, then PATH")
        own.parse_args(words, namespace)
        shown = [Path(word).name if Path(word).is_absolute() else word for word in words]  # no folder of this machine
        namespace.study, namespace.command = module, shlex.join(["lfsr", "study", name, *shown])


def run(arguments: argparse.Namespace) -> None:
    """Run the study; LfsrError for bad input, and where a package that writes reports is missing."""
    from lfsr_lab.experiments.engine.report import check_packages

    check_packages()
    arguments.study.run(arguments)
