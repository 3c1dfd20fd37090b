"""Compare a frame folder with a reference folder."""

from __future__ import annotations

import dataclasses
from pathlib import Path
from typing import Any

import numpy as np

from lfsr_core.base.arrays import Mask
from lfsr_core.base.errors import LfsrError
from lfsr_core.base.notices import Notice, Tell, silent
from lfsr_core.frames.frame import MASK_FILE, read_frame
from lfsr_core.frames.low_res import recall
from lfsr_core.frames.reference import Reference, check_reference
from lfsr_core.frames.request import Request, Sampling, read_report, write_report
from lfsr_core.images.png import read_mask
from lfsr_core.metrics.eia_metrics import compare
from lfsr_core.optics.lenses import choose_lenses
from lfsr_core.optics.rays import LensList
from lfsr_core.pipeline.make import make
from lfsr_core.process.child import Starts
from lfsr_core.reconstruct.second_stage import finished_linear, read_finished_linear

MIN_SAMPLES = 8


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

    Parameters
    ----------
    request : of the frame's render
    folder, output : the frame folder, and the reference's, in which a reference begun earlier continues
    lenses : number of random lenses, most of them foreground; 0, or as many as there are: all
    samples : of the reference per pixel, in two halves
    """
    mask = read_mask(Path(folder) / MASK_FILE, request.display.lenses)
    chosen = choose_lenses(mask, lenses, request.seed) if 0 < lenses < mask.size else None
    make(dataclasses.replace(request, kind="reference", sampling=Sampling(1, samples), layers=(), clamp_indirect=0.0,
                             output=str(output), lens_list=chosen), blender=blender, tell=tell, overwrite=True)
    return compare_folders(folder, output)


def compare_folders(folder: str | Path, reference: str | Path) -> Metrics:
    """Return the metrics of ``folder`` against ``reference``, and write them into its report.json.

    If the reference shows every lens, the foreground is the reference's, so that a mask that
    lost lenses does not hide them from the metrics. The finished image is read from eia.exr if
    that exists, else computed again.
    LfsrError if a folder is incomplete or the two show different images.
    """
    folder, frame = Path(folder), read_frame(folder)
    check_reference(frame, read_frame(reference))
    report = read_report(folder)
    image = read_finished_linear(folder)
    if image is None:
        image = finished_linear(folder, report.finish)
    known, mask = Reference.read(reference), read_mask(folder / MASK_FILE, frame.display.lenses)
    metrics = compare(image, (known.half_a, known.half_b), frame.display.lenses, known.foreground_mask(mask),
                      known.lens_list)
    if known.lens_list is None:
        metrics["recall"] = recall(mask, known.hits)
    else:
        metrics["recall"] = sampled_recall(mask, known.foreground, known.lens_list)
    if read_report(folder) != report:
        raise LfsrError(f"{folder} was finished again while it was compared, so the metrics belong to the earlier "
                        "image: compare it again")
    write_report(folder, dataclasses.replace(report, metrics=metrics))
    return Metrics(**metrics | {"notes": tuple(Notice(**note) for note in metrics.get("notes", ()))})


def sampled_recall(mask: Mask, hits: Mask, lens_list: LensList) -> float | None:
    """Estimate the recall of ``mask`` (sy, sx) from the true ``hits`` (N,) of listed (row, column) lenses.

    The list samples lenses inside and outside the mask at different rates, so
    each group counts by its size. None if a group is sampled by fewer than
    MIN_SAMPLES lenses, because one stray hit outside would stand for hundreds.
    """
    rows, columns = np.asarray(lens_list).T
    found = mask[rows, columns]
    counts = []
    for chosen, population in ((found, int(mask.sum())), (~found, int((~mask).sum()))):
        if population and chosen.sum() < min(MIN_SAMPLES, population):
            return None
        counts.append(population * hits[chosen].mean() if population else 0.0)
    return float(counts[0] / sum(counts)) if sum(counts) else 1.0
