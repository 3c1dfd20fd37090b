"""The chart as Markdown tables: every method and metric, and who wins."""

from __future__ import annotations

import statistics
from collections.abc import Iterator, Sequence
from typing import Any

from lfsr_core.bench.chart.analysis import DIRECT, MAIN_METRIC

METRICS = ("ssim_eia", "ssim_eia_fg", "psnr_fg", "ssim_views_fg", "ssim_eia_plain", "ssim_ceiling", "flip")
DIGITS = {"psnr_fg": 1}
HEAD = ("method", "spp", "s", "render s", "second stage ms", "method ms", "multiply-adds", "parameters", *METRICS)


def markdown(chart: dict[str, Any]) -> str:
    """All tables of a chart."""
    return "\n".join([*_means(chart), *_duels(chart), *_scenes(chart)]) + "\n"


def _means(chart: dict[str, Any]) -> Iterator[str]:
    scenes = chart["scenes"]
    if len(scenes) < 2:
        return
    yield f"## Mean of {len(scenes)} scenes ({', '.join(scene['scene'] for scene in scenes)})"
    yield ""
    yield from _head(HEAD)
    costs = {cost["method"]: cost for cost in chart["methods"]}
    for key in shared_keys(scenes):
        cells = [_find(scene, key) for scene in scenes]
        yield _line(*_facts(cells, costs), *(_mean(cells, name) for name in METRICS))
    yield ""


def shared_keys(scenes: Sequence[dict[str, Any]]) -> list[tuple[str, str, int]]:
    """(role, method, samples) of the cells that every scene has, in the order of the first scene's."""
    tables = [[(cell["role"], cell["method"], cell["samples"]) for cell in scene["cells"]] for scene in scenes]
    return [key for key in tables[0] if all(key in table for table in tables)]


def _find(scene: dict[str, Any], key: tuple[str, str, int]) -> dict[str, Any]:
    return next(cell for cell in scene["cells"] if (cell["role"], cell["method"], cell["samples"]) == key)


def _facts(cells: Sequence[dict[str, Any]], costs: dict[str, Any]) -> list[str]:
    """The columns before the metrics: geometric means of times."""
    first, cost = cells[0], costs.get(cells[0]["method"], {})
    render, second, own = (_geometric(values) for values in (
        [statistics.median(cell["render_seconds"]) for cell in cells],
        [statistics.median(cell["second_stage_seconds"]) for cell in cells],
        [cell["stage_seconds"]["upscale"] for cell in cells]))
    work, size = cost.get("multiply_adds_per_low_pixel"), cost.get("parameters")
    return [first["method"], first["samples"], first["scale"], f"{render:.2f}", f"{1000 * second:.0f}",
            f"{1000 * own:.1f}", "–" if work is None else f"{work:,.0f}", "–" if size is None else f"{size:,}"]


def _geometric(values: Sequence[float]) -> float:
    return statistics.geometric_mean(values) if min(values) > 0 else statistics.fmean(values)


def _mean(cells: Sequence[dict[str, Any]], name: str) -> str:
    values = [cell["metrics"][name] for cell in cells]
    return "–" if None in values else _number(statistics.fmean(values), name)


def _number(value: float, name: str) -> str:
    return f"{value:.{DIGITS.get(name, 4)}f}"


def _scenes(chart: dict[str, Any]) -> Iterator[str]:
    costs = {cost["method"]: cost for cost in chart["methods"]}
    for scene in chart["scenes"]:
        lenses = scene["reference"]["lenses"]
        yield f"## {scene['scene']}"
        yield ""
        yield (f"p = {scene['p']:.3f}; reference of {scene['reference']['samples']} samples, "
               f"{'every lens' if lenses is None else f'{lenses} lenses'}; ± is the 95 % interval over lenses.")
        yield ""
        yield from _head(HEAD)
        for cell in scene["cells"]:
            yield _line(*_facts([cell], costs), *(number_of(cell, name) for name in METRICS))
        yield ""


def number_of(cell: dict[str, Any], name: str) -> str:
    """A metric of a cell with its 95 % half-width."""
    value, half = cell["metrics"][name], cell["ci95"].get(name)
    if value is None:
        return "–"
    return _number(value, name) + ("" if half is None else f" ± {_number(half, name)}")


def _duels(chart: dict[str, Any]) -> Iterator[str]:
    """Our default against direct rendering, by scene."""
    ours = chart["settings"]["ours"]
    yield f"## {ours} against direct high-resolution rendering, {MAIN_METRIC}"
    yield ""
    yield from _head(("scene", "rival", "spp", "its value", "its s", "ours needs s", "ours / its", "outcome"))
    for scene in chart["scenes"]:
        for duel in scene["analysis"][0]["versus"]:
            if duel["role"] == DIRECT:
                yield _line(scene["scene"], duel["method"], duel["samples"], f"{duel['value']:.4f}",
                            f"{duel['seconds']:.2f}", *needs(duel), duel["outcome"])
    yield ""


def needs(duel: dict[str, Any]) -> tuple[str, str]:
    """Time and ratio of a duel in words: "never" where the accuracy is not reached, ≤ where only a bound is known."""
    if duel["needs_seconds"] is None:
        return "never", "–"
    at_most = "≤ " if duel["bound"] else ""
    return f"{at_most}{duel['needs_seconds']:.2f}", f"{at_most}{duel['ratio']:.3f}"


def _head(names: Sequence[str]) -> list[str]:
    return [_line(*names), _line(*["---"] * len(names))]


def _line(*cells: object) -> str:
    return "| " + " | ".join(map(str, cells)) + " |"
