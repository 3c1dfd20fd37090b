"""The command lines that start Blender."""

from __future__ import annotations

from pathlib import Path

from lfsr_core.render.blender import Blender


def test_blenders_own_python_gets_the_folder_of_the_package():
    words = Blender("/opt/blender").command(Path("job.json"))
    assert Path(words[words.index("--") + 1], "lfsr_core", "__init__.py").is_file()
    assert words[0] == "/opt/blender" and words[-1] == "job.json"
