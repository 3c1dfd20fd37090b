"""The renders behind a chart: those that are there are used, the others are made."""

from __future__ import annotations

import dataclasses
import tempfile
from pathlib import Path
from typing import Any

from lfsr_core.bench.chart.settings import LAYERS, REFERENCE_FOLDER, TIMES_FOLDER, Settings, render_folder
from lfsr_core.files import read_json, write_json
from lfsr_core.frames.foreground import foreground_mask
from lfsr_core.frames.frame import LOW_RES_FILE, Frame, read_frame
from lfsr_core.frames.job import Job
from lfsr_core.images.exr import read_layers
from lfsr_core.optics.lens_sampling import choose_lenses
from lfsr_core.render.store import is_complete, kept, with_blender


def low_render(settings: Settings, scene: Path, scale: int, samples: int) -> Path | None:
    """Frame folder of a render, made if it is not there; None if it is not and no render may be made.

    LfsrError if the folder holds a render of another display, scale or number of samples.
    """
    folder = render_folder(settings.folder / scene.stem, scale, samples)
    if settings.only_measure and not is_complete(folder):
        return None
    return kept(_job(settings, scene, folder, scale, samples), with_blender(settings.blender))


def reference(settings: Settings, scene: Path) -> Path | None:
    """Frame folder of the reference, made if it is not there; None if it is not and no render may be made.

    One that is there is used whatever its lenses and samples are: both are in the chart's file.
    """
    folder = settings.folder / scene.stem / REFERENCE_FOLDER
    if not is_complete(folder, "reference"):
        if settings.only_measure:
            return None
        with_blender(settings.blender)(dataclasses.replace(
            _job(settings, scene, folder, 1, settings.reference_spp), kind="reference", layers=(), clamp_indirect=0.0,
            lens_list=_lenses(settings, scene)))
    return folder


def seconds_of(settings: Settings, scene: Path, folder: Path) -> list[float]:
    """Cycles seconds of a render: of the one that is kept, then of repeats made only for their time.

    With ``settings.retime_renders`` of repeats alone: the kept one was made while the machine was busy.
    """
    path, known = _times(folder)
    first = known["first"]
    if settings.retime_renders and not known["alone"]:
        known = {"first": first, "alone": True, "repeats": []}
    while len(_counted(known)) < settings.render_repeats and not settings.only_measure:
        known["repeats"].append(_timed_again(settings, scene, read_frame(folder)))
        write_json(path, known)
    return _counted(known) or [first]


def known_seconds(folder: Path) -> list[float]:
    """Cycles seconds of a render as far as they are known, those of its repeats too where there are any."""
    known = _times(folder)[1]
    return _counted(known) or [known["first"]]


def _times(folder: Path) -> tuple[Path, dict[str, Any]]:
    """Where the seconds of a render and its repeats stand, and what stands there."""
    path = folder.parent / TIMES_FOLDER / f"{folder.name}.json"
    first = read_frame(folder).seconds["render"]
    known = read_json(path, "seconds of repeated renders") if path.exists() else {}
    if known.get("first") != first:  # the kept render is another one now
        known = {"first": first, "alone": False, "repeats": []}
    return path, known


def _counted(known: dict[str, Any]) -> list[float]:
    return known["repeats"] if known["alone"] else [known["first"], *known["repeats"]]


def widest_mask(scene_folder: Path, scale: int, display_lenses: tuple[int, int]) -> Any:
    """Foreground mask (sy, sx) bool of the render with most samples at ``scale``; None without a render."""
    folders = [folder for folder in scene_folder.glob(f"s{scale}-spp*") if is_complete(folder)]
    if not folders:
        return None
    best = max(folders, key=lambda folder: read_frame(folder).samples)
    return foreground_mask(read_layers(best / LOW_RES_FILE), display_lenses)


def _lenses(settings: Settings, scene: Path) -> tuple[tuple[int, int], ...] | None:
    if settings.lenses is None:
        return None
    low_render(settings, scene, settings.scale, max(settings.spps))
    mask = widest_mask(settings.folder / scene.stem, settings.scale, settings.profile.lenses)
    return choose_lenses(mask, settings.lenses)


def _timed_again(settings: Settings, scene: Path, frame: Frame) -> float:
    with tempfile.TemporaryDirectory(prefix=".chart-", dir=settings.folder) as name:
        again = Path(name) / "frame"
        with_blender(settings.blender)(_job(settings, scene, again, frame.scale, frame.samples))
        return read_frame(again).seconds["render"]


def _job(settings: Settings, scene: Path, folder: Path, scale: int, samples: int) -> Job:
    return Job(output=str(folder), display=settings.profile, scene=str(scene.resolve()), scale=scale, spp=samples,
               layers=LAYERS, device=settings.device)
