"""Weights of ours: what is checked before the library sees them, and the prefilter that uses them."""

import dataclasses
import hashlib
import json
import os
import sys

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from lfsr_core.base.errors import LfsrError
from lfsr_core.frames.low_res import LowResEIA
from lfsr_core.optics.eia import from_elemental_images
from lfsr_core.reconstruct import denoiser
from lfsr_core.reconstruct.denoiser import write_tza
from lfsr_core.reconstruct.methods import load_method, oidn
from lfsr_core.reconstruct.methods.denoise import denoise_eia, denoise_low_resolution, mirrored
from tests.support.prerequisites import needs_bpy
from tests.support.told import refuses

SMALLEST = (8,) * 15 + (3,)


def tensors(seed=0, widths=SMALLEST, inputs=3):
    draw = np.random.default_rng(seed)
    return {name: draw.normal(0, 0.1, shape) for name, shape in denoiser.network_shapes(widths, inputs).items()}


@pytest.fixture
def weights(tmp_path):
    write_tza(tmp_path / "some.tza", tensors())
    return tmp_path / "some.tza"


def low_resolution(parallax=(True, True), shape=(6, 8, 5, 5, 3)):
    color = np.random.default_rng(1).gamma(1, 1, shape).astype(np.float32)
    return LowResEIA(color, np.ones((*shape[:-1], 1), np.float32), 4, 4, parallax=parallax)


@given(st.lists(st.integers(1, 20), min_size=15, max_size=15), st.sampled_from((3, 9)))
def test_widths_follow_from_the_tensors(widths, inputs):
    shapes = denoiser.network_shapes((*widths, 3), inputs)
    assert len(shapes) == 32
    found = denoiser.check_network({name: np.empty(shape) for name, shape in shapes.items()}, "x", inputs)
    assert found == (*widths, 3)


@pytest.mark.parametrize(("name", "shape", "message"), [
    ("dec_conv0.bias", None, "missing"), ("enc_conv4.weight", None, "missing"), ("more", (3,), "no such tensor"),
    ("enc_conv2.bias", (9,), "expected"), ("dec_conv2a.weight", (8, 8, 3, 3), r"expected \(8, 16, 3, 3\)"),
    ("enc_conv0.weight", (8, 9, 3, 3), "denoiser with 3 inputs"), ("dec_conv0.bias", (4,), r"expected \(3,\)")])
def test_tensors_that_make_no_network_are_one_sentence(name, shape, message):
    changed = tensors() | ({name: np.zeros(shape)} if shape else {})
    if shape is None:
        del changed[name]
    refuses(rf"^x.tza has tensor .*{message}", denoiser.check_network, changed, "x.tza")


def test_a_file_is_read_again_when_it_has_changed(weights):
    first = denoiser.load(weights)
    assert denoiser.load(weights) is first
    write_tza(weights, tensors(seed=1))
    os.utime(weights, ns=(1, 1))
    assert denoiser.load(weights).content == weights.read_bytes() != first.content


def test_single_floats_are_refused_before_the_library_sees_them(tmp_path):
    write_tza(tmp_path / "x.tza", tensors(), half=False)
    refuses("x.tza holds single floats.*takes half floats", denoiser.load, tmp_path / "x.tza")


def test_weights_that_changed_since_their_training_are_refused(weights):
    content = weights.read_bytes()
    weights.with_suffix(".json").write_text(json.dumps({"sha256": hashlib.sha256(content).hexdigest()}))
    assert denoiser.load(weights).content == content
    weights.write_bytes(content[:100] + bytes([content[100] ^ 1]) + content[101:])
    os.utime(weights, ns=(1, 1))
    refuses(r"some.tza does not have the SHA-256 in some.json: .*get both again", denoiser.load, weights)
    weights.with_suffix(".json").unlink()
    assert len(denoiser.load(weights).content) == len(content)


def test_missing_weights_are_one_sentence(tmp_path):
    with pytest.raises(LfsrError, match="none.tza does not exist, expected TZA weights"):
        load_method("denoise+bilinear", weights=tmp_path / "none.tza").prepare(low_resolution())


