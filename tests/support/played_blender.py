"""An executable that plays Blender: it writes what Blender would for a job of a synthetic light field."""

import sys
from pathlib import Path

ROOT = Path(__file__).parents[2]
BLENDER = """#!{python}
import sys
sys.path.insert(0, {root!r})
if "--version" in sys.argv:
    print("Blender 5.0.1")
    sys.exit()
from tests.support import noisy_renders
sys.exit(noisy_renders.play(sys.argv[1:]))
"""


def played_blender(path: Path) -> str:
    """Write the executable to ``path``; its name."""
    path.write_text(BLENDER.format(python=sys.executable, root=str(ROOT)))
    path.chmod(0o755)
    return str(path)
