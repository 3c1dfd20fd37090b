"""Six scenes that nothing was trained, tuned or chosen on, as .blend files, for one last measurement.

    python scripts/lab/lfsr_lab/scenes/unseen_scenes.py DIR

They are ``glitter``, ``cloth``, ``room``, ``city``, ``deep`` and ``world``; docs/results/networks.md says how they are
measured. Once their figures have led to a change of a method they are unseen no more: write others then.
"""

from __future__ import annotations

import sys
from pathlib import Path

# Where lfsr_lab and lfsr_core are: installed side by side, or in a clone, scripts/lab and the root.
sys.path.extend(str(Path(__file__).resolve().parents[level]) for level in (2, 4))

import numpy as np

from lfsr_lab.scenes.shared.script import save
from lfsr_lab.scenes.unseen.builders import BUILDERS
from lfsr_lab.scenes.unseen.stage import begin


def main(folder: Path) -> None:
    """Write every scene into ``folder``."""
    folder.mkdir(parents=True, exist_ok=True)
    for number, (name, build) in enumerate(BUILDERS.items()):
        begin()
        build(np.random.default_rng([17, number]))
        save(folder / f"{name}.blend")


if __name__ == "__main__":
    main(Path(sys.argv[-1]))
