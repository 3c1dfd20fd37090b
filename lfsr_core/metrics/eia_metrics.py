"""How close an EIA, or a frame folder, is to its reference: every metric of docs/reference/metrics.md.

Images are compared as plain sRGB values clipped to [0, 1], whatever the scene's view transform. A reference is two
renders a and b with equal samples. Errors against the two have no noise in common, so the mean of their product, as of
"split" metrics, does not grow with the reference's noise.
"""

import dataclasses
import math
from pathlib import Path
from typing import Any, Self

import numpy as np

from lfsr_core.base.arrays import Array, Mask
from lfsr_core.base.messages import LfsrError, Notice, Tell, silent
from lfsr_core.base.records import to_data
from lfsr_core.frames import frame as files
from lfsr_core.frames.folder import first_difference, phrases
from lfsr_core.frames.frame import Frame, Request, Sampling, read_frame, read_report, write_report
from lfsr_core.images.color import srgb_encode
from lfsr_core.images.image_files import read_finite, read_mask
from lfsr_core.optics.rays import LensList, choose_lenses, to_elemental_images, to_views, views_per_lens
from lfsr_core.pipeline.make import make
from lfsr_core.process.child import Starts
from lfsr_core.reconstruct.averaging import neighbours_of
from lfsr_core.reconstruct.second_stage import finished_linear, read_finished_linear
from lfsr_core.reconstruct.upscaler import foreground_mask, over_background, recall

try:
    import flip_evaluator
except ImportError:  # its wheels are for one Python version each, so the Blender extension has none
    flip_evaluator = None

NORMAL_95 = 1.959964  # standard errors around the mean that contain 95 % of samples
Estimate = tuple[float | None, float | None]  # mean and half-width of its 95 % interval; None: unknown
METRIC_NAMES = ("p", "ssim_eia", "ssim_eia_fg", "ssim_lens", "ssim_lens_fg", "psnr_fg", "ssim_views_fg",
                "ssim_eia_plain", "ssim_ceiling", "flip")
# For a reference of only some lenses: SSIM windows cannot cross into lenses that it does not show.
SAMPLED_NAMES = ("p", "ssim_lens", "ssim_lens_fg", "psnr_fg", "ssim_lens_plain", "ssim_lens_ceiling", "flip")
MIN_SAMPLES = 8
SAME_AS_REFERENCE = ("display", "convention", "frame", "world_visible", "light")
MOST_NAME = 60  # characters of a scene's name in a message
SSIM_SIGMA, SSIM_WINDOW = 1.5, 11
SSIM_BORDER = SSIM_WINDOW // 2
HALF_WINDOW: Array = np.exp(-np.arange(SSIM_BORDER + 1) ** 2 / (2 * SSIM_SIGMA**2))
HALF_WINDOW = HALF_WINDOW / (2 * HALF_WINDOW.sum() - HALF_WINDOW[0])  # from its centre outwards; the whole sums to 1
SSIM_C1, SSIM_C2 = 0.01**2, 0.03**2  # for data in [0, 1], Wang et al. 2004
BAND_ROWS = 256
STRIP_ROWS = 16  # rows whose sums fit into a core's cache


@dataclasses.dataclass(frozen=True)
class Reference:
    """A reference folder in memory."""

    folder: Path  # that it was read from
    frame: Frame  # how it was rendered
    # half_a, half_b: (H, W, 3) scene-linear over the background; all lenses, or side by side those of the list
    half_a: Array
    half_b: Array
    hits: Mask  # (rows, columns) bool, the tiles where either half shows foreground

    @classmethod
    def read(cls, folder: str | Path) -> Self:
        """Read a reference; LfsrError where a file is missing or of another size, or both halves are the same."""
        folder = Path(folder)
        frame = read_frame(folder)
        (half_a, hits_a), (half_b, hits_b) = (read_half(folder / name, frame) for name in files.REFERENCE_FILES)
        if half_a.any() and np.array_equal(half_a, half_b):
            raise LfsrError(f"both halves in {folder} are the same image, so neither shows the other's noise: "
                            "render the reference again with this version")
        return cls(folder, frame, half_a, half_b, hits_a | hits_b)

    @property
    def lens_list(self) -> tuple[tuple[int, int], ...] | None:
        """(row, column) of the lenses it shows, None for all."""
        return self.frame.lens_list

    @property
    def lenses(self) -> Array:
        """(n, 2) rows and columns of the lenses it shows, in the order of its tiles."""
        sx, sy = self.frame.display.lenses
        return np.argwhere(np.ones((sy, sx), bool)) if self.lens_list is None else np.array(self.lens_list)

    @property
    def foreground(self) -> Mask:
        """(n,) bool: which of ``lenses`` show foreground."""
        return self.hits.reshape(-1)[:len(self.lenses)]


