"""The plan, step by step: render a sample of lenses, score every candidate on it, choose the cheapest."""

import dataclasses
import math
import shutil
import tempfile
import time
import zlib
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np

from lfsr_core.base.arrays import Array
from lfsr_core.base.messages import LfsrError, Notice, Progress, Tell, silent
from lfsr_core.base.records import to_data
from lfsr_core.base.system import LOCK_FILE, cache_folder, locks, read_json, write_json
from lfsr_core.frames import frame as files
from lfsr_core.frames.folder import PLACES, FrameFolder, digest, request_facts, scene_stamp
from lfsr_core.frames.frame import SUBPIXELS, Frame, Request, Sampling, read_frame
from lfsr_core.images.color import extreme_tone, srgb_encode
from lfsr_core.images.image_files import read_finite
from lfsr_core.metrics.eia_metrics import listed_images, read_half, stacked_ssim
from lfsr_core.optics.depth_scale import ScaleChoice
from lfsr_core.optics.display import DisplayProfile
from lfsr_core.optics.rays import systematic_sample
from lfsr_core.plan.options import Candidate, Choice, PlanOptions, Rated, choose, estimate, path_samples, render_seconds
from lfsr_core.reconstruct.methods import MethodName
from lfsr_core.reconstruct.methods import seconds as finish_seconds
from lfsr_core.reconstruct.second_stage import finished_lenses
from lfsr_core.reconstruct.upscaler import foreground_mask, low_resolution, read_world
from lfsr_core.version import __version__

SECONDS_CACHED = 24 * 3600  # changes of textures and linked files are not noticed, so old renders are not reused
CONTEXT = 16  # low-resolution pixels around a sampled lens that a denoiser should see
WIDE_ENOUGH = 32  # pixels across an elemental image that needs no neighbours: most of it is far from the border
MOST_REACH = 1  # lenses on each side; more neighbours would cost more than the lens
REACH_IN_A_VIEW = 4  # for displays with parallax along one axis, whose elemental images are one pixel high
LEAST_LENSES, USUAL_LENSES = 24, 48
LEAST_SIDE = 4  # pixels that Blender renders
REFERENCE_FRACTION = 0.15  # of the budget: most plans end after a few candidates, which cost less
REFERENCE_PARTS = 2  # renders of two independent halves each: four quarters
CORRECTED = 0.5  # fraction of the loss by the reference's remaining noise that is added to the metric

Lens = tuple[int, int]
Quarters = Sequence[Array]  # four independent renders of the sampled lenses (n, py, px, 3), scene-linear
Render = Callable[[Request, Tell], object]  # renders a request into its folder, all or nothing


def reach(display: DisplayProfile, scale: int, methods: Iterable[str]) -> int:
    """Number of neighbours on each side with which a sampled lens is rendered at ``scale``, for these ``methods``."""
    if not any(MethodName.parse(name).sees_neighbours for name in methods):
        return 0
    if not all(display.parallax):
        return REACH_IN_A_VIEW
    width = min(display.low_views(scale))
    return 0 if width >= WIDE_ENOUGH else min(math.ceil(CONTEXT / width), MOST_REACH)


def lens_count(display: DisplayProfile, options: PlanOptions) -> int:
    """Number of lenses to sample: as many as were asked for, else the usual number or what the budget allows."""
    if options.lenses is not None:
        return options.lenses
    reference = math.prod(display.views) * options.reference_samples
    return min(max(int(REFERENCE_FRACTION * options.most_paths(display) / reference), LEAST_LENSES), USUAL_LENSES)


def sampled_lenses(mask: Array, count: int, seed: int) -> list[Lens]:
    """Choose ``count`` random lenses, (row, column), spread over ``mask`` (sy, sx), or all of it where it has fewer."""
    places = np.argwhere(mask)
    chosen = systematic_sample(places, min(count, len(places)), np.random.default_rng(seed))
    return sorted((int(row), int(column)) for row, column in chosen)


