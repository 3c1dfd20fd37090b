"""Table 2: rivals with time and accuracy. Table 3: multiply-adds."""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping
from pathlib import Path

from lfsr_core.reconstruct.method_name import DEFAULT_METHOD
from lfsr_core.reconstruct.networks import catalogue
from lfsr_core.reconstruct.registry import Method
from lfsr_lab.experiments.engine.records import Records
from lfsr_lab.experiments.engine.report import markdown_table, number
from lfsr_lab.experiments.paper import quality, renders, weights
from lfsr_lab.experiments.paper.figure import Figure, cautions, gains, known, measured, metric
from lfsr_lab.experiments.paper.records import Results, Row, Rows
from lfsr_lab.experiments.paper.renders import View
from lfsr_lab.experiments.paper.settings import Settings
from lfsr_lab.experiments.paper.verdict import Difference, overall, sentence, single_runs
from lfsr_lab.networks import comparators

DIRECT, BY_VIEW, FEW_SAMPLES = "direct", "view by view + fsrcnn", "1 sample + oidn"
PAPER, PAPER_PLAIN, OURS = "paper (adversary)", "paper (no adversary)", "this project"
ENOUGH_SSIM = 0.90
CLAIM_RIVALS = f"The paper's method is faster than every rival, with an SSIM above {ENOUGH_SSIM:.2f}."
CLAIM_COST = "The generator needs fewer multiply-adds than other networks for super-resolution."
PLAIN, CEILING = ("ssim_eia_plain", "ssim_lens_plain"), ("ssim_ceiling", "ssim_lens_ceiling")
METRICS = (*PLAIN, *CEILING, "ssim_eia_fg", "ssim_lens_fg", "psnr_fg")
Found = Mapping[tuple[str, str], Row]


@dataclasses.dataclass(frozen=True)
class CostRow:
    """What one network costs."""

    method: str  # its name
    per_low_pixel: float  # multiply-adds per low-resolution pixel
    parameters: int = 0  # their number
    per_frame: float = 0.0  # multiply-adds for all lenses


@dataclasses.dataclass(frozen=True, kw_only=True)
class Costs(Results):
    """Costs of networks."""

    rows: tuple[CostRow, ...]  # one per network
    pixels: tuple[int, int] = (0, 0)  # of a frame, horizontal and vertical
    scale: int = 0  # factor


def rivals(settings: Settings, scene: Path) -> dict[str, tuple[View, str]]:
    """Return the render and method of each row."""
    view = View(scene, settings.scale, settings.spp)
    whole = dataclasses.replace(view, scale=1)
    return {DIRECT: (whole, "none"), BY_VIEW: (dataclasses.replace(view, layout="view-by-view"), "fsrcnn"),
            FEW_SAMPLES: (dataclasses.replace(whole, spp=1), "oidn"), PAPER: (view, "paper-gan"),
            PAPER_PLAIN: (view, "paper"), OURS: (view, DEFAULT_METHOD)}


def measure_rivals(settings: Settings) -> Rows:
    """Measure every rival on every scene."""
    records = quality.records_of(settings, "table2", Row)
    rows = tuple(_row(settings, records, name, *how) for scene in settings.scenes
                 for name, how in rivals(settings, scene).items())
    methods = [method for _, method in rivals(settings, settings.scenes[0]).values()]
    return Rows(rows=rows, load=records.load, schedules=quality.schedules(settings, methods))


def _row(settings: Settings, records: Records[Row], name: str, view: View, method: str) -> Row:
    inputs = quality.inputs(settings, view, method, render_scale=view.scale, layout=view.layout, device=settings.device,
                            repeats=settings.repeats, render_device=settings.render_device)
    key = f"{view.scene.stem}-{name}".replace(" ", "-").replace("(", "").replace(")", "")
    ready, found = weights.method(settings, method), Row()
    if ready is not None:
        found = quality.measure_once(records, key, inputs, lambda: _one(settings, view, ready))
    how = f"s{view.scale}, {view.spp} spp, {method}"
    return dataclasses.replace(found, scene=view.scene.stem, method=name, how=how)


def _one(settings: Settings, view: View, method: Method) -> Row:
    seen, folder = quality.finished(settings, view, method), renders.low_resolution(settings, view)
    return dataclasses.replace(quality.accuracy(seen), render=seen.frame.seconds["render"],
                               second_stage=quality.second_stage_seconds(settings, folder, method))


