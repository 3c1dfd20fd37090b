"""The whole chart: renders, cells, analysis, chart.json and what people read."""

from __future__ import annotations

import statistics
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from typing import Any

from lfsr_core.bench.chart import measure as chart_cells
from lfsr_core.bench.chart import measure as chart_cost
from lfsr_core.bench.chart import renders as chart_renders
from lfsr_core.bench.chart.analysis import CEILING, DIRECT, LOW, METRICS, analyse
from lfsr_core.bench.chart.records import FORMAT, check_chart
from lfsr_core.bench.chart.settings import Settings
from lfsr_core.bench.environment import environment
from lfsr_core.errors import LfsrError
from lfsr_core.files import atomic_path, write_json
from lfsr_core.frames.frame import read_frame
from lfsr_core.metrics.eia_metrics import METRIC_NAMES
from lfsr_core.reconstruct.method_name import MethodName
from lfsr_core.records import to_data

CHART_FILE, PAGE_FILE, PICTURE_FILE, TABLE_FILE = "chart.json", "chart.html", "chart.svg", "chart.md"
Say = Callable[[str], None]


def measure(settings: Settings, scenes: Sequence[Path], say: Say) -> dict[str, Any]:
    """Measure ``scenes``, as far as they are not; chart.json is written after every one, and returned.

    ``say(sentence)`` for every step. LfsrError where not one scene can be measured.
    """
    chart = {"format": FORMAT, "settings": settings.described(), "environment": to_data(environment()), "methods": [],
             "skipped": [], "scenes": []}
    _check_names(scenes)
    for scene in scenes:
        row = _scene(settings, scene, say, chart["skipped"])
        if row is not None:
            chart["scenes"].append(row)
            chart["methods"] = chart["methods"] or list(_methods(settings, scene, row, say))
            _write(settings, chart)
    if not chart["scenes"]:
        raise LfsrError(f"no scene could be measured ({'; '.join(chart['skipped'])}): run it without --only-measure")
    _write(settings, chart)
    return chart


def _check_names(scenes: Sequence[Path]) -> None:
    names = [scene.stem for scene in scenes]
    for name in names:
        if names.count(name) > 1:
            raise LfsrError(f"two scenes are called {name!r}, but each has a folder of its name: rename one file")


def _write(settings: Settings, chart: dict[str, Any]) -> None:
    chart["environment"] = to_data(environment())  # only now is it known whether PyTorch was needed
    check_chart(chart)
    write_json(settings.folder / CHART_FILE, chart)


def _scene(settings: Settings, path: Path, say: Say, skipped: list[str]) -> dict[str, Any] | None:
    """Row of one scene; None, with a sentence in ``skipped``, if its reference is missing and may not be made."""
    folder = chart_renders.reference(settings, path)
    if folder is None:
        _skip(f"{path.stem} has no reference", skipped, say)
        return None
    renders = list(_renders(settings, path, say, skipped))
    mask = chart_renders.widest_mask(settings.folder / path.stem, settings.scale, settings.profile.lenses)
    target = chart_cells.Target.read(folder, mask)
    cells = [cell for role, frame_folder in renders
             for cell in _cells(settings, path, role, frame_folder, target, say, skipped)]
    if not cells:
        _skip(f"{path.stem} has no render that a method could finish", skipped, say)
        return None
    frame = target.reference.frame
    return {"scene": path.stem, "blender": frame.blender, "p": float(target.mask.mean()),
            "reference": {"samples": frame.samples, "seconds": sum(frame.seconds.values()),
                          "lenses": None if frame.lens_list is None else len(frame.lens_list)},
            "cells": cells, "analysis": [analyse(cells, settings.ours, metric) for metric in METRICS]}


