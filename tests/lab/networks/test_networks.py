"""Comparators, built: shapes, layers, cost against formulas, and deconvolutions folded for inference."""

import copy
import dataclasses
import json
import pickle
import sys
from functools import partial
from pathlib import Path

import cv2
import numpy as np
import pytest
import torch
from safetensors.numpy import save_file
from torch import nn

from lfsr_core.base.system import read_json
from lfsr_core.optics.rays import from_elemental_images, to_elemental_images
from lfsr_core.reconstruct.second_stage import finished_linear
from lfsr_core.reconstruct.upscaler import LowResEIA, decode, encode
from lfsr_lab.networks import checkpoint, comparators, networks, upscalers
from lfsr_lab.networks.methods import LabMethod, ready
from lfsr_lab.networks.networks import PaperGenerator, load
from lfsr_lab.networks.upscalers import Engine, PhotographUpscaler, WholeEIAUpscaler, srgb_decode, srgb_encode
from tests.support.synthetic import FLAT, write_render
from tests.support.told import refuses


@pytest.fixture
def path(tmp_path):
    """Weights of the paper's generator of seed 1."""
    torch.manual_seed(1)
    checkpoint.save(tmp_path / "paper-x4.safetensors", PaperGenerator(4), 4, {"seconds": 1.5}, {"convolutions": 2})
    return tmp_path / "paper-x4.safetensors"


def rewrite(path, rehashed=False, header=None, **tensors):
    """The same file with another header or other tensors, its hash left as it was or made right."""
    before, values = checkpoint.read(path)
    values |= tensors
    save_file(values, path, before | (header or {}) | ({"sha256": checkpoint.digest(values)} if rehashed else {}))


def test_what_is_saved_is_loaded_and_its_provenance_lies_beside(path):
    torch.manual_seed(1)
    expected, loaded = PaperGenerator(4).state_dict(), load("paper", 4, path)
    assert not loaded.training
    assert all(torch.equal(loaded.state_dict()[name], value) for name, value in expected.items())
    facts, (header, tensors) = read_json(path.with_suffix(".json"), "provenance"), checkpoint.read(path)
    assert facts["sha256"] == header["sha256"] == checkpoint.digest(tensors)
    assert (facts["seconds"], facts["scale"], facts["bytes"]) == (1.5, 4, path.stat().st_size)
    assert json.loads(header["options"]) == {"convolutions": 2}


def bias(path, value):
    values = checkpoint.read(path)[1]["up.bias"].copy()
    values[1] = value
    return values


class Evil:
    """What must never be run: it would write the file ``written``."""

    def __init__(self, folder):
        self.folder = folder

    def __reduce__(self):
        return (open, (str(self.folder / "written"), "w"))


DAMAGES = [
    (lambda path: path.write_bytes(pickle.dumps(Evil(path.parent))), "cannot be read as safetensors weights"),
    (lambda path: rewrite(path, header={"version": "2"}), "weights format version '2', expected 1"),
    (lambda path: save_file({"a": np.zeros(2, np.float32)}, path), "not LFSR weights"),
    (lambda path: rewrite(path, **{"up.bias": bias(path, 1e-3)}), "does not match the SHA-256"),
    *((lambda path, value=value: rewrite(path, rehashed=True, **{"up.bias": bias(path, value)}),
       r"'up\.bias' of .* are not finite") for value in (np.nan, np.inf, -np.inf)),
    *((lambda path, keep=keep: path.write_bytes(path.read_bytes()[:keep]), "cannot be read as safetensors weights")
      for keep in (0, 6, 200, -1)),
    (lambda path: path.unlink(), "does not exist")]


@pytest.mark.parametrize(("damage", "message"), DAMAGES)
def test_a_file_that_is_wrong_is_refused(path, damage, message):
    damage(path)
    refuses(message, load, "paper", 4, path)
    assert not (path.parent / "written").exists()


@pytest.mark.parametrize(("name", "scale", "message"), [
    ("espcn", 4, "architecture 'PaperGenerator', expected 'ESPCN'"), ("paper", 2, "scale '4', expected '2'"),
    ("paper-3", 4, r"body\.4\..*missing, expected \(16"), ("paper", 3, "no weights for scale 3")])
def test_weights_of_another_network(path, name, scale, message):
    refuses(message, load, name, scale, None if scale == 3 else path)


def test_hash_sees_shapes_and_names_and_too_large_or_diverged_weights_are_not_written(tmp_path):
    value = np.arange(6, dtype=np.float32)
    variants = ({"a": value}, {"b": value}, {"a": value.reshape(2, 3)})
    assert len({checkpoint.digest(tensors) for tensors in variants}) == 3
    broken = PaperGenerator(4)
    torch.nn.init.constant_(broken.up.bias, float("nan"))
    for network, message in ((torch.nn.Linear(600, 600), "less than 1000000"), (broken, r"'up\.bias'.*not finite")):
        refuses(message, checkpoint.save, tmp_path / "big.safetensors", network, 4, {})
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize(("name", "scale"), [(name, scale) for name, network in comparators.NETWORKS.items()
                                             for scale in network.weights])
