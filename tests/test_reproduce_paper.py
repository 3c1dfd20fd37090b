"""The paper's figures: measured on synthetic frames, resumed, and put into words that follow the numbers."""

from __future__ import annotations

import dataclasses
import importlib.util
import json
import math
from pathlib import Path

import cv2
import pytest
from synthetic import MINI, write_reference, write_render
from training_photographs import pictures

from lfsr_core.bench.paper import cells, figure9, figure11, models, page, quality, renders, settings, timing, verdict
from lfsr_core.bench.paper.verdict import Difference

SCRIPT = Path(__file__).parents[1] / "scripts" / "reproduce_paper.py"
SCALE, SPP, CLEAN = 4, 4, 8
HALF = renders.resolution(MINI, 2)
SEEDS = (0.01, -0.02, 0.015, -0.005, 0.0, 0.012)


def script():
    specification = importlib.util.spec_from_file_location("reproduce_paper", SCRIPT)
    module = importlib.util.module_from_spec(specification)
    specification.loader.exec_module(module)
    return module


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
    return {name: figure.measure(frames, frames.output) for name, figure in page.FIGURES.items()}


def test_every_figure_measures_draws_and_speaks(frames, measured, tmp_path):
    assert json.loads(json.dumps(measured)) == measured
    for name, figure in page.FIGURES.items():
        rows = figure.table(measured[name])
        assert len(rows) > 2 and len({row.count("|") for row in rows}) == 1, rows
        assert figure.line(measured[name]).startswith("**")
        if figure.draw:
            path = tmp_path / page.picture_name(figure)
            figure.draw(measured[name], frames.output, path)
            assert cv2.imread(str(path)).std() > 5 and path.stat().st_size < 150_000


def test_networks_without_weights_are_named_and_not_invented(measured):
    rows = measured["fig9"]["rows"]
    assert [row["method"] for row in rows if "metrics" not in row] == ["paper-gan"] * 2
    assert "for want of weights: paper-gan" in figure9.line(measured["fig9"])
    assert measured["fig9"]["schedules"]["paper"].startswith("short schedule: ")
    assert measured["fig9"]["schedules"]["paper-gan"] == "no weights"


def test_accuracy_is_what_compare_gives(frames, measured):
    folder = frames.bench / "toy" / f"s4-spp{CLEAN}"
    from lfsr_core.comparison import compare_folders
    from lfsr_core.pipeline import upscale_frame

    upscale_frame(folder, "bicubic")
    expected = compare_folders(folder, frames.bench / "toy" / "reference")
    row = next(row for row in measured["fig9"]["rows"] if row["method"] == "bicubic" and row["samples"] == CLEAN)
    assert row["metrics"] == pytest.approx({name: expected[name] for name in quality.SHOWN})
    error = row["error"]
    assert -10 * math.log10(error["border"] + error["centre"]) == pytest.approx(expected["psnr_fg"], abs=0.01)


def test_second_stage_is_what_upscale_writes(frames):
    from lfsr_core.image_io import read_png
    from lfsr_core.pipeline import upscale_frame

    folder = frames.bench / "toy" / f"s4-spp{SPP}"
    upscale_frame(folder, "bicubic")
    made = quality.second_stage(folder, quality.method_of("bicubic"))
    assert (made == read_png(folder / "eia.png")).all()


def test_a_second_run_measures_nothing(frames, measured, monkeypatch):
    def forbidden(*_, **__):
        raise AssertionError("measured again")

    for module, name in ((quality, "linear_picture"), (timing, "take_turns"), (renders, "run_job")):
        monkeypatch.setattr(module, name, forbidden)
    for name, figure in page.FIGURES.items():
        assert figure.measure(frames, frames.output) == measured[name], name
    with pytest.raises(AssertionError, match="measured again"):
        figure9.measure(dataclasses.replace(frames, output=frames.output / "other"), frames.output / "other")


def test_cells_follow_their_inputs(tmp_path):
    kept, calls = cells.Cells(tmp_path, "fig"), []

    def measure(value):
        return lambda: calls.append(value) or value

    assert kept("a", {"n": 1}, measure(5)) == kept("a", {"n": 1}, measure(6)) == 5
    assert kept("a", {"n": 2}, measure(7)) == 7
    (tmp_path / "cells" / "fig" / "a.json").write_text("{broken")
    assert kept("a", {"n": 2}, measure(8)) == 8 and calls == [5, 7, 8]


def test_stopped_run_keeps_what_is_done(frames, measured, tmp_path, monkeypatch):
    monkeypatch.setattr(quality, "against", _stop_at(3))
    again = dataclasses.replace(frames, output=tmp_path)
    with pytest.raises(KeyboardInterrupt):
        figure9.measure(again, tmp_path)
    monkeypatch.undo()
    done = {path: path.stat().st_mtime_ns for path in tmp_path.rglob("*.json")}
    assert len(done) == 3  # two measured, one without weights
    assert figure9.measure(again, tmp_path)["rows"] == measured["fig9"]["rows"]
    assert all(path.stat().st_mtime_ns == before for path, before in done.items())


