"""Table 2: rivals with time and accuracy. Table 3: multiply-adds."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from lfsr_core.bench.paper import quality, renders, timing, weights
from lfsr_core.bench.paper.cells import Cells
from lfsr_core.bench.paper.figure import Figure, Results, by_name, gains, markdown, metric, missing, number, unequal
from lfsr_core.bench.paper.settings import Settings
from lfsr_core.bench.paper.verdict import Difference, overall, say, single_runs
from lfsr_core.frames.frame import read_frame
from lfsr_core.reconstruct.method_name import DEFAULT_METHOD
from lfsr_core.reconstruct.networks import catalogue
from lfsr_core.reconstruct.second_stage import panel_image

DIRECT, BY_VIEW, FEW_SAMPLES = "direct", "view by view + fsrcnn", "1 sample + oidn"
PAPER, PAPER_PLAIN, OURS = "paper (adversary)", "paper (no adversary)", "this project"
ENOUGH_SSIM = 0.90
CLAIM_RIVALS = f"The paper's method is faster than every rival, with an SSIM above {ENOUGH_SSIM:.2f}."
CLAIM_COST = "The generator needs fewer multiply-adds than other networks for super-resolution."


def rivals(settings: Settings) -> dict[str, tuple[int, int, str, str]]:
    """Scale, samples, layout and method of each row."""
    scale, spp = settings.scale, settings.spp
    return {DIRECT: (1, spp, "one-pass", "none"), BY_VIEW: (scale, spp, "view-by-view", "fsrcnn"),
            FEW_SAMPLES: (1, 1, "one-pass", "oidn"), PAPER: (scale, spp, "one-pass", "paper-gan"),
            PAPER_PLAIN: (scale, spp, "one-pass", "paper"), OURS: (scale, spp, "one-pass", DEFAULT_METHOD)}


def measure_rivals(settings: Settings, folder: Path) -> Results:
    """Every rival on every scene."""
    cells, rows = Cells(folder, "table2"), []
    for scene in settings.scenes:
        for name, (scale, spp, layout, method) in rivals(settings).items():
            inputs = quality.inputs(settings, scene, method, spp=spp, render_scale=scale, layout=layout,
                                    repeats=settings.repeats, device=settings.device,
                                    render_device=settings.render_device)
            key = f"{scene.stem}-{name}".replace(" ", "-").replace("(", "").replace(")", "")
            found = cells(key, inputs, lambda scene=scene, row=(scale, spp, layout, method): _one(
                settings, scene, *row))
            rows.append({"scene": scene.stem, "method": name, "how": f"s{scale}, {spp} spp, {method}", **(found or {})})
    methods = [how[3] for how in rivals(settings).values()]
    return {"rows": rows, "load": cells.load, "schedules": quality.schedules(settings, methods)}


def _one(settings: Settings, scene: Path, scale: int, spp: int, layout: str, name: str) -> dict[str, Any] | None:
    method = weights.method(settings, name)
    if method is None:
        return None
    folder = renders.low_resolution(settings, scene, scale, spp, layout=layout)
    seconds = timing.take_turns({"": lambda: panel_image(folder, method)}, settings.repeats)[""]
    return {**(quality.measure(settings, scene, folder, name) or {}), "render": read_frame(folder).seconds["render"],
            "second_stage": timing.median_ms(seconds) / 1e3}


def table_rivals(results: Results) -> list[str]:
    """Time, frame rate and accuracy."""
    names = ("ssim_eia_plain", "ssim_ceiling", "ssim_eia_fg", "psnr_fg")
    rows = [[row["scene"], row["method"], row["how"], number(row["render"]), number(row["second_stage"]),
             number(1 / total(row)), *(metric(row, name) for name in names)]
            for row in results["rows"] if row.get("metrics")]
    return markdown(["scene", "method", "how", "render, s", "second stage, s", "frames/s", *names], rows)


def total(row: dict[str, Any]) -> float:
    """Seconds per frame."""
    return row["render"] + row["second_stage"]


def line_rivals(results: Results) -> str:
    """The paper's method, with its adversary if it was trained, against each rival."""
    found = by_name(results["rows"], "scene", "method")
    scenes = list(dict.fromkeys(scene for scene, _ in found))
    ours = next((name for name in (PAPER, PAPER_PLAIN) if any((scene, name) in found for scene in scenes)), None)
    if ours is None:
        return "Not measured, for want of weights."
    faster = {rival: _faster(found, ours, rival, scenes) for rival in (DIRECT, BY_VIEW, FEW_SAMPLES)}
    enough = _enough(found, ours, scenes)
    words = [overall(*faster.values(), enough), f"Of {ours}:"]
    for rival in (DIRECT, BY_VIEW, FEW_SAMPLES):
        words.append(say(f"Faster than {rival}", faster[rival], "s"))
    words.append(say(f"Plain SSIM of the whole EIA above {ENOUGH_SSIM:.2f}", enough, f"from {ENOUGH_SSIM:.2f}"))
    words += _ceiling(found, ours, scenes)
    for rival in (DIRECT, BY_VIEW, FEW_SAMPLES, OURS):
        words.append(say(f"More accurate than {rival}", gains(results["rows"], ours, rival), "split SSIM"))
    return " ".join(words) + missing(results["rows"]) + unequal(results["schedules"])


