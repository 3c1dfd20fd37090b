"""One cell of a chart: one render, finished by one method, timed and measured; and what a method costs."""

from __future__ import annotations

import dataclasses
import os
import shutil
import statistics
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from lfsr_core import __version__
from lfsr_core.arrays import Array
from lfsr_core.errors import LfsrError
from lfsr_core.frames.foreground import foreground_mask, recall
from lfsr_core.frames.frame import FRAME_FILE, LOW_RES_FILE, read_frame
from lfsr_core.frames.reference import Reference, check_reference
from lfsr_core.frames.report import Report
from lfsr_core.images.exr import read_layers
from lfsr_core.metrics.eia_metrics import compare
from lfsr_core.reconstruct.method_name import MethodName
from lfsr_core.reconstruct.second_stage import finished_linear, upscale_frame
from lfsr_lab.experiments.cells import Cells, Fingerprint, digest
from lfsr_lab.experiments.chart.intervals import lens_intervals
from lfsr_lab.experiments.chart.records import MethodCost, Metrics
from lfsr_lab.experiments.chart.settings import CELL_FOLDER, FRESH_FOLDER
from lfsr_lab.experiments.environment import load_average

CELL_FORMAT = 3
STAGES = ("load", "mask", "upscale", "assemble", "color", "write")


@dataclasses.dataclass(frozen=True)
class Times:
    """Seconds of the second stage; the fields are those of ``records.Cell``."""

    second_stage_seconds: tuple[float, ...]
    stage_seconds: dict[str, float]
    notes: tuple[str, ...]
    load_average: float | None


@dataclasses.dataclass(frozen=True)
class KeptCell:
    """What is measured of a render and a method, as the bench folder keeps it."""

    method: str  # its name
    metrics: Metrics  # how near it comes to the reference
    ci95: dict[str, float | None]  # half-widths of the metrics' 95 % intervals
    times: Times  # of the second stage


@dataclasses.dataclass(frozen=True)
class FreshSeconds:
    """Seconds of `lfsr upscale` in a process of its own, start included."""

    seconds: float


@dataclasses.dataclass(frozen=True)
class Effort:
    """What is measured although a kept cell fits."""

    repeats: int  # timed runs of the second stage
    again: bool = False  # everything is measured afresh
    retime: bool = False  # the times are taken afresh, the metrics kept


@dataclasses.dataclass(frozen=True)
class Target:
    """What the cells of a scene are measured against."""

    reference: Reference
    mask: Array  # (sy, sx) bool, the foreground that counts

    @classmethod
    def read(cls, folder: Path, mask: Array | None) -> Target:
        """The reference in ``folder``; ``mask`` (sy, sx) is the foreground where it shows only some lenses."""
        reference = Reference.read(folder)
        if reference.lens_list is not None and mask is None:
            raise LfsrError(f"{folder} shows only some lenses, so a low-resolution render must show which are "
                            "foreground, but there is none: run it without --only-measure")
        return cls(reference, reference.foreground_mask(mask))


def cell(folder: Path, name: str, target: Target, effort: Effort) -> KeptCell:
    """The cell of a render and a method, measured unless it is kept and still fits.

    Parameters
    ----------
    folder : frame folder of the render; it is not written to
    name : the method
    target : what it is measured against
    effort : what is measured in any case

    Raises
    ------
    LfsrError : the method cannot finish this frame
    """
    cells, mark = Cells(folder.parent / CELL_FOLDER, KeptCell), fingerprint(folder, name, target)
    file_name = f"{folder.name}-{name}"
    known = None if effort.again else cells.read(file_name, mark)
    if known and not effort.retime and len(known.times.second_stage_seconds) >= effort.repeats:
        return known
    check_reference(read_frame(folder), target.reference.frame)
    with scratch_copy(folder) as copy:
        metrics, ci95 = (known.metrics, known.ci95) if known else _metrics(copy, name, target)
        found = KeptCell(name, metrics, ci95, _times(copy, name, effort.repeats, warm=known is None))
    cells.write(file_name, mark, found)
    return found


def fingerprint(folder: Path, name: str, target: Target) -> Fingerprint:
    """What a cell depends on, as hashes: a change means that it must be measured again."""
    method = MethodName.parse(name)
    return {"format": CELL_FORMAT, "lfsr": __version__,
            "frame": digest((folder / FRAME_FILE).read_bytes()),
            "reference": digest((target.reference.folder / FRAME_FILE).read_bytes()),
            "mask": digest(target.mask.tobytes()), "weights": method.weights_digest, **method.versions}


