"""Denoisers judged on renders that are played: measured once, compared in pairs, shown."""

import dataclasses
import json

import numpy as np
import pytest

from lfsr_core.base.records import read_record, write_record
from lfsr_core.base.system import read_json
from lfsr_core.cli import main
from lfsr_core.images.color import srgb_encode
from lfsr_core.optics.depth_scale import LossModel
from lfsr_core.optics.rays import to_elemental_images, to_views
from lfsr_lab.experiments.denoiser import study
from lfsr_lab.experiments.denoiser.study import places, read_settings
from lfsr_lab.experiments.engine.records import Store
from lfsr_lab.experiments.engine.truth import Truth
from lfsr_lab.experiments.scales.study import Cell, Table, collect, fit, groups_of
from tests.support.panels import whole
from tests.support.played_blender import played_blender
from tests.support.synthetic import MINI, fails, frame_of, light_field, write_reference

TOML = """
reference_samples = 512
repeated = [16]
once = [4]
scenes = [
    { name = "disc", file = "disc.blend", group = "round", display = "mini", scale = 2, lenses = 20 },
    { name = "elsewhere", file = "elsewhere.blend", group = "round" }]
rays = { one = { 1 = 1, 2 = 4, 4 = 16, 5 = 25 } }
"""


def test_what_is_there_is_measured_once_and_shown(tmp_path, capsys):
    (tmp_path / "disc.blend").touch()
    settings, blender, out = tmp_path / "settings.toml", tmp_path / "blender", tmp_path / "out"
    settings.write_text(TOML)
    words = ["study", "denoiser", str(tmp_path), "-o", str(out), "-m", "bilinear", "--settings", str(settings),
             "--blender", played_blender(blender)]
    assert main(words) == 0, capsys.readouterr().err
    first = capsys.readouterr().out
    blender.unlink()  # nothing more is rendered
    cells = sorted(out.rglob("bilinear.json"))
    times = [cell.stat().st_mtime_ns for cell in cells]
    assert main([*words, "--only-measure"]) == 0
    assert capsys.readouterr().out == first == (out / "denoiser.md").read_text() + "\n"
    assert [cell.stat().st_mtime_ns for cell in cells] == times and len(times) == 5
    assert "elsewhere" not in first
    record = read_record(out / "denoiser.json", study.Record, "means")
    lenses = [read_json(cell, "a cell")["record"]["ssim"] for cell in cells if "s2-spp16" in str(cell)]
    assert len(lenses) == 2 and record.mean("disc", 16, "bilinear") == pytest.approx(np.mean(lenses), abs=1e-5)
    assert record.group_mean("round", 16, "bilinear") == record.mean("disc", 16, "bilinear")
    assert "| 16 | round |" in study.markdown(record)
    assert {path.name for path in (out / "disc").iterdir()} == {
        "cells", "reference", "s1-spp1-seed0", "s2-spp16-seed0", "s2-spp16-seed1", "s2-spp4-seed0", "s4-spp16-seed0"}


def test_errors_do_not_grow_with_the_noise_of_the_reference_and_views_are_those_along_one_axis(tmp_path):
    truth = Truth(write_reference(tmp_path / "plain", noise=0.05))
    field = to_elemental_images(light_field()[..., :3], MINI.lenses)[tuple(truth.lenses.T)]
    exact, worse = (study.figures(truth, np.float32(factor) * field, 0.0) for factor in (1.0, 1.2))
    mean = np.mean(truth.halves, 0)
    noise = np.mean((srgb_encode(mean) - srgb_encode(field))**2)
    assert abs(np.mean(exact.squared)) < 0.1 * noise and abs(np.mean(exact.relative)) < 2e-3
    expected = np.mean((0.2 * field)**2 / (mean.mean(-1, keepdims=True)**2 + 0.01))
    assert np.mean(worse.relative) == pytest.approx(expected, rel=0.15)
    assert np.mean(exact.ssim) > np.mean(worse.ssim) and np.mean(exact.flip) < np.mean(worse.flip)
    panel, block = whole("lenticular"), tuple((row, column) for row in range(3, 7) for column in range(2, 8))
    truth = Truth(write_reference(tmp_path / "lenticular", display=panel, lens_list=block))
    field = light_field(panel)[..., :3]
    images = to_elemental_images(field, panel.lenses)[tuple(truth.lenses.T)]
    assert np.array_equal(truth.shown(images), to_views(field, panel.lenses)[0, :, 3:7, 2:8])


