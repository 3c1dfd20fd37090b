"""Fit the model by which `--scale auto` chooses, and show its choices against the best of the scales at equal rays.

    python -m lfsr_lab.experiments.scales TABLE.json [SCENES… -o OUT -m METHOD[=WEIGHTS]]

With SCENES, TABLE.json is written first: accuracies on renders that the experiment `denoiser` has made in OUT, and the
depths of its scenes. The numbers belong into lfsr_core/optics/depth_scale.py.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Iterable, Sequence
from pathlib import Path

import numpy as np

from lfsr_core.base.errors import LfsrError
from lfsr_core.base.records import read_record, write_record
from lfsr_core.optics.depth_scale import MODEL, LossModel
from lfsr_lab.experiments.denoiser.settings import SETTINGS, read_settings
from lfsr_lab.experiments.engine.renders import Store
from lfsr_lab.experiments.engine.report import exit_code, markdown_table
from lfsr_lab.experiments.scales.fit import ENOUGH, Fit, Group, fit, groups_of
from lfsr_lab.experiments.scales.table import Table, collect


def main(argv: Sequence[str] | None = None) -> int:
    """Return the exit code: 0, 2 after bad input, 130 if stopped."""
    parser = argparse.ArgumentParser(prog="python -m lfsr_lab.experiments.scales", description=__doc__.splitlines()[0])
    add = parser.add_argument
    add("table", type=Path, metavar="TABLE.json", help="accuracies and depths")
    add("scenes", type=Path, nargs="*", metavar="SCENES", help="folders with the files of the settings")
    add("-o", "--output", type=Path, metavar="OUT", help="folder of the experiment `denoiser`")
    add("-m", "--method", metavar="METHOD[=WEIGHTS]", help="whose accuracies count")
    add("--settings", type=Path, default=SETTINGS, metavar="FILE.toml", help="default: denoiser.toml of the laboratory")
    add("--blender", metavar="PATH", help="Blender 4.5 or newer; default: the bpy package, then PATH")
    arguments = parser.parse_args(argv)
    return exit_code("scales", lambda: run(arguments))


def run(arguments: argparse.Namespace) -> None:
    """Write the table where scenes are given; fit, and print the choices."""
    if arguments.scenes:
        if arguments.output is None or arguments.method is None:
            raise LfsrError("scenes were given without the folder of their renders and a method: add -o OUT -m METHOD")
        store = Store(arguments.output, arguments.blender)
        write_record(arguments.table, collect(read_settings(arguments.settings), store, arguments.scenes,
                                              arguments.method))
    table = read_record(arguments.table, Table, "accuracies and depths of scenes")
    groups = groups_of(table)
    if not groups:
        raise LfsrError(f"{arguments.table} has no scene with two scales at equal rays: render more of them")
    print("\n".join(page(groups, fit(groups), table.method)))


def page(groups: Sequence[Group], fitted: Fit, method: str) -> list[str]:
    """Return the lines of the tables."""
    rows = [[group.scene, f"{group.rays:g}", *(f"{group.ssims[scale]:.4f}" if scale in group.ssims else "–"
                                               for scale in (1, 2, 4, 5)), group.best, group.chosen(fitted.model),
             f"{group.lost(fitted.model):.4f}", f"{fitted.left_out[group.scene, group.rays]:.4f}",
             f"{group.lost(MODEL):.4f}"] for group in groups]
    return [f"`{method}`. Lost: against the best scale; left out: by a model fitted to all other scenes.", "",
            *markdown_table(["scene", "rays", "scale 1", "scale 2", "scale 4", "scale 5", "best", "chosen", "lost",
                             "left out", "lost by the model in use"], rows, "lr"), "",
            *markdown_table(["model", "mean", "largest", f"above {ENOUGH}"], [
                ["fitted", *_summary(group.lost(fitted.model) for group in groups)],
                ["fitted to other scenes", *_summary(fitted.left_out.values())],
                ["in use", *_summary(group.lost(MODEL) for group in groups)],
                *([f"always {scale}", *_summary(max(group.ssims.values()) - group.ssims[scale] for group in groups
                                                if scale in group.ssims)] for scale in (2, 4, 5))], "lr"), "",
            _numbers(fitted.model)]


def _summary(lost: Iterable[float]) -> list[str]:
    values = np.array([*lost])
    return [f"{values.mean():.4f}", f"{values.max():.4f}", f"{(values > ENOUGH).sum()} of {len(values)}"]


def _numbers(model: LossModel) -> str:
    return ("MODEL = LossModel(" + ", ".join(f"{name}={value:.3g}" for name, value in vars(model).items()) + ")")


if __name__ == "__main__":
    sys.exit(main())
