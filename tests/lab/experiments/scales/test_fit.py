"""The fit of the choice of a scale: a known model is found again, and its table is shown."""

from __future__ import annotations

import json

import numpy as np
import pytest

from lfsr_core.base.records import write_record
from lfsr_core.cli import main
from lfsr_core.optics.depth_scale import LossModel
from lfsr_lab.experiments.denoiser.measure import places, read_settings
from lfsr_lab.experiments.engine.renders import Store
from lfsr_lab.experiments.scales.study import Cell, Table, collect, fit, groups_of
from tests.lab.experiments.denoiser.test_run import TOML
from tests.support.played_blender import played_blender

TRUE = LossModel(detail=0.5, lenses=2.0, noise=0.2, power=0.8)


def table(random: np.random.Generator, noise: float = 0.0) -> Table:
    """Scenes whose accuracies follow a model, on top of what each scene has of its own."""
    moves = {f"scene{number}": tuple(np.sort(random.uniform(0, 2, 20) * depth).tolist())
             for number, depth in enumerate(np.geomspace(0.002, 1, 30))}
    cells = []
    for scene, points in moves.items():
        own = random.uniform(0.8, 1.0)
        cells += [Cell(scene, "made", rays, scale, own - TRUE.loss(np.array(points), scale, rays * scale**2)
                       + noise * random.normal())
                  for rays in (0.25, 1.0, 4.0) for scale in (1, 2, 4, 5) if rays * scale**2 >= 1]
    return Table("bilinear", moves, tuple(cells))


def test_a_known_model_is_found_again():
    groups = groups_of(table(np.random.default_rng(0)))
    found = fit(groups)
    assert max(group.lost(found.model) for group in groups) < 0.002
    assert max(found.left_out.values()) < 0.004 and found.left_out.keys() == {(g.scene, g.rays) for g in groups}
    # Its numbers as well, as far as the grid allows: predictions are in SSIM.
    for moved, scale, samples in ((0.05, 4, 16), (0.3, 2, 4), (0.3, 4, 64)):
        points = np.full(3, moved)
        shown, true = (model.loss(points, scale, samples) - model.loss(points, 1, 64) for model in (found.model, TRUE))
        assert shown == pytest.approx(true, abs=0.02)


def test_noisy_figures_still_give_good_choices():
    groups = groups_of(table(np.random.default_rng(1), noise=0.004))
    found = fit(groups)
    assert np.mean([group.lost(found.model) for group in groups]) < 0.002


def test_the_renders_of_another_experiment_are_measured(tmp_path, monkeypatch):
    (tmp_path / "disc.blend").touch()
    (tmp_path / "settings.toml").write_text(TOML.replace("lenses = 20", "lenses = 8"))
    settings, store = read_settings(tmp_path / "settings.toml"), Store(tmp_path, played_blender(tmp_path / "blender"))
    monkeypatch.setattr("lfsr_lab.experiments.scales.study._moves", lambda *_: (0.1, 0.2))  # that Blender sees nothing
    assert collect(settings, store, [tmp_path], "bilinear").cells == (), "nothing is rendered"
    (place,) = places(store, settings, [tmp_path])
    place.fill(settings.reference_samples, settings.at_rays(place.scene)["one"][:2])
    found = collect(settings, store, [tmp_path], "bilinear")
    assert [(cell.scene, cell.rays, cell.scale) for cell in found.cells] == [("disc", 1, 1), ("disc", 1, 2)]
    assert found.moves == {"disc": (0.1, 0.2)} and all(0 < cell.ssim < 1 for cell in found.cells)


def test_choices_are_shown(tmp_path, capsys):
    write_record(tmp_path / "table.json", table(np.random.default_rng(2)))
    assert main(["study", "scales", str(tmp_path / "table.json")]) == 0
    shown = capsys.readouterr().out
    assert "| scene0 | 1 | " in shown and "MODEL = LossModel(detail=" in shown and "| always 4 |" in shown


def test_what_cannot_be_fitted_is_said(tmp_path, capsys):
    assert main(["study", "scales", str(tmp_path / "table.json"), str(tmp_path)]) == 2
    assert "add -o OUT -m METHOD" in capsys.readouterr().err
    (tmp_path / "table.json").write_text(json.dumps({"method": "bilinear", "moves": {}, "cells": []}))
    assert main(["study", "scales", str(tmp_path / "table.json")]) == 2
    assert "has no scene with two scales at equal rays" in capsys.readouterr().err
