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
from lfsr_lab.experiments.chart.records import CEILING, DIRECT, LOW, Cell, MethodCost, Role, Spread
from lfsr_lab.experiments.chart.settings import Settings
from lfsr_lab.experiments.engine.accuracy import Accuracy, Target
from lfsr_lab.experiments.engine.records import Records, method_facts
from lfsr_lab.experiments.engine.renders import REFERENCE, digest, foreground, frame_digest
from lfsr_lab.experiments.engine.timing import scratch_copy, second_stage_times

CELL_FORMAT = 5
CELL_FOLDER, COST_FOLDER = "cells", "fresh-process"


def wanted_renders(settings: Settings, scene: Path) -> Iterator[tuple[Role, Job]]:
    """Yield every render of a scene and its role, the cheap ones first."""
    for samples in settings.spps:
        yield LOW, low_job(settings, scene, settings.scale, samples)
    for samples in settings.direct_spps:
        yield DIRECT, low_job(settings, scene, 1, samples)
    if settings.ceiling_spp:
        yield CEILING, low_job(settings, scene, settings.scale, settings.ceiling_spp)


def low_job(settings: Settings, scene: Path, scale: int, samples: int) -> Job:
    """Return one render of a scene; renders of other seeds lie beside each other."""
    name = f"s{scale}-spp{samples}" + (f"-seed{settings.seed}" if settings.seed else "")
    return Job(output=str(settings.folder / scene.stem / name), display=settings.profile, scene=str(scene.resolve()),
               scale=scale, spp=samples, device=settings.device, seed=settings.seed,
               subject=settings.subject, world_visible=settings.world_visible)


def read_target(settings: Settings, scene: Path) -> Target:
    """Read a scene's reference; its foreground is that of the render with most samples where it shows some lenses."""
    folder = settings.folder / scene.stem
    renders = [found for found in folder.glob(f"s{settings.scale}-spp*") if is_complete(found)]
    widest = max(renders, key=lambda found: read_frame(found).samples, default=None)
    return Target.read(folder / REFERENCE, foreground(widest) if widest else None)


def measured(folder: Path, role: Role, name: str, target: Target, settings: Settings,
             render_seconds: tuple[float, ...]) -> Cell:
    """Return the cell of a render and a method, measured unless it is stored and still fits.

    ``folder`` has the render and is not written to. LfsrError where the method cannot finish it.
    """
    records = Records(folder.parent / CELL_FOLDER, Cell)
    mark = {"format": CELL_FORMAT, "lfsr": __version__, "frame": frame_digest(folder),
            "reference": frame_digest(target.reference.folder), "mask": digest(target.mask.tobytes()),
            **method_facts(name)}
    file_name = f"{folder.name}-{name}"
    found = None if name in settings.again else records.read(file_name, mark)
    if (found is None or (name in settings.retime and role != CEILING)
            or len(found.second_stage_seconds) < settings.repeats):
        frame = read_frame(folder)
        target.check(frame)
        with scratch_copy(folder) as copy:
            accuracy: Accuracy = found or target.accuracy(finished_linear(copy, name), foreground(copy))
            times = second_stage_times(copy, name, settings.repeats, warm=found is None)
        found = Cell(role=role, method=name, scale=frame.scale, samples=frame.samples, render_seconds=render_seconds,
                     open_seconds=frame.seconds.get("open", 0.0), device=frame.device, metrics=accuracy.metrics,
                     seconds=Spread.of(render_seconds, times.second_stage_seconds), ci95=accuracy.ci95, **vars(times))
        records.write(file_name, mark, found)
    return dataclasses.replace(found, role=role, render_seconds=render_seconds,
                               seconds=Spread.of(render_seconds, found.second_stage_seconds))


def method_cost(settings: Settings, name: str, folder: Path) -> MethodCost:
    """Return what a method costs; a process of its own finishes the render in ``folder`` once per method."""
    records, low_views = Records(settings.folder / COST_FOLDER, MethodCost), settings.profile.low_views(settings.scale)
    if name in (*settings.again, *settings.retime):
        records.path(name).unlink(missing_ok=True)
    return records.get(name, {"scale": settings.scale, "views": [*low_views], **method_facts(name)}, lambda: MethodCost(
        name, *network_cost(name, settings.scale, low_views), upscale_seconds(folder, name)))


def network_cost(name: str, scale: int, low_views: tuple[int, int]) -> tuple[int | None, float | None]:
    """Return parameters of a method's network, and multiply-adds per low-resolution pixel, None without a network.

    ``low_views`` (w, h): pixels of a low-resolution elemental image. Open Image Denoise, whose size is not known, is
    not counted.
    """
    parsed = MethodName.parse(name)
    if not parsed.network:
        return None, None
    from lfsr_lab.networks.cost import multiply_adds, parameters
    from lfsr_lab.networks.networks import build

    network = build(parsed.upscaler, scale).eval()
    return parameters(network), multiply_adds(network, *low_views[::-1])


def upscale_seconds(folder: Path, name: str) -> float:
    """Return the wall seconds of `lfsr upscale` of a render in a process of its own, start included."""
    with scratch_copy(folder) as copy:
        started = time.perf_counter()
        finished = subprocess.run([sys.executable, "-m", "lfsr_core.cli", "upscale", str(copy), "--method", name],
                                  capture_output=True, text=True, check=False)
        if finished.returncode:
            raise LfsrError(f"`lfsr upscale {folder} --method {name}` failed ({finished.stderr.strip()}): "
                            "choose another method")
        return round(time.perf_counter() - started, 3)
