"""The paper's figures: measured on synthetic frames, resumed, and put into words that follow the numbers."""

import dataclasses
import json
import math
import statistics
from unittest.mock import Mock

import cv2
import numpy as np
import pytest

from lfsr_core.base.records import from_data, to_data
from lfsr_core.cli import main
from lfsr_core.metrics.eia_metrics import METRIC_NAMES, compare_folders
from lfsr_core.reconstruct.second_stage import finish_frame
from lfsr_lab.experiments.engine import records as engine_records
from lfsr_lab.experiments.engine import timing
from lfsr_lab.experiments.engine.plots import save
from lfsr_lab.experiments.seed_paper import measuring, study
from lfsr_lab.experiments.seed_paper.figure import Difference, holds, overall, paired
from lfsr_lab.experiments.seed_paper.figures import frames as whole
from lfsr_lab.experiments.seed_paper.figures import images, networks
from lfsr_lab.experiments.seed_paper.measuring import LENS_SSIM, RENDER, TOTAL, Results, Row, timed_rows
from tests.support.synthetic import MINI, write_reference, write_render
from tests.support.told import refuses
from tests.support.training_photographs import some_photographs

SPP, CLEAN = 4, 8
FIG9 = images.FIG9
HALF = measuring.resolution(MINI, 2)


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
    return measuring.make_settings(root, True, scenes=(scene,), display=MINI, timing_display=MINI, spp=SPP,
                                   clean_spp=CLEAN, repeats=3, steps=(4, 8), moves=(1.0,), workload=(8, 4),
                                   device="cpu")


@pytest.fixture(scope="module")
def measured(frames):
    return {name: figure.measure(frames) for name, figure in study.FIGURES.items()}


def test_every_figure_measures_draws_and_speaks_and_what_is_not_there_is_not_invented(frames, measured, tmp_path):
    for name, figure in study.FIGURES.items():
        results = measured[name]
        assert from_data(Results, json.loads(json.dumps(to_data(results))), name) == results
        rows = figure.table(results.rows)
        assert len(rows) > 2 and len({row.count("|") for row in rows}) == 1, rows
        assert figure.line(results).startswith("**")
        if figure.draw:
            path = tmp_path / figure.image
            save(figure.draw(results.rows, frames.output / measuring.CELLS / name), path)
            assert cv2.imread(str(path)).std() > 5 and path.stat().st_size < 150_000
    fig9 = measured["fig9"]
    assert [row.method for row in fig9.rows if not row.values] == ["paper-gan"] * 2
    assert "Not measured, because they have no weights: paper-gan." in FIG9.line(fig9)
    assert fig9.schedules["paper"].startswith("40 epochs of 16 ") and fig9.schedules["paper-gan"] == "no weights"


def test_accuracy_is_what_compare_gives_the_middle_lenses_are_shown_and_references_must_be_whole(frames, measured,
                                                                                                 tmp_path):
    folder = frames.bench / "toy" / f"s4-spp{CLEAN}"
    finish_frame(folder, "bicubic")
    expected = compare_folders(folder, frames.bench / "toy" / "reference")
    row = next(row for row in measured["fig9"].rows if row.method == "bicubic" and row.samples == CLEAN)
    assert [row.values[name] for name in METRIC_NAMES] == pytest.approx([getattr(expected, n) for n in METRIC_NAMES])
    assert statistics.mean(row.series[LENS_SSIM]) == pytest.approx(expected.ssim_lens_fg, abs=0.01)
    mask = np.zeros((12, 16), bool)
    mask[6:9, 13:] = True
    assert images.middle(mask, (8, 4)) == (slice(6 * 4, 9 * 4), slice(12 * 8, 16 * 8))
    write_reference(tmp_path / "toy" / "reference", lens_list=((1, 2), (3, 4)))
    refuses("shows only some lenses", FIG9.measure, dataclasses.replace(frames, bench=tmp_path, output=tmp_path))


def test_a_second_run_measures_nothing(frames, measured, monkeypatch):
    forbidden = Mock(side_effect=AssertionError("measured again"))
    for module, name in ((measuring, "finished_linear"), (timing, "take_turns"), (engine_records, "make")):
        monkeypatch.setattr(module, name, forbidden)
    for name, figure in study.FIGURES.items():
        assert figure.measure(frames) == measured[name], name
    with pytest.raises(AssertionError, match="measured again"):
        FIG9.measure(dataclasses.replace(frames, output=frames.output / "other"))


