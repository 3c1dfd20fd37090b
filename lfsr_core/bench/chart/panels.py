"""Which curves a chart draws, in which colours: the same method looks the same in every panel."""

from __future__ import annotations

import collections
import statistics
from collections.abc import Sequence
from html import escape
from typing import Any

from lfsr_core.bench.chart.analysis import (
    DIRECT,
    LOW,
    LOWER_IS_BETTER,
    MAIN_METRIC,
    RIVAL,
    Point,
    curves,
    end_to_end,
    mean_points,
    pareto_front,
    points,
)
from lfsr_core.bench.plots import HEIGHT, LEFT, WIDTH, Curve, Panel, panel_svg

Key = tuple[str, str]
OURS_STYLE, RIVAL_STYLE, UNDENOISED_STYLE = ("#0067a5", "circle"), ("#c24a00", "square"), ("#9c4477", "triangle")
# Apart in lightness and shape too, for eyes that do not tell red from green (after Okabe and Ito).
MORE_STYLES = (("#00785a", "diamond"), ("#7a5c00", "down"), ("#2b2b2b", "cross"), ("#4b3fa7", "ring"))
COLUMNS, FOOTER = 2, 30
AXES = {"ssim_eia_fg": "SSIM of the subject", "ssim_views_fg": "SSIM of the views", "ssim_eia": "SSIM of everything",
        "psnr_fg": "PSNR in dB", "flip": "−FLIP"}


def label(key: Key, ours: str) -> str:
    """A method as the page calls it."""
    role, name = key
    if role == DIRECT:
        return "every view" if name == "none" else f"every view +{name.upper() if name == RIVAL[1] else name}"
    return f"{name} (ours)" if name == ours else name


def styles(chart: dict[str, Any]) -> dict[Key, tuple[str, str]]:
    """Colour and marker of every method that is drawn with its name: ours, direct rendering, and who is on a front."""
    fixed = {(LOW, chart["settings"]["ours"]): OURS_STYLE, RIVAL: RIVAL_STYLE, (DIRECT, "none"): UNDENOISED_STYLE}
    seen = collections.Counter((point["role"], point["method"])
                               for scene in chart["scenes"] for point in scene["analysis"][0]["front"])
    more = [key for key, _ in seen.most_common() if key not in fixed]
    return fixed | dict(zip(more, MORE_STYLES, strict=False))


def scene_panel(chart: dict[str, Any], scene: dict[str, Any], metric: str = MAIN_METRIC) -> Panel:
    """Panel of one scene, with intervals and the ceiling."""
    sign = -1 if metric in LOWER_IS_BETTER else 1
    found, look, ours = curves(points(scene["cells"], metric)), styles(chart), chart["settings"]["ours"]
    cells = {(cell["role"], cell["method"], cell["samples"]): cell for cell in scene["cells"]}

    def drawn(key: Key) -> Curve:
        mine = [cells[(point.role, point.method, point.samples)] for point in found[key]]
        return Curve(label(key, ours), *look[key], found[key], [cell["ci95"].get(metric) for cell in mine],
                     [(cell["seconds"]["least"], cell["seconds"]["most"]) for cell in mine],
                     counted=key in ((LOW, ours), RIVAL), bold=key == (LOW, ours))

    ceiling = next(part["ceiling"] for part in scene["analysis"] if part["metric"] == metric)
    line = ceiling and (sign * ceiling["value"], ceiling_words(ceiling["value"]))
    every = [point for curve in found.values() for point in curve]
    return Panel(scene["scene"], AXES[metric], [drawn(key) for key in look if key in found], pareto_front(every),
                 _others(every, look), line or None, toward_one="ssim" in metric)


def mean_panel(chart: dict[str, Any], metric: str = MAIN_METRIC) -> Panel | None:
    """Panel of the mean over scenes; None where the scenes share no cell."""
    shared, look, ours = mean_points(chart["scenes"], metric), styles(chart), chart["settings"]["ours"]
    if not shared:
        return None
    found = curves(shared)
    drawn = [Curve(label(key, ours), *look[key], found[key], counted=key in ((LOW, ours), RIVAL),
                   bold=key == (LOW, ours)) for key in look if key in found]
    ceilings = [scene["analysis"][0]["ceiling"] for scene in chart["scenes"]]
    value = statistics.fmean(ceiling["value"] for ceiling in ceilings) if all(ceilings) else None
    return Panel(f"Mean of {len(chart['scenes'])} scenes", AXES[metric], drawn, pareto_front(shared),
                 _others(shared, look), None if value is None else (value, ceiling_words(value)),
                 toward_one="ssim" in metric)


def ceiling_words(value: float) -> str:
    """Name of the line across."""
    return f"the best from a low resolution without noise: {value:.3f}"


def picture(chart: dict[str, Any]) -> str:
    """All panels as one SVG: the mean, then every scene."""
    mean = mean_panel(chart) if len(chart["scenes"]) > 1 else None
    panels = [panel for panel in (mean, *(scene_panel(chart, scene) for scene in chart["scenes"])) if panel]
    rows = -(-len(panels) // COLUMNS)
    width, height = WIDTH * min(COLUMNS, len(panels)), rows * HEIGHT + FOOTER
    placed = [panel_svg(panel, index % COLUMNS * WIDTH, index // COLUMNS * HEIGHT)
              for index, panel in enumerate(panels)]
    return (f'<svg xmlns="http://www.w3.org/2000/svg" width="{width}" height="{height}" '
            f'viewBox="0 0 {width} {height}"><rect width="100%" height="100%" fill="#fff"/>{"".join(placed)}'
            f'<text x="{LEFT}" y="{height - 14}" font-family="system-ui,sans-serif" font-size="12" fill="#555">'
            f"{escape(_footer(chart))}</text></svg>\n")


def _footer(chart: dict[str, Any]) -> str:
    environment, settings = chart["environment"], chart["settings"]
    return (f"Pale band: Pareto front. Numbers: samples per pixel. Grey: other methods. "
            f"Display {settings['display']}, {environment['cores']} cores of {environment['cpu']}.")


def seconds_text(cell: dict[str, Any]) -> str:
    """Median of a cell's end-to-end seconds and their spread."""
    spread = cell["seconds"]
    return f"{end_to_end(cell):.2f} ({spread['least']:.2f}–{spread['most']:.2f})"


def _others(every: Sequence[Point], look: dict[Key, Any]) -> list[Point]:
    return [point for point in every if (point.role, point.method) not in look]