def listed_images(pixels: Array, frame: Frame) -> Array:
    """Return the elemental images (n, py, px, 3) of the lenses in a render (H, W, 3), without spare tiles."""
    images = to_elemental_images(pixels, frame.rays.tiles)
    count = images.shape[0] * images.shape[1] if frame.lens_list is None else len(frame.lens_list)
    return images.reshape(-1, *images.shape[2:])[:count]


def read_half(path: Path, frame: Frame) -> tuple[Array, Mask]:
    """Read one half of a reference: (H, W, 3) scene-linear over its background, and its foreground (rows, columns).

    LfsrError where the file is missing or of another size than ``frame``.
    """
    layers = read_finite(path)[0]
    return over_background(layers, frame, str(path)), foreground_mask(layers, frame.rays.tiles)


def check_reference(frame: Frame, reference: Frame) -> None:
    """LfsrError unless ``reference`` shows at full resolution what ``frame`` shows."""
    if reference.scale != 1:
        raise LfsrError(f"the reference has scale {reference.scale}, but it must be 1: render it with 'lfsr reference'")
    wanted = {name: vars(frame)[name] for name in SAME_AS_REFERENCE}
    # Older folders do not know their light.
    wanted["light"] = wanted["light"] if reference.light and frame.light else reference.light
    if name := first_difference(vars(reference), wanted):
        theirs, ours = phrases(name, vars(reference)[name], vars(frame)[name])
        raise LfsrError(f"the reference was rendered with {theirs}, but the frame with {ours}: "
                        "render the reference of the same frame in the same way")
    ours_at, theirs_at = ([of.array.distance, *of.array.half_size, of.array.spacing, *(of.array.clip or (0, 0)),
                         *np.ravel(of.matrix_world)] for of in (frame, reference))
    if not np.allclose(ours_at, theirs_at, rtol=1e-5, atol=1e-5 * frame.array.distance):
        if frame.scene != reference.scene:
            theirs, ours = (of.scene[:MOST_NAME] or "one without a name" for of in (reference, frame))
            raise LfsrError(f"the reference shows another scene, {theirs}, but the frame {ours}: compare with the "
                            "reference of the same scene")
        distances = [of.array.distance for of in (reference, frame)]
        where = (f"its display plane is {distances[0]:.4g} from the cameras, the frame's {distances[1]:.4g}"
                 if not math.isclose(*distances, rel_tol=1e-5) else
                 "its cameras stand, face or clip elsewhere, as with another camera or subject")
        raise LfsrError(f"the reference does not show what the frame shows: {where}. Render both of the same scene "
                        "in the same way")
    if frame.lens_list is not None and frame.lens_list != reference.lens_list:
        raise LfsrError(f"the reference shows other lenses than the {len(frame.lens_list)} of the frame: "
                        "render it for the same list")