def _renders(settings: Settings, scene: Path, say: Say, skipped: list[str]) -> Iterator[tuple[str, Path]]:
    """(role, frame folder) of every render, the cheap ones first."""
    wanted = [(LOW, settings.scale, samples) for samples in settings.spps]
    wanted += [(DIRECT, 1, samples) for samples in settings.direct_spps]
    wanted += [(CEILING, settings.scale, settings.ceiling_spp)] if settings.ceiling_spp else []
    for role, scale, samples in wanted:
        folder = chart_renders.low_render(settings, scene, scale, samples)
        if folder is None:
            _skip(f"{scene.stem} has no render at scale {scale} with {samples} samples", skipped, say)
        else:
            yield role, folder


def _cells(settings: Settings, scene: Path, role: str, folder: Path, target: chart_cells.Target, say: Say,
           skipped: list[str]) -> Iterator[dict[str, Any]]:
    frame = read_frame(folder)
    # The ceiling's time is on no axis.
    seconds = [frame.seconds["render"]] if role == CEILING else chart_renders.seconds_of(settings, scene, folder)
    shared = {"role": role, "scale": frame.scale, "samples": frame.samples, "render_seconds": seconds,
              "open_seconds": frame.seconds.get("open", 0.0), "device": frame.device}
    for name in settings.direct_methods if role == DIRECT else settings.methods:
        missing = MethodName.parse(name).untrained(frame.scale)
        if missing:
            _skip(f"{name} at scale {frame.scale}: {', '.join(missing)} has no weights for it", skipped, say)
            continue
        say(f"{scene.stem}: {name} at scale {frame.scale}, {frame.samples} samples")
        try:
            found = chart_cells.cell(folder, name, target, settings.repeats, again=name in settings.again,
                                     retime=name in settings.retime and role != CEILING)
        except LfsrError as error:
            _skip(f"{name} at scale {frame.scale}: {error}", skipped, say)
        else:
            yield _row(shared, found)


def _row(shared: dict[str, Any], found: dict[str, Any]) -> dict[str, Any]:
    """One entry of "cells"."""
    render, metrics = statistics.median(shared["render_seconds"]), found["metrics"]
    totals = [render + seconds for seconds in found["second_stage_seconds"]]
    spread = [min(shared["render_seconds"]) + min(found["second_stage_seconds"]),
              max(shared["render_seconds"]) + max(found["second_stage_seconds"])]
    return shared | {
        "method": found["method"], "second_stage_seconds": found["second_stage_seconds"],
        "stage_seconds": found["stage_seconds"], "notes": found["notes"], "load_average": found["load_average"],
        "seconds": {"median": statistics.median(totals), "least": spread[0], "most": spread[1]},
        "metrics": {name: metrics[name] for name in (*METRIC_NAMES, "recall")}, "ci95": metrics["ci95"]}


def _methods(settings: Settings, scene: Path, row: dict[str, Any], say: Say) -> Iterator[dict[str, Any]]:
    """What every method that was measured costs; its start is timed on the first scene's first render."""
    measured = {cell["method"] for cell in row["cells"] if cell["role"] != DIRECT}
    folder = chart_renders.render_folder(settings.folder / scene.stem, settings.scale, row["cells"][0]["samples"])
    for name in settings.methods:
        if name in measured:
            say(f"{name} in a process of its own")
            again = name in settings.again or name in settings.retime
            seconds = chart_cost.fresh_seconds(folder, name, settings.folder, again=again)
            cost = chart_cost.network_cost(name, settings.scale, settings.profile.low_views(settings.scale))
            yield {"method": name, **cost, "fresh_process_seconds": seconds}


def _skip(sentence: str, skipped: list[str], say: Say) -> None:
    if sentence not in skipped:
        skipped.append(sentence)
        say(f"skipped: {sentence}")


def write_pages(folder: Path, chart: dict[str, Any]) -> list[Path]:
    """Write what people read beside chart.json, and name all of it."""
    from lfsr_core.bench.chart import page, panels, tables

    written = {PAGE_FILE: page.page, PICTURE_FILE: panels.picture, TABLE_FILE: tables.markdown}
    for name, make in written.items():
        with atomic_path(folder / name) as temporary:
            temporary.write_text(make(chart), encoding="utf-8")
    return [folder / name for name in (CHART_FILE, *written)]
