"""Three kinds of displays: this way of making their images against the usual one, time and accuracy.

    python -m lfsr_lab.experiments.displays SCENES… -o OUT               the real panels, many hours on a CPU
    python -m lfsr_lab.experiments.displays SCENES… -o OUT --width 384   panels of 384×216 pixels with the same sheets

What is complete in OUT is not done again. OUT/displays.json has everything, displays.md tables, displays.svg and
displays-traced.svg pictures: against every view, and against the panel's subpixels where it has a lens sheet.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Sequence
from pathlib import Path

from lfsr_lab.experiments.displays.kinds import FULL_WIDTH, kind
from lfsr_lab.experiments.displays.run import Settings, compare, write_pages
from lfsr_lab.experiments.engine.environment import check_packages
from lfsr_lab.experiments.engine.report import exit_code


def main(argv: Sequence[str] | None = None) -> int:
    """Exit code 0, 2 after bad input, 130 if stopped."""
    arguments = _parser().parse_args(argv)
    return exit_code("chart_displays", lambda: run(arguments))


def run(arguments: argparse.Namespace) -> None:
    """Render and measure what is missing, then write the pages and name them."""
    check_packages()
    for name in FULL_WIDTH:
        kind(name, arguments.width)
    settings = Settings(arguments.output, arguments.width, arguments.reference_spp, arguments.blender)
    found = compare(settings, arguments.scenes, lambda line: print(line, file=sys.stderr, flush=True))
    print("\n".join(map(str, write_pages(arguments.output, found))))


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(prog="chart_displays", description=__doc__.splitlines()[0])
    add = parser.add_argument
    add("scenes", type=Path, nargs="+", metavar="SCENE", help=".blend, .glb, .gltf or .obj")
    add("-o", "--output", type=Path, required=True, metavar="OUT", help="folder of everything that is made")
    add("--width", type=int, metavar="PIXELS", help="of cut-down panels, a multiple of 192; default: the real panels")
    add("--reference-spp", type=int, default=1024, metavar="N", help="default: %(default)s")
    add("--blender", metavar="PATH", help="default: the bpy package, then PATH")
    return parser


if __name__ == "__main__":
    sys.exit(main())
