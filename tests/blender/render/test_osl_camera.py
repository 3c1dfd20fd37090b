"""A shader that does not compile is an error, never the shader before it."""

import re
import subprocess
import sys

import bpy
import numpy as np
import pytest
import torch

from blender_addon.render import cycles
from lfsr_core.optics.rays import RayLayout
from lfsr_core.reconstruct import denoiser
from lfsr_core.reconstruct.methods.denoise import denoise_eia
from lfsr_lab.networks.denoiser import Denoiser, hdr_decode, hdr_encode, stock_weights
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


@pytest.mark.parametrize("size", ["base", "small"])
def test_a_render_is_denoised_alike(scene, tmp_path, monkeypatch, size):
    add_box(scene, (0, 0, 0), (0.5, 0.5, 0.5))
    scene.world = bpy.data.worlds.new("world")
    noisy = encoded(scene, RayLayout.for_display(MINI, ARRAY, 2), tmp_path, samples=2)["color"][..., :3]
    stock = stock_weights("hdr", size)
    denoiser.write_tza(tmp_path / "some.tza", stock)
    by_library = denoise_eia(noisy, weights=denoiser.load(tmp_path / "some.tza"))
    assert np.abs(by_library - noisy).mean() > 1e-3, "there is noise to take away"

    seen = torch.from_numpy(noisy.astype(np.float32)).permute(2, 0, 1)[None]
    with torch.inference_mode():
        by_twin = hdr_decode(Denoiser.from_tensors(stock)(hdr_encode(seen)))[0].permute(1, 2, 0).numpy()
    np.testing.assert_allclose(by_twin, by_library, rtol=1e-4, atol=1e-4)

    monkeypatch.setitem(sys.modules, "pyoidn", None)
    by_blender = denoise_eia(noisy, weights=denoiser.load(tmp_path / "some.tza"))
    np.testing.assert_allclose(by_blender, by_library, rtol=1e-3, atol=1e-3)