def test_training_is_labelled_and_done_once(tmp_path, frames):
    photographs = tmp_path / "photographs"
    photographs.mkdir()
    for name, image in zip(some_photographs().names, some_photographs(height=100, width=100).images, strict=True):
        cv2.imwrite(str(photographs / name), image)
    chosen = dataclasses.replace(frames, output=tmp_path, train_epochs=1, photographs=str(photographs))
    path = measuring.weights(chosen, "paper-3")
    before = path.stat().st_mtime_ns
    assert measuring.weights(chosen, "paper-3") == path and path.stat().st_mtime_ns == before
    assert measuring.schedule(path).startswith("1 epochs of ")
    assert measuring.fingerprints(chosen, "paper-3") != measuring.fingerprints(frames, "paper-3")
    given = dataclasses.replace(frames, weights=path.parent)
    assert measuring.weights(given, "paper-3") == path and measuring.weights(given, "paper-4") is None


def test_one_command_writes_pages_and_goes_on_and_bad_input_is_one_sentence(frames, tmp_path, capsys):
    words = ["study", "paper", "-o", str(tmp_path / "out"), "--scenes", str(frames.scenes[0]), "--bench",
             str(frames.bench), "--quick", "--display", "mini", "--timing-display", "mini", "--spp", str(SPP),
             "--clean-spp", str(CLEAN), "--repeats", "3", "--docs", str(tmp_path / "docs")]
    assert [main([*words, "--only", name]) for name in ("table3", "fig9")] == [0, 0]
    text = (tmp_path / "docs" / "notebook" / "paper.md").read_text()
    assert "## Table 3: multiply-adds" in text and "![Fig. 9: residuals](../images/paper-fig9.png)" in text
    assert "Not measured in this run" in text and "Quick mode" in text
    assert str(tmp_path) not in text and str(frames.output) not in text
    assert (tmp_path / "docs" / "images" / "paper-fig9.png").exists()
    assert "Fig. 9: residuals: **" in capsys.readouterr().out
    common = ["study", "paper", "-o", str(tmp_path), "--scenes", str(frames.scenes[0])]
    for words, sentence in ((["--only", "fig13"], "there is no figure 'fig13'"),
                            (["--weights", str(tmp_path / "none")], "is not a folder"),
                            (["--bench", str(frames.bench), "--only", "fig9"], "was rendered with display mini, but")):
        assert main([*common, *words]) == 2 and sentence in capsys.readouterr().err.splitlines()[-1]


SEEDS = (0.01, -0.02, 0.015, -0.005, 0.0, 0.012)


def accurate(method, level, **values):
    return Row(scene="toy", method=method, samples=8, series={LENS_SSIM: tuple(level + seed for seed in SEEDS)},
               values={"ssim_eia_fg": level, "ssim_eia_plain": level, "ssim_ceiling": 0.99, **values})


def seconds(level):
    return tuple(level * (1 + seed) for seed in SEEDS)


def frame(render, second_stage=0.0):
    return {RENDER: render, TOTAL: render + second_stage}