def test_shipped_weights_fit_and_carry_their_provenance(name, scale):
    path = comparators.weights_path(name, scale)
    header, tensors = checkpoint.read(path)
    facts = json.loads(path.with_suffix(".json").read_text())
    assert path.stat().st_size < checkpoint.MAX_BYTES
    assert header["sha256"] == facts["sha256"] == checkpoint.digest(tensors)
    assert {"command", "versions", "validation"} <= facts.keys()
    load(name, scale)


SINGLE = [name for name, entry in comparators.NETWORKS.items() if not entry.whole]


@pytest.mark.parametrize("scale", comparators.SCALES)
def test_every_network_upscales_by_its_scale_and_folding_changes_nothing(scale):
    for name in SINGLE:
        torch.manual_seed(3)
        network, low = networks.build(name, scale), torch.rand(2, 3, 7, 10)
        high, folded = network(low), networks.fold_for_inference(copy.deepcopy(network))
        assert high.shape == (2, 3, 7 * scale, 10 * scale), name
        assert not any(isinstance(layer, nn.ConvTranspose2d) for layer in folded.modules())
        torch.testing.assert_close(folded(low), high, atol=1e-6, rtol=1e-5)


@pytest.mark.parametrize(("network", "expected"), [
    (networks.PaperGenerator(4), 25 * 3 * 32 + 9 * 32 * 16 + 81 * 16 * 3),
    (networks.FSRCNN(4), 25 * 3 * 56 + 56 * 12 + 4 * 9 * 12 * 12 + 12 * 56 + 81 * 56 * 3),
    (networks.ESPCN(4), 25 * 3 * 64 + 9 * 64 * 32 + 9 * 32 * 48),
    (nn.Sequential(nn.Conv2d(3, 8, 3, padding=1, groups=1), nn.Conv2d(8, 8, 3, padding=1, groups=4)),
     9 * 3 * 8 + 9 * 8 * 2)])
def test_cost_is_that_of_the_formula(network, expected):
    assert networks.multiply_adds(network, 10, 6) == expected
    if isinstance(network, networks.ESPCN):
        assert networks.parameters(network) == (75 + 1) * 64 + (576 + 1) * 32 + (288 + 1) * 48


torch.set_num_threads(2)
LENSES = np.array([[0, 0], [1, 3], [3, 4], [2, 2], [1, 0]])


@pytest.fixture
def network(monkeypatch):
    """A network, which stands for the shipped weights too."""
    torch.manual_seed(5)
    made = networks.PaperGenerator(2).eval().requires_grad_(False)
    torch.nn.init.constant_(made.up.bias, 0.4)
    monkeypatch.setattr(upscalers, "load", lambda name, scale, weights=None: made)
    return made


def low_images():
    return np.random.default_rng(2).random((7, 6, 5, 3), dtype=np.float32) * 1.4


def expected(network, linear):
    encoded = srgb_encode(torch.from_numpy(linear)).permute(0, 3, 1, 2)
    return srgb_decode(network(encoded).clamp(0, 1)).permute(0, 2, 3, 1).numpy()


@pytest.mark.parametrize("step", [1, 3, 7, 50, None])
def test_engine_agrees_with_the_network_for_every_step(network, step):
    result = Engine(network, device="cpu", step=step)(low_images())
    assert result.dtype == np.float32 and result.shape == (7, 12, 10, 3)
    np.testing.assert_allclose(result, expected(network, low_images()), atol=2e-5)


@pytest.mark.parametrize("scale", [2, 3, 4, 5, 8])
def test_the_whole_arrays_bicubic_is_opencvs(scale):
    """Each elemental image as cut from the photograph of them all, in the order asked for."""
    low = LowResEIA(np.random.default_rng(0).random((3, 4, 5, 6, 3), np.float32), np.ones((3, 4, 5, 6, 1), np.float32),
                    16, scale)
    expected = decode(cv2.resize(encode(from_elemental_images(low.color)), None, fx=scale, fy=scale,
                                 interpolation=cv2.INTER_CUBIC))
    finish, upscaler = ready("oidn+bicubic-eia")
    wanted = np.array([[2, 3], [0, 1], [2, 0], [1, 2]])
    images = upscaler(low, wanted)
    assert finish.method == "oidn+bilinear" and upscaler.kernel == "cubic"
    np.testing.assert_allclose(images, to_elemental_images(expected, (4, 3))[wanted[:, 0], wanted[:, 1]], atol=2e-5)


@pytest.mark.parametrize(("make", "wrong", "message"), [
    (comparators.spec, "fsrcn", "did you mean 'fsrcnn'"), (LabMethod.parse, "fsrcn", "did you mean 'fsrcnn'"),
    (LabMethod.parse, "fsrcnn+bicubic", "put it last"), (LabMethod.parse, "bicubic-eia+bicubic", "put it last"),
    (LabMethod.parse, "bicubic+oidn", "put one upscaler last"), (partial(networks.build, "paper"), 5, "has no scale 5"),
    (partial(networks.PaperGenerator, 4), 7, "2 to 6 convolutions, not 7"),
    (lambda step: Engine(PaperGenerator(2), step=step), 0, "step is 0"),
    (lambda device: Engine(PaperGenerator(2), device=device), "tpu", "device is 'tpu'"),
    pytest.param(lambda device: Engine(PaperGenerator(2), device=device), "cuda", "'cuda' is not available",
                 marks=pytest.mark.skipif(torch.cuda.is_available(), reason="says what happens without CUDA"))])
