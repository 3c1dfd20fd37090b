"""The cells of the animations: ways to render and finish one, its renders, and what is measured of a way."""

from __future__ import annotations

import dataclasses
import functools
import itertools
from collections.abc import Iterator, Sequence
from pathlib import Path

import numpy as np

from lfsr_core.frames.frame import frame_folder
from lfsr_core.frames.request import Request, Sampling
from lfsr_core.optics.display import DisplayProfile, load_display
from lfsr_core.reconstruct import averaging
from lfsr_core.reconstruct.averaging import read_low
from lfsr_lab.experiments.animations.accuracy import Figures, Truth, measure
from lfsr_lab.experiments.engine.cells import Cell
from lfsr_lab.experiments.engine.records import method_facts
from lfsr_lab.experiments.engine.renders import REFERENCE, SCENE_FILE, Store, reference_of

METHOD = "denoise+bilinear"
DISPLAY_FILE = Path(__file__).parent / "animations.toml"
NAMES = ("object", "light", "dance", "array")  # what moves, of lfsr_lab.scenes.animation_scenes
FIXED, CHANGING, TURNING = "fixed", "changing", "turning"  # seeds of the frames; the last begin again after PERIOD
PERIOD = 5
SCENE_SCALE = 4  # at which what the scenes show is within the usable depth
SEED_STEP = 1000  # from the seeds of one repetition to those of the next


@dataclasses.dataclass(frozen=True)
class Settings:
    """What decides every figure of a folder."""

    display: DisplayProfile = dataclasses.field(default_factory=lambda: load_display(DISPLAY_FILE))
    scale: int = 2  # of the low-resolution renders
    frames: int = 6  # of every animation
    samples: tuple[int, ...] = (4, 16)  # per pixel, that are compared
    more: tuple[int, ...] = (8,)  # per pixel, without averaging: what the same time buys, and more
    reference_samples: int = 256  # per pixel, of both halves together
    reference_lenses: int = 48  # drawn at random, the same for every frame
    seed: int = 0  # of everything

    @property
    def lens_list(self) -> tuple[tuple[int, int], ...]:
        """(row, column) of the lenses that references show."""
        sx, sy = self.display.lenses
        chosen = np.random.default_rng(self.seed).choice(sx * sy, self.reference_lenses, replace=False)
        return tuple((int(place) // sx, int(place) % sx) for place in np.sort(chosen))


@dataclasses.dataclass(frozen=True)
class Way:
    """One way to render and finish an animation."""

    name: str
    seeds: str
    reach: int = 0  # half the number of frames that each is averaged with


FIXED_ALONE = Way("fixed seeds, every frame alone", FIXED)
ALONE = Way("seeds that change, every frame alone", CHANGING)
AVERAGED = Way("averaged over 5 frames, 5 seeds in turn", TURNING, PERIOD // 2)
WAYS = (FIXED_ALONE, ALONE, AVERAGED)


def build_scenes(store: Store, settings: Settings) -> None:
    """Write the scene files that are missing."""
    store.build("animation_scenes.py", {store.folder / name / SCENE_FILE: {"name": name} for name in NAMES},
                display=settings.display.to_dict(), scale=SCENE_SCALE, frames=settings.frames)


@dataclasses.dataclass(frozen=True)
class Animation:
    """One animation, to be finished in any way."""

    store: Store
    settings: Settings
    name: str  # of NAMES

    @property
    def folder(self) -> Path:
        """Folder of its scene and renders."""
        return self.store.folder / self.name

    def cells(self) -> Iterator[tuple[Way, int, Cell[Figures]]]:
        """Yield what is measured: ways and samples per pixel."""
        settings = self.settings
        inputs = {"method": METHOD, **method_facts(METHOD), "averaging": averaging.VERSION}
        for way, spp in [*itertools.product(WAYS, settings.samples), *((ALONE, spp) for spp in settings.more)]:
            name = f"{way.name} spp{spp}".replace(",", "").replace(" ", "-")
            jobs = self.low(way.seeds, spp)
            yield way, spp, Cell(name, inputs, functools.partial(self._measure, way, jobs), jobs + self.references())

    def low(self, seeds: str, spp: int) -> list[Request]:
        """Return the low-resolution renders of all frames with one kind of seeds."""
        folder = self.folder / f"{seeds}-spp{spp}"
        seed = {FIXED: lambda number: 0, CHANGING: lambda number: number,
                TURNING: lambda number: 1 + (number - 1) % PERIOD}[seeds]
        return [self._job(folder, number, seed(number), spp) for number in range(1, self.settings.frames + 1)]

    def references(self) -> list[Request]:
        """Return the references of all frames."""
        settings, folder = self.settings, self.folder / REFERENCE
        return [reference_of(job, settings.reference_samples, frame_folder(folder, number),
                             lens_list=settings.lens_list)
                for number, job in enumerate(self.low(CHANGING, 1), start=1)]

    def _job(self, folder: Path, number: int, seed: int, spp: int) -> Request:
        settings = self.settings
        return Request(str(frame_folder(folder, number)), settings.display, str((self.folder / SCENE_FILE).resolve()),
                   sampling=Sampling(settings.scale, spp), frame=number, seed=settings.seed * SEED_STEP + seed)

    @functools.cached_property
    def truth(self) -> Truth:
        """The references, read."""
        return Truth.read([Path(job.output) for job in self.references()])

    def _measure(self, way: Way, jobs: Sequence[Request]) -> Figures:
        return measure([read_low(Path(job.output)) for job in jobs], self.truth, METHOD, way.reach)
