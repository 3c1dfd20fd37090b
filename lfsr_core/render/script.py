"""Scripts that make or change scenes inside Blender, run to their end."""

from __future__ import annotations

import subprocess
from collections.abc import Iterable
from pathlib import Path
from typing import Any

from lfsr_core.errors import LfsrError
from lfsr_core.render.blender import Blender
from lfsr_core.render.protocol import EXIT_BAD_INPUT, parse_progress


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
    command = blender.script_command(script, str(argument))
    done = subprocess.run(command, capture_output=True, text=True, errors="replace", check=False)
    last: dict[str, Any] = {}
    for line in done.stdout.splitlines():
        last = parse_progress(line) or last
    if done.returncode == EXIT_BAD_INPUT and last.get("stage") == "error":
        raise LfsrError(str(last.get("message")))
    missing = [path for path in products if not path.exists()]
    if done.returncode or missing:
        lines = (done.stderr.strip() or done.stdout.strip() or "nothing").splitlines()
        lacking = f" without writing {missing[0]}" if missing else ""
        raise LfsrError(f"Blender stopped with exit code {done.returncode} in {script.name}{lacking}, last saying "
                        f"{lines[-1]!r}: run the script by hand to see more")
