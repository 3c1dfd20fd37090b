"""Experiment folders of renders that are there already, and `lfsr chart` on them."""

import json
from pathlib import Path

import numpy as np

from lfsr_core.cli import main
from lfsr_core.frames.frame import LOW_RES_FILE
from lfsr_core.images.image_files import read_layers, write_layers
from lfsr_lab.experiments.chart.analysis import read_chart
from tests.support.synthetic import write_reference, write_render

LENSES = tuple((row, column) for row in range(2, 8) for column in range(3, 11))
SEEDS = 2


def experiment_folder(folder: Path, names=("vase",), **reference) -> Path:
    """Return an experiment folder of renders that are there already, with noise."""
    for name in names:
        write_reference(folder / name / "reference", noise=0.02, samples=64, **{"lens_list": LENSES} | reference)
        for seed in range(SEEDS):
            end = f"-seed{seed}" if seed else ""
            for samples in (1, 4):
                noisy_render(folder / name / f"s2-spp{samples}{end}", samples, seed)
            noisy_render(folder / name / f"s1-spp1{end}", 1, seed, scale=1, seconds={"open": 0.5, "render": 9.0})
    return folder


def noisy_render(folder: Path, samples: int, seed: int, scale: int = 2, **changes) -> None:
    """Write a render whose noise falls with its samples."""
    write_render(folder, scale, **{"samples": samples, "seed": seed,
                                   "seconds": {"open": 0.5, "render": float(samples)}} | changes)
    layers = read_layers(folder / LOW_RES_FILE)
    noise = np.random.default_rng((seed, samples, scale)).normal(0, 0.2 * samples**-0.5, layers["color"].shape)
    layers["color"][..., :3] += (noise * layers["color"][..., 3:])[..., :3]
    write_layers(folder / LOW_RES_FILE, {"color": np.maximum(layers["color"], 0)})


def arguments(folder: Path, *more: str, scenes=("vase.blend",)) -> list[str]:
    return ["study", "chart", *scenes, "-o", str(folder), "--display", "mini", "--scale", "2", "--spps", "1,4",
            "--seeds", str(SEEDS), "--direct-spps", "1", "--repeats", "2", "--only-measure",
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
