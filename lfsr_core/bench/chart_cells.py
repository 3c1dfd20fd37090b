"""One cell of a chart: one render, finished by one method, timed and measured."""

from __future__ import annotations

import dataclasses
import hashlib
import os
import shutil
import statistics
import tempfile
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np

from lfsr_core import __version__, networks
from lfsr_core.bench.chart_intervals import lens_intervals
from lfsr_core.bench.chart_settings import CELL_FOLDER
from lfsr_core.comparison import read_half
from lfsr_core.errors import LfsrError
from lfsr_core.files import read_json, write_json
from lfsr_core.foreground import foreground_mask, recall
from lfsr_core.frame import FRAME_FILE, LOW_RES_FILE, REFERENCE_FILES, Frame, read_frame
from lfsr_core.image_io import read_layers
from lfsr_core.metrics import LensList, check_reference, compare
from lfsr_core.pipeline import finished_linear, upscale_frame
from lfsr_core.upscale import versions_of

CELL_FORMAT = 1
STAGES = ("load", "mask", "upscale", "assemble", "color", "write")


@dataclasses.dataclass(frozen=True)
class Truth:
    """A reference in memory: halves (H, W, 3) scene-linear, foreground (sy, sx) bool, where it came from."""

    folder: Path
    frame: Frame
    half_a: np.ndarray
    half_b: np.ndarray
    mask: np.ndarray

    @property
    def lens_list(self) -> LensList | None:
        """The lenses it shows, None for all."""
        return self.frame.lens_list


def read_truth(folder: Path, mask: np.ndarray | None) -> Truth:
    """The reference in ``folder``; ``mask`` (sy, sx) is the foreground where it shows only some lenses."""
    frame = read_frame(folder)
    (half_a, hit_a), (half_b, hit_b) = (read_half(folder / name, frame) for name in REFERENCE_FILES)
    if frame.lens_list is None:
        mask = hit_a | hit_b
    if mask is None:
        raise LfsrError(f"{folder} shows only some lenses, so a low-resolution render must say which are foreground, "
                        "but there is none: run it without --only-measure")
    return Truth(folder, frame, half_a, half_b, mask)


def cell(folder: Path, name: str, truth: Truth, repeats: int, again: bool = False,
         retime: bool = False) -> dict[str, Any]:
    """The cell of frame folder ``folder`` and method ``name``; measured unless its file is there and still fits.

    ``again`` measures it in any case, ``retime`` keeps metrics that fit and takes new times. The folder itself is not
    written to. LfsrError where the method cannot finish this frame.
    """
    path = folder.parent / CELL_FOLDER / f"{folder.name}-{name}.json"
    print_of = fingerprint(folder, name, truth)
    known = read_json(path, "a measured cell") if path.exists() and not again else {}
    fits = known.get("fingerprint") == print_of
    if fits and not retime and len(known["second_stage_seconds"]) >= repeats:
        return known
    check_reference(read_frame(folder), truth.frame)
    with scratch_copy(folder) as copy:
        found = known if fits else {"fingerprint": print_of, "method": name, **_measured(copy, name, truth)}
        found |= _times(copy, name, repeats, warm=not fits)
    write_json(path, found)
    return found


def fingerprint(folder: Path, name: str, truth: Truth) -> dict[str, Any]:
    """What a cell depends on, as hashes: a change means that it must be measured again."""
    return {"format": CELL_FORMAT, "lfsr": __version__,
            "frame": _hash((folder / FRAME_FILE).read_bytes()),
            "reference": _hash((truth.folder / FRAME_FILE).read_bytes()), "mask": _hash(truth.mask.tobytes()),
            "weights": fingerprint_of_weights(name),
            **versions_of(name)}


def fingerprint_of_weights(name: str) -> str:
    """Hash of the weights behind a method."""
    return _hash(b"".join(path.read_bytes() for path in weight_files(name)))


def weight_files(name: str) -> list[Path]:
    """Weights that the parts of a method may use, at any scale."""
    stems = {networks.NETWORKS[part].weights or part if part in networks.NETWORKS else part
             for part in name.split("+")}
    return sorted(path for stem in stems for path in networks.WEIGHTS_FOLDER.glob(f"{stem}-x*.safetensors"))


def _hash(data: bytes) -> str:
    return hashlib.sha256(data).hexdigest()[:16]


def _measured(folder: Path, name: str, truth: Truth) -> dict[str, Any]:
    metrics = _metrics(finished_linear(folder, name), truth)
    if truth.lens_list is None:
        frame = read_frame(folder)
        mask = foreground_mask(read_layers(folder / LOW_RES_FILE), frame.rays.tiles)
        metrics["recall"] = recall(mask, truth.mask)
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


def _metrics(image: np.ndarray, truth: Truth) -> dict[str, Any]:
    """Every metric with "ci95", whether the reference is whole or of sampled lenses."""
    lenses = truth.frame.display.lenses
    found = compare(image, truth.half_a, truth.half_b, lenses, truth.mask, lens_list=truth.lens_list)
    if truth.lens_list is None:
        found |= {"lenses": None, "ci95": lens_intervals(image, truth.half_a, truth.half_b, lenses, truth.mask)}
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
