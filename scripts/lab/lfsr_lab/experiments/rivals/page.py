"""The record of everything measured, and its tables."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from typing import Any

import numpy as np

from lfsr_core.arrays import Array
from lfsr_core.metrics.intervals import student_95
from lfsr_lab.experiments.engine.report import UNKNOWN, markdown_table, number
from lfsr_lab.experiments.rivals.captured import OURS, TASKS, Likeness
from lfsr_lab.experiments.rivals.measure import Figures, Row
from lfsr_lab.experiments.rivals.renders import SAMPLES, SCALES, SCENES, WIDE, View

Rows = dict[tuple[str, View, str], Row]  # by scene, render and denoiser
Captured = dict[tuple[str, str], Likeness]  # by task and method
WIDTHS = (WIDE, "narrow")


def record(rows: Rows, captured: Captured) -> dict[str, Any]:
    """Return everything measured as plain JSON: means over lenses, and differences from the default."""
    scenes: dict[str, Any] = {}
    for (scene, view, denoiser), row in rows.items():
        ours = rows.get((scene, View(view.scale, view.samples), "denoise"))
        of_view = scenes.setdefault(scene, {}).setdefault(view.name, {})
        for follower, figures in row.followers.items():
            of_view[f"{denoiser}+{follower}"] = _entry(figures, row, ours)
    tasks: dict[str, Any] = {}
    for (task, method), found in captured.items():
        tasks.setdefault(task, {})[method] = [round(found.psnr, 2), round(found.ssim, 4)]
    return {"columns": ["ssim_lens_fg", "psnr_fg", "cpu_seconds", "ssim_minus_default", "half_of_95"],
            "groups": {name: group for name, (_, group) in SCENES.items()}, "scenes": scenes,
            "captured_columns": ["psnr_y", "ssim_y"], "captured": tasks}


def _entry(figures: Figures, row: Row, ours: Row | None) -> list[float]:
    seconds = round(row.cpu_seconds + figures.cpu_seconds, 2)
    entry = [round(float(np.mean(figures.ssim)), 4), round(figures.psnr, 2), seconds]
    if ours is None:
        return entry
    each = np.subtract(figures.ssim, ours.followers["bilinear+epi"].ssim)
    half = student_95(len(each) - 1) * each.std(ddof=1) / math.sqrt(len(each)) if len(each) > 1 else 0.0
    return [*entry, round(float(each.mean()), 4), round(float(half), 4)]


def tables(measured: dict[str, Any]) -> str:
    """Return the tables of a record."""
    lines = ["# Rivals"]
    for scale in SCALES:
        lines += ["", f"## Our renders, scale {scale}", "", "Each: `ssim_lens_fg`, PSNR, CPU seconds; means over "
                  "scenes.", "", *_renders(measured["scenes"], scale)]
        lines += ["", "By scene, 16 samples, wide: `ssim_lens_fg`.", "", *_scenes(measured["scenes"], scale)]
    lines += ["", "## Captured light fields", "", "PSNR / SSIM of luma, views that were made.", "",
              *_captured(measured["captured"])]
    return "\n".join(lines) + "\n"


def _renders(scenes: dict[str, Any], scale: int) -> list[str]:
    views = [View(scale, samples, width) for width in WIDTHS for samples in SAMPLES]
    header = ["method", *(f"{view.samples} samples, {view.width}" for view in views)]
    return markdown_table(header, [[f"`{method}`", *(_mean(scenes, view, method) for view in views)]
                                   for method in _methods(scenes, views)], "lr")


def _methods(scenes: dict[str, Any], views: Sequence[View]) -> list[str]:
    return list(dict.fromkeys(method for of_scene in scenes.values() for view in views
                              for method in of_scene.get(view.name, {})))


def _mean(scenes: dict[str, Any], view: View, method: str) -> str:
    values = _values(scenes.values(), view, method)
    if not len(values):
        return UNKNOWN
    ssim, psnr, seconds = values[:, :3].mean(0)
    return f"{ssim:.3f} {psnr:.1f} {seconds:.1f}"


def _values(scenes: Iterable[dict[str, Any]], view: View, method: str) -> Array:
    return np.array([of_scene[view.name][method] for of_scene in scenes
                     if method in of_scene.get(view.name, {})])


def _scenes(scenes: dict[str, Any], scale: int) -> list[str]:
    view = View(scale, SAMPLES[-1])
    return markdown_table(["method", *scenes], [
        [f"`{method}`", *(number(values[0, 0]) if len(values := _values([of_scene], view, method)) else UNKNOWN
                          for of_scene in scenes.values())] for method in _methods(scenes, [view])], "lr")


def _captured(captured: dict[str, Any]) -> list[str]:
    names = [name for name in dict.fromkeys([*OURS, *(each for found in captured.values() for each in found)])]
    tasks = [task.name for task in TASKS if task.name in captured]
    return markdown_table(["method", *tasks], [
        [f"`{name}`", *("{:.2f} / {:.4f}".format(*captured[task][name]) if name in captured[task] else UNKNOWN
                        for task in tasks)] for name in names], "lr")

