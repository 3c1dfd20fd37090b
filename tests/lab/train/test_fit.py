"""Fitting a network to a scene: it learns that scene, is judged on other lenses, and its file works everywhere."""

from __future__ import annotations

import dataclasses
import itertools
from types import SimpleNamespace

import numpy as np
import pytest
import torch

from lfsr_core.errors import LfsrError
from lfsr_core.files import read_json
from lfsr_core.frames.frame import LOW_RES_FILE, REFERENCE_FILES, REPORT_FILE, read_frame
from lfsr_core.frames.low_res import read_world
from lfsr_core.frames.reference import Reference
from lfsr_core.images.exr import read_layers, write_layers
from lfsr_core.images.srgb import srgb_encode
from lfsr_core.metrics.compare import compare_folders
from lfsr_core.optics.eia import to_elemental_images
from lfsr_core.reconstruct.options import UpscaleOptions
from lfsr_core.reconstruct.registry import method
from lfsr_core.reconstruct.second_stage import finished_linear, upscale_frame
from lfsr_lab.networks.networks import load
from lfsr_lab.train import fit as fit_module
from lfsr_lab.train.fit import FitOptions, fit
from tests.support.synthetic import MINI, fails, write_apart, write_reference, write_render

SCALE = 2
SECONDS_PER_STEP = 1 / 32
# The lenses are few: a second thread would only wait for the first.
torch.set_num_threads(1)


@pytest.fixture
def folders(tmp_path):
    """A noisy render of synthetic.light_field with albedo and normal, and its reference."""
    folder, reference = write_render(tmp_path / "f", SCALE), write_reference(tmp_path / "r")
    color = read_layers(folder / LOW_RES_FILE)["color"]
    rng = np.random.default_rng(0)
    albedo, normal = color[..., :3].copy(), np.repeat(color[..., 3:], 3, -1) * np.float32([0, 0, 1])
    color[..., :3] *= rng.exponential(1, color[..., :1].shape).astype(np.float32)
    write_layers(folder / LOW_RES_FILE, {"color": color, "albedo": albedo, "normal": normal})
    return folder, reference


def test_fit_gains_on_lenses_it_has_not_seen(folders, tmp_path, monkeypatch):
    folder, reference = folders
    weights = tmp_path / "w.safetensors"
    # A clock that each step moves on: a busy machine takes as many steps as an idle one.
    clock = itertools.count(0, SECONDS_PER_STEP)
    monkeypatch.setattr(fit_module, "time", SimpleNamespace(monotonic=lambda: next(clock)))
    fitted = fit(folder, reference, weights, FitOptions("light", lenses=16, seconds=3))
    assert (fitted.lenses, fitted.steps) == (16, 3 / SECONDS_PER_STEP - 1) and fitted.unseen_lenses > 16
    assert fitted.after > fitted.before + 0.01
    assert read_json(weights.with_suffix(".json"), "provenance").items() >= dataclasses.asdict(fitted).items()
    upscale_frame(folder, "light")
    general = compare_folders(folder, reference).ssim_eia_fg
    upscale_frame(folder, "light", UpscaleOptions(weights=weights))
    assert read_json(folder / REPORT_FILE, "report")["weights"] == str(weights)
    assert compare_folders(folder, reference).ssim_eia_fg > general + 0.01


def test_no_time_leaves_the_network_as_it_was(folders, tmp_path):
    fitted = fit(*folders, tmp_path / "w.safetensors", FitOptions("light", seconds=0))
    assert fitted.steps == 0 and fitted.after == fitted.before


def test_too_few_lenses(folders, tmp_path):
    folder, _ = folders
    listed = tuple((6, column) for column in range(6, 12))
    reference = write_reference(tmp_path / "few", lens_list=listed)
    with pytest.raises(LfsrError, match="a fit needs 8"):
        fit(folder, reference, tmp_path / "w.safetensors", FitOptions("light", seconds=1))


def test_layers_are_needed(tmp_path):
    folder, reference = write_render(tmp_path / "f", SCALE), write_reference(tmp_path / "r")
    with pytest.raises(LfsrError, match="lacks the layers albedo, normal"):
        fit(folder, reference, tmp_path / "w.safetensors", FitOptions("light", seconds=1))


def test_networks_of_photographs_are_refused(folders, tmp_path, capsys):
    words = ["fit", *map(str, folders), "-o", str(tmp_path / "w.safetensors"), "--network", "paper"]
    assert "cannot be fitted" in fails(words, capsys)


def test_weights_without_a_network_are_refused():
    with pytest.raises(LfsrError, match="'bicubic' is no network"):
        method("oidn+bicubic", weights="w.safetensors")


def test_over_a_world_apart_it_sees_and_scores_what_the_second_stage_does(tmp_path):
    """The network is fed the subject alone, and judged with the world behind it."""
    rng = np.random.default_rng(0)

    def grainy(color):
        color[..., :3] *= rng.exponential(1, color[..., :1].shape).astype(np.float32)
        return color
    folder = write_apart(tmp_path / "f", paint=grainy)
    layers = read_layers(folder / LOW_RES_FILE)
    alpha = np.repeat(layers["color"][..., 3:], 3, -1)
    layers |= {"albedo": 0.5 * alpha + layers["environment"], "normal": alpha * np.float32([0, 0, 1])}
    write_layers(folder / LOW_RES_FILE, layers)
    reference = write_reference(tmp_path / "r", world_visible=True)
    frame = read_frame(folder)
    everywhere = np.argwhere(np.ones(MINI.lenses[::-1], bool))
    world = read_world(folder, frame).elemental_images(everywhere).reshape(*MINI.lenses[::-1], 8, 8, 3)
    for name in REFERENCE_FILES:
        color = read_layers(reference / name)["color"]
        behind = world.swapaxes(1, 2).reshape(*color.shape[:2], 3) * (1 - color[..., 3:])
        write_layers(reference / name, {"color": color, "environment": behind})

    known = Reference.read(reference)
    lenses = known.lenses[known.foreground]
    finished = srgb_encode(to_elemental_images(finished_linear(folder, "light"), MINI.lenses)[tuple(lenses.T)])
    data, network = fit_module.lenses_of(folder, reference, "light"), load("light", SCALE)
    with torch.no_grad():
        seen = fit_module.finished_images(network, data).numpy().transpose(0, 2, 3, 1)
    # Fireflies, of which a fit knows nothing, are all that differs.
    assert np.abs(seen - finished).mean() < 2e-3
    blind = dataclasses.replace(data, behind=torch.zeros_like(data.behind))
    assert fit_module.score(network, blind) < fit_module.score(network, data) - 0.02
