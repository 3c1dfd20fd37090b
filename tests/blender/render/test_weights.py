"""Weights on a real render: the PyTorch twin, pyoidn's library and Blender's own make the same image."""

import sys

import bpy
import numpy as np
import pytest
import torch

from lfsr_core.optics.rays import RayLayout
from lfsr_core.reconstruct import denoiser
from lfsr_core.reconstruct.methods.denoise import denoise_eia
from lfsr_lab.networks.denoiser import Denoiser, hdr_decode, hdr_encode, stock_weights
from tests.support.scenes import ARRAY, MINI, add_box, encoded


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
