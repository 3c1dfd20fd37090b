"""The plan, step by step: render a sample of lenses, score every candidate on it, choose the cheapest."""

from __future__ import annotations

import dataclasses
import math
import time
from pathlib import Path

import numpy as np

from lfsr_core.base.arrays import Array
from lfsr_core.base.errors import LfsrError
from lfsr_core.base.notices import Notice, Tell, silent
from lfsr_core.base.records import to_data
from lfsr_core.frames.frame import LOW_RES_FILE, SUBPIXELS, Frame
from lfsr_core.frames.low_res import foreground_mask
from lfsr_core.frames.request import Request
from lfsr_core.images.exposure import extreme_tone
from lfsr_core.images.exr import read_finite
from lfsr_core.images.srgb import srgb_encode
from lfsr_core.optics.depth_scale import ScaleChoice
from lfsr_core.optics.display import DisplayProfile
from lfsr_core.plan.choose import Choice, Rated, choose, estimate
from lfsr_core.plan.options import Candidate, PlanOptions
from lfsr_core.plan.sample import (
    LEAST_LENSES,
    Mosaic,
    Render,
    SampleRenders,
    lens_count,
    path_samples,
    paths_per_lens,
    reach,
    render_seconds,
    sampled_lenses,
    with_neighbours,
)
from lfsr_core.plan.score import Quarters, read_quarters, scores
from lfsr_core.plan.work import check_sample
from lfsr_core.reconstruct.methods import seconds as finish_seconds


@dataclasses.dataclass(frozen=True)
class SampleFacts:
    """The sample of a plan and its cost."""

    lenses: int  # number of sampled lenses
    foreground: int  # lenses of the display that show foreground
    costliest: str  # name of the candidate whose frame takes the most path samples
    costliest_seconds: float  # predicted for that frame
    seconds: float  # of all renders of the sample
    measuring_seconds: float  # of all second stages on it
    fraction: float  # path samples of the sample, as a fraction of those of the costliest candidate's frame


@dataclasses.dataclass(frozen=True)
class Planned:
    """A finished plan, as `lfsr plan --json` writes it, see docs/guide/plan.md."""

    # scene, display, seed: of the request
    scene: str
    display: str
    seed: int
    options: PlanOptions
    sample: SampleFacts
    candidates: tuple[Rated, ...]  # all of them, cheapest first
    choice: Choice


