"""Runs the stability suite: scenes, references, renders and one small JSON file per cell.

A *cell* is one method at one value of one dial. What is complete in the bench
folder is not made again, so an interrupted run goes on where it stopped.
"""

from __future__ import annotations

import importlib.metadata
import importlib.util
import math
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from lfsr_core.bench.stress.dials import Dial, choose_dials, label
from lfsr_core.bench.stress.folder import BASELINE, SETTINGS_FILE, Bench, Settings, cell_path, read_cell
from lfsr_core.errors import LfsrError
from lfsr_core.files import read_json, write_json
from lfsr_core.reconstruct.method_name import DEFAULT_METHOD, PLAIN_CHAINS, MethodName
from lfsr_core.reconstruct.networks import catalogue
from lfsr_core.reconstruct.registry import method


def default_methods(scale: int) -> list[str]:
    """Bicubic, plain upscaling after each prefilter, the default, and every network with weights at ``scale``."""
    names = [BASELINE, *PLAIN_CHAINS, DEFAULT_METHOD]
    torch = importlib.util.find_spec("torch") is not None
    names += [f"{entry.after}+{name}" if entry.after else name for name, entry in catalogue.NETWORKS.items()
              if scale in catalogue.trained_scales(name) and (torch or entry.light_field)]
    return list(dict.fromkeys(names))


def run_suite(folder: Path, settings: Settings, dial_names: Sequence[str] | None, methods: Sequence[str], *,
              quick: bool = False, blender: str | None = None) -> Path:
    """Measure every missing cell in ``folder``, then write the report, tables and pictures; path of stress.json.

    LfsrError for unknown dials or methods, for a folder begun with other
    settings, and where Blender fails.
    """
    from lfsr_core.bench.stress.page import write_pages
    from lfsr_core.bench.stress.report import write_report

    dials = choose_dials(dial_names)
    methods = list(dict.fromkeys([BASELINE, *methods]))
    for name in methods:
        method(name)
    claim(folder, settings)
    bench = Bench(folder, settings, blender)
    values = {dial: dial.quick if quick else dial.values for dial in dials}
    bench.build_scenes([(dial, value) for dial in dials for value in values[dial]])
    for number, dial in enumerate(dials):
        print(f"dial {number + 1} of {len(dials)}: {dial.name}, {len(values[dial])} values", flush=True)
        for value in values[dial]:
            measure_value(bench, dial, value, methods)
    report = write_report(bench, values, methods)
    write_pages(bench, report)
    return report


def claim(folder: Path, settings: Settings) -> None:
    """Record the settings of a new folder; LfsrError if it was begun with other ones."""
    path = folder / SETTINGS_FILE
    if path.exists():
        found = read_json(path, "the settings of a stability suite")
        changed = [key for key, value in _plain(settings).items() if found.get(key) != value]
        if changed:
            raise LfsrError(f"{folder} was begun with other settings ({changed[0]} differs, see {SETTINGS_FILE} "
                            "there): choose another folder or the same settings")
    write_json(path, _plain(settings))


def _plain(settings: Settings) -> dict[str, Any]:
    return {key: list(value) if isinstance(value, tuple) else value for key, value in settings.to_dict().items()}


def measure_value(bench: Bench, dial: Dial, value: float, methods: Sequence[str]) -> None:
    """Measure the missing cells of one value; reference and renders are made only for those."""
    missing = [name for name in methods if read_cell(bench, dial, value, name) is None]
    if not missing:
        return
    from lfsr_core.bench.stress.measure import Scene

    scene = Scene.load(bench, dial, value)
    for name in missing:
        metrics, worst = scene.measure(name)
        told = metrics.get(dial.judged)
        shown = "–" if told is None else f"{told:.4f}"
        print(f"  {dial.name} {label(value)} {name}: {dial.judged} {shown}", flush=True)
        write_json(cell_path(bench, dial, value, name), {
            "value": value, "scene": dial.scene_name(value), "samples": dial.samples(value), "method": name,
            "weights": MethodName.parse(name).weights_digest, "versions": MethodName.parse(name).versions,
            "metrics": finite(metrics), "worst_lens": worst})


def finite(metrics: dict[str, Any]) -> dict[str, Any]:
    """The metrics with None for what is not a finite number."""
    return {name: value if value is None or math.isfinite(value) else None for name, value in metrics.items()}
