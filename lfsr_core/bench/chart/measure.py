"""One cell of a chart: one render, finished by one method, timed and measured."""

from __future__ import annotations

import dataclasses
import hashlib
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

import numpy as np

from lfsr_core import __version__
from lfsr_core.bench.chart.settings import CELL_FOLDER
from lfsr_core.errors import LfsrError
from lfsr_core.files import read_json, write_json
from lfsr_core.frames.foreground import foreground_mask, recall
from lfsr_core.frames.frame import FRAME_FILE, LOW_RES_FILE, read_frame
from lfsr_core.frames.reference import Reference, check_reference
from lfsr_core.images.exr import read_layers
from lfsr_core.metrics.eia_metrics import compare
from lfsr_core.metrics.intervals import lens_intervals
from lfsr_core.reconstruct.method_name import MethodName
from lfsr_core.reconstruct.networks import catalogue
from lfsr_core.reconstruct.second_stage import finished_linear, upscale_frame

CELL_FORMAT = 1
STAGES = ("load", "mask", "upscale", "assemble", "color", "write")


@dataclasses.dataclass(frozen=True)
class Target:
    """What the cells of a scene are measured against.

    Attributes
    ----------
    reference : the reference
    mask : (sy, sx) bool, the foreground that counts
    """

    reference: Reference
    mask: np.ndarray

    @classmethod
    def read(cls, folder: Path, mask: np.ndarray | None) -> Target:
        """The reference in ``folder``; ``mask`` (sy, sx) is the foreground where it shows only some lenses."""
        reference = Reference.read(folder)
        if reference.lens_list is not None and mask is None:
            raise LfsrError(f"{folder} shows only some lenses, so a low-resolution render must say which are "
                            "foreground, but there is none: run it without --only-measure")
        return cls(reference, reference.foreground_mask(mask))


def cell(folder: Path, name: str, target: Target, repeats: int, again: bool = False,
         retime: bool = False) -> dict[str, Any]:
    """The cell of frame folder ``folder`` and method ``name``; measured unless its file is there and still fits.

    ``again`` measures it in any case, ``retime`` keeps metrics that fit and takes new times. The folder itself is not
    written to. LfsrError where the method cannot finish this frame.
    """
    path = folder.parent / CELL_FOLDER / f"{folder.name}-{name}.json"
    print_of = fingerprint(folder, name, target)
    known = read_json(path, "a measured cell") if path.exists() and not again else {}
    fits = known.get("fingerprint") == print_of
    if fits and not retime and len(known["second_stage_seconds"]) >= repeats:
        return known
    check_reference(read_frame(folder), target.reference.frame)
    with scratch_copy(folder) as copy:
        found = known if fits else {"fingerprint": print_of, "method": name, **_measured(copy, name, target)}
        found |= _times(copy, name, repeats, warm=not fits)
    write_json(path, found)
    return found


def fingerprint(folder: Path, name: str, target: Target) -> dict[str, Any]:
    """What a cell depends on, as hashes: a change means that it must be measured again."""
    return {"format": CELL_FORMAT, "lfsr": __version__,
            "frame": _hash((folder / FRAME_FILE).read_bytes()),
            "reference": _hash((target.reference.folder / FRAME_FILE).read_bytes()),
            "mask": _hash(target.mask.tobytes()),
            "weights": MethodName.parse(name).weights_digest,
            **MethodName.parse(name).versions}


def _hash(data: bytes) -> str:
    return hashlib.sha256(data).hexdigest()[:16]


def _measured(folder: Path, name: str, target: Target) -> dict[str, Any]:
    metrics = _metrics(finished_linear(folder, name), target)
    if target.reference.lens_list is None:
        frame = read_frame(folder)
        mask = foreground_mask(read_layers(folder / LOW_RES_FILE), frame.rays.tiles)
        metrics["recall"] = recall(mask, target.mask)
    return {"metrics": metrics}


