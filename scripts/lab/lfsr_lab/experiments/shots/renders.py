"""The bench folder of the animations: scenes, a low-resolution frame per setting and a reference per frame."""

from __future__ import annotations

import dataclasses
import tempfile
from collections.abc import Iterator
from pathlib import Path

import numpy as np

from lfsr_core.errors import LfsrError
from lfsr_core.files import write_json
from lfsr_core.frames.frame import frame_folder
from lfsr_core.frames.identity import check_same
from lfsr_core.frames.job import Job
from lfsr_core.optics.display import DisplayProfile, load_display
from lfsr_core.progress import ProgressBar
from lfsr_core.records import read_record, write_record
from lfsr_core.render.blender import find_blender
from lfsr_core.render.process import Listener, run_jobs
from lfsr_core.render.store import is_complete
from lfsr_lab.scenes import scene_script
from lfsr_lab.scenes.running import run_script

DISPLAY_FILE, SCENE_FILE, SETTINGS_FILE = Path(__file__).parent / "shots.toml", "scene.blend", "settings.json"
NAMES = ("object", "light", "array")  # what moves, of scripts/lab/lfsr_lab/scenes/shot_scenes.py
FIXED, CHANGING, TURNING = "fixed", "changing", "turning"  # seeds of the frames; the last begin again after PERIOD
PERIOD = 5
LAYERS = ("albedo", "normal")
SCENE_SCALE = 4  # at which what the scenes show is within the usable depth
SEED_STEP = 1000  # from the seeds of one repetition to those of the next


@dataclasses.dataclass(frozen=True)
class Settings:
    """What decides every figure of a bench folder; LfsrError for what cannot be measured."""

    display: DisplayProfile = dataclasses.field(default_factory=lambda: load_display(DISPLAY_FILE))
    scale: int = 2  # of the low-resolution renders
    frames: int = 6  # of every animation
    samples: tuple[int, ...] = (4, 16)  # per pixel, that are compared
    more: tuple[int, ...] = (8,)  # per pixel, without anything shared: what the same time buys, and more
    reference_samples: int = 256  # per pixel, of both halves together
    reference_lenses: int = 48  # drawn at random, the same for every frame
    seed: int = 0  # of everything

    def __post_init__(self) -> None:
        lenses = self.display.lenses[0] * self.display.lenses[1]
        if self.frames < 3 or not 1 <= self.reference_lenses <= lenses:
            raise LfsrError(f"{self.frames} frames with references of {self.reference_lenses} lenses were asked for, "
                            f"but it must be at least 3 frames and 1 to {lenses} lenses")

    @property
    def lens_list(self) -> tuple[tuple[int, int], ...]:
        """(row, column) of the lenses that references show."""
        sx, sy = self.display.lenses
        chosen = np.random.default_rng(self.seed).choice(sx * sy, self.reference_lenses, replace=False)
        return tuple((int(place) // sx, int(place) % sx) for place in np.sort(chosen))


@dataclasses.dataclass(frozen=True)
class Bench:
    """A folder with everything that was rendered; each render is made once."""

    folder: Path
    settings: Settings
    executable: str | None = None  # of Blender, None to look for one

    def claim(self) -> None:
        """Record the settings of a new folder; LfsrError if it was begun with other ones."""
        path = self.folder / SETTINGS_FILE
        if path.exists() and read_record(path, Settings, "the settings of a bench") != self.settings:
            raise LfsrError(f"{self.folder} was begun with other settings, see {SETTINGS_FILE} there: choose another "
                            "folder or the same settings")
        write_record(path, self.settings)

    def low(self, name: str, seeds: str, spp: int) -> list[Path]:
        """Frame folders of one animation."""
        return [Path(job.output) for job in self._low_jobs(name, seeds, spp)]

    def references(self, name: str) -> list[Path]:
        """Reference folders of one animation."""
        return [Path(job.output) for job in self._reference_jobs(name)]

    def render(self, name: str) -> None:
        """Everything of one animation that is missing, all in one Blender."""
        self._build_scenes()
        settings = self.settings
        pairs = [(seeds, spp) for spp in settings.samples for seeds in (FIXED, TURNING)]
        jobs = [job for seeds, spp in pairs for job in self._low_jobs(name, seeds, spp)]
        jobs += [job for spp in (*settings.samples, *settings.more) for job in self._low_jobs(name, CHANGING, spp)]
        jobs += self._reference_jobs(name)
        waiting = [job for job in jobs if not is_complete(Path(job.output), job.kind)]
        if waiting:
            bar = ProgressBar()
            bar.note(f"rendering {len(waiting)} images of the animation {name!r}")
            run_jobs(waiting, find_blender(self.executable), Listener(bar, bar.note))
            bar.close()
        for job in jobs:
            check_same(Path(job.output), job)

    def _build_scenes(self) -> None:
        paths = {self.folder / name / SCENE_FILE: name for name in NAMES}
        if all(path.exists() for path in paths):
            return
        for path in paths:
            path.parent.mkdir(parents=True, exist_ok=True)
        scenes = [{"name": name, "path": str(path.resolve())} for path, name in paths.items()]
        with tempfile.TemporaryDirectory() as temporary:
            job = Path(temporary) / "shots.json"
            write_json(job, {"display": self.settings.display.to_dict(), "scale": SCENE_SCALE,
                             "frames": self.settings.frames, "scenes": scenes})
            run_script(find_blender(self.executable), scene_script("shot_scenes.py"), job, paths)

    def _low_jobs(self, name: str, seeds: str, spp: int) -> list[Job]:
        folder, settings = self.folder / name / f"{seeds}-spp{spp}", self.settings
        seed = {FIXED: lambda number: 0, CHANGING: lambda number: number,
                TURNING: lambda number: 1 + (number - 1) % PERIOD}[seeds]
        return [Job(str(frame_folder(folder, number)), settings.display, self._scene(name), scale=settings.scale,
                    spp=spp, layers=LAYERS, frame=number, seed=settings.seed * SEED_STEP + seed(number))
                for number in self._numbers()]

    def _reference_jobs(self, name: str) -> list[Job]:
        folder, settings = self.folder / name / "reference", self.settings
        return [Job(str(frame_folder(folder, number)), settings.display, self._scene(name), "reference", 1,
                    settings.reference_samples, frame=number, seed=settings.seed * SEED_STEP + number,
                    lens_list=settings.lens_list, clamp_indirect=0.0)
                for number in self._numbers()]

    def _numbers(self) -> Iterator[int]:
        return iter(range(1, self.settings.frames + 1))

    def _scene(self, name: str) -> str:
        return str((self.folder / name / SCENE_FILE).resolve())