def make_plan(request: Request, options: PlanOptions, render: Render, folder: str | Path,
              tell: Tell = silent) -> Planned:
    """Find the cheapest settings for the scene, display and frame of a request.

    Parameters
    ----------
    request : its sampling and output are ignored
    options : target, candidates, and cost of the sample
    render : renders one request into its folder, all or nothing; called with the request and a ``Tell``
    folder : holds the renders: a second call continues where one stopped
    tell : called with progress and with what the renders tell

    Raises
    ------
    LfsrError : for bad options, a scene without foreground, or as of ``render``
    """
    request, display, folder = request.with_scale(ScaleChoice(1)), request.display, Path(folder)
    wanted = options.candidates(display)
    if request.layout in ("view-by-view", SUBPIXELS):
        raise LfsrError(f"a plan renders single lenses, which the layout {request.layout} cannot: choose another "
                        "layout")
    check_sample(folder, request, options)
    renders = SampleRenders(folder, request, render, tell)
    quick, first = renders.quick()
    layers, _ = read_finite(quick / LOW_RES_FILE)
    mask, wide = (foreground_mask(layers, first.rays.tiles, grown) for grown in (0, 1))
    if not mask.any():
        raise LfsrError("no lens shows any foreground: check where the camera looks, and the subject")
    # A ring around the foreground is sampled too, where the quick look may have missed something thin.
    places = np.ones_like(mask) if options.metric == "ssim_lens" else wide
    lenses = sampled_lenses(places, lens_count(display, options), request.seed)
    costs = {(each.scale, each.samples): len(lenses) * paths_per_lens(display, each.scale, each.samples)
             for each in wanted}
    reference_paths = len(lenses) * math.prod(display.views) * options.reference_samples
    renders.whole = path_samples(first) + reference_paths + sum(costs.values())
    is_limited = options.lenses is None and len(lenses) > LEAST_LENSES
    allowed = options.most_paths(display) if is_limited else math.inf

    files, reference = renders.reference(options.reference_samples, lenses)
    quarters, shown = read_quarters(files, reference, len(lenses))
    _check_exposure(quarters, shown)
    counts = shown if places is wide else np.ones_like(shown)
    # Each has something that the mean path of a frame lacks: the first its set-up, the other foreground everywhere.
    rate = min(render_seconds(frame) / path_samples(frame) for frame in (first, reference))
    rows = {each: Rated(**vars(each), seconds=_frame_seconds(each, display, first, rate)) for each in wanted}

    measuring, choice = 0.0, Choice(None, None)
    for group in sorted(costs, key=lambda group: min(row.seconds for row in rows.values() if _group(row) == group)):
        open_rows = [row for row in rows.values() if _group(row) == group]
        why = _why_not(min(row.seconds for row in open_rows), choice.chosen, options,
                       renders.paths + costs[group] <= allowed)
        if why is not None:
            rows |= {row.candidate: dataclasses.replace(row, unmeasured=why) for row in open_rows}
            continue
        listed, blocks = with_neighbours(lenses, reach(display, group[0]), display.lenses)
        rendered = renders.sampled(*group, listed, len(lenses))
        read_finite(rendered / LOW_RES_FILE)  # where it is damaged, no method is to blame
        started = time.perf_counter()
        for row in open_rows:
            try:
                values = scores(rendered, row.method, Mosaic.of(blocks), quarters)
                found = estimate(values, counts, int(places.sum()))
                rows[row.candidate] = dataclasses.replace(row, estimate=found)
            except LfsrError as error:
                failed = Notice("candidate-failed", {"error": str(error)})
                rows[row.candidate] = dataclasses.replace(row, unmeasured=failed)
        measuring += time.perf_counter() - started
        choice = choose(list(rows.values()), options.target, options.limit)

    rated = tuple(sorted(rows.values(), key=lambda row: row.seconds))
    costliest = rows[wanted[-1]]
    sample = SampleFacts(len(lenses), int(mask.sum()), costliest.name, costliest.seconds, renders.seconds, measuring,
                         renders.paths / costliest.paths(display))
    return Planned(request.scene, display.name, request.seed, options, sample, rated,
                   choose(rated, options.target, options.limit))


def _why_not(seconds: float, chosen: Rated | None, options: PlanOptions, is_affordable: bool) -> Notice | None:
    """Why candidates that take at least ``seconds`` are not measured, None where they are."""
    if seconds > options.limit:
        return Notice("candidate-too-slow", {"seconds": options.limit})
    if chosen is not None and seconds > chosen.seconds:
        return Notice("candidate-not-needed", to_data(chosen.candidate))
    return None if is_affordable else Notice("candidate-over-budget", {"budget": options.budget})


def _group(candidate: Candidate) -> tuple[int, int]:
    """Scale and samples, which candidates of one render share."""
    return candidate.scale, candidate.samples


def _frame_seconds(candidate: Candidate, display: DisplayProfile, quick: Frame, rate: float) -> float:
    """Predicted seconds of a whole frame; ``rate``: seconds of a path sample, ``quick``: the render of every lens."""
    world = quick.seconds.get("world", 0.0) if candidate.scale > 1 else 0.0  # rendered apart but at full resolution
    second = finish_seconds(display, candidate.scale, candidate.method)
    return quick.seconds["open"] + rate * candidate.paths(display) + world + second


def _check_exposure(quarters: Quarters, shown: Array) -> None:
    """LfsrError if the image is almost black or white: every candidate would be perfect."""
    tone = extreme_tone(srgb_encode(np.mean(quarters, 0)[shown]))
    if tone:
        change = "stronger" if tone == "black" else "weaker"
        raise LfsrError(f"the sampled lenses are almost {tone}, so that every setting would seem perfect: make the "
                        f"scene's lights {change}, or check where the camera looks")
