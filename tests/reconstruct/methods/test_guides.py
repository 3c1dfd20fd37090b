import numpy as np
import pytest

from lfsr_core.reconstruct.methods import guides

RANDOM = np.random.default_rng(0)
LENSES, VIEWS = (3, 4), (10, 12)


def guides_of(layers, samples, clean=lambda images: images):
    return guides.guides_of(layers, samples, clean, VIEWS)


def blind(images):
    """A denoiser that takes everything for noise."""
    return np.broadcast_to(images.mean((2, 3), keepdims=True), images.shape)


def plain(albedo=0.4, normal=(0.0, 0.6, 0.8)):
    """Guides of a plain surface."""
    shape = (*LENSES, *VIEWS, 3)
    return {"albedo": np.full(shape, albedo, np.float32), "normal": np.broadcast_to(np.float32(normal), shape).copy()}


def grainy(samples, layers):
    """``layers`` with the noise of that many samples."""
    return {name: layer + RANDOM.normal(0, 0.2 / samples ** 0.5, layer.shape).astype(np.float32)
            for name, layer in layers.items()}


def tiles(size=2):
    """Dark and bright tiles of so many pixels."""
    places = np.add.outer(np.arange(VIEWS[0]) // size, np.arange(VIEWS[1]) // size) % 2
    return np.broadcast_to(np.float32(0.1) + 0.8 * places[..., None].astype(np.float32), (*LENSES, *VIEWS, 3)).copy()


@pytest.mark.parametrize("samples", [1, 4, 16, 64])
def test_grain_goes_and_the_value_stays(samples):
    clean = plain()
    noisy = grainy(samples, clean)
    made = guides_of(noisy, samples)
    for name in guides.GUIDES:
        before, after = (np.abs(layers[name] - clean[name]).mean() for layers in (noisy, made.images))
        assert after < before / 2 and made.images[name].dtype == np.float32
        np.testing.assert_allclose(made.images[name].mean(), clean[name].mean(), atol=0.1 / samples ** 0.5)
    assert made.detail.shape == LENSES and made.detail.max() < 0.5


def test_plain_guides_stay_as_they_are():
    made = guides_of(plain(), 16)
    for name, layer in plain().items():
        np.testing.assert_allclose(made.images[name], layer, atol=1e-6)
    assert not made.detail.any()


def test_detail_stays_as_the_denoiser_leaves_it():
    layers = {"albedo": tiles()}
    fine = guides_of(layers, 16)
    np.testing.assert_allclose(fine.detail, 1)
    np.testing.assert_allclose(fine.images["albedo"], layers["albedo"], atol=1e-6)


def test_what_the_denoiser_takes_for_noise_is_no_detail():
    noise = {"albedo": RANDOM.integers(0, 2, (*LENSES, *VIEWS, 1)).repeat(3, -1).astype(np.float32)}
    made = guides_of(noise, 16, blind)
    assert not made.detail.any()
    assert np.ptp(made.images["albedo"], axis=(2, 3)).max() < 0.01, "no grain is left"


def test_the_denoiser_is_asked_only_where_there_may_be_detail():
    asked = []

    def clean(images):
        asked.append(images.shape[:2])
        return images

    albedo = np.broadcast_to(np.float32(0.4), (20, 30, *VIEWS, 3)).copy()
    albedo[3, 4], albedo[15:17, 25] = tiles()[0, 0], tiles()[0, 0]
    made = guides_of({"albedo": albedo}, 16, clean)
    assert np.argwhere(made.detail > 0).tolist() == [[3, 4], [15, 25], [16, 25]]
    assert len(asked) == 2 and all(rows <= 12 and columns <= 12 for rows, columns in asked)
    guides_of({"albedo": 0.5 + (tiles() - 0.5) / 4}, 1, clean)
    assert len(asked) == 2, "one sample is as far from its mean"


@pytest.mark.parametrize("samples", [4, 16, 64])
def test_an_edge_stays_amid_grain_and_grain_is_no_structure(samples):
    clean = plain()
    edged = {"albedo": clean["albedo"].copy()}
    edged["albedo"][0, 0, 6:] += 0.5
    noisy = {"albedo": grainy(64, edged)["albedo"]}
    made = guides_of(noisy, samples)
    step = made.images["albedo"][0, 0, 6].mean() - made.images["albedo"][0, 0, 5].mean()
    assert step > 0.2 and made.detail[0, 0] > 0.9
    assert made.detail[1:].max() < 0.1
    grain = np.abs(made.images["albedo"][1:] - 0.4).mean()
    assert grain < np.abs(noisy["albedo"][1:] - 0.4).mean() / 2


def test_mirrored_guides_make_mirrored_guides():
    noisy = grainy(4, plain())
    mirrored = guides_of({name: layer[:, :, ::-1, ::-1] for name, layer in noisy.items()}, 4)
    for name, image in guides_of(noisy, 4).images.items():
        np.testing.assert_allclose(mirrored.images[name][:, :, ::-1, ::-1], image, atol=1e-6)


def test_values_out_of_range_are_cut_and_views_along_one_axis_work():
    made = guides_of({"albedo": np.full((2, 3, 1, 5, 3), 7, np.float32)}, 16)
    assert made.images["albedo"].shape == (2, 3, 1, 5, 3) and made.images["albedo"].max() == pytest.approx(1)
    assert guides_of({"normal": np.zeros((1, 1, 4, 4, 3), np.float32)}, 4) is None, "the library wants an albedo"
