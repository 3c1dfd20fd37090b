"""``lfsr chart`` of some scenes after others, of another seed or subject, and how far all of it is."""

from __future__ import annotations

import shutil
from pathlib import Path

import pytest

from lfsr_core.cli import main
from lfsr_lab.experiments.chart import cells, overall
from lfsr_lab.experiments.chart.settings import Settings
from tests.support.chart_bench import arguments, bench, main_fails, measured
from tests.support.chart_example import example
from tests.support.synthetic import write_render


@pytest.fixture(autouse=True)
def no_start(monkeypatch):
    """Starting programs is tested once; elsewhere it would only take time."""
    monkeypatch.setattr(cells, "_process_seconds", lambda command: 1.25)


def test_the_run_of_one_scene_leaves_the_others_on_the_page(tmp_path, capsys):
    folder, both = bench(tmp_path, names=("vase", "head")), ("vase.blend", "head.glb")
    assert main(arguments(folder, scenes=both)) == 0
    before = measured(folder)
    assert main(arguments(folder, "--again", "bicubic")) == 0
    after = measured(folder)
    assert [scene["scene"] for scene in after["scenes"]] == ["vase", "head"]
    assert after["scenes"][1] == before["scenes"][1] and after["scenes"][0] != before["scenes"][0]
    assert "head" in (folder / "chart.html").read_text()
    capsys.readouterr()
    assert main(arguments(folder, "--methods", "nearest", "--ours", "nearest", scenes=("head.glb",))) == 0
    assert capsys.readouterr().out.splitlines()[0] == str(folder / "chart-head.json"), "other settings: another page"
    assert measured(folder) == after
    shutil.rmtree(folder / "head" / "reference")
    assert main(arguments(folder, scenes=both)) == 0
    assert [scene["scene"] for scene in measured(folder)["scenes"]] == ["vase"], "what cannot be measured is not shown"


def test_renders_of_another_seed_lie_beside_the_others_and_other_subjects_are_refused(tmp_path, capsys):
    folder = bench(tmp_path)
    for samples in (1, 4):
        write_render(folder / "vase" / f"s2-spp{samples}-seed7", samples=samples, seed=7,
                     seconds={"open": 0.5, "render": samples})
    assert main(arguments(folder, "--seed", "7", "--direct-spps", "none")) == 0
    capsys.readouterr()
    assert measured(folder)["settings"]["seed"] == 7
    assert {path.name for path in (folder / "vase" / "cells").iterdir()} == {
        f"s2-spp{samples}-seed7-{name}.json" for samples in (1, 4) for name in ("bicubic", "nearest")}
    assert "was rendered with no subject, but subject Vase" in main_fails(
        arguments(folder, "--subject", "Vase"), capsys)
    assert "but visible world was asked for" in main_fails(arguments(folder, "--world-visible"), capsys)


def test_overall_progress_grows_to_its_end_and_tells_the_time_left(monkeypatch):
    shown, now = [], [0.0]
    monkeypatch.setattr(overall.time, "monotonic", lambda: now[0])
    whole = overall.Overall({"render": 30.0, "cell": 10.0}, lambda *state: shown.append(state))
    for seconds, tell in {0: lambda: whole.begin("render", "vase: 16 samples"), 10: lambda: whole("", 0.5, "S"),
                          20: whole.close, 20.1: lambda: whole.begin("cell", "vase: bicubic"),
                          30: lambda: whole.begin("kept", "vase: nearest")}.items():
        now[0] = seconds
        tell()
    assert [fraction for _, fraction, _ in shown] == [0, 15 / 40, 30 / 40, 1]
    assert [message for *_, message in shown] == ["vase: 16 samples", "0:17 left, vase: 16 samples: S",
                                                  "0:07 left, vase: bicubic", "0:00 left, vase: nearest"]
    assert overall.clock(3909.2) == "1:05:10"


def test_what_is_there_already_is_not_counted_as_work(tmp_path):
    folder = bench(tmp_path)
    settings = Settings(folder=folder, **vars(example(1).settings) | {
        "display": "mini", "scale": 2, "spps": (1, 4), "direct_spps": (1,), "methods": ("bicubic", "nearest"),
        "ours": "bicubic", "ceiling_spp": 0})
    scenes = (Path("vase.blend"), Path("head.glb"))
    steps = overall.costs(settings, scenes)
    assert folder / "vase" / "reference" not in steps and steps[folder / "head" / "reference"] > 0
    assert {key for key in steps if isinstance(key, tuple) and key[0].parent.name == "vase"} == {
        (folder / "vase" / render, name) for render, names in
        {"s2-spp1": ("bicubic", "nearest"), "s2-spp4": ("bicubic", "nearest"), "s1-spp1": ("none", "oidn")}.items()
        for name in names}
    assert main(arguments(folder)) == 0
    assert not any("vase" in str(key) for key in overall.costs(settings, scenes))
