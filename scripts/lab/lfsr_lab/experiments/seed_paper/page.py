"""The page: every figure with its image, its table and what became of the claim."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from lfsr_core.base.errors import LfsrError
from lfsr_lab.experiments.engine.report import Environment
from lfsr_lab.experiments.seed_paper.figure import Figure, Results
from lfsr_lab.experiments.seed_paper.figures import frames, images
from lfsr_lab.experiments.seed_paper.figures.networks import ARCHITECTURE, COST, DEPTH, STEPS
from lfsr_lab.experiments.seed_paper.renders import SCALE, Settings

FIGURES: dict[str, Figure] = {figure.id: figure for figure in (
    images.FIG9, STEPS, frames.FRACTION, DEPTH, ARCHITECTURE, images.FIG11, frames.SCALES,
    frames.SCENES, frames.TABLE2, COST)}
"""Every figure and table by its id, in the paper's order."""

INTRODUCTION = """# The paper, measured again

"Real-time optical reconstruction for a three-dimensional light-field display based on path-tracing and CNN
super-resolution", Optics Express 29(23), 37862 (2021). Its abstract claims more than 30 frames per second at 8K with
an SSIM that can be over 0.90, from a low-resolution path-traced EIA, elemental images that a light network (trained
with an adversary) super-resolves one by one, and foreground selection.

Its text and curves were not at hand: the claims below are as far as they are known here. Its graphics card, scenes and
lens count are not known either, so times are compared with times of this machine only.

Every sentence beside a figure is derived from the numbers. "Holds" and "other way round" mean that the 95 % interval
of the paired difference (the same lenses, or runs taken in turns) lies on that side of zero; neighbouring lenses
resemble each other, so these intervals are rather too narrow.
SSIM is the split estimate of [metrics.md](../reference/metrics.md) unless it is called plain."""
QUICK = "**Quick mode: tiny frames and few samples, which touch every figure but decide nothing.**"


def chosen(only: str | None) -> list[Figure]:
    """Return the figures of a comma-separated list of ids, all without one; LfsrError for an unknown id."""
    names = list(FIGURES) if only is None else [name.strip() for name in only.split(",") if name.strip()]
    for name in names:
        if name not in FIGURES:
            raise LfsrError(f"there is no figure {name!r}: choose from {', '.join(FIGURES)}")
    return [figure for name, figure in FIGURES.items() if name in names]


def markdown(results: Mapping[str, Results], run: Sequence[str], folder: str = "images") -> str:
    """Return the page of the figures in ``results``, by id, of a ``run``; ``folder`` holds the images."""
    there = [figure for name, figure in FIGURES.items() if name in results]
    parts = [INTRODUCTION, *run, *("\n".join(_section(figure, results[figure.id], folder)) for figure in there)]
    absent = [figure.title for name, figure in FIGURES.items() if name not in results]
    if absent:
        parts.append("## Not measured in this run\n\n" + "; ".join(absent))
    return "\n\n".join(parts) + "\n"


def _section(figure: Figure, results: Results, folder: str) -> list[str]:
    image = ["", f"![{figure.title}]({folder}/{figure.image})"] if figure.draw else []
    trained = [f"- {name}: {text}" for name, text in results.schedules.items()]
    networks = ["", "Networks (the paper's recipes are in lfsr_lab/train/configs):", "", *trained] if trained else []
    # This program's own threads count too.
    load = [] if results.load is None else ["", f"Load average while this was measured: at most {results.load:g}."]
    return [f"## {figure.title}", "", f"Claim: {figure.claim}", "", f"Here: {figure.line(results)}", *image, "",
            *figure.table(results.rows), *networks, *load]


def run_text(of: Settings, machine: Environment, command: str) -> list[str]:
    """Return paragraphs about a run: its command line, what it measures and on which machine."""
    return [*([QUICK] if of.quick else []), "## The run", "    " + command,
            f"Accuracy on `{of.display.name}`, times of whole frames on `{of.timing_display.name}`; s = {SCALE}, "
            f"{of.spp} samples per pixel ({of.clean_spp} where noise should not matter, {of.reference_spp} of "
            f"references), rendered on {of.render_device}. Scenes: {', '.join(scene.stem for scene in of.scenes)}. "
            f"{machine.machine}, Python {machine.python}, {machine.packages}."]
