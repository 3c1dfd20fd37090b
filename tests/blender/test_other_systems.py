"""A real render as on Windows and macOS, whose functions, locks and open files stand-ins play on Linux."""

import sys

import bpy
import pytest

from lfsr_core.frames.frame import read_frame
from lfsr_core.images.png import read_png
from tests.support.other_systems import FOLDER, SYSTEMS
from tests.support.scenes import add_box, emission


@pytest.mark.skipif(sys.platform != "linux", reason="the stand-ins are of Linux")
@pytest.mark.parametrize("system", SYSTEMS[:1], ids=lambda system: system.name)
def test_a_render_and_another_into_the_same_folder(scene, tmp_path, system):
    folder = tmp_path / FOLDER
    folder.mkdir()
    add_box(scene, (0, 0, 0), (0.5, 0.5, 0.5), emission((1, 0.5, 0.2)))
    bpy.ops.wm.save_as_mainfile(filepath=str(folder / "scene.blend"))
    for seed in (1, 2):
        system.lfsr(["render", str(folder / "scene.blend"), "-o", str(folder / "frame"), "--display", "mini", "--scale",
                     "4", "--spp", "1", "--method", "bicubic", "--seed", str(seed)])
        assert read_frame(folder / "frame").seed == seed and read_png(folder / "frame" / "eia.png").any()
    assert sorted(path.name for path in folder.iterdir()) == ["frame", "scene.blend"]
