"""Weights of ours: what is checked before the library sees them, and the denoiser that uses them."""

import dataclasses
import hashlib
import json
import os
import sys
from unittest.mock import Mock

import hypothesis.extra.numpy as npst
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from lfsr_core.base.messages import LfsrError
from lfsr_core.optics.rays import from_elemental_images
from lfsr_core.reconstruct.methods import denoise, load_method
from lfsr_core.reconstruct.methods.denoise import denoise_eia, denoise_low_resolution, denoised_opacity, mirrored
from lfsr_core.reconstruct.upscaler import LowResEIA
from lfsr_lab.networks.tza import read_tza, write_tza
from tests.support.prerequisites import needs_bpy
from tests.support.told import refuses

SMALLEST = (8,) * 15 + (3,)


def tensors(seed=0, widths=SMALLEST, inputs=3):
    draw = np.random.default_rng(seed)
    made = {name: draw.normal(0, 0.1, shape) for name, shape in denoise.network_shapes(widths, inputs).items()}
    return made | {"dec_conv0.bias": made["dec_conv0.bias"] + 0.5}  # not black


@pytest.fixture
def weights(tmp_path):
    write_tza(tmp_path / "some.tza", tensors())
    return tmp_path / "some.tza"


def low_resolution(parallax=(True, True), shape=(6, 8, 5, 5, 3)):
    color = np.random.default_rng(1).gamma(1, 1, shape).astype(np.float32)
    return LowResEIA(color, np.ones((*shape[:-1], 1), np.float32), 4, 4, parallax=parallax)


@given(st.lists(st.integers(1, 20), min_size=15, max_size=15), st.sampled_from((3, 9)))
def test_widths_follow_from_the_tensors(widths, inputs):
    shapes = denoise.network_shapes((*widths, 3), inputs)
    assert len(shapes) == 32
    assert denoise.check_network({name: np.empty(shape) for name, shape in shapes.items()}, "x", inputs) == (*widths, 3)


@pytest.mark.parametrize(("name", "shape", "message"), [
    ("dec_conv0.bias", None, "missing"), ("enc_conv4.weight", None, "missing"), ("more", (3,), "no such tensor"),
    ("enc_conv2.bias", (9,), "expected"), ("dec_conv2a.weight", (8, 8, 3, 3), r"expected \(8, 16, 3, 3\)"),
    ("enc_conv0.weight", (8, 9, 3, 3), "denoiser with 3 inputs"), ("dec_conv0.bias", (4,), r"expected \(3,\)")])
def test_tensors_that_make_no_network_are_one_sentence(name, shape, message):
    changed = tensors() | ({name: np.zeros(shape)} if shape else {})
    if shape is None:
        del changed[name]
    refuses(rf"^x.tza has tensor .*{message}", denoise.check_network, changed, "x.tza")