def _times(folder: Path, name: str, repeats: int, warm: bool) -> dict[str, Any]:
    """Seconds of ``repeats`` runs; if not ``warm``, of runs after one that is not counted.

    That one loads what a running program has loaded.
    """
    if not warm:
        upscale_frame(folder, name)
    load = os.getloadavg()[0] if hasattr(os, "getloadavg") else None
    runs = [_timed(folder, name) for _ in range(repeats)]
    reports = [report for _, report in runs]
    stages = {stage: statistics.median(report["seconds"][stage] for report in reports) for stage in STAGES}
    return {"second_stage_seconds": [seconds for seconds, _ in runs], "stage_seconds": stages,
            "notes": reports[-1]["notes"], "load_average": load}


def _timed(folder: Path, name: str) -> tuple[float, dict[str, Any]]:
    started = time.perf_counter()
    report = upscale_frame(folder, name)
    return round(time.perf_counter() - started, 4), report


def _metrics(image: np.ndarray, target: Target) -> dict[str, Any]:
    """Every metric with "ci95", whether the reference is whole or of sampled lenses."""
    reference, mask = target.reference, target.mask
    lenses = reference.frame.display.lenses
    found = compare(image, reference.half_a, reference.half_b, lenses, mask, lens_list=reference.lens_list)
    if reference.lens_list is None:
        found |= {"lenses": None, "ci95": lens_intervals(image, reference.half_a, reference.half_b, lenses, mask)}
    return {"recall": None} | found


@contextmanager
def scratch_copy(folder: Path) -> Iterator[Path]:
    """A new folder beside ``folder`` with the same render in it, so that other readers of the render see no change."""
    with tempfile.TemporaryDirectory(prefix=".chart-", dir=folder.parent) as name:
        for file in (FRAME_FILE, LOW_RES_FILE):
            try:
                os.link(folder / file, Path(name) / file)
            except OSError:  # another file system, or one without links
                shutil.copyfile(folder / file, Path(name) / file)
        yield Path(name)


FRESH_FILE = "fresh-process.json"


def network_cost(name: str, scale: int, low_views: tuple[int, int]) -> dict[str, Any]:
    """Parameters and multiply-adds per low-resolution pixel of the networks in a method; None where it has none.

    ``low_views`` (w, h): pixels of a low-resolution elemental image. Open Image Denoise is not counted: it does not
    tell.
    """
    counts = [_count(part, scale, low_views) for part in MethodName.parse(name).networks]
    if not counts:
        return {"parameters": None, "multiply_adds_per_low_pixel": None}
    return {"parameters": sum(count for count, _ in counts),
            "multiply_adds_per_low_pixel": float(sum(work for _, work in counts))}


def _count(part: str, scale: int, low_views: tuple[int, int]) -> tuple[int, float]:
    from lfsr_core.reconstruct.networks.pytorch.cost import multiply_adds, parameters

    network = catalogue.build(part, scale).eval()
    return parameters(network), multiply_adds(network, *low_views[::-1])


def fresh_seconds(folder: Path, name: str, chart_folder: Path, again: bool = False) -> float:
    """Wall seconds of `lfsr upscale` in a process of its own, start included; measured once per method and chart."""
    path, key = chart_folder / FRESH_FILE, f"{name} {MethodName.parse(name).weights_digest}"
    known = read_json(path, "seconds of fresh processes") if path.exists() else {}
    if key not in known or again:
        with scratch_copy(folder) as copy:
            command = [sys.executable, "-m", "lfsr_core.cli", "upscale", str(copy), "--method", name]
            known[key] = _process_seconds(command)
        write_json(path, known)
    return known[key]


def _process_seconds(command: list[str]) -> float:
    started = time.perf_counter()
    finished = subprocess.run(command, capture_output=True, text=True, check=False)
    if finished.returncode:
        raise LfsrError(f"`{' '.join(command[3:])}` failed ({finished.stderr.strip()}): choose another method")
    return round(time.perf_counter() - started, 3)
