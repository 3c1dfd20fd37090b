"""What is rendered: scenes, samples and scales, from a TOML file, as jobs of a store."""

from __future__ import annotations

import dataclasses
import itertools
import tomllib
from collections.abc import Iterable, Iterator
from pathlib import Path

import numpy as np

from lfsr_core.base.errors import LfsrError
from lfsr_core.base.records import from_data
from lfsr_core.frames.request import Request, Sampling, check_scene
from lfsr_core.optics.display import DisplayProfile, load_display
from lfsr_lab.experiments.displays.kinds import FULL_WIDTH, kind
from lfsr_lab.experiments.engine.renders import REFERENCE, Store, foreground, reference_of, sampled

SETTINGS = Path(__file__).parent / "denoiser.toml"
REFERENCE_SEED = 1000  # other noise than that of any render
BASE_SAMPLES = 16  # of the render whose foreground decides which lenses the reference shows
BLOCK = 24  # lenses along each side that a reference shows where views differ along one axis


@dataclasses.dataclass(frozen=True)
class Scene:
    """One scene on one display."""

    name: str
    file: str  # below one of the folders of scenes
    group: str  # over which figures are averaged
    seeds: int = 2  # renders of each of ``Settings.repeated``
    display: str = "small"  # its name, or "lenticular-384": a kind of the displays' study and its width
    scale: int = 4  # of the renders that are compared between methods
    lenses: int = 22  # that a reference shows

    @property
    def profile(self) -> DisplayProfile:
        """Its display."""
        name, _, width = self.display.rpartition("-")
        return kind(name, int(width)) if name in FULL_WIDTH else load_display(self.display)


@dataclasses.dataclass(frozen=True, order=True)
class Render:
    """One low-resolution render."""

    scale: int
    samples: int
    seed: int = 0

    @property
    def folder(self) -> str:
        """Its folder's name."""
        return f"s{self.scale}-spp{self.samples}-seed{self.seed}"


@dataclasses.dataclass(frozen=True)
class Settings:
    """What is rendered."""

    scenes: tuple[Scene, ...]
    reference_samples: int  # in both halves together
    repeated: tuple[int, ...]  # samples that are rendered with several seeds
    once: tuple[int, ...]  # samples that are rendered with one
    rays: dict[str, dict[str, int]]  # samples by scale, for each number of rays per finished pixel

    def at_scale(self, scene: Scene) -> list[Render]:
        """Return the renders at the scene's scale, by which methods are compared."""
        seeds = {samples: scene.seeds for samples in self.repeated} | dict.fromkeys(self.once, 1)
        return [Render(scene.scale, samples, seed) for samples in sorted(seeds) for seed in range(seeds[samples])]

    def at_rays(self, scene: Scene) -> dict[str, list[Render]]:
        """Return the renders with equal rays at every scale that the display has."""
        possible = {1, *scene.profile.scales()}
        return {rays: [Render(int(scale), samples) for scale, samples in samples_at.items() if int(scale) in possible]
                for rays, samples_at in self.rays.items()}

    def renders(self, scene: Scene) -> list[Render]:
        """Return every render of a scene, those at its scale first."""
        return list(dict.fromkeys(itertools.chain(self.at_scale(scene), *self.at_rays(scene).values())))


@dataclasses.dataclass(frozen=True)
class Place:
    """A scene's file, and its folder in the store."""

    store: Store
    scene: Scene
    file: Path

    @property
    def folder(self) -> Path:
        """Folder of all its renders."""
        return self.store.folder / self.scene.name

    def job(self, render: Render) -> Request:
        """Return the job of a render."""
        return Request(str(self.folder / render.folder), self.scene.profile, check_scene(self.file),
                       sampling=Sampling(render.scale, render.samples), seed=render.seed)

    def reference(self, samples: int) -> Request:
        """Return the job of the reference; what decides its lenses is rendered now."""
        base = self.job(Render(self.scene.scale, BASE_SAMPLES))
        whole = reference_of(base, samples, self.folder / REFERENCE, seed=REFERENCE_SEED)
        if all(base.display.parallax):
            return sampled(whole, self.scene.lenses, lambda: self.store.rendered(base))
        return dataclasses.replace(whole, lens_list=_block(self.store.rendered(base)))

    def fill(self, reference_samples: int, renders: Iterable[Render]) -> None:
        """Render what is missing."""
        self.store.render_all([self.reference(reference_samples), *map(self.job, renders)])


def _block(folder: Path) -> tuple[tuple[int, int], ...]:
    """Return the lenses of a square block in the middle of a render's foreground."""
    mask = foreground(folder)
    middle = np.argwhere(mask).mean(0).astype(int) - BLOCK // 2
    row, column = np.clip(middle, 0, np.array(mask.shape) - BLOCK)
    return tuple((int(row) + y, int(column) + x) for y in range(BLOCK) for x in range(BLOCK))


def read_settings(path: Path) -> Settings:
    """Read settings; LfsrError where a value is wrong."""
    try:
        return from_data(Settings, tomllib.loads(path.read_text(encoding="utf-8")), str(path))
    except (OSError, tomllib.TOMLDecodeError) as error:
        raise LfsrError(f"{path} cannot be read as settings ({error}): check the file") from None


def places(store: Store, settings: Settings, folders: Iterable[Path]) -> Iterator[Place]:
    """Yield the scenes whose files are below one of ``folders``."""
    for scene in settings.scenes:
        found = next((file for folder in folders if (file := folder / scene.file).is_file()), None)
        if found:
            yield Place(store, scene, found)
