"""``lfsr merge PARTS… -o DIR``: join parts of a frame that were rendered on several machines."""

from __future__ import annotations

import argparse
from contextlib import closing
from pathlib import Path
from typing import Any

from lfsr_core.base.notices import ProgressBar
from lfsr_core.commands.sentences import sentence

NAME = "merge"
HELP = "join parts of `lfsr render --rows` or `lfsr reference --rows`, or average references of other seeds"


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Arguments of this verb."""
    parser.add_argument("parts", type=Path, nargs="+", metavar="PART",
                        help="folder of a part, in any order, or a folder of such folders")
    parser.add_argument("-o", "--output", type=Path, required=True, metavar="DIR", help="frame folder to write")
    parser.add_argument("--numbered", action="store_true",
                        help="write into a folder of DIR named by the frame's number, such as 0001")


def run(arguments: argparse.Namespace) -> Any:
    """Join the parts and print the result."""
    from lfsr_core.frames.folder import FrameFolder
    from lfsr_core.pipeline.merge import merge, part_folders

    parts, output = part_folders(arguments.parts), arguments.output
    if arguments.numbered:
        output = FrameFolder.of_frame(output, FrameFolder(parts[0]).part.frame).path
    with closing(ProgressBar(words=sentence)) as bar:
        frame = merge(parts, output, bar)
    print(f"{output}: {len(parts)} parts, {frame.samples} samples, rendered in "
          f"{frame.seconds.get('render', 0.0):.1f} s in all")
    return {"folder": output, "parts": len(parts), "frame": frame}
