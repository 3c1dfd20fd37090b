"""The plan, step by step: render a sample of lenses, score every candidate on it, choose the cheapest."""

from __future__ import annotations

import dataclasses
import math
import shutil
import tempfile
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np

from lfsr_core.base.errors import LfsrError
from lfsr_core.base.files import LOCK_FILE, cache_folder, locks, read_json, write_json
from lfsr_core.base.notices import Notice, Tell, silent
from lfsr_core.base.records import to_data
from lfsr_core.frames.folder import PLACES, digest, request_facts, scene_stamp
from lfsr_core.frames.frame import LOW_RES_FILE, SUBPIXELS
from lfsr_core.frames.low_res import foreground_mask
from lfsr_core.frames.request import Request
from lfsr_core.images.exr import read_finite
from lfsr_core.images.srgb import srgb_encode
from lfsr_core.images.view_transform import extreme_tone
from lfsr_core.optics.depth_scale import ScaleChoice
from lfsr_core.plan.choose import Choice, Rated, choose, estimate
from lfsr_core.plan.options import Candidate, PlanOptions, path_samples, render_seconds
from lfsr_core.plan.sample import (
    LEAST_LENSES,
    Mosaic,
    Render,
    SampleRenders,
    lens_count,
    paths_per_lens,
    reach,
    sampled_lenses,
    scores,
    with_neighbours,
)
from lfsr_core.reconstruct.methods import seconds as finish_seconds
from lfsr_core.version import __version__

SAMPLE_FILE = "sample.json"
SECONDS_CACHED = 24 * 3600  # changes of textures and linked files are not noticed, so old renders are not reused


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
    facts, described = sample_facts(request, options), folder / SAMPLE_FILE
    if described.exists() and read_json(described, "the description of a sample") != facts:
        raise LfsrError(f"{folder} holds the sample of another scene or of other options: choose another folder")
    write_json(described, facts)
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

    quarters, shown, reference = renders.reference(options.reference_samples, lenses)
    if tone := extreme_tone(srgb_encode(np.mean(quarters, 0)[shown])):
        change = "stronger" if tone == "black" else "weaker"
        raise LfsrError(f"the sampled lenses are almost {tone}, so that every setting would seem perfect: make the "
                        f"scene's lights {change}, or check where the camera looks")
    counts = shown if places is wide else np.ones_like(shown)
    # Each has something that the mean path of a frame lacks: the first its set-up, the other foreground everywhere.
    rate = min(render_seconds(frame) / path_samples(frame) for frame in (first, reference))
    opening, world = first.seconds["open"], first.seconds.get("world", 0.0)  # rendered apart but at full resolution
    rows: dict[Candidate, Rated] = {}
    groups: dict[tuple[int, int], list[Rated]] = {}  # candidates of one render, by scale and samples
    for each in wanted:
        seconds = (opening + rate * each.paths(display) + (world if each.scale > 1 else 0.0)
                   + finish_seconds(display, each.scale, each.method))
        rows[each] = Rated(**vars(each), seconds=seconds)
        groups.setdefault((each.scale, each.samples), []).append(rows[each])

    measuring, choice = 0.0, Choice(None, None)
    for group, open_rows in sorted(groups.items(), key=lambda pair: min(row.seconds for row in pair[1])):
        why, least = None, min(row.seconds for row in open_rows)
        if least > options.limit:
            why = Notice("candidate-too-slow", {"seconds": options.limit})
        elif choice.chosen is not None and least > choice.chosen.seconds:
            why = Notice("candidate-not-needed", to_data(choice.chosen.candidate))
        elif renders.paths + costs[group] > allowed:
            why = Notice("candidate-over-budget", {"budget": options.budget})
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


def sample_facts(request: Request, options: PlanOptions) -> dict[str, Any]:
    """JSON-ready facts that two plans must have in common to use the same renders."""
    return request_facts(request, (*PLACES, "sampling")) | {
        "lenses": lens_count(request.display, options), "reference_samples": options.reference_samples,
        "metric": options.metric}


@contextmanager
def work_folder(folder: Path | None, request: Request, options: PlanOptions, tell: Tell) -> Iterator[Path]:
    """Yield ``folder``, or one in the user's cache that is removed after the block.

    After an error or an interrupt the cached one stays, if a render was begun, for the next plan of the same question
    and scene file; a notice says so. Of two such plans at once the second works in a temporary folder.
    """
    if folder is not None:
        yield folder
        return
    plans = cache_folder() / "plans"
    for path in plans.iterdir() if plans.is_dir() else ():
        if time.time() - path.stat().st_mtime > SECONDS_CACHED:
            shutil.rmtree(path, ignore_errors=True)
    made = plans / digest([sample_facts(request, options), scene_stamp(request.scene), __version__])
    made.mkdir(parents=True, exist_ok=True)
    with (made / LOCK_FILE).open("ab") as lock:
        if not locks(lock):
            with tempfile.TemporaryDirectory(prefix="lfsr-plan-") as name:
                yield Path(name)
            return
        try:
            yield made
        except BaseException:
            if any(path.is_dir() for path in made.iterdir()):
                tell(Notice("plan-kept", {"folder": str(made)}))
            else:
                shutil.rmtree(made, ignore_errors=True)
            raise
        shutil.rmtree(made, ignore_errors=True)