def test_what_there_is_not_is_refused(make, wrong, message):
    refuses(message, make, wrong)


@pytest.mark.skipif(not torch.cuda.is_available(), reason="needs CUDA")
@pytest.mark.parametrize("step", [3, 64])
def test_cuda_is_near_and_stays_on_the_device(network, step):
    result = Engine(network, device="cuda", step=step).run(torch.from_numpy(low_images()).cuda())
    assert result.is_cuda
    np.testing.assert_allclose(result.cpu().numpy(), expected(network, low_images()), atol=5e-3)


def low_eia(seed=0):
    color = np.random.default_rng(seed).random((4, 5, 6, 5, 3), dtype=np.float32)
    return LowResEIA(color, np.ones((4, 5, 6, 5, 1), np.float32), 16, 2)


def test_upscaler_gives_the_lenses_asked_for_and_nan_is_replaced_and_noted(network):
    low = low_eia()
    result = PhotographUpscaler("paper", device="cpu")(low, LENSES)
    np.testing.assert_allclose(result, expected(network, low.color[LENSES[:, 0], LENSES[:, 1]]), atol=2e-5)
    assert PhotographUpscaler("paper")(low, np.zeros((0, 2), int)).shape == (0, 12, 10, 3)
    low, upscaler = low_eia(), PhotographUpscaler("paper", device="cpu")
    low.color[0, 0, 2, 2, 0], low.color[1, 3, 0, 0, 1] = np.nan, np.inf
    with pytest.warns(UserWarning, match="NaN or infinite"):
        result = upscaler(low, LENSES)
    low.color[0, 0, 2, 2, 0] = low.color[1, 3, 0, 0, 1] = 0
    np.testing.assert_array_equal(result, upscaler(low, LENSES))
    assert len(upscaler.notes) == 1


@pytest.mark.parametrize("rows_at_once", [1, 2, 8])
def test_whole_eia_is_one_image_whatever_the_strips_and_of_one_frame(network, rows_at_once, monkeypatch):
    monkeypatch.setattr(upscalers, "ROWS_AT_ONCE", rows_at_once)
    upscaler = WholeEIAUpscaler("paper-eia", device="cpu")
    for low in map(low_eia, (0, 1)):
        image = low.color.transpose(0, 2, 1, 3, 4).reshape(1, 4 * 6, 5 * 5, 3)
        whole = expected(network, image)[0].reshape(4, 12, 5, 10, 3)
        np.testing.assert_allclose(upscaler(low, LENSES), np.stack([whole[row, :, column] for row, column in LENSES]),
                                   atol=2e-5)


def test_plain_interpolation_stands_for_a_network_and_weights_decide_the_digest():
    method = LabMethod.parse("oidn+fsrcnn")
    assert (method.name.text, method.network) == ("oidn+bilinear", "fsrcnn")
    assert LabMethod.parse("denoise+bicubic").network is None and ready("denoise+bicubic")[1] is None
    digest = {text: LabMethod.parse(text).weights_digest for text in
              ("oidn+bicubic", "denoise", "denoise+bicubic", "denoise+paper", "espcn", "oidn+espcn", "fsrcnn-eia",
               "fsrcnn", "paper")}
    assert digest["oidn+bicubic"] == "" and digest["denoise"] == digest["denoise+bicubic"] != ""
    assert digest["denoise+paper"] not in (digest["denoise"], digest["paper"])
    assert digest["espcn"] == digest["oidn+espcn"] != "" and digest["fsrcnn-eia"] == digest["fsrcnn"]
    assert digest["paper"] != digest["espcn"]


def test_a_network_works_at_its_scales_on_both_axes_and_not_without_torch(tmp_path, monkeypatch):
    only_4 = dataclasses.replace(comparators.NETWORKS["fsrcnn"], weights={4: Path("x.safetensors")})
    monkeypatch.setitem(comparators.NETWORKS, "fsrcnn", only_4)
    assert LabMethod.parse("oidn+fsrcnn").works_at(4) and not LabMethod.parse("oidn+fsrcnn").works_at(2)
    finish, upscaler = ready("paper")
    for refused in (lambda: finished_linear(write_render(tmp_path, display=FLAT), finish, upscaler=upscaler),
                    lambda: LabMethod.parse("paper").check_parallax((True, False))):
        refuses("'paper' needs views in two directions", refused)
    monkeypatch.setitem(sys.modules, "torch", None)
    monkeypatch.delitem(sys.modules, "lfsr_lab.networks.upscalers", raising=False)
    refuses(r"'torch'.*lfsr-lab\[training\]", ready, "espcn")
