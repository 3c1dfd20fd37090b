"""``lfsr farm`` and ``lfsr merge``: renders on several machines."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import Any

from lfsr_core.base.errors import LfsrError
from lfsr_core.commands.common import progress
from lfsr_core.frames.folder import FrameFolder
from lfsr_core.pipeline.farms import NEXT, TEMPLATES, write_template


def farm_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the arguments of `lfsr farm`."""
    parser.add_argument("farm", choices=TEMPLATES, help="openjd: a job template of Open Job Description; flamenco: a "
                                                        "job type of Flamenco 3")
    parser.add_argument("-o", "--output", type=Path, metavar="FILE",
                        help="default: lfsr-openjd.yaml or lfsr-flamenco.js here")


def run_farm(arguments: argparse.Namespace) -> Any:
    """Write the template and print its path."""
    name = TEMPLATES[arguments.farm]
    output = arguments.output or Path(f"lfsr-{name}")
    if output.is_dir():
        raise LfsrError(f"{output} is a folder, but the template is a file: give a file in it, as {output / name}")
    write_template(arguments.farm, output)
    print(f"{output}: {NEXT[arguments.farm].replace('FILE', str(output))}")
    return {"file": output}


def merge_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the arguments of `lfsr merge`."""
    parser.add_argument("parts", type=Path, nargs="+", metavar="PART",
                        help="folder of a part, in any order, or a folder of such folders")
    parser.add_argument("-o", "--output", type=Path, required=True, metavar="DIR", help="frame folder to write")
    parser.add_argument("--numbered", action="store_true",
                        help="write into a folder of DIR named by the frame's number, such as 0001")


def run_merge(arguments: argparse.Namespace) -> Any:
    """Join the parts and print the result."""
    from lfsr_core.pipeline.merge import merge, part_folders

    parts, output = part_folders(arguments.parts), arguments.output
    if arguments.numbered:
        output = FrameFolder.of_frame(output, FrameFolder(parts[0]).part.frame).path
    with progress() as bar:
        frame = merge(parts, output, bar)
    print(f"{output}: {len(parts)} parts, {frame.samples} samples, rendered in "
          f"{frame.seconds.get('render', 0.0):.1f} s in all")
    return {"folder": output, "parts": len(parts), "frame": frame}
