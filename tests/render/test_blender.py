"""The command lines that start Blender."""

from __future__ import annotations

import os
from pathlib import Path

from lfsr_core.render.blender import Blender


def test_blenders_own_python_gets_the_folders_of_the_packages():
    words = Blender("/opt/blender").command(Path("job.json"))
    folders = [Path(folder) for folder in words[words.index("--") + 1].split(os.pathsep)]
    for package in ("lfsr_core", "cattrs", "attr"):
        assert any((folder / package / "__init__.py").is_file() for folder in folders), package
    assert words[0] == "/opt/blender" and words[-1] == "job.json"