def test_weights_are_told_apart_and_stay_at_scale_1_and_settings_have_equal_rays_at_every_scale(tmp_path):
    names = []
    for folder in ("first", "second"):
        file = tmp_path / folder / "weights.tza"
        file.parent.mkdir()
        file.write_text(folder)
        names.append(study.Candidate.parse(f"denoise+bilinear={file}"))
    assert names[0].label != names[1].label
    at_one = names[0].at(frame_of(1))
    assert (at_one.name.text, at_one.weights) == ("denoise", names[0].weights)
    settings = study.read_settings(study.SETTINGS)
    for rays, samples in settings.rays.items():
        counts = {number / int(scale)**2 for scale, number in samples.items()}
        assert max(counts) - min(counts) < 0.02, (rays, counts)
    assert {scene.group for scene in settings.scenes} >= {"known", "unseen"}
    assert study.Render(4, 16) in study.Settings.renders(settings, settings.scenes[0])


TRUE = LossModel(detail=0.5, lenses=2.0, noise=0.2, power=0.8)


def table(random: np.random.Generator) -> Table:
    """Scenes whose accuracies follow a model, on top of what each scene has of its own."""
    moves = {f"scene{number}": tuple(np.sort(random.uniform(0, 2, 20) * depth).tolist())
             for number, depth in enumerate(np.geomspace(0.002, 1, 12))}
    cells = []
    for scene, points in moves.items():
        own = random.uniform(0.8, 1.0)
        cells += [Cell(scene, "made", rays, scale, own - TRUE.loss(np.array(points), scale, rays * scale**2))
                  for rays in (0.25, 1.0, 4.0) for scale in (1, 2, 4, 5) if rays * scale**2 >= 1]
    return Table("bilinear", moves, tuple(cells))


def test_a_known_model_is_found_again_and_its_choices_are_shown(tmp_path, capsys):
    made = table(np.random.default_rng(0))
    groups = groups_of(made)
    fitted = fit(groups)
    assert max(group.lost(fitted.model) for group in groups) < 0.002
    assert max(fitted.left_out.values()) < 0.004 and fitted.left_out.keys() == {(g.scene, g.rays) for g in groups}
    # Its numbers as well, as far as the grid allows: predictions are in SSIM.
    for moved, scale, samples in ((0.05, 4, 16), (0.3, 2, 4), (0.3, 4, 64)):
        points = np.full(3, moved)
        shown, true = (model.loss(points, scale, samples) - model.loss(points, 1, 64) for model in (fitted.model, TRUE))
        assert shown == pytest.approx(true, abs=0.02)
    write_record(tmp_path / "table.json", dataclasses.replace(made, cells=made.cells[:40]))
    assert main(["study", "scales", str(tmp_path / "table.json")]) == 0
    shown = capsys.readouterr().out
    assert "| scene0 | 1 | " in shown and "MODEL = LossModel(detail=" in shown and "| always 4 |" in shown


def test_the_renders_of_another_experiment_are_measured_and_what_cannot_be_fitted_is_said(tmp_path, monkeypatch,
                                                                                          capsys):
    (tmp_path / "disc.blend").touch()
    (tmp_path / "settings.toml").write_text(TOML.replace("lenses = 20", "lenses = 8"))
    settings, store = read_settings(tmp_path / "settings.toml"), Store(tmp_path, played_blender(tmp_path / "blender"))
    monkeypatch.setattr("lfsr_lab.experiments.scales.study._moves", lambda *_: (0.1, 0.2))  # that Blender sees nothing
    assert collect(settings, store, [tmp_path], "bilinear").cells == (), "nothing is rendered"
    (place,) = places(store, settings, [tmp_path])
    place.fill(settings.reference_samples, settings.at_rays(place.scene)["one"][:2])
    collected = collect(settings, store, [tmp_path], "bilinear")
    assert [(cell.scene, cell.rays, cell.scale) for cell in collected.cells] == [("disc", 1, 1), ("disc", 1, 2)]
    assert collected.moves == {"disc": (0.1, 0.2)} and all(0 < cell.ssim < 1 for cell in collected.cells)
    capsys.readouterr()
    file = tmp_path / "table.json"
    file.write_text(json.dumps({"method": "bilinear", "moves": {}, "cells": []}))
    for words, said in (([str(tmp_path)], "add -o OUT -m METHOD"), ([], "no scene with two scales at equal rays")):
        assert said in fails(["study", "scales", str(file), *words], capsys)