def table_rivals(results: Rows) -> list[str]:
    """Return a table of time, frame rate and accuracy."""
    columns = known(results.rows, METRICS)
    rows = [[row.scene, row.method, row.how, number(row.render), number(row.second_stage), number(1 / row.total),
             *(metric(row, name) for name in columns)] for row in results.rows if row.metrics]
    return markdown_table(["scene", "method", "how", "render, s", "second stage, s", "frames/s", *columns], rows)


def line_rivals(results: Rows) -> str:
    """Return sentences on the paper's method, with its adversary if it was trained, against each rival."""
    found = measured(results.rows)
    ours = next((name for name in (PAPER, PAPER_PLAIN) if any(method == name for _, method in found)), None)
    if ours is None:
        return "Not measured, for want of weights."
    faster = {rival: _faster(found, ours, rival) for rival in (DIRECT, BY_VIEW, FEW_SAMPLES)}
    enough = _enough(found, ours)
    words = [overall(*faster.values(), enough), f"Of {ours}:"]
    words += [sentence(f"Faster than {rival}", found_faster, "s") for rival, found_faster in faster.items()]
    words.append(sentence(f"Plain SSIM above {ENOUGH_SSIM:.2f}", enough, f"from {ENOUGH_SSIM:.2f}"))
    words += _ceiling(found, ours)
    words += [sentence(f"More accurate than {rival}", gains(results.rows, ours, rival), "split SSIM")
              for rival in (*faster, OURS)]
    return " ".join(words) + cautions(results.rows, results.schedules)


def _faster(found: Found, ours: str, rival: str) -> dict[str, Difference]:
    """Seconds by which ``ours`` is faster, for every scene that has both."""
    return {scene: single_runs(row.total, found[scene, ours].total) for (scene, method), row in found.items()
            if method == rival and (scene, ours) in found}


def _enough(found: Found, ours: str) -> dict[str, Difference]:
    """Plain SSIM, the paper's own figure, above its bound; a reference of all lenses has no interval."""
    return {scene: Difference(row.value(name) - ENOUGH_SSIM, row.ci95.get(name) or 0.0)
            for (scene, method), row in found.items() if method == ours for name in known([row], PLAIN)}


def _ceiling(found: Found, ours: str) -> list[str]:
    """A caution where the reference's own noise alone keeps plain SSIM below the bound."""
    low = [scene for (scene, method), row in found.items()
           if method == ours and any(row.value(name) < ENOUGH_SSIM for name in known([row], CEILING))]
    return [f"The reference of {', '.join(low)} is itself too noisy for that: its halves agree less."] if low else []


def measure_cost(settings: Settings) -> Costs:
    """Count multiply-adds at the settings' scale; nothing is timed."""
    from lfsr_lab.networks.cost import multiply_adds, parameters

    display, scale, rows = settings.timing_display, settings.scale, []
    width, height = display.eia_pixels
    for name, entry in catalogue.NETWORKS.items():
        # Only what works on an elemental image of its own; the adversary leaves the generator's size as it is.
        if entry.upscaler != comparators.PER_IMAGE or name == "paper-gan" or scale not in entry.scales:
            continue
        network = weights.untrained(name, scale)
        per_pixel = multiply_adds(network, *display.low_views(scale)[::-1])
        rows.append(CostRow(name, per_pixel, parameters(network), per_pixel * width * height / scale**2))
    return Costs(rows=tuple(rows), pixels=(width, height), scale=scale)


def table_cost(results: Costs) -> list[str]:
    """Return a table of parameters and multiply-adds."""
    rows = [[row.method, row.parameters, f"{row.per_low_pixel:.0f}", f"{row.per_frame / 1e9:.2f}"]
            for row in results.rows]
    return markdown_table(["network", "parameters", "multiply-adds per low-resolution pixel",
                           f"10⁹ per {results.pixels[0]}×{results.pixels[1]} frame, all lenses"], rows)


def line_cost(results: Costs) -> str:
    """Return sentences on the generator against the other architectures."""
    cost = {row.method: row.per_low_pixel for row in results.rows}
    others = {name: Difference(value / cost["paper"] - 1, 0.0) for name, value in cost.items()
              if not name.startswith("paper")}
    ratios = ", ".join(f"{name} {1 + other.value:.2f}" for name, other in others.items())
    return f"{overall(others)} Times the generator's: {ratios} (counted, so without an interval)."


RIVALS = Figure("table2", "Table 2: rivals", CLAIM_RIVALS, Rows, measure_rivals, table_rivals, line_rivals)
COST = Figure("table3", "Table 3: multiply-adds", CLAIM_COST, Costs, measure_cost, table_cost, line_cost)