def test_weights_that_are_missing_too_large_or_cannot_be_stored(tmp_path):
    write_tza(tmp_path / "x.tza", tensors(), half=False)
    refuses("x.tza holds single floats.*takes half floats", denoise.load, tmp_path / "x.tza")
    with pytest.raises(LfsrError, match="none.tza does not exist, expected TZA weights"):
        load_method("denoise+bilinear", weights=tmp_path / "none.tza").prepare(low_resolution())
    write_tza(tmp_path / "a.tza", {"a": np.full(3, 1e5)}, half=False)
    np.testing.assert_array_equal(read_tza(tmp_path / "a.tza")["a"], np.float32(1e5))
    refuses("use a smaller network", write_tza, tmp_path / "a.tza", {"a": np.zeros(denoise.MOST_BYTES // 2)})
    (tmp_path / "b.tza").write_bytes(bytes(denoise.MOST_BYTES + 1))
    refuses("more than 8000000 bytes", read_tza, tmp_path / "b.tza")
    for tensor in [np.full(3, np.nan), np.full(3, 1e5), np.ones((2, 2))]:
        refuses("'a' of shape", write_tza, tmp_path / "c.tza", {"a": tensor})
        assert not (tmp_path / "c.tza").exists() and len(list(tmp_path.iterdir())) == 3


def test_a_file_is_read_again_when_it_has_changed_and_refused_if_changed_since_its_training(weights):
    content = weights.read_bytes()
    weights.with_suffix(".json").write_text(json.dumps({"sha256": hashlib.sha256(content).hexdigest()}))
    assert denoise.load(weights).content == content
    weights.write_bytes(content[:100] + bytes([content[100] ^ 1]) + content[101:])
    os.utime(weights, ns=(1, 1))
    refuses(r"some.tza does not have the SHA-256 in some.json: .*get both again", denoise.load, weights)
    weights.with_suffix(".json").unlink()
    assert len(denoise.load(weights).content) == len(content)
    first = denoise.load(weights)
    assert denoise.load(weights) is first
    write_tza(weights, tensors(seed=1))
    os.utime(weights, ns=(2, 2))
    assert denoise.load(weights).content == weights.read_bytes() != first.content


@pytest.mark.parametrize("parallax", [(True, True), (True, False)])
def test_colour_is_denoised_as_one_image(weights, parallax):
    low = low_resolution(parallax, (6, 8, 5, 5, 3) if all(parallax) else (12, 8, 1, 5, 3))
    rows, columns = low.color.shape[0] * low.color.shape[2], low.color.shape[1] * 5
    image, results = mirrored(low.color).swapaxes(1, 2).reshape(rows, columns, 3), {}
    for chosen in (None, weights):
        results[chosen] = denoise_low_resolution(low, chosen)
        expected = denoise_eia(image, weights=chosen and denoise.load(chosen))
        denoised = mirrored(results[chosen].color).swapaxes(1, 2).reshape(rows, columns, 3)
        np.testing.assert_allclose(denoised, expected, atol=0 if chosen else 1e-5)
        assert results[chosen].noisy is low.color and results[chosen].alpha is low.alpha
    prepared = load_method("denoise+bilinear", weights=weights).prepare(low)
    np.testing.assert_array_equal(prepared.color, results[weights].color)
    write_tza(weights, tensors(seed=1))
    assert not np.array_equal(denoise_low_resolution(low, weights).color, results[weights].color)


def test_a_small_render_is_the_mean_of_both_weights():
    low = low_resolution()
    ours, own = (denoise_low_resolution(low, weights) for weights in (denoise.WEIGHTS, None))
    small, large = (denoise_low_resolution(dataclasses.replace(low, pixels=denoise.MOST_TWICE + n)) for n in (0, 1))
    np.testing.assert_array_equal(small.color, (ours.color + own.color) / 2)
    np.testing.assert_array_equal(large.color, ours.color)
    assert small.noisy is low.color and small.pixels == denoise.MOST_TWICE


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
    guided = denoise_low_resolution(dataclasses.replace(low, guides=guides), path)
    color, albedo, normal = (mirrored(image).swapaxes(1, 2).reshape(30, 40, 3)
                             for image in (low.color, guides[..., :3], guides[..., 3:]))
    expected = denoise.denoise_image(color, albedo, normal, weights=path.read_bytes(), input_scale=1.0)
    np.testing.assert_allclose(mirrored(guided.color).swapaxes(1, 2).reshape(30, 40, 3), np.maximum(expected, 0))
    black, without = (denoise_low_resolution(dataclasses.replace(low, guides=given), path)
                      for given in (np.zeros_like(guides), None))
    np.testing.assert_array_equal(without.color, black.color)
    assert not np.array_equal(without.color, guided.color)


def test_shipped_weights_are_those_of_their_provenance_and_a_missing_library_one_sentence(monkeypatch):
    facts = json.loads(denoise.WEIGHTS.with_suffix(".json").read_text(encoding="utf-8"))
    content = denoise.load().content
    assert facts["sha256"] == hashlib.sha256(content).hexdigest() and len(content) < 2_000_000
    assert facts["command"].startswith("lfsr train denoiser") and facts["data"]["scenes"] > 200
    assert "Apache License" in (denoise.WEIGHTS.parent / "NOTICE.txt").read_text(encoding="utf-8")
    monkeypatch.setitem(sys.modules, "pyoidn", None)
    monkeypatch.setattr(denoise, "find_libraries", lambda: iter(()))
    refuses("install the package pyoidn", denoise_eia, np.zeros((4, 4, 3), np.float32))


NAMES = st.text(st.characters(min_codepoint=32, max_codepoint=126), min_size=1, max_size=30)
SHAPES = st.one_of(st.tuples(st.integers(1, 40)), st.tuples(*[st.integers(1, 6)] * 4))


@given(st.dictionaries(NAMES, npst.arrays(np.float16, SHAPES, elements=st.floats(-9, 9, width=16)), max_size=6),
       st.booleans())
def test_what_is_written_is_read(tmp_path_factory, tensors, half):
    path = tmp_path_factory.mktemp("tza") / "some.tza"
    write_tza(path, tensors, half=half)
    stored = read_tza(path)
    assert list(stored) == list(tensors)
    for name, tensor in tensors.items():
        assert stored[name].dtype == (np.float16 if half else np.float32)
        np.testing.assert_array_equal(stored[name], tensor)
    table = denoise.HEADER.unpack_from(path.read_bytes())[3]
    assert len(tensors) == int.from_bytes(path.read_bytes()[table:table + 4], "little")


def test_a_cut_file_is_one_sentence(weights):
    content = weights.read_bytes()
    for length in [*range(0, 200), *range(200, len(content), 61), len(content) - 1]:
        refuses("^x.tza ", denoise.parse_tza, content[:length], "x.tza")


@pytest.mark.parametrize(("place", "value", "message"), [
    (0, 0, "begins with 0x4100 version 2"), (2, 3, "begins with 0x41d7 version 3"), (11, 255, "its table is at byte"),
    (65, 255, "'enc_conv0.weight' has values that are not finite")])
def test_damage_is_named(weights, place, value, message):
    damaged = bytearray(weights.read_bytes())
    damaged[place] = value
    refuses(rf"x.tza cannot be read as TZA weights \(.*{message}.*get it again", denoise.parse_tza, bytes(damaged),
            "x.tza")


RANDOM = np.random.default_rng(0)


def noisy_card(noise=0.5):
    """A card of eight bright stripes, (64, 96, 3), and the same with Monte Carlo-like noise."""
    clean = np.full((64, 96, 3), 0.1, np.float32)
    clean[:, (np.arange(96) // 12) % 2 == 1] = [3.0, 0.6, 0.2]
    return clean, np.maximum(clean * RANDOM.gamma(1 / noise**2, noise**2, clean.shape), 0).astype(np.float32)


def error(image, clean):
    return float(np.mean(((image - clean) / (clean + 0.1)) ** 2))


@pytest.mark.parametrize("weights", [None, denoise.WEIGHTS])
def test_noise_goes_and_brightness_stays(weights):
    clean, noisy = noisy_card()
    denoised = denoise_eia(noisy, weights=weights and denoise.load(weights))
    assert denoised.shape == noisy.shape and denoised.dtype == np.float32 and denoised.min() >= 0
    assert error(denoised, clean) < error(noisy, clean) / 5 and denoised.mean() == pytest.approx(clean.mean(), rel=0.1)
    assert denoised.max() > 2, "values above 1 must survive"


def card_as_lenses():
    """A noisy card as 8×8 lenses."""
    color = noisy_card()[1].reshape(8, 8, 12, 8, 3).swapaxes(1, 2)
    return LowResEIA(color, np.ones((*color.shape[:-1], 1), np.float32), 16, 4)


def framed(row=9, column=13):
    """The noisy card amid 30×40 lenses that show nothing."""
    card = card_as_lenses()
    part = slice(row, row + 8), slice(column, column + 12)
    low = card.each(lambda image: np.zeros((30, 40, *image.shape[2:]), np.float32))
    low.color[part], low.alpha[part] = card.color, card.alpha
    return low, part


@pytest.mark.parametrize("weights", [None, denoise.WEIGHTS])
def test_only_what_shows_something_is_denoised(monkeypatch, weights):
    (low, part), spy = framed(), Mock(wraps=denoise_eia)
    monkeypatch.setattr(denoise, "denoise_eia", spy)
    denoised = denoise_low_resolution(low, weights).color
    spy.assert_called_once()
    assert spy.call_args.args[0].size < low.color.size / 3
    outside = denoised.copy()
    outside[part] = 0
    assert outside.max() < 0.3, "only what spills over a border"
    monkeypatch.setattr(denoise, "shown_part", lambda _: (slice(None), slice(None)))
    np.testing.assert_allclose(denoised[part], denoise_low_resolution(low, weights).color[part], rtol=0.1, atol=0.05)


@pytest.mark.parametrize(("name", "slope", "gain"), [
    ("denoise+pool", 2.4, 0.8), ("oidn+pool", 2.4, 0.8), ("denoise+pool", 0.5, 1), ("denoise+bilinear", 2.4, 1)])
def test_deep_samples_are_denoised_beside_their_neighbours_in_a_view(name, slope, gain):
    """Stripes on a plane with a spot whose depth is unknown; what interpolates inside a lens follows no depth."""
    stripes = 0.4 + 0.3 * np.sin(0.9 * (np.arange(24)[:, None] + slope * np.arange(6)))  # by lens and view
    clean = np.tile(stripes[None, :, None, :, None], (10, 1, 6, 1, 3)).astype(np.float32)
    noisy = (clean * np.random.default_rng(0).gamma(4, 0.25, clean.shape)).astype(np.float32)
    low = LowResEIA(noisy, np.ones_like(clean[..., :1]), 4, 4, slope=np.full_like(clean[..., :1], slope))
    low.slope[4:6, 8:10, 2:4, 2:4] = np.nan
    deep, plain = (((load_method(name).prepare(image).color - clean) ** 2).mean()
                   for image in (low, dataclasses.replace(low, slope=None)))
    assert deep < gain * plain if gain < 1 else deep == plain


@pytest.mark.parametrize("factor", [1e3, 3e4])
def test_weights_that_overflow_are_refused(tmp_path, factor):
    write_tza(tmp_path / "black.tza", {name: np.clip(tensor.astype(float) * factor, -6e4, 6e4)
                                       for name, tensor in read_tza(denoise.WEIGHTS).items()})
    refuses("of 96 elemental images black or infinite", denoise_low_resolution, framed()[0], tmp_path / "black.tza")


def test_exposure_is_what_the_weights_see_and_a_lamp_far_away_changes_nothing(weights):
    """A frame four times as dark, exposed two stops more, is denoised alike: the library does not expose by itself."""
    low = card_as_lenses()
    dark = dataclasses.replace(low, color=low.color / 4, exposure=2.0)
    expected = denoise_low_resolution(low).color
    np.testing.assert_allclose(denoise_low_resolution(dark).color * 4, expected, rtol=1e-3, atol=1e-4)
    unexposed = denoise_low_resolution(dataclasses.replace(dark, exposure=0.0)).color * 4
    assert not np.allclose(unexposed, expected, rtol=1e-3, atol=1e-4)
    dark = np.random.default_rng(1).gamma(1, 0.1, (32, 400, 3)).astype(np.float32)
    lit = dark.copy()
    lit[:, 380:] = 50
    dark, lit = (denoise_eia(image, weights=denoise.load(weights)) for image in (dark, lit))
    np.testing.assert_allclose(lit[:, :60], dark[:, :60], rtol=1e-4)
    assert not np.allclose(lit[:, 340:], dark[:, 340:], rtol=1e-2)


def test_nothing_to_denoise_stays_as_it_is():
    low, part = framed()
    empty = dataclasses.replace(low, color=np.full_like(low.color, 0.25))
    np.testing.assert_array_equal(denoise_low_resolution(empty).color, empty.color)
    for corner in [(0, 0), (3, 9), (9, 13), (22, 28)]:
        rows, columns = denoise.shown_part(framed(*corner)[0].color)
        for part, start, length, count in ((rows, corner[0], 8, 30), (columns, corner[1], 12, 40)):
            assert 0 <= part.start <= max(start - 4, 0) and min(start + length + 4, count) <= part.stop <= count
            assert part.start * 8 % 16 == 0, "the library pools the same pixels as in the whole image"
    for pixels in [4, 10, 20, 32]:
        for first in range(20):
            span = denoise.span(np.arange(30) == first, pixels)
            assert span.start * pixels % 16 == 0 and span.stop == min(30, first + 1 + -(-32 // pixels))
            assert span.start <= max(first - 32 // pixels, 0)
        assert denoise.span(np.zeros(5, bool), pixels) == slice(0, 0)


@needs_bpy
def test_library_of_blender_gives_the_same_image(monkeypatch):
    _, noisy = noisy_card()

    def images():
        return denoise_eia(noisy), denoise_eia(noisy, weights=denoise.load())

    expected = images()
    monkeypatch.setitem(sys.modules, "pyoidn", None)
    for image, wanted in zip(images(), expected, strict=True):
        np.testing.assert_allclose(image, wanted, rtol=1e-3, atol=1e-4)


@pytest.mark.parametrize("parallax", [(True, True), (True, False)])
def test_what_is_certain_is_not_denoised(weights, parallax):
    """Where this lens and its neighbours see no subject, or nothing but it, there is no noise."""
    low = low_resolution(parallax, (9, 12, 5 if parallax[1] else 1, 5, 3))
    seen = np.zeros(low.alpha.shape, np.float32)
    seen[:, :6] = 1
    low = dataclasses.replace(low, color=low.color * seen + 0.25 * (1 - seen), alpha=seen)
    made = denoise_low_resolution(low, weights)
    opacity = denoised_opacity(dataclasses.replace(low, color=np.repeat(seen, 3, -1))).color
    np.testing.assert_array_equal(made.color[:, 7:], 0.25)
    assert (np.ptp(made.color[:, 6], axis=(0, 3)) > 0).all() and not np.array_equal(made.color[:, :6], low.color[:, :6])
    np.testing.assert_array_equal(opacity[:, :5], 1)
    np.testing.assert_array_equal(opacity[:, 7:], 0)
