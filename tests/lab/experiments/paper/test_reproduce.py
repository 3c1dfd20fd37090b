"""The paper's figures: measured on synthetic frames, resumed, and put into words that follow the numbers."""

from __future__ import annotations

import dataclasses
import json
import math

import cv2
import pytest

from lfsr_core.frames.frame import read_frame
from lfsr_core.frames.reference import Reference
from lfsr_core.metrics.compare import compare_folders
from lfsr_core.metrics.eia_metrics import METRIC_NAMES
from lfsr_core.reconstruct.networks import catalogue
from lfsr_core.reconstruct.registry import method
from lfsr_core.reconstruct.second_stage import linear_and_mask, upscale_frame
from lfsr_core.records import from_data, to_data
from lfsr_core.render import store
from lfsr_lab.experiments.engine import timing
from lfsr_lab.experiments.engine.accuracy import Target
from lfsr_lab.experiments.engine.plots import save
from lfsr_lab.experiments.paper import __main__ as command
from lfsr_lab.experiments.paper import page, quality, renders, settings, weights
from lfsr_lab.experiments.paper.figures import figure9, figure11
from lfsr_lab.train.config import load_config
from tests.support.synthetic import MINI, write_reference, write_render
from tests.support.training_photographs import some_photographs

SCALE, SPP, CLEAN = 4, 4, 8
HALF = renders.resolution(MINI, 2)


@pytest.fixture(scope="module")
def frames(tmp_path_factory):
    """Every render that the figures ask for, made without Blender."""
    root = tmp_path_factory.mktemp("paper")
    scene, moved = root / "toy.obj", root / "moved" / "toy-mini-1.blend"
    moved.parent.mkdir()
    for path in (scene, moved):
        path.touch()
    write_reference(root / "bench" / "toy" / "reference", noise=0.02)
    for scale, spp in ((8, SPP), (4, SPP), (4, CLEAN), (2, SPP), (1, SPP), (1, 1)):
        write_render(root / "bench" / "toy" / f"s{scale}-spp{spp}", scale, samples=spp)
    write_render(root / "bench" / "toy" / f"s4-spp{SPP}-view-by-view", 4, samples=SPP, layout="view-by-view")
    write_render(root / "bench" / moved.stem / f"s4-spp{SPP}", 4, samples=SPP)
    for scale in (1, 2, 4):
        write_render(root / f"bench-{HALF.name}" / "toy" / f"s{scale}-spp{SPP}", scale, HALF, samples=SPP)
    return settings.quick(root, (scene,), display=MINI, timing_display=MINI, spp=SPP, clean_spp=CLEAN, repeats=3,
                          steps=(4, 8), moves=(1.0,), workload=(8, 4), device="cpu")


@pytest.fixture(scope="module")
def measured(frames):
    return {name: figure.measure(frames) for name, figure in page.FIGURES.items()}


def test_every_figure_measures_draws_and_speaks(frames, measured, tmp_path):
    for name, figure in page.FIGURES.items():
        results = measured[name]
        assert from_data(figure.kind, json.loads(json.dumps(to_data(results))), name) == results
        rows = figure.table(results)
        assert len(rows) > 2 and len({row.count("|") for row in rows}) == 1, rows
        assert figure.line(results).startswith("**")
        if figure.draw:
            path = tmp_path / page.picture_name(figure)
            save(figure.draw(results, frames.output), path)
            assert cv2.imread(str(path)).std() > 5 and path.stat().st_size < 150_000


def test_networks_without_weights_are_named_and_not_invented(measured):
    found = measured["fig9"]
    assert [row.method for row in found.rows if row.metrics is None] == ["paper-gan"] * 2
    assert "for want of weights: paper-gan" in figure9.line(found)
    assert found.schedules["paper"].startswith("short schedule: ")
    assert found.schedules["paper-gan"] == "no weights"


def test_accuracy_is_what_compare_gives(frames, measured):
    folder = frames.bench / "toy" / f"s4-spp{CLEAN}"
    upscale_frame(folder, "bicubic")
    expected = compare_folders(folder, frames.bench / "toy" / "reference")
    row = next(row for row in measured["fig9"].rows if row.method == "bicubic" and row.samples == CLEAN)
    assert row.metrics == pytest.approx({name: getattr(expected, name) for name in METRIC_NAMES})
    assert sum(row.lens_ssim_fg) / len(row.lens_ssim_fg) == pytest.approx(expected.ssim_lens_fg, abs=0.01)
    assert -10 * math.log10(row.error.border + row.error.centre) == pytest.approx(expected.psnr_fg, abs=0.01)


def test_sampled_lenses_are_compared_as_they_are_elsewhere(frames, tmp_path):
    listed = tuple((row, column) for row in range(0, 12, 3) for column in range(0, 16, 2))
    write_reference(tmp_path, noise=0.02, lens_list=listed)
    reference, folder = Reference.read(tmp_path), frames.bench / "toy" / f"s4-spp{CLEAN}"
    image, mask = linear_and_mask(folder, method("bicubic"))
    target = Target(reference, reference.foreground_mask(mask))
    found = quality.accuracy(quality.Finished(image, read_frame(folder), target))
    inside = [mask[row, column] for row, column in listed]
    assert 0 < sum(inside) < len(listed) and len(found.lens_ssim_fg) == reference.foreground.sum()
    assert found.ci95["ssim_lens_fg"] > 0
    if list(reference.foreground) == inside:
        assert sum(found.lens_ssim_fg) / sum(inside) == pytest.approx(found.metrics["ssim_lens_fg"], abs=1e-5)
    rows, columns = reference.lenses[quality.middle_lenses(reference, 4)].T
    assert len(rows) == 4 and mask[rows, columns].all()