def _metrics(folder: Path, name: str, target: Target) -> tuple[Metrics, dict[str, float | None]]:
    """Every metric and its interval, whether the reference is whole or of sampled lenses."""
    image, reference, mask = finished_linear(folder, name), target.reference, target.mask
    halves, frame = (reference.half_a, reference.half_b), read_frame(folder)
    lenses = frame.display.lenses
    found: dict[str, Any] = compare(image, halves, lenses, mask, lens_list=reference.lens_list)
    if reference.lens_list is None:
        found["ci95"] = lens_intervals(image, *halves, lenses, mask)
        found["recall"] = recall(foreground_mask(read_layers(folder / LOW_RES_FILE), frame.rays.tiles), mask)
    return Metrics(**{field.name: found.get(field.name) for field in dataclasses.fields(Metrics)}), found["ci95"]


def _times(folder: Path, name: str, repeats: int, warm: bool) -> Times:
    """Seconds of ``repeats`` runs; if not ``warm``, of runs after one that is not counted.

    That one loads what a running program has loaded.
    """
    if not warm:
        upscale_frame(folder, name)
    load = load_average()
    runs = [_timed(folder, name) for _ in range(repeats)]
    stages = {stage: statistics.median(report.seconds[stage] for _, report in runs) for stage in STAGES}
    return Times(tuple(seconds for seconds, _ in runs), stages, runs[-1][1].notes, load)


def _timed(folder: Path, name: str) -> tuple[float, Report]:
    started = time.perf_counter()
    report = upscale_frame(folder, name)
    return round(time.perf_counter() - started, 4), report


@contextmanager
def scratch_copy(folder: Path) -> Iterator[Path]:
    """A new folder beside ``folder`` with the same render in it, so that other readers of the render see no change."""
    with tempfile.TemporaryDirectory(prefix=".chart-", dir=folder.parent) as name:
        for file in (FRAME_FILE, *read_frame(folder).render_files):
            try:
                os.link(folder / file, Path(name) / file)
            except OSError:  # another file system, or one without links
                shutil.copyfile(folder / file, Path(name) / file)
        yield Path(name)


def method_cost(name: str, scale: int, low_views: tuple[int, int], seconds: float | None = None) -> MethodCost:
    """What a method costs; Open Image Denoise, whose size is not known, is not counted.

    Parameters
    ----------
    name : the method
    scale : of its networks
    low_views : (w, h) pixels of a low-resolution elemental image
    seconds : of a process of its own
    """
    counts = [_count(part, scale, low_views) for part in MethodName.parse(name).networks]
    if not counts:
        return MethodCost(name, None, None, seconds)
    return MethodCost(name, sum(count for count, _ in counts), float(sum(work for _, work in counts)), seconds)


def _count(part: str, scale: int, low_views: tuple[int, int]) -> tuple[int, float]:
    """Parameters of a network, and its multiply-adds per low-resolution pixel."""
    from lfsr_lab.networks.cost import multiply_adds, parameters
    from lfsr_lab.networks.networks import build

    network = build(part, scale).eval()
    return parameters(network), multiply_adds(network, *low_views[::-1])


def fresh_seconds(folder: Path, name: str, chart_folder: Path, again: bool = False) -> float:
    """Wall seconds of `lfsr upscale` in a process of its own, start included; measured once per method and chart.

    Parameters
    ----------
    folder : frame folder of the render that is upscaled; it is not written to
    name : the method
    chart_folder : bench folder that keeps the seconds
    again : measure it although it is known
    """
    cells, mark = Cells(chart_folder / FRESH_FOLDER, FreshSeconds), {"weights": MethodName.parse(name).weights_digest}
    if again:
        cells.path(name).unlink(missing_ok=True)
    return cells.get(name, mark, lambda: FreshSeconds(_upscaled(folder, name))).seconds


def _upscaled(folder: Path, name: str) -> float:
    with scratch_copy(folder) as copy:
        return _process_seconds([sys.executable, "-m", "lfsr_core.cli", "upscale", str(copy), "--method", name])


def _process_seconds(command: list[str]) -> float:
    started = time.perf_counter()
    finished = subprocess.run(command, capture_output=True, text=True, check=False)
    if finished.returncode:
        raise LfsrError(f"`{' '.join(command[3:])}` failed ({finished.stderr.strip()}): choose another method")
    return round(time.perf_counter() - started, 3)
