"""An executable that plays Blender: it writes what Blender would for a job of a synthetic light field."""

from __future__ import annotations

import sys
from pathlib import Path

ROOT = Path(__file__).parents[2]
BLENDER = """#!{python}
import json, sys
from pathlib import Path
sys.path.insert(0, {root!r})
if "--version" in sys.argv:
    print("Blender 5.0.1")
    sys.exit()
from tests.support.noisy_renders import render
from lfsr_core.frames.job import read_job
jobs = [read_job(path) for path in sys.argv[sys.argv.index("--") + 2:]]
for job in jobs:
    render(job)
    if len(jobs) > 1:
        print('LFSR {{"stage": "rendered"}}', flush=True)
print('LFSR {{"stage": "done", "folder": "."}}')
"""


def played_blender(path: Path) -> str:
    """Write the executable to ``path``; its name."""
    path.write_text(BLENDER.format(python=sys.executable, root=str(ROOT)))
    path.chmod(0o755)
    return str(path)
