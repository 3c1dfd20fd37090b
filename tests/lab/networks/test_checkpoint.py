"""Weights files: what is written, and every way in which one can be wrong."""

from __future__ import annotations

import json
import pickle

import numpy as np
import pytest
import torch
from safetensors.numpy import save_file

from lfsr_core.base.errors import LfsrError
from lfsr_core.base.files import read_json
from lfsr_lab.networks import checkpoint, comparators
from lfsr_lab.networks.networks import PaperGenerator, load


@pytest.fixture
def saved(tmp_path):
    torch.manual_seed(1)
    network = PaperGenerator(4)
    path = tmp_path / "paper-x4.safetensors"
    checkpoint.save(path, network, 4, {"seconds": 1.5}, {"convolutions": 2})
    return network, path


def rewrite(path, change_header=None, change_tensors=None):
    """The same file with another header or other tensors, its hash left as it was."""
    header, tensors = checkpoint.read(path)
    header, tensors = {**header, **(change_header or {})}, {**tensors, **(change_tensors or {})}
    save_file({name: value for name, value in tensors.items() if value is not None}, path, metadata=header)


def test_load_gives_the_saved_values(saved):
    network, path = saved
    loaded = load("paper", 4, path)
    assert not loaded.training
    for name, value in network.state_dict().items():
        assert torch.equal(loaded.state_dict()[name], value)


def test_provenance_lies_beside_and_agrees(saved):
    _, path = saved
    facts = read_json(path.with_suffix(".json"), "provenance")
    header, tensors = checkpoint.read(path)
    assert facts["sha256"] == header["sha256"] == checkpoint.digest(tensors)
    assert (facts["seconds"], facts["scale"], facts["bytes"]) == (1.5, 4, path.stat().st_size)
    assert json.loads(checkpoint.read(path)[0]["options"]) == {"convolutions": 2}


def test_another_version(saved):
    rewrite(saved[1], {"version": "2"})
    with pytest.raises(LfsrError, match="weights format version '2', expected 1"):
        load("paper", 4, saved[1])


def test_another_format(saved):
    save_file({"a": np.zeros(2, np.float32)}, saved[1])
    with pytest.raises(LfsrError, match="not LFSR weights"):
        load("paper", 4, saved[1])


@pytest.mark.parametrize(("name", "scale", "message"), [
    ("espcn", 4, "architecture 'PaperGenerator', expected 'ESPCN'"),
    ("paper", 2, "scale '4', expected '2'"),
    ("paper-3", 4, r"body\.4\..*missing, expected \(16"),
])
def test_weights_of_another_network(saved, name, scale, message):
    with pytest.raises(LfsrError, match=message):
        load(name, scale, saved[1])


def test_one_changed_value_breaks_the_hash(saved):
    _, tensors = checkpoint.read(saved[1])
    value = tensors["up.bias"].copy()
    value[0] += 1e-3
    rewrite(saved[1], change_tensors={"up.bias": value})
    with pytest.raises(LfsrError, match="does not match the SHA-256"):
        load("paper", 4, saved[1])


@pytest.mark.parametrize("value", [np.nan, np.inf, -np.inf])
def test_weights_that_are_not_finite_are_refused_with_a_right_hash(saved, value):
    header, tensors = checkpoint.read(saved[1])
    tensors["up.bias"][1] = value
    save_file(tensors, saved[1], header | {"sha256": checkpoint.digest(tensors)})
    with pytest.raises(LfsrError, match=r"'up\.bias' of .* are not finite: the training diverged, train it again"):
        load("paper", 4, saved[1])


def test_hash_sees_shapes_and_names():
    value = np.arange(6, dtype=np.float32)
    variants = ({"a": value}, {"b": value}, {"a": value.reshape(2, 3)})
    digests = {checkpoint.digest(tensors) for tensors in variants}
    assert len(digests) == 3


@pytest.mark.parametrize("keep", [0, 6, 200, -1])
def test_truncated_file(saved, keep):
    saved[1].write_bytes(saved[1].read_bytes()[:keep])
    with pytest.raises(LfsrError, match="cannot be read as safetensors weights"):
        load("paper", 4, saved[1])


def test_a_pickle_is_never_run(saved, tmp_path):
    class Evil:
        def __reduce__(self):
            return (open, (str(tmp_path / "proof"), "w"))

    saved[1].write_bytes(pickle.dumps(Evil()))
    with pytest.raises(LfsrError, match="cannot be read"):
        load("paper", 4, saved[1])
    assert not (tmp_path / "proof").exists()


def test_missing_file_and_missing_scale(tmp_path):
    with pytest.raises(LfsrError, match="does not exist"):
        load("paper", 4, tmp_path / "none.safetensors")
    with pytest.raises(LfsrError, match=r"no weights for scale 3 \(there are some for 4\)"):
        load("paper", 3)


def test_too_large_and_diverged_weights_are_refused(tmp_path):
    path = tmp_path / "big.safetensors"
    with pytest.raises(LfsrError, match="expected less than 1000000"):
        checkpoint.save(path, torch.nn.Linear(600, 600), 4, {})
    broken = PaperGenerator(4)
    torch.nn.init.constant_(broken.up.bias, float("nan"))
    with pytest.raises(LfsrError, match=r"'up\.bias'.*not finite"):
        checkpoint.save(path, broken, 4, {})
    assert list(tmp_path.iterdir()) == []


def shipped():
    return [(name, scale) for name, network in comparators.NETWORKS.items() for scale in network.weights]


@pytest.mark.parametrize(("name", "scale"), shipped())
def test_shipped_weights_fit_and_carry_their_provenance(name, scale):
    path = comparators.weights_path(name, scale)
    header, tensors = checkpoint.read(path)
    facts = json.loads(path.with_suffix(".json").read_text())
    assert path.stat().st_size < checkpoint.MAX_BYTES
    assert header["sha256"] == facts["sha256"] == checkpoint.digest(tensors)
    assert {"command", "versions", "validation"} <= facts.keys()
    load(name, scale)
