"""The command with real Blender: the demo scene to images and numbers, bad scenes, Ctrl-C."""

import dataclasses
import json
import os
import re
import signal
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest

from lfsr_core.frames.views import read_views
from lfsr_core.images.png import read_png
from lfsr_core.optics.display import write_profile
from lfsr_core.optics.eia import to_views
from tests.support.panels import SHEETS
from tests.support.prerequisites import needs_bpy

pytestmark = needs_bpy
ROOT = Path(__file__).parents[2]


def lfsr(*arguments: object, **options) -> subprocess.CompletedProcess[str]:
    command = [sys.executable, "-m", "lfsr_core.cli", *map(str, arguments)]
    return subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=False, timeout=300, **options)


@pytest.fixture(scope="module")
def scene(tmp_path_factory):
    path = tmp_path_factory.mktemp("scene") / "demo.blend"
    script = ROOT / "scripts" / "lab" / "lfsr_lab" / "scenes" / "demo_scene.py"
    subprocess.run([sys.executable, script, path], check=True, capture_output=True)
    return path


@pytest.fixture(scope="module")
def frame(scene, tmp_path_factory):
    folder = tmp_path_factory.mktemp("frame") / "frame"
    answer = lfsr("render", scene, "-o", folder, "--display", "small", "--scale", "4", "--spp", "4")
    assert answer.returncode == 0, answer.stderr
    assert re.search(r"^render +\d+%", answer.stderr, re.M) and "write      100%" in answer.stderr
    return folder


def test_demo_scene_stands_the_right_way_round(frame):
    views = read_views(frame).astype(int)
    middle = views[20, 20]
    bluest = (middle[..., 2] - middle[..., 0]).argmax()
    greenest = (2 * middle[..., 1] - middle[..., 0] - middle[..., 2]).argmax()
    rows, columns = np.unravel_index([bluest, greenest], middle.shape[:2])
    assert columns[0] < 8, "the blue cone is on the left"
    assert rows[1] > 8, "the green cube is low"
    assert middle[1:4, 12:19].sum() > 4 * middle[1:4, 3:10].sum(), "the text is at the upper right"


def test_near_things_move_left_when_the_eye_moves_right(frame):
    views = read_views(frame).astype(float)

    def column_of_green(view: np.ndarray) -> float:
        green = np.maximum(2 * view[..., 1] - view[..., 0] - view[..., 2] - 40, 0).sum(0)
        return green @ np.arange(len(green)) / green.sum()

    assert column_of_green(views[20, 35]) < column_of_green(views[20, 4]) - 0.5


def test_reference_and_comparison(scene, frame, tmp_path):
    answer = lfsr("reference", scene, "-o", tmp_path / "reference", "--display", "small", "--spp", "32",
                  "--lenses", "24")
    assert answer.returncode == 0, answer.stderr
    answer = lfsr("compare", frame, tmp_path / "reference")
    assert answer.returncode == 0, answer.stderr
    metrics = json.loads((frame / "report.json").read_text())["metrics"]
    assert 0.4 < metrics["p"] < 0.8
    assert metrics["ssim_lens_fg"] > 0.6
    assert metrics["psnr_fg"] > 18


@pytest.mark.parametrize(("name", "content", "message"), [
    ("broken.blend", b"BLENDER-v", "broken.blend"),
    ("broken.glb", b"glTF\x02\x00\x00\x00", "broken.glb"),
    ("empty.gltf", b'{"asset": {"version": "2.0"}}', "subject"),
])
def test_bad_scene_is_one_sentence_and_leaves_nothing(tmp_path, name, content, message):
    (tmp_path / name).write_bytes(content)
    answer = lfsr("render", tmp_path / name, "-o", tmp_path / "frame", "--display", "mini")
    assert answer.returncode == 2, answer.stderr
    assert message in answer.stderr.splitlines()[-1]
    assert "Traceback" not in answer.stderr
    assert [path.name for path in tmp_path.iterdir()] == [name]


def test_unknown_subject_names_the_collections(scene, tmp_path):
    answer = lfsr("render", scene, "-o", tmp_path / "frame", "--display", "mini", "--subject", "Nothing")
    assert answer.returncode == 2
    assert "'Nothing'" in answer.stderr.splitlines()[-1]
    assert list(tmp_path.iterdir()) == []


def processes_naming(path: Path) -> list[str]:
    """Command lines of running processes that mention ``path``."""
    lines = []
    for file in Path("/proc").glob("[0-9]*/cmdline"):
        try:
            lines.append(file.read_bytes().replace(b"\0", b" ").decode(errors="replace"))
        except OSError:  # ended meanwhile
            continue
    return [line for line in lines if str(path) in line]


def test_interrupt_ends_a_real_render_soon(scene, tmp_path):
    command = [sys.executable, "-m", "lfsr_core.cli", "render", str(scene), "-o", str(tmp_path / "frame"),
               "--display", "fhd", "--scale", "2", "--spp", "4096", "--method", "nearest"]
    program = subprocess.Popen(command, cwd=ROOT, stderr=subprocess.PIPE, text=True, bufsize=1,
                               env=os.environ | {"PYTHONUNBUFFERED": "1"})
    try:
        next(line for line in program.stderr if line.startswith("render"))
        sent = time.monotonic()
        program.send_signal(signal.SIGINT)
        program.communicate(timeout=60)
    finally:
        program.kill()
    assert program.returncode == 130
    assert time.monotonic() - sent < 30
    assert list(tmp_path.iterdir()) == []
    assert processes_naming(tmp_path) == [], "Blender must not live on"


@pytest.mark.parametrize("kind", ["lenticular", "hexagonal"])
def test_a_lens_sheet_from_scene_to_panel(scene, tmp_path, kind):
    views = (8, 1) if kind == "lenticular" else (4, 4)
    write_profile(tmp_path / "own.toml", dataclasses.replace(SHEETS[kind](), lenses=(48, 32), views=views))
    answer = lfsr("render", scene, "-o", tmp_path / "frame", "--display", tmp_path / "own.toml", "--scale", "2",
                  "--spp", "4")
    assert answer.returncode == 0, answer.stderr
    panel = read_png(tmp_path / "frame" / "panel.png")
    assert panel.shape == (160, 240, 3) and panel.std() > 10
    answer = lfsr("views", tmp_path / "frame", "--eye=0,0,300")
    assert answer.returncode == 0, answer.stderr
    middle = to_views(read_png(tmp_path / "frame" / "eia.png"), (48, 32))[views[1] // 2, views[0] // 2]
    seen = read_png(tmp_path / "frame" / "eye.png")
    # The same image at another resolution: the simulated eye looks from the middle of the views.
    rows, columns = (np.linspace(0, size - 1, count).astype(int)
                     for size, count in zip(seen.shape, (32, 48), strict=False))
    assert np.corrcoef(seen[rows][:, columns].ravel(), middle.ravel())[0, 1] > 0.8