def _stop_at(call):
    original, calls = quality.against, []

    def against(*arguments):
        calls.append(1)
        if len(calls) == call:
            raise KeyboardInterrupt
        return original(*arguments)

    return against


def lenses(level):
    return [level + seed for seed in SEEDS]


def quality_row(method, level, scene="toy", **more):
    return {"scene": scene, "method": method, "samples": 8, "lens_ssim_fg": lenses(level), "ci95": {},
            "metrics": {"ssim_eia_fg": level, "ssim_eia_plain": level, "ssim_ceiling": 0.99}, **more}


def seconds(level):
    return [level * (1 + seed) for seed in SEEDS]


def fig9(gap):
    rows = [quality_row(name, 0.9 + gap * index, error={"border": 0.01 - gap / 20 * index, "centre": 0.01,
                                                        "border_pixels": 0.4})
            for index, name in enumerate(figure9.METHODS)]
    return {"rows": rows, "samples": [8], "schedules": {}}


def fig10a(gap):
    return {"seconds": {"8": seconds(1.0), "208": [value + gap + seed / 5 for value, seed in
                                                   zip(seconds(1.0), SEEDS, strict=True)]},
            "engine": "onnx", "device": "CPU"}


def fig10b(gap):
    return {"rows": [{"p": p, "seconds": {"with": seconds(1.0), "without": [1.0 + gap * (2 - p) + 3 * seed * gap
                                                                            for seed in SEEDS]}} for p in (0.2, 0.8)]}


def fig10c(gap):
    times = {f"paper-{n}": seconds(1 + n * gap) for n in (3, 4, 5, 6)} | {"paper": seconds(1.0)}
    rows = [quality_row(name, 0.9 + (0.005 - gap / 20) * (name != "paper")) for name in times]
    return {"times": {"seconds": times}, "rows": rows, "schedules": {}}


def fig10d(gap):
    times = {name: seconds(1 + (name != "paper") * gap) for name in ("paper", "espcn", "fsrcnn")}
    rows = [quality_row(name, 0.9 - gap * (name != "paper")) for name in (*times, "bicubic")]
    return {"times": {"seconds": times}, "rows": rows, "schedules": {}}


def fig11(gap):
    rows = []
    for name in figure11.methods():
        errors = [0.01 + (gap / 100 + seed / 1000) * name.endswith("-eia") for seed in SEEDS]
        rows.append({"scene": "toy", "method": name, "metrics": {"epi": errors, "epi_border": errors}})
    return {"rows": rows, "default": "oidn+bilinear", "schedules": {}}


def fig12a(gap):
    rows = [{"pixels": [7680, 4320], "scale": scale, "render": 0.01 * 2 ** (-math.copysign(scale, gap)),
             "second_stage": 0.001 if gap > 0 else 0.1} for scale in (1, 2, 4)]
    return {"rows": rows, "render_device": "CPU"}


def fig12b(gap):
    return {"rows": [{"scene": "toy", "render": 1.0, **fig10b(gap)["rows"][0]}]}


def table2(gap):
    names = ("direct", "view by view + fsrcnn", "1 sample + oidn", "this project", "paper (adversary)")
    return {"rows": [quality_row(name, 0.9 + gap, render=1 - gap * name.startswith("paper"), second_stage=0.0)
                     for name in names], "schedules": {}}


def table3(gap):
    return {"rows": [{"method": name, "per_low_pixel": value} for name, value in
                     (("paper", 100.0), ("paper-3", 120.0), ("espcn", 100 + 100 * gap), ("fsrcnn", 100 + 90 * gap))]}


MADE_UP = {"fig9": fig9, "fig10a": fig10a, "fig10b": fig10b, "fig10c": fig10c, "fig10d": fig10d, "fig11": fig11,
           "fig12a": fig12a, "fig12b": fig12b, "table2": table2, "table3": table3}


@pytest.mark.parametrize("name", MADE_UP)
def test_sentences_flip_with_the_numbers(name):
    make, line = MADE_UP[name], page.FIGURES[name].line
    assert line(make(0.4)).startswith("**Holds.**"), line(make(0.4))
    if name != "fig10a":  # whichever step is slower, the step matters
        assert line(make(-0.4)).startswith("**Does not hold.**"), line(make(-0.4))


@pytest.mark.parametrize("name", ["fig9", "fig10a", "fig11", "table3"])
def test_without_a_difference_nothing_is_claimed(name):
    assert page.FIGURES[name].line(MADE_UP[name](0.0)).startswith("**Cannot be told.**")


