"""Scenes that are made inside Blender: to train on, to measure with, and the demo."""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path

from lfsr_core.process.child import Blender, Child


def run_script(blender: Blender, script: Path, argument: Path, products: Iterable[Path]) -> None:
    """Run ``script`` with ``argument`` in Blender.

    Parameters
    ----------
    blender : the Blender to run it in
    script : Python file, see ``blender.scene_script``
    argument : its one argument, a file to read or to write
    products : files that must be there when it is done

    Raises
    ------
    LfsrError : with the script's own sentence, or with its last line after a crash or where a product is missing
    """
    with Child(blender.script_command(script, str(argument))) as child:
        for _ in child.records():
            pass
        code = child.wait()
        missing = [path for path in products if not path.exists()]
        if code or missing:
            lacking = f" without writing {missing[0]}" if missing else ""
            raise child.crash(f"Blender stopped in {script.name}{lacking} with", "run the script by hand to see more")


def scene_script(name: str) -> Path:
    """Path of a script of this package, to be run in Blender."""
    return Path(__file__).parent / name
