"""A frame folder against a reference folder: is it the same picture, and how close."""

from __future__ import annotations

import dataclasses
from pathlib import Path
from typing import Any

import numpy as np

from lfsr_core.arrays import Array
from lfsr_core.errors import LfsrError
from lfsr_core.frames.foreground import recall
from lfsr_core.frames.frame import MASK_FILE, read_frame
from lfsr_core.frames.reference import Reference, check_reference
from lfsr_core.frames.report import read_report, write_report
from lfsr_core.images.png import read_mask
from lfsr_core.metrics.eia_metrics import compare
from lfsr_core.reconstruct.second_stage import UpscaleOptions, finished_linear, kept_linear

LEAST_SAMPLES = 8


def compare_folders(folder: str | Path, reference: str | Path) -> dict[str, Any]:
    """Metrics of ``folder`` against ``reference``, also written into its report.json.

    Keys as in docs/reference/frame-folder.md. The foreground is the reference's where it
    shows every lens: a mask that lost some must not hide them from the metrics. The finished
    picture is read from eia.exr where that was kept, else made once more.
    LfsrError where either folder is incomplete or the two show different pictures.
    """
    folder, frame = Path(folder), read_frame(folder)
    check_reference(frame, read_frame(reference))
    report = read_report(folder)
    image = kept_linear(folder)
    if image is None:
        image = finished_linear(folder, report.method, UpscaleOptions(
            dilate=report.dilate, weights=report.weights, temporal_averaging=report.share_frames))
    known, mask = Reference.read(reference), read_mask(folder / MASK_FILE, frame.display.lenses)
    metrics = compare(image, (known.half_a, known.half_b), frame.display.lenses, known.foreground_mask(mask),
                      known.lens_list)
    if known.lens_list is None:
        metrics["recall"] = recall(mask, known.hits)
    else:
        metrics["recall"] = sampled_recall(mask, known.foreground, known.lens_list)
    if read_report(folder) != report:
        raise LfsrError(f"{folder} was finished anew while it was compared, so the metrics are of what it was before: "
                        "compare it again")
    write_report(folder, dataclasses.replace(report, metrics=metrics))
    return metrics


def sampled_recall(mask: Array, hits: Array, lens_list: tuple[tuple[int, int], ...]) -> float | None:
    """Recall of ``mask`` (sy, sx), estimated from the true ``hits`` (N,) of listed (row, column) lenses.

    The list samples lenses inside and outside the mask at different rates, so
    each part counts by its size. None where a part is sampled by fewer than
    LEAST_SAMPLES lenses: one stray hit outside would then stand for hundreds.
    """
    rows, columns = np.asarray(lens_list).T
    found = mask[rows, columns]
    counts = []
    for chosen, population in ((found, int(mask.sum())), (~found, int((~mask).sum()))):
        if population and chosen.sum() < min(LEAST_SAMPLES, population):
            return None
        counts.append(population * hits[chosen].mean() if population else 0.0)
    return float(counts[0] / sum(counts)) if sum(counts) else 1.0
