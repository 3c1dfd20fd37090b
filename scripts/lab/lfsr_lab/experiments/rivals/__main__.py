"""Compare with methods of others, with their own stored weights, on our renders and on captured light fields.

    python -m lfsr_lab.experiments.rivals CLONES -o OUT --scenes FOLDER…

CLONES is a folder with clones of the public repositories, under their own names: lfepicnn and Sheared-EPI (of
GaochangWu), LightFieldAngularSR (angularsr), LightField_Denoising (tsfeith-epfl), epinet (chshin10), and LFBM5D
(V-Sense) with its program compiled as its README says. Nothing is fetched. A repository without a licence may be
measured, not shipped. OUT/rivals.json is the record, OUT/rivals.md its tables; the run can be stopped and repeated.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Sequence
from pathlib import Path

from lfsr_core.base.files import read_json, write_json
from lfsr_lab.experiments.engine.renders import Store
from lfsr_lab.experiments.engine.report import exit_code, write_text
from lfsr_lab.experiments.rivals import run
from lfsr_lab.experiments.rivals.page import markdown, record
from lfsr_lab.experiments.rivals.renders import SCENES

RECORD = "rivals.json"


def main(argv: Sequence[str] | None = None) -> int:
    """Return the exit code: 0, 2 after bad input, 130 if stopped."""
    arguments = _parser().parse_args(argv)
    return exit_code("rivals", lambda: compare(arguments))


def compare(arguments: argparse.Namespace) -> None:
    """Render and measure what is missing, then write the record and its tables."""
    folder, clones = arguments.output, arguments.clones
    store = Store(folder, arguments.blender, may_render=not arguments.only_measure)
    rows = run.scenes(arguments.scenes, clones, store, arguments.only)
    captured = {} if arguments.no_captured else run.captured(clones, folder / "captured")
    write_json(folder / RECORD, record(rows, captured))
    text = markdown(read_json(folder / RECORD, "a record"))
    print(write_text(folder / "rivals.md", text).read_text(encoding="utf-8"))


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(prog="python -m lfsr_lab.experiments.rivals",
                                     description=__doc__.splitlines()[0])
    add = parser.add_argument
    add("clones", type=Path, metavar="CLONES", help="folder with the clones")
    add("-o", "--output", type=Path, required=True, metavar="OUT", help="folder of everything that is made")
    add("--scenes", type=Path, nargs="+", default=(), metavar="FOLDER", help="folders of our scenes; default: none")
    add("--only", nargs="+", choices=SCENES, default=(), metavar="NAME", help="some of the scenes")
    add("--only-measure", action="store_true", help="render nothing")
    add("--no-captured", action="store_true", help="leave captured light fields out")
    add("--blender", metavar="PATH", help="Blender 4.5 or newer; default: the bpy package, then PATH")
    return parser


if __name__ == "__main__":
    sys.exit(main())
