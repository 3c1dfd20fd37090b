"""The paper's figures: measured on synthetic frames, resumed, and put into words that follow the numbers."""

from __future__ import annotations

import dataclasses
import json
import statistics
from unittest.mock import DEFAULT, Mock

import cv2
import numpy as np
import pytest

from lfsr_core.base.errors import LfsrError
from lfsr_core.base.records import from_data, to_data
from lfsr_core.cli import main
from lfsr_core.metrics.compare import compare_folders
from lfsr_core.metrics.eia_metrics import METRIC_NAMES
from lfsr_core.pipeline.make import finish_frame
from lfsr_lab.experiments.engine import renders as engine_renders
from lfsr_lab.experiments.engine import timing
from lfsr_lab.experiments.engine.plots import save
from lfsr_lab.experiments.seed_paper import measuring, renders, study, weights
from lfsr_lab.experiments.seed_paper.figure import LENS_SSIM, Results
from lfsr_lab.experiments.seed_paper.figures import images
from tests.support.synthetic import MINI, write_reference, write_render
from tests.support.training_photographs import some_photographs

SPP, CLEAN = 4, 8
FIG9 = images.FIG9
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
    return renders.make_settings(root, True, scenes=(scene,), display=MINI, timing_display=MINI, spp=SPP,
                                  clean_spp=CLEAN,
                                  repeats=3, steps=(4, 8), moves=(1.0,), workload=(8, 4), device="cpu")


@pytest.fixture(scope="module")
def measured(frames):
    return {name: figure.measure(frames) for name, figure in study.FIGURES.items()}


def test_every_figure_measures_draws_and_speaks(frames, measured, tmp_path):
    for name, figure in study.FIGURES.items():
        results = measured[name]
        assert from_data(Results, json.loads(json.dumps(to_data(results))), name) == results
        rows = figure.table(results.rows)
        assert len(rows) > 2 and len({row.count("|") for row in rows}) == 1, rows
        assert figure.line(results).startswith("**")
        if figure.draw:
            path = tmp_path / figure.image
            save(figure.draw(results.rows, frames.output / renders.CELLS / name), path)
            assert cv2.imread(str(path)).std() > 5 and path.stat().st_size < 150_000


def test_networks_without_weights_are_named_and_not_invented(measured):
    found = measured["fig9"]
    assert [row.method for row in found.rows if not row.values] == ["paper-gan"] * 2
    assert "Not measured, because they have no weights: paper-gan." in FIG9.line(found)
    assert found.schedules["paper"].startswith("40 epochs of 16 ")
    assert found.schedules["paper-gan"] == "no weights"


def test_accuracy_is_what_compare_gives(frames, measured):
    folder = frames.bench / "toy" / f"s4-spp{CLEAN}"
    finish_frame(folder, "bicubic")
    expected = compare_folders(folder, frames.bench / "toy" / "reference")
    row = next(row for row in measured["fig9"].rows if row.method == "bicubic" and row.samples == CLEAN)
    assert [row.values[name] for name in METRIC_NAMES] == pytest.approx([getattr(expected, n) for n in METRIC_NAMES])
    assert statistics.mean(row.series[LENS_SSIM]) == pytest.approx(expected.ssim_lens_fg, abs=0.01)


def test_references_of_some_lenses_are_refused(frames, tmp_path):
    write_reference(tmp_path / "toy" / "reference", lens_list=((1, 2), (3, 4)))
    with pytest.raises(LfsrError, match="shows only some lenses: give --bench a folder"):
        FIG9.measure(dataclasses.replace(frames, bench=tmp_path, output=tmp_path))


def test_the_middle_lenses_are_shown():
    mask = np.zeros((12, 16), bool)
    mask[6:9, 13:] = True
    assert images.middle(mask, (8, 4)) == (slice(6 * 4, 9 * 4), slice(12 * 8, 16 * 8))


def test_a_second_run_measures_nothing(frames, measured, monkeypatch):
    def forbidden(*_, **__):
        raise AssertionError("measured again")

    for module, name in ((measuring, "linear_and_mask"), (timing, "take_turns"), (engine_renders, "render_all")):
        monkeypatch.setattr(module, name, forbidden)
    for name, figure in study.FIGURES.items():
        assert figure.measure(frames) == measured[name], name
    with pytest.raises(AssertionError, match="measured again"):
        FIG9.measure(dataclasses.replace(frames, output=frames.output / "other"))


def test_stopped_run_keeps_what_is_done(frames, measured, tmp_path, monkeypatch):
    accuracy = Mock(wraps=measuring.accuracy, side_effect=[DEFAULT, DEFAULT, KeyboardInterrupt, DEFAULT, DEFAULT])
    monkeypatch.setattr(measuring, "accuracy", accuracy)
    again = dataclasses.replace(frames, output=tmp_path)
    with pytest.raises(KeyboardInterrupt):
        FIG9.measure(again)
    assert FIG9.measure(again).rows == measured["fig9"].rows and accuracy.call_count == 5


def test_training_is_labelled_and_done_once(tmp_path, frames):
    photographs = tmp_path / "photographs"
    photographs.mkdir()
    for name, image in zip(some_photographs().names, some_photographs(height=100, width=100).images, strict=True):
        cv2.imwrite(str(photographs / name), image)
    chosen = dataclasses.replace(frames, output=tmp_path, train_epochs=1, photographs=str(photographs))
    path = weights.weights(chosen, "paper-3")
    before = path.stat().st_mtime_ns
    assert weights.weights(chosen, "paper-3") == path and path.stat().st_mtime_ns == before
    assert weights.schedule(path).startswith("1 epochs of ")
    assert weights.fingerprints(chosen, "paper-3") != weights.fingerprints(frames, "paper-3")
    given = dataclasses.replace(frames, weights=path.parent)
    assert weights.weights(given, "paper-3") == path
    assert weights.weights(given, "paper-4") is None


def test_one_command_writes_pages_and_goes_on(frames, tmp_path, capsys):
    words = ["study", "paper", "-o", str(tmp_path / "out"), "--scenes", str(frames.scenes[0]), "--bench",
             str(frames.bench), "--quick",
             "--display", "mini", "--timing-display", "mini", "--spp", str(SPP), "--clean-spp", str(CLEAN),
             "--repeats", "3", "--docs", str(tmp_path / "docs")]
    assert [main([*words, "--only", name]) for name in ("table3", "fig9")] == [0, 0]
    text = (tmp_path / "docs" / "notebook" / "paper.md").read_text()
    assert "## Table 3: multiply-adds" in text and "![Fig. 9: residuals](../images/paper-fig9.png)" in text
    assert "Not measured in this run" in text and "Quick mode" in text
    assert str(tmp_path) not in text and str(frames.output) not in text
    assert (tmp_path / "docs" / "images" / "paper-fig9.png").exists()
    assert "Fig. 9: residuals: **" in capsys.readouterr().out


def test_bad_input_is_one_sentence(frames, tmp_path, capsys):
    common = ["study", "paper", "-o", str(tmp_path), "--scenes", str(frames.scenes[0])]
    for words, sentence in ((["--only", "fig13"], "there is no figure 'fig13'"),
                            (["--weights", str(tmp_path / "none")], "is not a folder"),
                            (["--bench", str(frames.bench), "--only", "fig9"], "was rendered with display mini, but")):
        assert main([*common, *words]) == 2 and sentence in capsys.readouterr().err.splitlines()[-1]
