"""Six scenes that nothing was trained, tuned or chosen on, as .blend files, for one last measurement.

    python scripts/scenes/unseen_scenes.py DIR

They are ``glitter``, ``cloth``, ``room``, ``city``, ``deep`` and ``world``; docs/results/networks.md says how they are
measured. Once their figures have led to a change of a method they are unseen no more: write others then.
"""

from __future__ import annotations

import sys
from pathlib import Path

# This folder, and where lfsr_core lies: beside the installed package, or at the root of a clone.
sys.path.insert(0, str(Path(__file__).resolve().parent))
sys.path.extend(str(folder) for folder in Path(__file__).resolve().parents[1:3])

import numpy as np
from shared.script import save
from unseen.builders import BUILDERS
from unseen.stage import begin


def main(folder: Path) -> None:
    """Write every scene into ``folder``."""
    folder.mkdir(parents=True, exist_ok=True)
    for number, (name, build) in enumerate(BUILDERS.items()):
        begin()
        build(np.random.default_rng([17, number]))
        save(folder / f"{name}.blend")


if __name__ == "__main__":
    main(Path(sys.argv[-1]))
