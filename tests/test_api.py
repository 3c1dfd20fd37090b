"""What ``import lfsr_core`` offers, and the notebook's face on a played Blender and in memory."""

import subprocess
import sys

import numpy as np
import pytest

import lfsr_core
from lfsr_core.api import reconstruct
from lfsr_core.base.messages import LfsrError
from lfsr_core.images.image_files import read_layers, read_png
from lfsr_core.reconstruct.upscaler import low_resolution
from tests.support.finished import finished
from tests.support.played_blender import played_blender
from tests.support.requests import make_request
from tests.support.synthetic import MINI, write_render


@pytest.fixture(scope="module")
def frame(tmp_path_factory):
    folder = tmp_path_factory.mktemp("api")
    (folder / "scene.glb").touch()
    return lfsr_core.render(folder / "scene.glb", folder / "frame", display="mini", scale=np.int64(2), method="bicubic",
                            samples=np.int64(16), blender=played_blender(folder / "blender"), progress=False)


def test_a_scene_becomes_views_is_finished_compared_and_exported(frame, tmp_path):
    assert frame.views.shape == (8, 8, 12, 16, 3) and frame.views.dtype == np.uint8
    assert frame.linear.shape == (96, 128, 3) and frame.report.method == "bicubic"
    assert frame._repr_png_().startswith(b"\x89PNG") and "mini" in repr(frame)
    left, right = frame.eye(-40), frame.eye(40)
    assert left.shape == right.shape == frame.eye().shape and (left != right).any()
    before = frame.views
    assert (frame.finish("nearest").views != before).any() and frame.report.method == "nearest"
    request = make_request(str(tmp_path / "reference"), MINI, str(frame.folder.path.with_name("scene.glb")),
                           kind="reference", scale=1, samples=64)
    lfsr_core.make(request, blender=str(frame.folder.path.with_name("blender")))
    assert 0 < frame.compare(request.output).ssim_eia_fg <= 1
    [quilt] = frame.export("quilt", tmp_path / "quilt", views=(4, 1), grid=(4, 1))
    assert read_png(quilt).shape[2] == 3


def test_progress_goes_to_whoever_asks_for_it(frame, tmp_path):
    told = []
    lfsr_core.render(frame.folder.path.with_name("scene.glb"), tmp_path / "frame", display="mini", rays=1,
                     method="none", scale=1, blender=str(frame.folder.path.with_name("blender")), progress=told.append)
    assert told and told[-1].fraction == 1
    with pytest.raises(LfsrError, match="kind is 'reference', expected 'render'"):
        lfsr_core.render(frame.folder.path.with_name("scene.glb"), tmp_path / "other", display="mini", scale=1,
                         samples=2, kind="reference", blender=str(frame.folder.path.with_name("blender")))


def test_depth_is_that_of_what_is_covered(tmp_path):
    frame = lfsr_core.RenderedFrame(finished(tmp_path / "frame"))
    depth, distance = frame.depth, frame.folder.frame.array.distance
    assert depth.shape == (48, 64) and set(np.round(depth.astype(float) / distance, 3).ravel()) == {0.8, 1.25}
    with pytest.raises(LfsrError, match="position"):
        _ = lfsr_core.RenderedFrame(write_render(tmp_path / "other")).depth


def test_reconstruction_in_memory_is_that_of_a_folder(tmp_path):
    folder = write_render(tmp_path / "frame")
    lfsr_core.finish_frame(folder, "bicubic")
    frame = lfsr_core.RenderedFrame(folder)
    low = low_resolution(read_layers(folder / "lr_eia.exr"), frame.folder.frame)
    result, mask = reconstruct(low, "bicubic"), read_png(folder / "eia.png").any(-1)
    assert result.shape == frame.linear.shape
    lenses = frame.linear.reshape(12, 8, 16, 8, 3).any(axis=(1, 3, 4)) & mask.reshape(12, 8, 16, 8).any(axis=(1, 3))
    assert np.isclose(result, frame.linear, atol=1e-5).reshape(12, 8, 16, 8, 3).all(axis=(1, 3, 4))[lenses].mean() > 0.9


def test_the_list_of_names_is_complete_documented_and_loads_nothing_heavy():
    assert {*lfsr_core.__all__} == {"__version__", *" ".join(lfsr_core._MODULES.values()).split()}
    with pytest.raises(AttributeError, match="no attribute 'finish_frames'"):
        _ = lfsr_core.finish_frames
    for name in lfsr_core.__all__:
        value = getattr(lfsr_core, name)
        assert name in dir(lfsr_core)
        assert isinstance(value, str) or value.__doc__
    code = "import sys, lfsr_core; print(sorted({'numpy', 'torch', 'bpy', 'OpenImageIO'} & set(sys.modules)))"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "[]"
