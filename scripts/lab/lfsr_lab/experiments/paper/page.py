"""The page: every figure with its picture, its table and what became of the claim."""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping
from typing import Any

from lfsr_core.errors import LfsrError
from lfsr_lab.experiments.engine.environment import Environment
from lfsr_lab.experiments.paper.figure import Figure
from lfsr_lab.experiments.paper.figures import figure9, figure10, figure11, frames, tables
from lfsr_lab.experiments.paper.records import Results
from lfsr_lab.experiments.paper.settings import Settings

FIGURES: dict[str, Figure[Any]] = {figure.id: figure for figure in (
    figure9.FIGURE, figure10.STEPS, frames.SHARE, figure10.DEPTH, figure10.ARCHITECTURE, figure11.FIGURE,
    frames.SCALES, frames.SCENES, tables.RIVALS, tables.COST)}
"""Every figure and table by its id, in the paper's order."""

INTRODUCTION = """# The paper, measured again

"Real-time optical reconstruction for a three-dimensional light-field display based on path-tracing and CNN
super-resolution", Optics Express 29(23), 37862 (2021). Its abstract claims more than 30 frames per second at 8K with
an SSIM that can be over 0.90, from a low-resolution path-traced EIA, elemental images that a light network (trained
with an adversary) super-resolves one by one, and foreground selection.

Its text and curves were not at hand when this was written: the claims below are as far as they are known here, and
whether the paper's words agree with its own curves is not judged. Its graphics card, scenes and lens count are not
known either, so times are compared with times of this machine only.

Every sentence beside a figure is derived from the numbers. "Holds" and "other way round" mean that the 95 % interval
of the paired difference (the same lenses, or runs taken in turns) lies on that side of zero; neighbouring lenses
resemble each other, so these intervals are rather too narrow. SSIM is the split estimate of [metrics.md](metrics.md)
unless it is called plain. Scenes and samples are in each table."""


def chosen(only: str | None) -> list[Figure]:
    """Figures of a comma-separated list of ids, all without one; LfsrError for an unknown id."""
    if only is None:
        return list(FIGURES.values())
    names = [name.strip() for name in only.split(",") if name.strip()]
    for name in names:
        if name not in FIGURES:
            raise LfsrError(f"there is no figure {name!r}: choose from {', '.join(FIGURES)}")
    return [figure for name, figure in FIGURES.items() if name in names]


def picture_name(figure: Figure) -> str:
    """File name of a figure's picture."""
    return f"paper-{figure.id}.png"


@dataclasses.dataclass(frozen=True)
class Run:
    """One run of the reproduction."""

    settings: Settings  # what it measures
    environment: Environment  # of the machine
    command: str  # line that began it


def markdown(results: Mapping[str, Results], run: Run, images: str = "images") -> str:
    """The page of the figures in ``results``, by id; ``images``: folder of the pictures as seen from it."""
    parts = [INTRODUCTION, *_run(run)]
    parts += ["\n".join(_section(figure, results[name], images)) for name, figure in FIGURES.items() if name in results]
    absent = [figure.title for name, figure in FIGURES.items() if name not in results]
    if absent:
        parts.append("## Not measured in this run\n\n" + "; ".join(absent))
    return "\n\n".join(parts) + "\n"


def _section(figure: Figure[Any], results: Results, images: str) -> list[str]:
    picture = ["", f"![{figure.title}]({images}/{picture_name(figure)})"] if figure.draw else []
    # This program's own threads count too.
    load = [] if results.load is None else ["", f"Load average while this was measured: at most {results.load:g}."]
    return [f"## {figure.title}", "", f"Claim: {figure.claim}", "", f"Here: {figure.line(results)}", *picture, "",
            *figure.table(results), *_schedules(results.schedules), *load]


def _schedules(schedules: Mapping[str, str]) -> list[str]:
    """How the networks were trained, those with the same schedule together."""
    if not schedules:
        return []
    groups: dict[str, list[str]] = {}
    for name, text in schedules.items():
        groups.setdefault(text, []).append(name)
    return ["", "Networks:", "", *(f"- {', '.join(names)}: {text}" for text, names in groups.items())]


def _run(run: Run) -> list[str]:
    of, machine = run.settings, run.environment
    quick = ("**Quick mode: tiny frames and few samples, which touch every figure but decide nothing.**",)
    lenses = "all lenses" if of.lenses is None else f"{of.lenses} lenses"
    return [*(quick if of.quick else ()), "## The run", "    " + run.command,
            f"Accuracy on `{of.display.name}`, times of whole frames on `{of.timing_display.name}`; s = {of.scale}, "
            f"{of.spp} samples per pixel ({of.clean_spp} where noise should not matter), references of {lenses}, "
            f"convention {of.convention}. Scenes: {', '.join(scene.stem for scene in of.scenes)}. "
            f"{machine.cores} cores of {machine.cpu}, Python {machine.python}, {machine.packages}."]
