"""The cells of a chart: renders, each finished by every method, timed and measured; and what a method costs."""

from __future__ import annotations

import dataclasses
import subprocess
import sys
import time
from collections.abc import Iterator
from pathlib import Path

from lfsr_core import __version__
from lfsr_core.errors import LfsrError
from lfsr_core.frames.frame import read_frame
from lfsr_core.frames.job import Job
from lfsr_core.reconstruct.method_name import MethodName
from lfsr_core.reconstruct.second_stage import finished_linear
from lfsr_core.render.store import is_complete
from lfsr_lab.experiments.chart.records import CEILING, DIRECT, LOW, MethodCost, Role
from lfsr_lab.experiments.chart.settings import CELL_FOLDER, FRESH_FOLDER, Settings, render_folder
from lfsr_lab.experiments.engine.accuracy import Accuracy, Target, check_pair
from lfsr_lab.experiments.engine.records import Fingerprint, Records, method_facts
from lfsr_lab.experiments.engine.renders import LAYERS, REFERENCE, Store, digest, foreground, frame_digest, reference_of
from lfsr_lab.experiments.engine.timing import StageTimes, scratch_copy, second_stage_times

CELL_FORMAT = 4


@dataclasses.dataclass(frozen=True)
class MeasuredCell:
    """What is measured of a render and a method."""

    method: str
    accuracy: Accuracy
    times: StageTimes


@dataclasses.dataclass(frozen=True)
class FreshSeconds:
    """Seconds of `lfsr upscale` in a process of its own, start included."""

    seconds: float


@dataclasses.dataclass(frozen=True)
class Effort:
    """What is measured although a stored cell fits."""

    repeats: int  # timed runs of the second stage
    again: bool = False  # everything
    retime: bool = False  # the times; metrics stay


def wanted_renders(settings: Settings, scene: Path) -> Iterator[tuple[Role, Job]]:
    """Yield every render of a scene and its role, the cheap ones first."""
    for samples in settings.spps:
        yield LOW, low_job(settings, scene, settings.scale, samples)
    for samples in settings.direct_spps:
        yield DIRECT, low_job(settings, scene, 1, samples)
    if settings.ceiling_spp:
        yield CEILING, low_job(settings, scene, settings.scale, settings.ceiling_spp)


def low_job(settings: Settings, scene: Path, scale: int, samples: int) -> Job:
    """Return one render of a scene."""
    folder = render_folder(settings.folder / scene.stem, scale, samples, settings.seed)
    return Job(output=str(folder), display=settings.profile, scene=str(scene.resolve()), scale=scale, spp=samples,
               layers=LAYERS, device=settings.device, seed=settings.seed, subject=settings.subject,
               world_visible=settings.world_visible)


def reference_job(settings: Settings, scene: Path) -> Job:
    """Return the reference of a scene, the same for renders of any seed."""
    return reference_of(low_job(settings, scene, settings.scale, settings.spps[0]), settings.reference_spp,
                        settings.folder / scene.stem / REFERENCE, seed=0)


def read_target(settings: Settings, scene: Path) -> Target:
    """Read a scene's reference; its foreground is that of the render with most samples where it shows some lenses."""
    folder = settings.folder / scene.stem
    renders = [found for found in folder.glob(f"s{settings.scale}-spp*") if is_complete(found)]
    widest = max(renders, key=lambda found: read_frame(found).samples, default=None)
    return Target.read(folder / REFERENCE, foreground(widest) if widest else None)


def cell(folder: Path, name: str, target: Target, effort: Effort) -> MeasuredCell:
    """Return the cell of a render and a method, measured unless it is stored and still fits.

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
    records, mark = Records(folder.parent / CELL_FOLDER, MeasuredCell), fingerprint(folder, name, target)
    file_name = f"{folder.name}-{name}"
    known = None if effort.again else records.read(file_name, mark)
    if known and not effort.retime and len(known.times.second_stage_seconds) >= effort.repeats:
        return known
    check_pair(read_frame(folder), target)
    with scratch_copy(folder) as copy:
        accuracy = known.accuracy if known else target.accuracy(finished_linear(copy, name), foreground(copy))
        found = MeasuredCell(name, accuracy, second_stage_times(copy, name, effort.repeats, warm=known is None))
    records.write(file_name, mark, found)
    return found


def fingerprint(folder: Path, name: str, target: Target) -> Fingerprint:
    """Return what a cell depends on."""
    return {"format": CELL_FORMAT, "lfsr": __version__, "frame": frame_digest(folder),
            "reference": frame_digest(target.reference.folder), "mask": digest(target.mask.tobytes()),
            **method_facts(name)}


def method_cost(name: str, scale: int, low_views: tuple[int, int], seconds: float | None = None) -> MethodCost:
    """Return what a method costs; Open Image Denoise, whose size is not known, is not counted.

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
    """Return the parameters of a network and its multiply-adds per low-resolution pixel."""
    from lfsr_lab.networks.cost import multiply_adds, parameters
    from lfsr_lab.networks.networks import build

    network = build(part, scale).eval()
    return parameters(network), multiply_adds(network, *low_views[::-1])


def fresh_seconds(folder: Path, name: str, store: Store, again: bool) -> float:
    """Return the wall seconds of `lfsr upscale` of a render in a process of its own, measured once per method."""
    records, mark = Records(store.folder / FRESH_FOLDER, FreshSeconds), {"weights": method_facts(name)["weights"]}
    if again:
        records.path(name).unlink(missing_ok=True)
    return records.get(name, mark, lambda: FreshSeconds(_upscaled(folder, name))).seconds


def _upscaled(folder: Path, name: str) -> float:
    with scratch_copy(folder) as copy:
        return _process_seconds([sys.executable, "-m", "lfsr_core.cli", "upscale", str(copy), "--method", name])


def _process_seconds(command: list[str]) -> float:
    started = time.perf_counter()
    finished = subprocess.run(command, capture_output=True, text=True, check=False)
    if finished.returncode:
        raise LfsrError(f"`{' '.join(command[3:])}` failed ({finished.stderr.strip()}): choose another method")
    return round(time.perf_counter() - started, 3)