@pytest.mark.parametrize("parallax", [(True, True), (True, False)])
def test_colour_is_denoised_as_one_image_by_our_weights(weights, parallax):
    low = low_resolution(parallax, (6, 8, 5, 5, 3) if all(parallax) else (12, 8, 1, 5, 3))
    found = load_method("denoise+bilinear", weights=weights).prepare(low)
    rows, columns = low.color.shape[0] * low.color.shape[2], low.color.shape[1] * 5
    image = mirrored(low.color).swapaxes(1, 2).reshape(rows, columns, 3)
    expected = denoise_eia(image, weights=denoiser.load(weights))
    np.testing.assert_array_equal(mirrored(found.color).swapaxes(1, 2).reshape(rows, columns, 3), expected)
    assert found.noisy is low.color
    write_tza(weights, tensors(seed=1))
    assert not np.array_equal(denoise_low_resolution(low, weights).color, found.color)


@given(st.integers(1, 4), st.integers(1, 4), st.integers(1, 5), st.integers(1, 5))
def test_neighbours_meet_at_the_same_view_once_mirrored(sy, sx, h, w):
    views = np.broadcast_to(np.arange(h * w).reshape(h, w, 1), (sy, sx, h, w, 1))  # of each pixel
    image = from_elemental_images(mirrored(views))[..., 0]
    np.testing.assert_array_equal(image[:, w - 1:-1:w], image[:, w::w])
    np.testing.assert_array_equal(image[h - 1:-1:h], image[h::h])
    np.testing.assert_array_equal(mirrored(mirrored(views)), views)


def test_guided_weights_see_albedo_and_normal_mirrored_like_the_colour(tmp_path):
    path = tmp_path / "guided.tza"
    write_tza(path, tensors(inputs=9))
    low = low_resolution()
    guides = np.random.default_rng(2).uniform(-1, 1, (*low.color.shape[:4], 6)).astype(np.float32)
    guides[..., :3] = np.abs(guides[..., :3])
    found = denoise_low_resolution(dataclasses.replace(low, guides=guides), path)
    color, albedo, normal = (mirrored(image).swapaxes(1, 2).reshape(30, 40, 3)
                             for image in (low.color, guides[..., :3], guides[..., 3:]))
    expected = oidn.denoise(color, albedo, normal, hdr=True, weights=path.read_bytes(), input_scale=1.0)
    np.testing.assert_allclose(mirrored(found.color).swapaxes(1, 2).reshape(30, 40, 3), np.maximum(expected, 0))
    without = denoise_low_resolution(low, path)
    black = denoise_low_resolution(dataclasses.replace(low, guides=np.zeros_like(guides)), path)
    np.testing.assert_array_equal(without.color, black.color)
    assert not np.array_equal(without.color, found.color)


def test_a_lamp_far_away_changes_nothing(weights):
    """The library does not expose by itself, so that frames of an animation agree."""
    dark = np.random.default_rng(1).gamma(1, 0.1, (32, 400, 3)).astype(np.float32)
    lit = dark.copy()
    lit[:, 380:] = 50
    dark, lit = (denoise_eia(image, weights=denoiser.load(weights)) for image in (dark, lit))
    np.testing.assert_allclose(lit[:, :60], dark[:, :60], rtol=1e-4)
    assert not np.allclose(lit[:, 340:], dark[:, 340:], rtol=1e-2)


@needs_bpy
def test_library_of_blender_takes_our_weights(monkeypatch, weights):
    color, content = low_resolution().color.swapaxes(1, 2).reshape(30, 40, 3), denoiser.load(weights)
    expected = denoise_eia(color, weights=content)
    monkeypatch.setitem(sys.modules, "pyoidn", None)
    np.testing.assert_allclose(denoise_eia(color, weights=content), expected, rtol=1e-3, atol=1e-4)


def test_shipped_weights_are_those_of_their_provenance():
    facts = json.loads(denoiser.WEIGHTS.with_suffix(".json").read_text(encoding="utf-8"))
    content = denoiser.load().content
    assert facts["sha256"] == hashlib.sha256(content).hexdigest() and len(content) < 2_000_000
    assert facts["command"].startswith("lfsr train denoiser") and facts["data"]["scenes"] > 200
    assert "Apache License" in (denoiser.WEIGHTS.parent / "NOTICE.txt").read_text(encoding="utf-8")
