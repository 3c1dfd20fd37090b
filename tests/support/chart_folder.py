"""Experiment folders of renders that are there already, and `lfsr chart` on them."""

from __future__ import annotations

import json
from pathlib import Path

from lfsr_core.cli import main
from lfsr_lab.experiments.chart.records import read_chart
from tests.support.synthetic import write_reference, write_render


def experiment_folder(folder: Path, names=("vase",), **reference) -> Path:
    """Return an experiment folder of renders that are there already."""
    for name in names:
        write_reference(folder / name / "reference", noise=0.02, samples=64, **reference)
        for samples in (1, 4):
            write_render(folder / name / f"s2-spp{samples}", samples=samples, seconds={"open": 0.5, "render": samples})
        write_render(folder / name / "s1-spp1", scale=1, samples=1, seconds={"open": 0.5, "render": 9.0})
    return folder


def arguments(folder: Path, *more: str, scenes=("vase.blend",)) -> list[str]:
    return ["chart", *scenes, "-o", str(folder), "--display", "mini", "--scale", "2", "--spps", "1,4",
            "--direct-spps", "1", "--ceiling-spp", "0", "--repeats", "2", "--only-measure",
            "--methods", "bicubic,nearest", "--ours", "bicubic", *more]


def measured(folder: Path) -> dict:
    read_chart(folder / "chart.json")
    return json.loads((folder / "chart.json").read_text())


def main_fails(words: list[str], capsys) -> str:
    """Last line on standard error; progress may stand before it."""
    assert main(words) == 2
    captured = capsys.readouterr()
    assert captured.out == ""
    return captured.err.splitlines()[-1]
