"""The command with real Blender: the demo scene to images and numbers, a bad scene, a lens sheet."""

import dataclasses
import re
import subprocess
import sys

import numpy as np
import pytest

from lfsr_core.exports.light_field import read_views
from lfsr_core.images.png import read_png
from lfsr_core.optics.display import write_profile
from lfsr_core.optics.eia import to_views
from tests.support.panels import hexagonal
from tests.support.prerequisites import needs_bpy
from tests.support.processes import ROOT, run_lfsr

pytestmark = needs_bpy


@pytest.fixture(scope="module")
def scene(tmp_path_factory):
    path = tmp_path_factory.mktemp("scene") / "demo.blend"
    script = ROOT / "scripts" / "lab" / "lfsr_lab" / "scenes" / "demo_scene.py"
    subprocess.run([sys.executable, script, path], check=True, capture_output=True)
    return path


def test_demo_scene_stands_the_right_way_round_and_moves_against_the_eye(scene, tmp_path):
    said = run_lfsr("render", scene, "-o", tmp_path / "frame", "--display", "small", "--scale", 4, "--spp", 4)
    assert re.search(r"^render +\d+%", said, re.M) and "write      100%" in said
    views = read_views(tmp_path / "frame").astype(int)
    middle = views[20, 20]
    bluest = (middle[..., 2] - middle[..., 0]).argmax()
    greenest = (2 * middle[..., 1] - middle[..., 0] - middle[..., 2]).argmax()
    rows, columns = np.unravel_index([bluest, greenest], middle.shape[:2])
    assert columns[0] < 8, "the blue cone is on the left"
    assert rows[1] > 8, "the green cube is low"
    assert middle[1:4, 12:19].sum() > 4 * middle[1:4, 3:10].sum(), "the text is at the upper right"

    def column_of_green(view: np.ndarray) -> float:
        green = np.maximum(2 * view[..., 1] - view[..., 0] - view[..., 2] - 40, 0).sum(0)
        return green @ np.arange(len(green)) / green.sum()

    assert column_of_green(views[20, 35]) < column_of_green(views[20, 4]) - 0.5, "near things move left"


def test_a_lens_sheet_from_scene_to_panel(scene, tmp_path):
    """Lenses of 4 by 4 views; of cylinders, an image of every view is woven in tests of direct rendering."""
    write_profile(tmp_path / "own.toml", dataclasses.replace(hexagonal(), lenses=(48, 32), views=(4, 4)))
    run_lfsr("render", scene, "-o", tmp_path / "frame", "--display", tmp_path / "own.toml", "--scale", 2, "--spp", 4)
    panel = read_png(tmp_path / "frame" / "panel.png")
    assert panel.shape == (160, 240, 3) and panel.std() > 10
    run_lfsr("views", tmp_path / "frame", "--eye=0,0,300")
    middle = to_views(read_png(tmp_path / "frame" / "eia.png"), (48, 32))[2, 2]
    seen = read_png(tmp_path / "frame" / "eye.png")
    # The same image at another resolution: the simulated eye looks from the middle of the views.
    rows, columns = (np.linspace(0, size - 1, count).astype(int)
                     for size, count in zip(seen.shape, (32, 48), strict=False))
    assert np.corrcoef(seen[rows][:, columns].ravel(), middle.ravel())[0, 1] > 0.8