def test_sampled_references_have_no_epipolar_images(frames, tmp_path):
    write_reference(tmp_path / "toy" / "reference", lens_list=((1, 2), (3, 4)))
    write_render(tmp_path / "toy" / f"s4-spp{CLEAN}", 4, samples=CLEAN)
    sampled = dataclasses.replace(frames, bench=tmp_path, output=tmp_path)
    results = figure11.measure(sampled)
    assert page.FIGURES["fig11"].line(results).startswith("**Not measured.**")
    assert len(figure11.draw(results, tmp_path).axes) == 1


def test_a_second_run_measures_nothing(frames, measured, monkeypatch):
    def forbidden(*_, **__):
        raise AssertionError("measured again")

    for module, name in ((quality, "linear_and_mask"), (timing, "take_turns"), (store, "run_job")):
        monkeypatch.setattr(module, name, forbidden)
    for name, figure in page.FIGURES.items():
        assert figure.measure(frames) == measured[name], name
    with pytest.raises(AssertionError, match="measured again"):
        figure9.measure(dataclasses.replace(frames, output=frames.output / "other"))


def test_stopped_run_keeps_what_is_done(frames, measured, tmp_path, monkeypatch):
    monkeypatch.setattr(quality, "accuracy", _stop_at(3))
    again = dataclasses.replace(frames, output=tmp_path)
    with pytest.raises(KeyboardInterrupt):
        figure9.measure(again)
    monkeypatch.undo()
    done = {path: path.stat().st_mtime_ns for path in tmp_path.rglob("*.json")}
    assert len(done) == 2
    assert figure9.measure(again).rows == measured["fig9"].rows
    assert all(path.stat().st_mtime_ns == before for path, before in done.items())


def _stop_at(call):
    original, calls = quality.accuracy, []

    def accuracy(made):
        calls.append(1)
        if len(calls) == call:
            raise KeyboardInterrupt
        return original(made)

    return accuracy


def test_training_is_labelled_and_done_once(tmp_path, frames):
    photographs = tmp_path / "photographs"
    photographs.mkdir()
    for name, image in zip(some_photographs().names, some_photographs(height=100, width=100).images, strict=True):
        cv2.imwrite(str(photographs / name), image)
    chosen = dataclasses.replace(frames, output=tmp_path, train_epochs=1, photographs=str(photographs),
                                 validation=str(photographs))
    path = weights.weights(chosen, "paper-3")
    before = path.stat().st_mtime_ns
    assert weights.weights(chosen, "paper-3") == path and path.stat().st_mtime_ns == before
    assert path.parent == weights.trained_folder(chosen)
    assert weights.schedule(path).startswith("short schedule: 1 epochs of ")
    assert weights.fingerprint(path) != weights.fingerprint(weights.weights(frames, "paper"))
    assert weights.weights(chosen, "refine") == catalogue.weights_path("refine", chosen.scale), "ours ship"
    given = dataclasses.replace(frames, weights=path.parent)
    assert weights.weights(given, "paper-3") == path
    assert weights.weights(given, "paper-4") is None


def test_a_short_adversary_begins_with_the_generator_of_the_same_run(tmp_path, frames):
    path = tmp_path / "given" / f"paper-x{frames.scale}.safetensors"
    weights._published(catalogue.weights_path("paper", frames.scale), path.parent)
    given = dataclasses.replace(frames, weights=path.parent)
    assert weights._start(given, "paper-gan") == str(path.resolve())
    assert weights._start(given, "paper") == weights._start(given, "paper-3") == ""
    full = dataclasses.asdict(load_config("paper-gan"))
    assert weights._is_full(full) and not weights._is_full({**full, "epochs": 5})


def test_one_command_writes_pages_and_goes_on(frames, tmp_path, capsys):
    words = ["-o", str(tmp_path / "out"), "--scenes", str(frames.scenes[0]), "--bench", str(frames.bench), "--quick",
             "--display", "mini", "--timing-display", "mini", "--spp", str(SPP), "--clean-spp", str(CLEAN),
             "--repeats", "3", "--docs", str(tmp_path / "docs")]
    run = command.main
    assert run([*words, "--only", "table3"]) == 0
    assert run([*words, "--only", "fig9"]) == 0
    text = (tmp_path / "docs" / "notebook" / "paper.md").read_text()
    assert "## Table 3: multiply-adds" in text and "![Fig. 9: residuals](../images/paper-fig9.png)" in text
    assert "Not measured in this run" in text and "Quick mode" in text
    assert str(tmp_path) not in text and str(frames.output) not in text
    assert (tmp_path / "docs" / "images" / "paper-fig9.png").exists()
    assert "Fig. 9: residuals: **" in capsys.readouterr().out


def test_bad_input_is_one_sentence(frames, tmp_path, capsys):
    common = ["-o", str(tmp_path), "--scenes", str(frames.scenes[0])]
    for words, sentence in ((["--only", "fig13"], "there is no figure 'fig13'"),
                            (["--weights", str(tmp_path / "none")], "is no folder"),
                            (["--bench", str(frames.bench), "--only", "fig9"],
                             "was rendered with display mini, but display small was asked for")):
        assert command.main([*common, *words]) == 2
        error = capsys.readouterr().err
        assert sentence in error.splitlines()[-1]


def test_resolutions_keep_the_lenses():
    assert HALF.lenses == MINI.lenses and HALF.views == (4, 4) and HALF.panel_mm == MINI.panel_mm
    assert renders.resolution(MINI, 3) is None
