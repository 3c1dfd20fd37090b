"""Count what a frame at 8K asks of a GPU, and measure it where there is one.

    python -m lfsr_lab.experiments.gpu_budget -o OUT                                    counts and published rates
    python -m lfsr_lab.experiments.gpu_budget -o OUT --measure SCENE [--scale 4 --spp 4]  this machine's device too

OUT/gpu-budget.json keeps what was measured; OUT/gpu-budget.md is the page.
"""

from __future__ import annotations

import argparse
import dataclasses
import sys
from collections.abc import Sequence
from pathlib import Path

from lfsr_core.base.records import read_record, write_record
from lfsr_core.optics.display import load_display
from lfsr_lab.experiments.engine.renders import Store
from lfsr_lab.experiments.engine.report import exit_code, write_report
from lfsr_lab.experiments.gpu_budget import page
from lfsr_lab.experiments.gpu_budget.budget import read_gpus
from lfsr_lab.experiments.gpu_budget.measure import Measured, measure

STEM = "gpu-budget"


@dataclasses.dataclass(frozen=True)
class Record:
    """Everything that was measured."""

    measured: tuple[Measured, ...] = ()


def main(argv: Sequence[str] | None = None) -> int:
    """Return the exit code: 0, 2 after bad input, 130 if stopped."""
    parser = argparse.ArgumentParser(prog=page.COMMAND, description=__doc__.splitlines()[0])
    add = parser.add_argument
    add("-o", "--output", type=Path, required=True, metavar="OUT", help="folder of the page and of the renders")
    add("--measure", type=Path, metavar="SCENE", help="render this scene and time every step")
    add("--display", default=page.DISPLAY, metavar="NAME", help="of the measurement; default: %(default)s")
    add("--scale", type=int, default=page.EXAMPLE[0], metavar="S", help="of the measurement; default: %(default)s")
    add("--spp", type=int, default=page.EXAMPLE[1], metavar="N", help="of the measurement; default: %(default)s")
    add("--blender", metavar="PATH", help="Blender 4.5 or newer; default: the bpy package, then PATH")
    arguments = parser.parse_args(argv)
    return exit_code("gpu_budget", lambda: run(arguments))


def run(arguments: argparse.Namespace) -> None:
    """Measure if asked to, then write the page and name its files."""
    path = arguments.output / f"{STEM}.json"
    record = read_record(path, Record, "measured steps") if path.exists() else Record()
    if arguments.measure:
        found = measure(Store(arguments.output / "renders", arguments.blender), arguments.measure,
                        load_display(arguments.display), arguments.scale, arguments.spp)
        record = Record((*(each for each in record.measured if _place(each) != _place(found)), found))
    write_record(path, record)
    texts = {".md": lambda: page.markdown(read_gpus(), record.measured)}
    print("\n".join(map(str, write_report(arguments.output, STEM, None, texts))))


def _place(found: Measured) -> tuple[object, ...]:
    return found.device, found.environment.machine, found.display, found.scale, found.spp


if __name__ == "__main__":
    sys.exit(main())