def with_neighbours(lenses: Sequence[Lens], reach_: int, grid: tuple[int, int]) -> tuple[list[Lens], Array]:
    """Lenses to render, and the index into them of each lens of each block, (n, 2·reach + 1, 2·reach + 1).

    ``grid`` (sx, sy). Beyond the display's edge a block repeats the lens at the edge.
    """
    offsets, places = np.arange(-reach_, reach_ + 1), np.asarray(lenses)
    rows = np.clip(places[:, 0, None] + offsets, 0, grid[1] - 1)[:, :, None]
    columns = np.clip(places[:, 1, None] + offsets, 0, grid[0] - 1)[:, None, :]
    flat = np.broadcast_to(rows * grid[0] + columns, (len(places), len(offsets), len(offsets)))
    listed, index = np.unique(flat, return_inverse=True)
    return [(int(n) // grid[0], int(n) % grid[0]) for n in listed], index.reshape(flat.shape)


def sample_eia(blocks: Array) -> tuple[Array, Array]:
    """Lay blocks of lenses side by side, as one small EIA, on which a method runs as on a whole frame.

    A denoiser looks at the neighbours of a lens, so a sampled lens is rendered with a block of lenses around it.
    ``blocks`` (n, side, side): places in a list of rendered lenses. Returns those of that EIA's lenses, nearly square
    (rows, columns), where unused places repeat the last block, and row and column of each block's middle (n, 2).
    """
    count, side, _ = blocks.shape
    across = math.isqrt(count - 1) + 1
    down = math.ceil(count / across)
    filled = blocks[np.minimum(np.arange(across * down), count - 1)].reshape(down, across, side, side)
    centres = np.stack(np.divmod(np.arange(count), across), -1) * side + side // 2
    return filled.transpose(0, 2, 1, 3).reshape(down * side, across * side), centres


class SampleRenders:
    """Frame folders of the sample in ``folder``, each rendered when it is first needed."""

    def __init__(self, folder: Path, request: Request, render: Render, tell: Tell) -> None:
        self.frames: list[Frame] = []
        self.whole = 1.0  # path samples of the plan, if all candidates are rendered
        self.world: str | None = None  # file of the world, the same for all lenses and samples, where it is apart
        self._folder, self._request, self._render, self._tell = folder, request, render, tell

    @property
    def paths(self) -> int:
        """Path samples of all renders so far."""
        return sum(map(path_samples, self.frames))

    def rendered(self, name: str, message: str, **changes: Any) -> tuple[Path, Frame]:
        """Folder of the request with ``changes``, rendered unless it is there; its name decides its random numbers."""
        seed = (self._request.seed + zlib.crc32(name.encode())) % 2**31
        request = dataclasses.replace(self._request, output=str(self._folder / name), seed=seed, world=self.world,
                                      **changes)
        lenses = math.prod(request.display.lenses) if request.lens_list is None else len(request.lens_list)
        scale, samples = request.sampling.scale, request.sampling.samples
        begun, paths = self.paths, lenses * math.prod(request.display.low_views(scale)) * samples

        def tell(told: Progress | Notice) -> None:
            if isinstance(told, Progress):
                done = min((begun + told.fraction * paths) / self.whole, 1.0)
                told = Progress("plan", done, f"{message}: {told.detail}" if told.detail else message)
            self._tell(told)
        tell(Progress("plan"))
        folder = FrameFolder(request.output)
        if not folder.holds(request.kind):
            self._render(request, tell)
        folder.check_rendered(request)
        self.frames.append(folder.frame)
        return folder.path, folder.frame


def scores(folder: Path, name: str, blocks: Array, quarters: Quarters) -> Array:
    """Accuracy (n,) of the method ``name`` on each sampled lens, from a render of them and their neighbours."""
    frame, (index, centres) = read_frame(folder), sample_eia(blocks)
    layers, _ = read_finite(folder / files.LOW_RES_FILE)
    low = low_resolution(layers, frame, read_world(folder, frame))
    low = dataclasses.replace(low.each(lambda layer: layer.reshape(-1, *layer.shape[2:])[index]),  # in reading order
                              block=blocks.shape[1])
    mask = foreground_mask(layers, frame.rays.tiles).reshape(-1)[index[tuple(centres.T)]]
    return split_scores(srgb_encode(finished_lenses(low, mask, name, centres)), quarters)


def split_scores(images: Array, quarters: Quarters) -> Array:
    """Split SSIM (n,) of images (n, py, px, 3) in [0, 1], corrected for the noise of the reference.

    That noise lowers the metric about in proportion to its variance. So what the metric gains from halves of one
    quarter to halves of two is missing once more. CORRECTED of that gain is added: adding all of it would sometimes
    promise too much (docs/notebook/plan.md).
    """
    def ssim(first: Sequence[int], second: Sequence[int]) -> Array:
        half_a, half_b = (srgb_encode(np.mean([quarters[n] for n in half], 0)) for half in (first, second))
        return np.asarray(stacked_ssim(images, half_a, half_b).mean((1, 2)))

    full, less = ssim((0, 1), (2, 3)), (ssim((0,), (2,)) + ssim((1,), (3,))) / 2
    # Strong noise, whose variances are cut off at 0, raises the metric: then there is no gain to extrapolate.
    return np.asarray(full + CORRECTED * (full - less) if np.mean(full - less) > 0 else full)


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
    """Find the cheapest settings for the scene, display and frame of a request, whose sampling and output are ignored.

    ``render``: renders one request into its folder, all or nothing, called with the request and a ``Tell``;
    ``folder``: holds the renders, from which a second call continues; ``tell``: called with progress and with what the
    renders tell. LfsrError for bad options, a scene without foreground, or as of ``render``.
    """
    request, display, folder = request.with_scale(ScaleChoice(1)), request.display, Path(folder)
    wanted = options.candidates(display)
    if request.layout in ("view-by-view", SUBPIXELS):
        raise LfsrError(f"a plan renders single lenses, which the layout {request.layout} cannot: choose another "
                        "layout")
    facts, described = sample_facts(request, options), folder / "sample.json"
    if described.exists() and read_json(described, "the description of a sample") != facts:
        raise LfsrError(f"{folder} holds the sample of another scene or of other options: choose another folder")
    write_json(described, facts)
    renders = SampleRenders(folder, request, render, tell)
    scales = [scale for scale in display.scales()
              if min(np.multiply(display.lenses, display.low_views(scale))) >= LEAST_SIDE]
    scale = min(scales or [1], key=lambda scale: abs(scale - 4))
    quick, first = renders.rendered("quick", "every lens", sampling=Sampling(scale, 1))
    renders.world = str(quick / files.WORLD_FILE) if first.world_apart else None
    layers, _ = read_finite(quick / files.LOW_RES_FILE)
    mask, wide = (foreground_mask(layers, first.rays.tiles, grown) for grown in (0, 1))
    if not mask.any():
        raise LfsrError("no lens shows any foreground: check where the camera looks, and the subject")
    # A ring around the foreground is sampled too, where the quick look may have missed something thin.
    places = np.ones_like(mask) if options.metric == "ssim_lens" else wide
    lenses = sampled_lenses(places, lens_count(display, options), request.seed)
    # Path samples of the sampled lenses, with their neighbours, of the render of each scale and number of samples.
    methods: dict[tuple[int, int], list[str]] = {}
    for candidate in wanted:
        methods.setdefault((candidate.scale, candidate.samples), []).append(candidate.method)
    costs = {(scale, samples): len(lenses) * (2 * reach(display, scale, names) + 1)**2
             * math.prod(display.low_views(scale)) * samples for (scale, samples), names in methods.items()}
    reference_paths = len(lenses) * math.prod(display.views) * options.reference_samples
    renders.whole = path_samples(first) + reference_paths + sum(costs.values())
    allowed = math.inf if options.lenses or len(lenses) <= LEAST_LENSES else options.most_paths(display)

    quarters, hits = list[Array](), []
    for part in range(REFERENCE_PARTS):
        halves, reference = renders.rendered(
            f"reference-{part}", f"reference of {len(lenses)} lenses, part {part + 1} of {REFERENCE_PARTS}",
            kind="reference", layers=(), clamp_indirect=0.0, lens_list=tuple(lenses),
            sampling=Sampling(1, max(2, options.reference_samples // REFERENCE_PARTS)))
        for name in files.REFERENCE_FILES:
            image, hit = read_half(halves / name, reference)
            quarters.append(listed_images(image, reference)[:len(lenses)])
            hits.append(hit)
    shown = np.any(hits, 0).reshape(-1)[:len(lenses)]  # which lenses (n,) show any foreground
    if tone := extreme_tone(srgb_encode(np.mean(quarters, 0)[shown])):
        change = "stronger" if tone == "black" else "weaker"
        raise LfsrError(f"the sampled lenses are almost {tone}, so that every setting would seem perfect: make the "
                        f"scene's lights {change}, or check where the camera looks")
    counts = shown if places is wide else np.ones_like(shown)
    # The lower rate: the first render is slowed by its set-up, the reference by showing nothing but foreground.
    rate = min(render_seconds(frame) / path_samples(frame) for frame in (first, reference))
    opening, world = first.seconds["open"], first.seconds.get("world", 0.0)  # rendered apart but at full resolution
    rows: dict[Candidate, Rated] = {}
    groups: dict[tuple[int, int], list[Rated]] = {}  # candidates of one render, by scale and samples
    for candidate in wanted:
        seconds = (opening + rate * candidate.paths(display) + (world if candidate.scale > 1 else 0.0)
                   + finish_seconds(display, candidate.scale, candidate.method))
        rows[candidate] = Rated(**vars(candidate), seconds=seconds)
        groups.setdefault((candidate.scale, candidate.samples), []).append(rows[candidate])

    measuring, choice = 0.0, Choice(None, None)
    means: dict[tuple[int, int], float] = {}  # accuracy of the best method of each group
    # Scales that are less accurate than a smaller one with as many rays. They stay so: more samples reduce the noise,
    # and the other errors are less at the smaller scale.
    beaten: dict[int, int] = {}
    for group, open_rows in sorted(groups.items(), key=lambda pair: min(row.seconds for row in pair[1])):
        why, least = None, min(row.seconds for row in open_rows)
        if least > options.limit:
            why = Notice("candidate-too-slow", {"seconds": options.limit})
        elif choice.chosen is not None and choice.chosen.is_as_cheap(least):
            why = Notice("candidate-not-needed", to_data(choice.chosen.candidate))
        elif group[0] in beaten:
            why = Notice("candidate-beaten", {"scale": beaten[group[0]]})
        elif renders.paths + costs[group] > allowed:
            why = Notice("candidate-over-budget", {"budget": options.budget})
        if why is not None:
            rows |= {row.candidate: dataclasses.replace(row, unmeasured=why) for row in open_rows}
            continue
        wide_by = reach(display, group[0], (row.method for row in open_rows))
        listed, blocks = with_neighbours(lenses, wide_by, display.lenses)
        rendered, _ = renders.rendered(
            "s{}-spp{}".format(*group), "{} lenses at scale {}, {} samples".format(len(lenses), *group),
            sampling=Sampling(*group), lens_list=tuple(listed))
        read_finite(rendered / files.LOW_RES_FILE)  # where it is damaged, no method is to blame
        started = time.perf_counter()
        for row in open_rows:
            try:
                estimated = estimate(scores(rendered, row.method, blocks, quarters), counts, int(places.sum()))
                rows[row.candidate] = dataclasses.replace(row, estimate=estimated)
                means[group] = max(estimated.mean, means.get(group, 0.0))
            except LfsrError as error:
                failed = Notice("candidate-failed", {"error": str(error)})
                rows[row.candidate] = dataclasses.replace(row, unmeasured=failed)
        measuring += time.perf_counter() - started
        rays = {group: group[1] / display.finished_pixels(group[0]) for group in means}
        beaten |= {large[0]: small[0] for large in means for small in means
                   if small[0] < large[0] and rays[small] <= rays[large] and means[small] >= means[large]}
        choice = choose(list(rows.values()), options.target, options.limit)

    rated = tuple(sorted(rows.values(), key=lambda row: row.seconds))
    costliest, spent = rows[wanted[-1]], sum(made.seconds["open"] + made.seconds["render"] for made in renders.frames)
    sample = SampleFacts(len(lenses), int(mask.sum()), costliest.name, costliest.seconds, spent, measuring,
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
