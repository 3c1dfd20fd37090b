"""The suite as a page: breaking points, curves, and the worst crop of every method."""

from __future__ import annotations

import html
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from lfsr_core.bench.stress.dials import Dial, choose_dials, label
from lfsr_core.bench.stress.folder import BASELINE, Bench
from lfsr_core.bench.stress.report import EXTRAS, LEGEND, break_text, made_with, number, series
from lfsr_core.files import atomic_path, read_json

PAGE_FILE, PICTURES = "index.html", "pictures"
LENSES_IN_CROP, LEAST_CROP, GAP = 3, 240, 6
COLORS = ("#222222", "#0072b2", "#d55e00", "#009e73", "#cc79a7", "#e69f00")
DASHES = (("solid", "none"), ("dashed", "7 4"), ("dotted", "2 3"))  # after each round of colours, in CSS and SVG
WIDTH, HEIGHT, LEFT, BOTTOM, TOP, RIGHT = 640, 300, 60, 34, 12, 12
STYLE = """body{font:15px/1.45 system-ui,sans-serif;max-width:1100px;margin:2em auto;padding:0 1em;color:#222}
table{border-collapse:collapse;font-variant-numeric:tabular-nums;margin:.6em 0}td,th{border:1px solid #ccc;
padding:.15em .5em;text-align:right}td:first-child,th:first-child{text-align:left}.wide table{display:inline-block;
vertical-align:top;margin-right:1.5em}.b{background:#fbdcd0}
figure{display:inline-block;margin:.4em 1em .8em 0;vertical-align:top}figcaption{font-size:13px}
img{image-rendering:pixelated;max-width:100%}svg text{font:11px system-ui,sans-serif}.key i{display:inline-block;
width:2em;margin:0 .3em .25em 1em}.key span{white-space:nowrap}.wide{overflow-x:auto}"""


def write_pages(bench: Bench, report_file: Path) -> Path:
    """Write index.html and its pictures beside ``report_file``; path of the page."""
    report = read_json(report_file, "the report of a stability suite")
    pictures = {(dial["name"], method): _write_crop(bench, dial, method)
                for dial in report["dials"] for method in report["methods"]}
    with atomic_path(bench.folder / PAGE_FILE) as temporary:
        temporary.write_text(page(report, pictures), encoding="utf-8")
    return bench.folder / PAGE_FILE


def shown_cell(dial: dict[str, Any], method: str) -> dict[str, Any] | None:
    """The cell whose crop is shown: where the method breaks, else where its judged figure is lowest."""
    cells = [cell for cell in dial["cells"] if cell["method"] == method and cell["worst_lens"] is not None]
    found = dial["breaks"][method]
    if found is not None:
        return next((cell for cell in cells if cell["value"] == found["value"]), None)
    told = [cell for cell in cells if cell["metrics"].get(dial["judged"]) is not None]
    return min(told, key=lambda cell: cell["metrics"][dial["judged"]], default=None)


def _write_crop(bench: Bench, entry: dict[str, Any], method: str) -> tuple[str, dict[str, Any]] | None:
    """Picture of reference, bicubic and method around the worst lens: its path from the page, and its cell."""
    from lfsr_core.frames.reference import Reference
    from lfsr_core.images.png import write_png
    from lfsr_core.images.srgb import srgb_encode
    from lfsr_core.reconstruct.second_stage import finished_linear

    cell = shown_cell(entry, method)
    if cell is None:
        return None
    dial: Dial = choose_dials([entry["name"]])[0]
    known = Reference.read(bench.reference(dial, cell["value"]))
    render = bench.render(dial, cell["value"])
    images = [(known.half_a + known.half_b) / 2]
    images += [finished_linear(render, name) for name in dict.fromkeys((BASELINE, method))]
    lenses = bench.settings.display.lenses
    crops = [enlarged(crop_around(srgb_encode(image), lenses, tuple(cell["worst_lens"]))) for image in images]
    name = f"{PICTURES}/{dial.name}-{method.replace('+', '-')}.png"
    write_png(bench.folder / name, side_by_side(crops))
    return name, cell


