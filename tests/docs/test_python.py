"""The programs of docs/reference/python.md: each runs as it stands, and passes a type checker."""

import os
import re
import subprocess
import sys
from pathlib import Path

import pytest

import lfsr_core
from tests.support.prerequisites import needs_bpy
from tests.support.synthetic import write_render

ROOT = Path(__file__).parents[2]
PAGE = (ROOT / "docs" / "reference" / "python.md").read_text(encoding="utf-8")
PROGRAMS = dict(re.findall(r"^## ([^\n]+)\n(?:(?!^## ).)*?^```python\n(.*?)^```", PAGE, re.MULTILINE | re.DOTALL))
NEED_BLENDER = {"Render a scene", "Compare methods"}
FILES = {"Render a scene": ["frame/eia.png", "frame/eia.exr"], "Compare methods": ["reference/reference_a.exr"],
         "Work on the views": ["middle.png", "epi.png", "without-parallax.png"],
         "See through an eye": ["eye-left.png", "eye-middle.png", "eye-right.png"],
         "Hand it on": ["frame/view.html", "imported/eia.png"]}


def run(folder: Path, *command: str | Path) -> str:
    done = subprocess.run([sys.executable, *map(str, command)], cwd=folder, capture_output=True, text=True, check=False,
                          env=os.environ | {"PYTHONPATH": str(ROOT), "PYTHONUTF8": "1"})
    assert done.returncode == 0, done.stdout + done.stderr
    return done.stdout


def test_there_are_five_programs_and_every_public_name():
    assert set(PROGRAMS) == set(FILES)
    assert [name for name in lfsr_core.__all__ if not re.search(rf"\b{name}\b", PAGE)] == ["__version__"]


@needs_bpy
@pytest.mark.slow
def test_programs_that_render(tmp_path):
    import bpy
    bpy.ops.wm.read_homefile(use_factory_startup=True)
    bpy.ops.wm.save_as_mainfile(filepath=str(tmp_path / "scene.blend"))
    for name in (name for name in PROGRAMS if name in NEED_BLENDER):
        assert run(tmp_path, "-c", PROGRAMS[name]) and all((tmp_path / file).exists() for file in FILES[name]), name


@pytest.mark.parametrize("name", sorted(set(FILES) - NEED_BLENDER))
def test_programs_on_a_finished_frame(tmp_path, name):
    lfsr_core.finish_frame(write_render(tmp_path / "frame"), "bilinear")
    run(tmp_path, "-c", PROGRAMS[name])
    assert all((tmp_path / file).exists() for file in FILES[name])


USER = """import lfsr_core
from lfsr_core import Finish, FrameFolder, Metrics, Report, RenderedFrame, compare_folders, finish_frame

folder: FrameFolder = FrameFolder("frame")
report: Report = finish_frame("frame", Finish("denoise+bilinear", dilate=1))
metrics: Metrics = compare_folders("frame", "reference")
brightest: int = int(RenderedFrame("frame").views.max())
print(report.seconds["render"], metrics.notes, brightest, folder.frame.display.lenses[0] + 1, lfsr_core.__version__)
"""
WRONG = ["from lfsr_core import finish_frames", "from lfsr_core import Finish; Finish('none', dilate='1')",
         "from lfsr_core import compare_folders; compare_folders('a', 'b')['p']",
         "from lfsr_core import FrameFolder; FrameFolder('a').frame.display.lense"]


@pytest.mark.slow
def test_a_strict_type_checker_knows_the_public_names(tmp_path):
    right = {f"right{number}": text for number, text in enumerate([USER, *PROGRAMS.values()])}
    wrong = {f"wrong{number}": text + "\n" for number, text in enumerate(WRONG)}
    for name, text in (right | wrong).items():
        (tmp_path / f"{name}.py").write_text(text, encoding="utf-8")
    checked = subprocess.run([sys.executable, "-m", "mypy", "--strict", "--ignore-missing-imports",
                              "--follow-imports=silent", *sorted(tmp_path.glob("*.py"))], cwd=ROOT, check=False,
                             capture_output=True, text=True, env=os.environ | {"MYPYPATH": str(ROOT)})
    assert set(re.findall(r"(\w+)\.py:\d+: error", checked.stdout)) == set(wrong), checked.stdout + checked.stderr