def test_the_reason_follows_where_the_error_lies():
    at_borders, spread = fig9(-0.4), fig9(-0.4)
    for row in spread["rows"]:
        row["error"]["centre"] = row["error"]["border"] * 1.5
    assert "zero padding is a large part" in figure9.line(at_borders)
    assert "borders are not the reason" in figure9.line(spread)
    assert "squared error" not in figure9.line(fig9(0.4))


def test_verdicts():
    above, below, neither, unknown = (Difference(*pair) for pair in ((1, 0.5), (-1, 0.5), (1, 2), (1, math.inf)))
    assert [d.sign for d in (above, below, neither, unknown)] == [1, -1, 0, 0]
    assert verdict.overall({"a": above}, {}) == "**Holds; not all of it was measured.**"
    assert verdict.overall({"a": above, "b": below}) == "**Holds in part.**"
    assert verdict.overall({"a": below, "b": neither}) == "**Does not hold where it can be told.**"
    assert verdict.overall({}) == "**Not measured.**"
    assert verdict.holds({"a": above, "b": below}) == "holds in 1 of 2 (a); the other way round in 1 of 2 (b)"
    assert verdict.mean_interval([1.0, 1.1]).half == math.inf
    # Student's t for 3 degrees of freedom is 3.182; the standard error of 1, 2, 3, 4 is 0.6455.
    assert verdict.mean_interval([1.0, 2.0, 3.0, 4.0]).half == pytest.approx(2.054, rel=0.01)


def test_training_is_planned_labelled_and_done_once(tmp_path, frames):
    photographs = tmp_path / "photographs"
    photographs.mkdir()
    for name, image in zip(pictures().names, pictures(height=100, width=100).images, strict=True):
        cv2.imwrite(str(photographs / name), image)
    chosen = dataclasses.replace(frames, output=tmp_path, train_minutes=1e-4, photographs=str(photographs),
                                 validation=str(photographs))
    path = models.weights(chosen, "paper-3")
    before = path.stat().st_mtime_ns
    assert models.weights(chosen, "paper-3") == path and path.stat().st_mtime_ns == before
    assert path.parent == models.trained_folder(chosen)
    assert models.schedule(path).startswith("short schedule: 1 epochs of 1 96-pixel crops per photograph, rate 0.001")
    assert models.fingerprint(path) != models.fingerprint(models.weights(frames, "paper"))
    given = dataclasses.replace(frames, weights=path.parent)
    assert models.weights(given, "paper-3") == path
    assert models.weights(given, "paper-4") is None


def test_planned_steps_fit_the_minutes():
    from lfsr_core.train.config import load_config

    config = load_config("paper-short")
    for steps in (20, 300, 5000):
        planned = models.fitted(config, steps, 62)
        done = planned.epochs * max(1, 62 * planned.crops_per_photograph // planned.batch)
        assert 0.5 * steps <= done <= steps
    full = dataclasses.asdict(load_config("paper-gan"))
    assert models._is_full(full) and not models._is_full({**full, "epochs": 5})


def test_one_command_writes_pages_and_goes_on(frames, tmp_path, capsys):
    words = ["-o", str(tmp_path / "out"), "--scenes", str(frames.scenes[0]), "--bench", str(frames.bench), "--quick",
             "--display", "mini", "--timing-display", "mini", "--spp", str(SPP), "--clean-spp", str(CLEAN),
             "--repeats", "3", "--docs", str(tmp_path / "docs")]
    run = script().main
    assert run([*words, "--only", "table3"]) == 0
    assert run([*words, "--only", "fig9"]) == 0
    text = (tmp_path / "docs" / "paper.md").read_text()
    assert "## Table 3: multiply-adds" in text and "![Fig. 9: residuals](images/paper-fig9.png)" in text
    assert "Not measured in this run" in text and "Quick mode" in text
    assert str(tmp_path) not in text and str(frames.output) not in text
    assert (tmp_path / "docs" / "images" / "paper-fig9.png").exists()
    assert "Fig. 9: residuals: **" in capsys.readouterr().out


def test_bad_input_is_one_sentence(frames, tmp_path, capsys):
    common = ["-o", str(tmp_path), "--scenes", str(frames.scenes[0])]
    for words, sentence in ((["--only", "fig13"], "there is no figure 'fig13'"),
                            (["--weights", str(tmp_path / "none")], "is no folder"),
                            (["--bench", str(frames.bench), "--only", "fig9"], "has display 'mini', expected 'small'")):
        assert script().main([*common, *words]) == 2
        error = capsys.readouterr().err
        assert sentence in error.splitlines()[-1]


def test_resolutions_keep_the_lenses():
    assert HALF.lenses == MINI.lenses and HALF.views == (4, 4) and HALF.panel_mm == MINI.panel_mm
    assert renders.resolution(MINI, 3) is None