def crop_around(image: np.ndarray, lenses: tuple[int, int], lens: tuple[int, int],
                across: int = LENSES_IN_CROP) -> np.ndarray:
    """``across``² elemental images of an EIA (H, W, 3) around ``lens`` (row, column), inside the image."""
    size = image.shape[0] // lenses[1], image.shape[1] // lenses[0]
    spans = []
    for at, count, pixels in zip(lens, lenses[::-1], size, strict=True):
        reach = min(across, count)
        first = min(max(at - reach // 2, 0), count - reach)
        spans.append(slice(first * pixels, (first + reach) * pixels))
    return image[tuple(spans)]


def enlarged(crop: np.ndarray) -> np.ndarray:
    """8-bit crop of sRGB values in [0, 1], pixels repeated until it is LEAST_CROP high."""
    times = max(1, -(-LEAST_CROP // crop.shape[0]))
    return np.rint(np.clip(crop, 0, 1) * 255).astype(np.uint8).repeat(times, axis=0).repeat(times, axis=1)


def side_by_side(crops: Sequence[np.ndarray]) -> np.ndarray:
    """Crops of equal height in a row with white gaps."""
    gap = np.full((crops[0].shape[0], GAP, 3), 255, np.uint8)
    parts = [part for crop in crops for part in (gap, crop)]
    return np.concatenate(parts[1:], axis=1)


def page(report: dict[str, Any], pictures: dict[tuple[str, str], tuple[str, dict[str, Any]] | None]) -> str:
    """The whole page as HTML."""
    intro = made_with(report["settings"])
    parts = ["<!doctype html><html lang=en><meta charset=utf-8><meta name=viewport content='width=device-width'>",
             f"<title>Stability suite</title><style>{STYLE}</style><h1>Stability suite</h1><p>{html.escape(intro)}</p>",
             f"<h2>Breaking points</h2><p>{_bold(LEGEND)}</p>", _break_table(report)]
    for dial in report["dials"]:
        parts += [_section(dial, report["methods"]), _figures(dial, report["methods"], pictures)]
    return "\n".join(parts) + "\n</html>\n"


def _bold(text: str) -> str:
    pieces = html.escape(text).split("**")
    return "".join(piece if index % 2 == 0 else f"<b>{piece}</b>" for index, piece in enumerate(pieces))


def _break_table(report: dict[str, Any]) -> str:
    head = "".join(f"<th>{_breakable(name)}" for name in ("dial", "values", *report["methods"]))
    rows = []
    for dial in report["dials"]:
        cells = "".join(f"<td{' class=b' if dial['breaks'][method] else ''}>{break_text(dial, method)}"
                        for method in report["methods"])
        span = f"{label(dial['values'][0])} – {label(dial['values'][-1])}"
        rows.append(f"<tr><td><a href='#{dial['name']}'>{dial['name']}</a><td>{span}{cells}")
    return f"<div class=wide><table><tr>{head}{''.join(rows)}</table></div>"


def _breakable(name: str) -> str:
    """A method's name whose parts may stand below each other."""
    return html.escape(name).replace("+", "+<wbr>")


def _section(dial: dict[str, Any], methods: Sequence[str]) -> str:
    key = " ".join(f"<span><i style='border-top:3px {DASHES[dash][0]} {color}'></i>{html.escape(name)}</span>"
                   for name, (color, dash) in zip(methods, map(stroke, range(len(methods))), strict=True))
    tables = "".join(_metric_table(dial, methods, metric)
                     for metric in (dial["judged"], *EXTRAS.get(dial["name"], ()), "ssim_ceiling"))
    return (f"<h2 id='{dial['name']}'>{dial['name']}</h2><p>{html.escape(dial['meaning'].capitalize())}; values are "
            f"{html.escape(dial['unit'])}. Judged by {dial['judged']}; a ring marks a breaking point.</p>"
            f"<p class=key>{key}</p>{curves(dial, methods)}<div class=wide>{tables}</div>")


def _metric_table(dial: dict[str, Any], methods: Sequence[str], metric: str) -> str:
    """One metric by value and method; the reference's own noise is the same for all methods."""
    methods = methods[:1] if metric == "ssim_ceiling" else methods
    shown = ("all",) if metric == "ssim_ceiling" else methods
    rows = "".join("<tr><td>" + label(value) + "".join(_value_cell(dial, method, metric, index) for method in methods)
                   for index, value in enumerate(dial["values"]))
    return f"<table><tr>{''.join(f'<th>{_breakable(name)}' for name in (metric, *shown))}{rows}</table>"


def _value_cell(dial: dict[str, Any], method: str, metric: str, index: int) -> str:
    found = dial["breaks"][method]
    broken = metric == dial["judged"] and found is not None and found["value"] == dial["values"][index]
    return f"<td{' class=b' if broken else ''}>{number(series(dial, method, metric)[index])}"


def stroke(index: int) -> tuple[str, int]:
    """Colour of a method's curve and its place in DASHES."""
    return COLORS[index % len(COLORS)], index // len(COLORS) % len(DASHES)


def curves(dial: dict[str, Any], methods: Sequence[str]) -> str:
    """Judged figure along the dial as inline SVG, one step of the dial per step across."""
    lines = {method: series(dial, method, dial["judged"]) for method in methods}
    told = [value for line in lines.values() for value in line if value is not None]
    if not told:
        return "<p>Nothing could be measured.</p>"
    low, high = min(told), max(told)
    margin = max(0.05 * (high - low), 0.005)
    low, high, steps = low - margin, high + margin, max(1, len(dial["values"]) - 1)

    def place(index: int, value: float) -> tuple[float, float]:
        across = LEFT + (WIDTH - LEFT - RIGHT) * (index + 0.2) / (steps + 0.4)
        return across, TOP + (HEIGHT - TOP - BOTTOM) * (high - value) / (high - low)

    drawn = [_curve(line, [place(i, v) for i, v in enumerate(line) if v is not None], dial, method, stroke(number_))
             for number_, (method, line) in enumerate(lines.items())]
    ticks = [f"<text x='{place(i, low)[0]:.1f}' y='{HEIGHT - 14}' text-anchor=middle>{label(value)}</text>"
             for i, value in enumerate(dial["values"])]
    return (f"<svg viewBox='0 0 {WIDTH} {HEIGHT}' width={WIDTH} height={HEIGHT} role=img aria-label='"
            f"{dial['judged']} along {dial['name']}'>{_scale(low, high)}{''.join(ticks)}{''.join(drawn)}</svg>")


def _scale(low: float, high: float) -> str:
    parts = []
    for share in np.linspace(0, 1, 5):
        y = TOP + (HEIGHT - TOP - BOTTOM) * share
        parts.append(f"<line x1={LEFT} x2={WIDTH - RIGHT} y1={y:.1f} y2={y:.1f} stroke='#ddd'/>"
                     f"<text x={LEFT - 6} y={y + 4:.1f} text-anchor=end>{high - (high - low) * share:.3f}</text>")
    return "".join(parts)


def _curve(line: Sequence[float | None], points: Sequence[tuple[float, float]], dial: dict[str, Any], method: str,
           style: tuple[str, int]) -> str:
    ink, dash = style[0], DASHES[style[1]][1]
    path = " ".join(f"{x:.1f},{y:.1f}" for x, y in points)
    dots = "".join(f"<circle cx={x:.1f} cy={y:.1f} r=2.5 fill='{ink}'/>" for x, y in points)
    found, told = dial["breaks"][method], [v for v, q in zip(dial["values"], line, strict=True) if q is not None]
    if found is not None:
        x, y = points[told.index(found["value"])]
        dots += f"<circle cx={x:.1f} cy={y:.1f} r=7 fill=none stroke='{ink}' stroke-width=1.5 />"
    return f"<polyline points='{path}' fill=none stroke='{ink}' stroke-dasharray='{dash}' stroke-width=1.6 />{dots}"


def _figures(dial: dict[str, Any], methods: Sequence[str],
             pictures: dict[tuple[str, str], tuple[str, dict[str, Any]] | None]) -> str:
    parts = []
    for method in methods:
        found = pictures.get((dial["name"], method))
        if found is None:
            continue
        name, cell = found
        what = "breaks here" if dial["breaks"][method] else "never breaks, worst value"
        order = " | ".join(dict.fromkeys(("reference", BASELINE, method)))
        parts.append(f"<figure><img loading=lazy src='{name}' alt='worst crop of {html.escape(method)}'><figcaption>"
                     f"{html.escape(order)}<br>{dial['name']} {label(cell['value'])}, {what}: {dial['judged']} "
                     f"{number(cell['metrics'].get(dial['judged']))}</figcaption></figure>")
    return "".join(parts)
