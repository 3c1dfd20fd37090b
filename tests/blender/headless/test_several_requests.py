"""Several jobs in one Blender: each renders the same image as alone."""

import bpy
import numpy as np
import pytest

from lfsr_core.frames.frame import read_frame
from lfsr_core.images.exr import read_layers
from lfsr_core.pipeline.make import render_all
from lfsr_core.process.child import find_blender
from tests.support.processes import run_lfsr
from tests.support.requests import make_request
from tests.support.scenes import MINI, add_box, add_lamp


@pytest.fixture
def blend(scene, tmp_path):
    """A box that moves, turns and changes its colour, and a lamp that grows brighter."""
    item = add_box(scene, (0, 0, 0), (0.5, 0.4, 0.3), bpy.data.materials.new("paint"))
    add_box(scene, (0, 1, 0), (2, 0.1, 2))
    lamp = add_lamp(scene)
    for frame, amount in ((1, 0.0), (9, 1.0)):
        item.location.x, item.rotation_euler.z, lamp.data.energy = amount - 0.5, amount, 100 + 200 * amount
        for owner, path in ((item, "location"), (item, "rotation_euler"), (lamp.data, "energy")):
            owner.keyframe_insert(path, frame=frame)
    bpy.ops.wm.save_as_mainfile(filepath=str(tmp_path / "scene.blend"))
    return tmp_path / "scene.blend"


@pytest.mark.parametrize("layout", ["one-pass", "lens-card"])
def test_frames_of_one_blender_are_those_of_several(blend, tmp_path, layout):
    def job(name, frame):
        return make_request(str(tmp_path / name), MINI, str(blend), scale=2, samples=4, frame=frame, layout=layout,
                   layers=("albedo", "position"))
    rendered = []
    jobs = [job(f"{frame:04d}", frame) for frame in (1, 5, 9)]
    render_all(jobs, find_blender(), rendered=rendered.append)
    assert rendered == jobs
    opened = [read_frame(done.output).seconds["open"] for done in jobs]
    assert opened[0] > 0 and opened[1:] == [0, 0]
    render_all([job("alone", 9)], find_blender())
    alone, last = (read_layers(tmp_path / name / "lr_eia.exr") for name in ("alone", "0009"))
    for layer, pixels in alone.items():
        np.testing.assert_array_equal(last[layer], pixels, layer)
    first = read_layers(tmp_path / "0001" / "lr_eia.exr")
    assert np.abs(first["color"] - last["color"]).mean() > 0.01
    assert sorted(path.name for path in tmp_path.iterdir()) == ["0001", "0005", "0009", "alone", "scene.blend"]


def test_an_animation_from_the_command(blend, tmp_path):
    for made, kept in ((3, 0), (0, 3)):
        said = run_lfsr("render", blend, "-o", tmp_path / "film", "--frames", "1-9x4", "--display", "mini",
                        "--scale", 4, "--spp", 2, "--method", "bicubic")
        assert f"3 frames: {made} made, {kept} kept, 0 failed" in said
    assert sorted(path.name for path in (tmp_path / "film").iterdir()) == ["0001", "0005", "0009"]
    images = {path.read_bytes() for path in (tmp_path / "film").glob("*/eia.png")}
    assert len(images) == 3
