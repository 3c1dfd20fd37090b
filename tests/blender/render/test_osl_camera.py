"""A shader that does not compile is an error, never the shader before it."""

import re
import subprocess
import sys

import bpy
import pytest

from blender_addon.render import cycles
from lfsr_core.optics.rays import RayLayout
from tests.support.scenes import ARRAY, MINI, ROOT, add_box, emission, encoded
from tests.support.told import refuses

GOOD = cycles.SOURCE.read_text()


@pytest.mark.parametrize("broken", ["shader", GOOD.replace("place_x", "misspelled", 1), GOOD.replace("}", "", 1), ""])
def test_broken_shader_is_an_error_and_not_the_last_good_one(scene, broken):
    camera = bpy.data.cameras.new("camera")
    cycles.set_shader(camera, GOOD, {"spacing": 0.5})
    refuses("rejected the ray-layout shader.*lens-card", cycles.set_shader, camera, broken, {"spacing": 1.5})
    assert camera.cycles_custom["spacing"] == 0.5, "neither half of it is set"


def test_blender_without_osl_says_what_to_do(scene, monkeypatch):
    import _cycles

    monkeypatch.setattr(_cycles, "with_osl", False)
    refuses("built without OSL.*lens-card", cycles.compile_osl, GOOD)


FULL = """
import resource, signal, sys, bpy
from blender_addon.render import cycles
from lfsr_core.base.errors import LfsrError
signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
source = cycles.SOURCE.read_text()
resource.setrlimit(resource.RLIMIT_FSIZE, (len(source) + int(sys.argv[1]),) * 2)
try:
    cycles.compile_osl(source)
except LfsrError as error:
    print("said:", error)
"""


@pytest.mark.skipif(sys.platform == "win32", reason="needs a POSIX limit on file size")
@pytest.mark.parametrize("room", [-1, 9000])
def test_a_full_temporary_folder_is_not_called_a_missing_camera(room):
    told = subprocess.run([sys.executable, "-c", FULL, str(room)], stdout=subprocess.PIPE, text=True, cwd=ROOT).stdout
    assert re.search(r"said: \S*lfsr-osl\S* cannot be written \(File too large\): free some space", told), told


def test_every_parameter_of_the_shader_is_set_and_no_other(scene):
    layout = RayLayout.for_display(MINI, ARRAY, lens_list=((1, 2), (3, 4)))
    interface = GOOD[GOOD.index("shader ray_layout("):GOOD.index("output point")]
    declared = {line.split("=")[0].split()[-1] for line in interface.splitlines() if "=" in line}
    assert set(cycles.layout_parameters(layout)) == declared


def test_new_parameters_replace_those_of_an_older_layout(scene):
    camera = bpy.data.cameras.new("camera")
    camera.cycles_custom["left_over"] = 1.0
    layout = RayLayout.for_display(MINI, ARRAY)
    cycles.set_shader(camera, cycles.layout_source(layout), cycles.layout_parameters(layout))
    assert "left_over" not in camera.cycles_custom


def test_hundreds_of_listed_lenses_render(scene, tmp_path):
    scene.world = bpy.data.worlds.new("world")
    lenses = tuple((row % 12, row // 12 % 16) for row in range(512))
    layout = RayLayout.for_display(MINI, ARRAY, 2, lens_list=lenses)
    add_box(scene, (0, 0, 0), (9, 0.1, 9), emission((0.5, 0.5, 0.5)))
    color = encoded(scene, layout, tmp_path)["color"]
    assert color.shape == (24 * 4, 22 * 4, 4) and color[..., :3] == pytest.approx(0.5)
