"""The record of everything measured, and the page that it makes."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import numpy as np

from lfsr_core.metrics.intervals import student_95
from lfsr_lab.experiments.engine.report import UNKNOWN, markdown_table
from lfsr_lab.experiments.rivals.captured import TASKS, Likeness
from lfsr_lab.experiments.rivals.measure import NARROW, SAMPLES, SCALES, SCENES, WIDE, Row, View

Rows = dict[tuple[str, View, str], Row]  # by scene, render and denoiser
Captured = dict[tuple[str, str], Likeness]  # by task and method
Record = dict[str, Any]
TEMPLATE = Path(__file__).parent / "page.txt"
DEFAULT = "denoise+bilinear+epi"
SHOWN = (*(f"denoise+{name}" for name in ("bilinear", "bilinear+epi", "AngularSR-2", "Sheared-EPI", "EPICNN")),
         "oidn+bilinear", "LFBM5D+bilinear", "LFBM5D+AngularSR-2", "LFDnPatch+bilinear")
OF_CAPTURED = ("bilinear", "bicubic", "bilinear+epi", "AngularSR-2", "Sheared-EPI", "EPICNN")
SSIM, PSNR, SECONDS = range(3)  # places in an entry


def record(rows: Rows, captured: Captured) -> Record:
    """Return everything measured as plain JSON: means over lenses, and differences from the default."""
    scenes: Record = {}
    for (scene, view, denoiser), row in rows.items():
        default = rows[scene, View(view.scale, view.samples, view.width), "denoise"].followers["bilinear+epi"]
        of_view = scenes.setdefault(scene, {}).setdefault(view.name, {})
        for follower, figures in row.followers.items():
            each = np.subtract(figures.ssim, default.ssim)
            half = student_95(len(each) - 1) * each.std(ddof=1) / math.sqrt(len(each)) if len(each) > 1 else 0.0
            of_view[f"{denoiser}+{follower}"] = [round(float(np.mean(figures.ssim)), 4), round(figures.psnr, 2),
                                                 round(row.cpu_seconds + figures.cpu_seconds, 2),
                                                 round(float(each.mean()), 4), round(float(half), 4)]
    tasks: Record = {}
    for (task, method), found in captured.items():
        tasks.setdefault(task, {})[method] = [round(found.psnr, 2), round(found.ssim, 4)]
    return {"columns": ["ssim_lens_fg", "psnr_fg", "cpu_seconds", "ssim_minus_default", "half_width_95"],
            "groups": {name: group for name, (_, group) in SCENES.items() if name in scenes}, "scenes": scenes,
            "captured_columns": ["psnr_y", "ssim_y"], "captured": tasks}


def markdown(found: Record) -> str:
    seven, three = (renders_table(found, scale) for scale in SCALES)
    return TEMPLATE.read_text(encoding="utf-8").format(
        scenes=", ".join(found["scenes"]), seven="\n".join(seven), three="\n".join(three),
        captured="\n".join(captured_table(found)), **_gaps(found))


def renders_table(found: Record, scale: int) -> list[str]:
    """Return the table of a scale: means over scenes."""
    views = [View(scale, samples, width) for samples in SAMPLES[::-1] for width in (WIDE, NARROW)]
    header = [f"scale {scale}", *(f"{view.samples}, {view.width}" for view in views), "CPU s"]
    return markdown_table(header, [
        [f"`{method}`", *(_cell(found, view, method, view.samples == SAMPLES[-1]) for view in views),
         f"{mean(found, views[0], method, SECONDS):.1f}"]
        for method in SHOWN if math.isfinite(mean(found, views[0], method, SSIM))], "lr")


def mean(found: Record, view: View, method: str, place: int) -> float:
    """Return the mean over all scenes of a figure of a method; NaN where it was not measured."""
    values = [of_scene[view.name][method][place] for of_scene in found["scenes"].values()
              if method in of_scene.get(view.name, {})]
    return float(np.mean(values)) if values else math.nan


def _cell(found: Record, view: View, method: str, with_psnr: bool) -> str:
    ssim, psnr = (mean(found, view, method, place) for place in (SSIM, PSNR))
    if not math.isfinite(ssim):
        return UNKNOWN
    return f"{ssim:.3f}".removeprefix("0") + (f", {psnr:.1f}" if with_psnr else "")


def captured_table(found: Record) -> list[str]:
    """Return the table of captured light fields: PSNR in dB."""
    tasks = {task.name: found["captured"][task.name] for task in TASKS if task.name in found["captured"]}
    return markdown_table(["dB", *tasks], [
        [f"`{name}`", *(f"{of_task[name][0]:.1f}" if name in of_task else UNKNOWN for of_task in tasks.values())]
        for name in OF_CAPTURED], "lr")


def _gaps(found: Record) -> dict[str, str]:
    """Return the numbers of the page's sentences, by name."""
    wide, narrow = (View(SCALES[0], SAMPLES[-1], width) for width in (WIDE, NARROW))

    def above(scene: str, method: str, other: str, place: int) -> float:
        entries = found["scenes"].get(scene, {}).get(narrow.name, {})
        return entries[method][place] - entries[other][place] if method in entries else math.nan

    default, fine = mean(found, wide, DEFAULT, SSIM), View(SCALES[1], SAMPLES[-1])
    return {"epicnn": _signed(mean(found, fine, "denoise+EPICNN", SSIM) - mean(found, fine, DEFAULT, SSIM)),
            "narrow": _signed(mean(found, narrow, DEFAULT, SSIM) - default),
            "deep_ssim": _signed(above("deep", "denoise+AngularSR-2", DEFAULT, SSIM)),
            "deep_psnr": _decibels(above("deep", "denoise+AngularSR-2", DEFAULT, PSNR)),
            "figures_ssim": _signed(above("figures", "LFBM5D+AngularSR-2", DEFAULT, SSIM)),
            "figures_psnr": _decibels(above("figures", "LFBM5D+AngularSR-2", DEFAULT, PSNR)),
            "filtered": _signed(above("truck", "LFBM5D+bilinear", "denoise+bilinear", SSIM)),
            "sheared": _decibels(_gain(found, "antinous 2→7", "Sheared-EPI", "bilinear")),
            "row": _decibels(_gain(found, "Amethyst 6→16", "EPICNN", "bilinear+epi")),
            "known": ", ".join(name for name, group in found["groups"].items() if group == "known")}


def _gain(found: Record, task: str, method: str, other: str) -> float:
    """Return by how many dB a method is above another on a captured light field."""
    entries = found["captured"].get(task, {})
    return entries[method][0] - entries[other][0] if {method, other} <= entries.keys() else math.nan


def _signed(number: float) -> str:
    return f"{number:+.3f}".replace("0.", ".").replace("-", "−") if math.isfinite(number) else UNKNOWN


def _decibels(number: float) -> str:
    return f"{number:.1f}" if math.isfinite(number) else UNKNOWN
