"""``lfsr chart`` of some scenes after others, of another seed or subject, and how far all of it is."""

from __future__ import annotations

import shutil

import pytest

from lfsr_core.cli import main
from lfsr_lab.experiments.chart import cells
from tests.support.chart_bench import arguments, bench, main_fails, measured
from tests.support.synthetic import write_render


@pytest.fixture(autouse=True)
def no_start(monkeypatch):
    """Starting programs is tested once; elsewhere it would only take time."""
    monkeypatch.setattr(cells, "upscale_seconds", lambda folder, name: 1.25)


def test_the_run_of_one_scene_leaves_the_others_on_the_page(tmp_path):
    folder, both = bench(tmp_path, names=("vase", "head")), ("vase.blend", "head.glb")
    assert main(arguments(folder, scenes=both)) == 0
    before = measured(folder)
    assert main(arguments(folder, "--again", "bicubic")) == 0
    after = measured(folder)
    assert [scene["scene"] for scene in after["scenes"]] == ["vase", "head"]
    assert after["scenes"][1] == before["scenes"][1] and after["scenes"][0] != before["scenes"][0]
    assert "head" in (folder / "chart.html").read_text()
    assert main(arguments(folder, "--methods", "nearest", "--ours", "nearest", scenes=("head.glb",))) == 0
    assert [scene["scene"] for scene in measured(folder)["scenes"]] == ["head"], "other settings: another chart"
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