def _faster(found: dict[tuple[str, str], Any], ours: str, rival: str, scenes: list[str]) -> dict[str, Difference]:
    """Seconds by which ``ours`` is faster, for every scene that has both."""
    return {scene: single_runs(total(found[scene, rival]), total(found[scene, ours])) for scene in scenes
            if (scene, rival) in found and (scene, ours) in found}


def _enough(found: dict[tuple[str, str], Any], ours: str, scenes: list[str]) -> dict[str, Difference]:
    """Plain SSIM, the paper's own figure, above its bound; a reference of all lenses has no interval."""
    rows = {scene: found[scene, ours] for scene in scenes if (scene, ours) in found}
    return {scene: Difference(row["metrics"]["ssim_eia_plain"] - ENOUGH_SSIM,
                              row["ci95"].get("ssim_eia_plain") or 0.0) for scene, row in rows.items()}


def _ceiling(found: dict[tuple[str, str], Any], ours: str, scenes: list[str]) -> list[str]:
    """A caution where the reference's own noise alone keeps plain SSIM below the bound."""
    low = [scene for scene in scenes if (scene, ours) in found
           and found[scene, ours]["metrics"]["ssim_ceiling"] < ENOUGH_SSIM]
    return [f"The reference of {', '.join(low)} is itself too noisy for that: its halves agree less."] if low else []


def measure_cost(settings: Settings, folder: Path) -> Results:
    """Counted, not timed; at every scale that a network comes in."""
    from lfsr_core.reconstruct.networks.pytorch.cost import multiply_adds, parameters

    width, height = settings.timing_display.panel_pixels
    rows = []
    for name, entry in catalogue.NETWORKS.items():
        # Only what works on an elemental image of its own; the adversary leaves the generator's size as it is.
        if entry.upscaler != catalogue.PHOTOGRAPH_UPSCALER or name == "paper-gan" or settings.scale not in entry.scales:
            continue
        network = weights.untrained(name, settings.scale)
        per_pixel = multiply_adds(network, *settings.timing_display.low_views(settings.scale)[::-1])
        rows.append({"method": name, "parameters": parameters(network), "per_low_pixel": per_pixel,
                     "per_frame": per_pixel * width * height / settings.scale**2})
    return {"rows": rows, "pixels": [width, height], "scale": settings.scale}


def table_cost(results: Results) -> list[str]:
    """Parameters and multiply-adds."""
    rows = [[row["method"], row["parameters"], f"{row['per_low_pixel']:.0f}", f"{row['per_frame'] / 1e9:.2f}"]
            for row in results["rows"]]
    return markdown(["network", "parameters", "multiply-adds per low-resolution pixel",
                     f"10⁹ per {results['pixels'][0]}×{results['pixels'][1]} frame, all lenses"], rows)


def line_cost(results: Results) -> str:
    """The generator against the other architectures."""
    cost = {row["method"]: row["per_low_pixel"] for row in results["rows"]}
    others = {name: Difference(value / cost["paper"] - 1, 0.0) for name, value in cost.items()
              if not name.startswith("paper")}
    ratios = ", ".join(f"{name} {1 + other.value:.2f}" for name, other in others.items())
    return f"{overall(others)} Times the generator's: {ratios} (counted, so without an interval)."


RIVALS = Figure("table2", "Table 2: rivals", CLAIM_RIVALS, measure_rivals, None, table_rivals, line_rivals)
COST = Figure("table3", "Table 3: multiply-adds", CLAIM_COST, measure_cost, None, table_cost, line_cost)