def compare(image: Array, halves: tuple[Array, Array], lenses: tuple[int, int], mask: Mask,
            lens_list: LensList | None = None) -> dict[str, Any]:
    """Return every metric of an EIA by name; None if it cannot be known.

    ``image`` (H, W, 3): scene-linear, in view order; ``halves``: the two independent halves of the reference,
    scene-linear, (H, W, 3) or tiles of the listed lenses as ``RayLayout`` places them; ``lenses``: (sx, sy); ``mask``
    (sy, sx): the foreground. With ``lens_list``, (row, column) of the reference's lenses, drawn at random inside and
    outside the mask, the metrics are estimates for the whole EIA, and "ci95" holds the half-widths of their 95 %
    confidence intervals.

    The names are METRIC_NAMES, or with ``lens_list`` SAMPLED_NAMES, "lenses" and "ci95"; without the package
    flip-evaluator "flip" is None and "notes" tells so. LfsrError if shapes differ.
    """
    px, py = views_per_lens(image, lenses)
    if mask.shape != lenses[::-1]:
        raise LfsrError(f"the foreground mask has shape {mask.shape}, expected {lenses[::-1]}, one entry per lens: "
                        "upscale the frame again")
    notes = {} if flip_evaluator else {"notes": [to_data(Notice("flip-missing"))]}
    if lens_list is not None:
        rows, columns = np.asarray(lens_list).T
        chosen = to_elemental_images(image, lenses)[rows, columns]
        count, channels = len(chosen), image.shape[2]
        encoded = [srgb_encode(chosen)]
        for half in halves:  # its first tiles are those of the lenses
            if half.shape[0] % py or half.shape[1] % px or half.shape[0] * half.shape[1] < count * py * px:
                raise _shape_error(half.shape, (f"{count} tiles of", py, px, channels))
            tiles = to_elemental_images(half, (half.shape[1] // px, half.shape[0] // py)).reshape(-1, py, px, channels)
            encoded.append(srgb_encode(tiles[:count]))
        x, a, b = encoded
        mean = (a + b) / 2
        # Metrics (N,) of each elemental image on its own; "psnr" holds squared errors.
        values = {
            "ssim_lens": stacked_ssim(x, a, b).mean((1, 2)), "ssim_lens_ceiling": stacked_ssim(a, b, b).mean((1, 2)),
            "ssim_lens_plain": stacked_ssim(x, mean, mean).mean((1, 2)),
            "psnr": np.mean((x - a) * (x - b), (1, 2, 3), dtype=np.float64)}
        if flip_evaluator:
            values["flip"] = np.array([mean_flip(*pair) for pair in zip(x, mean, strict=True)])
        in_foreground = mask[rows, columns]
        estimates: dict[str, Estimate] = {
            name: stratified(values[name], in_foreground, mask) if name in values else (None, None)
            for name in ("ssim_lens", "ssim_lens_plain", "ssim_lens_ceiling", "flip")}
        for name in ("ssim_lens", "psnr"):
            estimates[f"{name}_fg"] = stratum(values[name][in_foreground], int(mask.sum()))
        # Decibels and their half-width (first order) from a squared error and its half-width.
        error, width = estimates["psnr_fg"]
        estimates["psnr_fg"] = (None, None) if error is None or error <= 0 else (
            psnr(error), None if width is None else 10 / math.log(10) * width / error)
        metrics = {"p": mean_of(mask)} | {name: value for name, (value, _) in estimates.items()}
        return {**{name: metrics[name] for name in SAMPLED_NAMES},
                "lenses": len(lens_list), "ci95": {name: width for name, (_, width) in estimates.items()}} | notes
    for half in halves:
        if half.shape != image.shape:
            raise _shape_error(half.shape, image.shape)
    x, a, b = srgb_encode(image), srgb_encode(halves[0]), srgb_encode(halves[1])
    mean, any_foreground, (sx, sy) = (a + b) / 2, bool(mask.any()), lenses
    foreground = np.kron(mask, np.ones((py, px), bool))
    shown, of_a, of_b = (values[foreground] for values in (x, a, b))
    # Windows cross from lens to lens in ``local``, but not in ``alone``.
    local, inside = inside_border(split_ssim_map(x, a, b)), inside_border(foreground)
    alone, views_ssim = lens_ssim(x, a, b, (sx, sy)), None
    if any_foreground:  # views are small, so their borders count
        views = [to_views(values, (sx, sy)).reshape(-1, sy, sx, x.shape[2]) for values in (x, a, b)]
        views_ssim = mean_of(stacked_ssim(*views)[:, mask])
    return {
        "p": mean_of(mask), "ssim_eia": mean_of(local) if local.size else None,  # smaller than a window
        "ssim_eia_fg": mean_of(local[inside]) if inside.any() else None,
        "ssim_lens": mean_of(alone), "ssim_lens_fg": mean_of(alone[mask]) if any_foreground else None,
        "psnr_fg": psnr(mean_of((shown - of_a) * (shown - of_b))) if any_foreground else None,
        "ssim_views_fg": views_ssim, "ssim_eia_plain": split_ssim(x, mean, mean) if local.size else None,
        "ssim_ceiling": split_ssim(a, b, b) if local.size else None, "flip": mean_flip(x, mean),
    } | notes


def mean_flip(image: Array, reference: Array) -> float | None:
    """Mean LDR-FLIP (Andersson et al. 2020) of two (H, W, 3) sRGB images in [0, 1]; None without its package."""
    if flip_evaluator is None:
        return None
    images = [np.ascontiguousarray(values, np.float32) for values in (reference, image)]
    return float(flip_evaluator.evaluate(*images, "LDR", inputsRGB=True, applyMagma=False, computeMeanError=True)[1])


def _shape_error(reference: tuple[int, ...], expected: object) -> LfsrError:
    return LfsrError(f"the reference has shape {reference}, but {expected} was expected: "
                     "render the reference of the same frame")


def stratum(values: Array, population: int) -> Estimate:
    """Estimate the mean over ``population`` lenses from the ``values`` of a random sample."""
    if len(values) == 0:
        return None, None
    if len(values) == population:
        return mean_of(values), 0.0
    if len(values) == 1:
        return mean_of(values), None
    error = math.sqrt(values.var(ddof=1) / len(values) * (1 - len(values) / population))
    return mean_of(values), student_95(len(values) - 1) * error


def stratified(values: Array, in_foreground: Mask, mask: Mask) -> Estimate:
    """Estimate the mean over all lenses from samples inside and outside ``mask`` (sy, sx)."""
    total, squared_width = 0.0, 0.0
    for chosen, population in ((in_foreground, int(mask.sum())), (~in_foreground, int((~mask).sum()))):
        if population == 0:
            continue
        mean, width = stratum(values[chosen], population)
        if mean is None:
            return None, None
        total += mean * population / mask.size
        squared_width = math.nan if width is None else squared_width + (width * population / mask.size) ** 2
    return total, None if math.isnan(squared_width) else math.sqrt(squared_width)


def student_95(freedom: int) -> float:
    """Two-sided 95 % quantile of Student's t, within 1 % from 3 degrees of freedom on.

    Cornish-Fisher expansion (Abramowitz and Stegun 26.7.5).
    """
    z = NORMAL_95
    terms = ((z**3 + z) / 4, (5 * z**5 + 16 * z**3 + 3 * z) / 96, (3 * z**7 + 19 * z**5 + 17 * z**3 - 15 * z) / 384)
    return z + sum(term / float(freedom) ** (power + 1) for power, term in enumerate(terms))


def _metric(meaning: str) -> Any:
    return dataclasses.field(default=None, metadata={"meaning": meaning})


@dataclasses.dataclass(frozen=True)
class Metrics:
    """How close a finished frame is to its reference, see docs/reference/metrics.md; None: not measured.

    A reference of all lenses has ``ssim_eia``, ``ssim_eia_fg``, ``ssim_eia_plain``, ``ssim_ceiling`` and
    ``ssim_views_fg``; one of sampled lenses has ``ssim_lens_plain``, ``ssim_lens_ceiling``, ``lenses`` and ``ci95``.
    """

    p: float | None = _metric("fraction of the lenses that show foreground")
    ssim_eia: float | None = _metric("SSIM of the whole EIA (split: the reference's noise cancels)")
    ssim_eia_fg: float | None = _metric("the same, foreground elemental images only")
    ssim_lens: float | None = _metric("mean SSIM of single elemental images (split)")
    ssim_lens_fg: float | None = _metric("the same, foreground lenses only")
    psnr_fg: float | None = _metric("PSNR in dB of foreground elemental images (split)")
    ssim_views_fg: float | None = _metric("SSIM of the decoded views, foreground (split)")
    ssim_eia_plain: float | None = _metric("ordinary SSIM against the mean of the halves, as in the paper")
    ssim_ceiling: float | None = _metric("ordinary SSIM of one half of the reference against the other")
    ssim_lens_plain: float | None = _metric("mean ordinary SSIM of elemental images against the mean of the halves")
    ssim_lens_ceiling: float | None = _metric("the same, one half of the reference against the other")
    flip: float | None = _metric("mean FLIP difference, 0 is identical")
    recall: float | None = _metric("fraction of the reference's foreground lenses in the mask")
    lenses: int | None = None  # lenses of the sample
    # half-widths of the 95 % confidence intervals of a sample, by metric
    ci95: dict[str, float | None] = dataclasses.field(default_factory=dict)
    notes: tuple[Notice, ...] = ()  # what the user should know


def compare_with_reference(request: Request, folder: str | Path, output: str | Path, lenses: int, samples: int,
                           blender: str | Starts | None = None, tell: Tell = silent) -> Metrics:
    """Render the reference of a finished frame, and return its metrics as ``compare_folders`` does.

    ``request``: of the frame's render in ``folder``; ``output``: the reference's folder, where an interrupted one
    continues; ``lenses``: number of random lenses, most of them foreground; 0, or as many as there are: all of them;
    ``samples``: of the reference per pixel, in two halves.
    """
    mask = read_mask(Path(folder) / files.MASK_FILE, request.display.lenses)
    chosen = choose_lenses(mask, lenses, request.seed) if 0 < lenses < mask.size else None
    make(dataclasses.replace(request, kind="reference", sampling=Sampling(1, samples), layers=(), clamp_indirect=0.0,
                             output=str(output), lens_list=chosen), blender=blender, tell=tell, overwrite=True)
    return compare_folders(folder, output)


def compare_folders(folder: str | Path, reference: str | Path) -> Metrics:
    """Return the metrics of ``folder`` against ``reference``, and write them into its report.json.

    If the reference shows every lens, the foreground is the reference's, so that a mask that lost lenses does not hide
    them from the metrics. The finished image is read from eia.exr if that exists, else computed again. LfsrError if a
    folder is incomplete or the two show different images.
    """
    folder, frame = Path(folder), read_frame(folder)
    check_reference(frame, read_frame(reference))
    report = read_report(folder)
    if (image := read_finished_linear(folder)) is None:
        beside = tuple(neighbour.number for neighbour in neighbours_of(folder, frame, report.finish.temporal_averaging))
        if beside != report.neighbours:
            raise LfsrError(f"{folder} was averaged with frames {str(report.neighbours)[:60]}, but those beside it are "
                            f"now {beside or 'none'}: finish it again, then compare")
        image = finished_linear(folder, report.finish)
    truth, mask = Reference.read(reference), read_mask(folder / files.MASK_FILE, frame.display.lenses)
    metrics = compare(image, (truth.half_a, truth.half_b), frame.display.lenses,
                      truth.hits if truth.lens_list is None else mask, truth.lens_list)
    metrics["recall"] = (recall(mask, truth.hits) if truth.lens_list is None
                         else sampled_recall(mask, truth.foreground, truth.lens_list))
    if read_report(folder) != report:
        raise LfsrError(f"{folder} was finished again while it was compared, so the metrics belong to the earlier "
                        "image: compare it again")
    write_report(folder, dataclasses.replace(report, metrics=metrics))
    return Metrics(**metrics | {"notes": tuple(Notice(**note) for note in metrics.get("notes", ()))})


def sampled_recall(mask: Mask, hits: Mask, lens_list: LensList) -> float | None:
    """Estimate the recall of ``mask`` (sy, sx) from the true ``hits`` (N,) of listed (row, column) lenses.

    The list samples lenses inside and outside the mask at different rates, so each group counts by its size. None if a
    group is sampled by fewer than MIN_SAMPLES lenses, because one stray hit outside would stand for hundreds.
    """
    rows, columns = np.asarray(lens_list).T
    selected, counts = mask[rows, columns], []
    for chosen, population in ((selected, int(mask.sum())), (~selected, int((~mask).sum()))):
        if population and chosen.sum() < min(MIN_SAMPLES, population):
            return None
        counts.append(population * hits[chosen].mean() if population else 0.0)
    return float(counts[0] / sum(counts)) if sum(counts) else 1.0


def split_ssim_map(image: Array, half_a: Array, half_b: Array) -> Array:
    """Local SSIM (H, W, C) of ``image`` against two noisy halves of one reference.

    All are (H, W, C) in [0, 1]. Gaussian window of 11 × 11, σ = 1.5, data range 1, borders mirrored. Estimates: of the
    reference's variance cov(a, b), of its squared mean mean(a) · mean(b), of its covariance with the image cov(image,
    (a + b) / 2). With a = b this is plain SSIM.
    """
    local = np.empty(image.shape, np.float64 if image.size < 1 << 26 else np.float32)
    for start in range(0, image.shape[0], BAND_ROWS):
        # Windows cross the band's edge, so the band is computed with a margin that is then cut off.
        first, end = max(0, start - SSIM_BORDER), start + BAND_ROWS
        margin = slice(first, end + SSIM_BORDER)
        x, a, b = (np.asarray(values[margin], np.float64) for values in (image, half_a, half_b))
        mean_x, mean_a, mean_b = blur(x), blur(a), blur(b)
        mean_r = (mean_a + mean_b) / 2
        variance_x: Array = blur(x * x) - mean_x * mean_x
        variance_r: Array = blur(a * b) - mean_a * mean_b
        covariance = blur(x * (a + b)) / 2 - mean_x * mean_r
        light = (2 * mean_x * mean_r + SSIM_C1) / (mean_x * mean_x + mean_a * mean_b + SSIM_C1)
        # In flat places noise can push cov(a, b) below 0, but the sum of two variances is never negative.
        band = np.divide(light * (2 * covariance + SSIM_C2), np.maximum(variance_x + variance_r, 0) + SSIM_C2)
        local[start:end] = band[start - first:end - first]
    return local


def split_ssim(image: Array, half_a: Array, half_b: Array) -> float:
    """Mean of ``split_ssim_map`` where the window lies inside the image; plain SSIM where both halves are the same."""
    return mean_of(inside_border(split_ssim_map(image, half_a, half_b)))


def stacked_ssim(images: Array, halves_a: Array, halves_b: Array) -> Array:
    """Local split SSIM (N, h, w) of many separate small images (N, h, w, C), mean over C."""
    count, height, width, channels = images.shape
    step, parts = max(1, 512 // channels), []  # images in one call
    for start in range(0, count, step):
        # As channels of one image, each is filtered on its own, all in one call.
        x, a, b = (np.moveaxis(stack[start:start + step], 0, 2).reshape(height, width, -1)
                   for stack in (images, halves_a, halves_b))
        parts.append(np.moveaxis(split_ssim_map(x, a, b).reshape(height, width, -1, channels).mean(-1), 2, 0))
    return np.concatenate(parts)


def lens_ssim(image: Array, half_a: Array, half_b: Array, lenses: tuple[int, int]) -> Array:
    """Split SSIM (sy, sx) of every elemental image of EIAs (H, W, C) on its own; ``lenses``: (sx, sy)."""
    stacks = [to_elemental_images(values, lenses) for values in (image, half_a, half_b)]
    x, a, b = (stack.reshape(-1, *stack.shape[2:]) for stack in stacks)
    return np.asarray(stacked_ssim(x, a, b).mean((1, 2), dtype=np.float64)).reshape(lenses[::-1])


def psnr(squared_error: float) -> float | None:
    """Decibels for data in [0, 1]; None if the error is smaller than the reference can resolve."""
    return -10 * math.log10(squared_error) if squared_error > 0 else None


def inside_border(values: Array) -> Array:
    """Rows and columns whose whole SSIM window lies inside the image."""
    return values[SSIM_BORDER:-SSIM_BORDER, SSIM_BORDER:-SSIM_BORDER]


def mean_of(values: Array) -> float:
    """Mean as a float, summed in double precision."""
    return float(np.mean(values, dtype=np.float64))


def blur(values: Array) -> Array:
    """Blur a float image (H, W, C) by the window of SSIM, keeping its type; beyond its edge it is mirrored.

    Neither side may be shorter than half the window.
    """
    half = HALF_WINDOW.astype(values.dtype)
    padded = np.pad(values, ((SSIM_BORDER, SSIM_BORDER), (0, 0), (0, 0)), mode="symmetric")
    result = np.empty_like(values)
    for start in range(0, len(values), STRIP_ROWS):
        strip = padded[start:start + STRIP_ROWS + 2 * SSIM_BORDER]
        across = np.pad(_along(strip, half), ((0, 0), (SSIM_BORDER, SSIM_BORDER), (0, 0)), mode="symmetric")
        result[start:start + STRIP_ROWS] = _along(across.swapaxes(0, 1), half).swapaxes(0, 1)
    return result


def _along(padded: Array, half: Array) -> Array:
    """Weighted sum along the first axis; the result is shorter by the window less one."""
    reach = len(half) - 1
    count = len(padded) - 2 * reach
    total: Array = half[0] * padded[reach:reach + count]
    for offset in range(1, reach + 1):
        pair = padded[reach - offset:reach - offset + count] + padded[reach + offset:reach + offset + count]
        pair *= half[offset]
        total += pair
    return total
