"""The renders behind a chart: those that are there are used, the others are made."""

from __future__ import annotations

import dataclasses
import tempfile
from pathlib import Path

from lfsr_core.arrays import Array
from lfsr_core.errors import LfsrError
from lfsr_core.frames.foreground import foreground_mask
from lfsr_core.frames.frame import LOW_RES_FILE, Frame, read_frame
from lfsr_core.frames.job import Job
from lfsr_core.images.exr import read_layers
from lfsr_core.optics.lens_sampling import choose_lenses
from lfsr_core.render.store import cached, is_complete, with_blender
from lfsr_lab.experiments.cells import Cells, Fingerprint
from lfsr_lab.experiments.chart.overall import Overall
from lfsr_lab.experiments.chart.settings import LAYERS, REFERENCE_FOLDER, TIMES_FOLDER, Settings, render_folder


@dataclasses.dataclass(frozen=True)
class Repeats:
    """Seconds of renders that were made again only for their time; ``alone``: that of the kept one does not count."""

    alone: bool = False
    repeats: tuple[float, ...] = ()

    def counted(self, first: float) -> list[float]:
        """All seconds that count, of the kept render's ``first`` and the others."""
        return [*(() if self.alone else (first,)), *self.repeats]


def low_render(settings: Settings, scene: Path, scale: int, samples: int,
               progress: Overall | None = None) -> Path | None:
    """Frame folder of a render, made if it is not there; None if it is not and no render may be made.

    Parameters
    ----------
    settings : of the chart
    scene : its file
    scale, samples : of the render
    progress : follows it

    Raises
    ------
    LfsrError : the folder holds another render
    """
    folder = render_folder(settings.folder / scene.stem, scale, samples, settings.seed)
    return _kept(settings, _job(settings, scene, folder, scale, samples), progress)


def reference(settings: Settings, scene: Path, progress: Overall | None = None) -> Path | None:
    """Frame folder of the reference, made if it is not there; None if it is not and no render may be made.

    One that is there is used whatever its lenses and samples are: both are in the chart's file.
    """
    folder = settings.folder / scene.stem / REFERENCE_FOLDER
    made = is_complete(folder, "reference") or settings.only_measure
    job = dataclasses.replace(_job(settings, scene, folder, 1, settings.reference_spp), kind="reference", layers=(),
                              clamp_indirect=0.0, seed=0)  # the same for renders of any seed
    lenses = None if made else _lenses(settings, scene, progress)
    if progress and not made:
        progress.begin(folder, f"{scene.stem}: reference of {job.spp} samples")
    return _kept(settings, dataclasses.replace(job, lens_list=lenses), progress)


def seconds_of(settings: Settings, scene: Path, folder: Path) -> list[float]:
    """Cycles seconds of a render: of the one that is kept, then of repeats made only for their time.

    With ``settings.retime_renders`` of repeats alone: the kept one was made while the machine was busy.
    """
    cells, mark, known = _repeats(folder)
    first = mark["first"]
    if settings.retime_renders and not known.alone:
        known = Repeats(alone=True)
    while len(known.counted(first)) < settings.render_repeats and not settings.only_measure:
        again = _timed_again(settings, scene, read_frame(folder))
        known = dataclasses.replace(known, repeats=(*known.repeats, again))
        cells.write(folder.name, mark, known)
    return known.counted(first) or [first]


def known_seconds(folder: Path) -> list[float]:
    """Cycles seconds of a render as far as they are known, those of its repeats too where there are any."""
    _, mark, known = _repeats(folder)
    return known.counted(mark["first"]) or [mark["first"]]


def _repeats(folder: Path) -> tuple[Cells[Repeats], Fingerprint, Repeats]:
    """Where the seconds of a render's repeats are kept, for which render, and what is kept of them."""
    cells = Cells(folder.parent / TIMES_FOLDER, Repeats, key=None)
    mark = {"first": read_frame(folder).seconds["render"]}
    return cells, mark, cells.read(folder.name, mark) or Repeats()


def widest_mask(scene_folder: Path, scale: int, display_lenses: tuple[int, int]) -> Array | None:
    """Foreground mask (sy, sx) bool of the render with most samples at ``scale``; None without a render."""
    folders = [folder for folder in scene_folder.glob(f"s{scale}-spp*") if is_complete(folder)]
    if not folders:
        return None
    best = max(folders, key=lambda folder: read_frame(folder).samples)
    return foreground_mask(read_layers(best / LOW_RES_FILE), display_lenses)


def _lenses(settings: Settings, scene: Path, progress: Overall | None) -> tuple[tuple[int, int], ...] | None:
    if settings.lenses is None:
        return None
    samples = max(settings.spps)
    if progress:
        progress.begin(render_folder(settings.folder / scene.stem, settings.scale, samples, settings.seed),
                       f"{scene.stem}: scale {settings.scale}, {samples} samples")
    low_render(settings, scene, settings.scale, samples, progress)
    mask = widest_mask(settings.folder / scene.stem, settings.scale, settings.profile.lenses)
    return choose_lenses(mask, settings.lenses)


def _timed_again(settings: Settings, scene: Path, frame: Frame) -> float:
    with tempfile.TemporaryDirectory(prefix=".chart-", dir=settings.folder) as name:
        job = _job(settings, scene, Path(name) / "frame", frame.scale, frame.samples)
        return read_frame(_kept(settings, job)).seconds["render"]


def _job(settings: Settings, scene: Path, folder: Path, scale: int, samples: int) -> Job:
    return Job(output=str(folder), display=settings.profile, scene=str(scene.resolve()), scale=scale, spp=samples,
               layers=LAYERS, device=settings.device, seed=settings.seed, subject=settings.subject,
               world_visible=settings.world_visible)


def _kept(settings: Settings, job: Job, progress: Overall | None = None) -> Path | None:
    """The job's folder; None where it would have to be rendered and may not."""
    if settings.only_measure and not is_complete(Path(job.output), job.kind):
        return None
    folder = cached(job, with_blender(settings.blender, announce=progress is None, bar=progress))
    _check_shown(read_frame(folder), job)
    return folder


def _check_shown(frame: Frame, job: Job) -> None:
    """LfsrError where a render that was there shows another subject, or the world otherwise."""
    if job.subject is not None and frame.subject != job.subject:
        subject = repr(frame.subject) if frame.subject else "everything but the world"
        raise LfsrError(f"{job.output} was rendered with subject {subject}, but {job.subject!r} is needed: "
                        "choose another folder")
    if job.world_visible not in (None, frame.world_visible):
        words = {True: "visible", False: "hidden"}
        raise LfsrError(f"{job.output} was rendered with the world {words[frame.world_visible]}, but it must be "
                        f"{words[job.world_visible]}: choose another folder")
