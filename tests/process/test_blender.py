"""The command lines that start Blender."""

from pathlib import Path

from lfsr_core.process.blender import Blender


def test_blenders_own_python_is_told_where_both_packages_lie():
    words = Blender("/opt/blender").command(Path("job.json"))
    script = Path(words[words.index("--python") + 1])
    assert (script.parents[2] / "lfsr_core" / "__init__.py").is_file() and "parents[2]" in script.read_text()
    assert words[0] == "/opt/blender" and words[-1] == "job.json"