def made_up(gap):
    """Return rows of every figure that favour its claim, or with a ``gap`` below zero speak against it."""
    slow = tuple(value + gap + seed / 5 for value, seed in zip(seconds(1.0), SEEDS, strict=True))
    selected = [row for p in (0.2, 0.8) for row in timed_rows(
        {whole.WITH: seconds(1.0), whole.WITHOUT: tuple(1.0 + gap * (2 - p) + 3 * seed * gap for seed in SEEDS)},
        scene=f"distance {p}", facts={"p": p}).rows]
    deeper = {"paper": seconds(1.0)} | {f"paper-{n}": seconds(1 + n * gap) for n in (3, 4, 5, 6)}
    others = {name: seconds(1 + (name != "paper") * gap) for name in ("paper", "espcn", "fsrcnn")}
    errors = {name: tuple(0.01 + (gap / 100 + seed / 1000) * name.endswith("-eia") for seed in SEEDS)
              for name in images.EPI_METHODS}
    costs = {"paper": 100.0, "paper-3": 120.0, "espcn": 100 + 100 * gap, "fsrcnn": 100 + 90 * gap}
    return {
        "fig9": [accurate(name, 0.9 + gap * index) for index, name in enumerate(images.METHODS)],
        "fig10a": timed_rows({"8": seconds(1.0), "208": slow}).rows, "fig10b": selected, "fig12b": selected[:2],
        "fig10c": [*timed_rows(deeper).rows,
                   *(accurate(name, 0.9 + (0.005 - gap / 20) * (name != "paper")) for name in deeper)],
        "fig10d": [*timed_rows(others).rows,
                   *(accurate(name, 0.9 - gap * (name != "paper")) for name in (*others, "bicubic"))],
        "fig11": [Row(scene="toy", method=name, series={images.EPI: error}) for name, error in errors.items()],
        "fig12a": [Row(scene="7680×4320", method=f"s = {scale}" if scale > 1 else "direct", values={
            "width": 7680, "scale": scale,
            **frame(0.01 * 2 ** (-math.copysign(scale, gap)), 0.001 if gap > 0 else 0.1)}) for scale in (1, 2, 4)],
        "table2": [accurate(name, 0.9 + gap, **frame(1 - gap * (name == whole.PAPER)))
                   for name in (*whole.RIVALS, whole.OURS, whole.PAPER)],
        "table3": [Row(method=name, values={networks.PER_PIXEL: value}) for name, value in costs.items()]}


def line(name, gap):
    return study.FIGURES[name].line(Results(tuple(made_up(gap)[name])))


@pytest.mark.parametrize("name", study.FIGURES)
def test_sentences_flip_with_the_numbers(name):
    assert line(name, 0.4).startswith("**Holds.**"), line(name, 0.4)
    if name != "fig10a":  # whichever step is slower, the step matters
        assert line(name, -0.4).startswith("**Does not hold.**"), line(name, -0.4)
    if name in ("fig9", "fig10a", "fig11", "table3"):
        assert line(name, 0.0).startswith("**Cannot be told.**"), "without a difference nothing is claimed"


def test_verdicts():
    above, below, neither, unknown = (Difference(*pair) for pair in ((1, 0.5), (-1, 0.5), (1, 2), (1, math.inf)))
    assert [d.sign for d in (above, below, neither, unknown)] == [1, -1, 0, 0]
    assert overall({"a": above}, {}) == "**Holds; not all of it was measured.**"
    assert overall({"a": above, "b": below}) == "**Holds in part.**"
    assert overall({"a": below, "b": neither}) == "**Does not hold.**" and overall({}) == "**Not measured.**"
    assert holds({"a": above, "b": below}) == "holds in 1 of 2 (a); the other way round in 1 of 2 (b)"
    assert paired([1.0, 1.1], [0.0, 0.0]).half == math.inf
    # Student's t for 3 degrees of freedom is 3.182; the standard error of 1, 2, 3, 4 is 0.6455.
    assert paired([1.0, 2.0, 3.0, 4.0], [0.0] * 4).half == pytest.approx(2.054, rel=0.01)
    # A rival wins only with both.
    for faster, better, sign in ((1, 1, -1), (1, -1, 1), (-1, 1, 1), (-1, 0, 1), (1, 0, 0), (0, 0, 0)):
        assert networks.worst(Difference(faster, 0.5), Difference(better, 0.5)).sign == sign


def test_networks_trained_differently_are_called_so():
    alike = "9 epochs of 4 96-pixel crops per photograph, rate 0.001 cosine"

    def sentence_of(label):
        schedules = {"paper": f"{alike}, 60 s on CPU", "paper-gan": label}
        return study.FIGURES["fig9"].line(Results(tuple(made_up(0.4)["fig9"]), schedules=schedules))

    assert "trained" not in sentence_of(f"{alike}, 900 s on CPU") and "trained" not in sentence_of("no weights")
    assert "not trained alike" in sentence_of(f"{alike.replace('9 epochs', '2 epochs')}, 60 s on CPU")
    assert "not trained alike" in sentence_of("schedule not recorded")
