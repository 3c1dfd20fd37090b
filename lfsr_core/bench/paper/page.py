"""The page: every figure with its picture, its table and what became of the claim."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from lfsr_core.bench.paper.figure import Figure, Results
from lfsr_core.bench.paper.figures import figure9, figure10, figure10_networks, figure11, figure12, tables
from lfsr_core.errors import LfsrError
from lfsr_core.files import atomic_path

FIGURES: dict[str, Figure] = {figure.id: figure for figure in (
    figure9.FIGURE, figure10.STEP, figure10.SHARE, figure10_networks.DEPTH, figure10_networks.ARCHITECTURE,
    figure11.FIGURE, figure12.SCALE, figure12.SELECTION, tables.RIVALS, tables.COST)}
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


def markdown(results: Mapping[str, Results], run: Mapping[str, Any], command: str, images: str = "images") -> str:
    """The page of the figures in ``results``, by id; ``run`` as ``reproduce_paper`` records it."""
    parts = [INTRODUCTION, *_run(run, command)]
    parts += ["\n".join(_section(figure, results[name], images)) for name, figure in FIGURES.items() if name in results]
    absent = [figure.title for name, figure in FIGURES.items() if name not in results]
    if absent:
        parts.append("## Not measured in this run\n\n" + "; ".join(absent))
    return "\n\n".join(parts) + "\n"


def write(path: Path, text: str) -> None:
    """The page, whole or not at all."""
    with atomic_path(path) as temporary:
        temporary.write_text(text, encoding="utf-8")


def _section(figure: Figure, results: Results, images: str) -> list[str]:
    picture = ["", f"![{figure.title}]({images}/{picture_name(figure)})"] if figure.draw else []
    return [f"## {figure.title}", "", f"Claim: {figure.claim}", "", f"Here: {figure.line(results)}", *picture, "",
            *figure.table(results), *_schedules(results.get("schedules", {})),
            *_load(results.get("load"))]


def _load(load: float | None) -> list[str]:
    """What else the machine did: this program's own threads count too."""
    return [] if load is None else ["", f"Load average while this was measured: at most {load:g}."]


def _schedules(schedules: Mapping[str, str]) -> list[str]:
    """How the networks were trained, those with the same schedule together."""
    if not schedules:
        return []
    groups: dict[str, list[str]] = {}
    for name, text in schedules.items():
        groups.setdefault(text, []).append(name)
    return ["", "Networks:", "", *(f"- {', '.join(names)}: {text}" for text, names in groups.items())]


def _run(run: Mapping[str, Any], command: str) -> Sequence[str]:
    settings, machine = run["settings"], run["environment"]
    quick = ("**Quick mode: tiny frames and few samples, which touch every figure but decide nothing.**",)
    versions = ", ".join(f"{name} {version}" for name, version in machine["versions"].items())
    lenses = "all lenses" if settings["lenses"] is None else f"{settings['lenses']} lenses"
    return [*(quick if settings["quick"] else ()), "## The run", "    " + command,
            f"Accuracy on `{settings['display']}`, times of whole frames on `{settings['timing_display']}`; s = "
            f"{settings['scale']}, {settings['spp']} samples per pixel ({settings['clean_spp']} where noise should not "
            f"matter), references of {lenses}, convention {settings['convention']}. "
            f"Scenes: {', '.join(settings['scenes'])}. {machine['cores']} cores of {machine['cpu']}, "
            f"Python {machine['python']}, {versions}."]
