"""What is rendered: scenes on a display whose low-resolution views fit the networks, with one reference each.

A network interpolates between views as narrow as those that it makes, so each render is there twice: with views that
fill their cells, as ours are, and with views as narrow as finished ones.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence
from pathlib import Path

from lfsr_core.frames.request import Request
from lfsr_lab.experiments.denoiser.settings import Place, Render, Scene
from lfsr_lab.experiments.engine.renders import Store

DISPLAY = str(Path(__file__).parent / "rivals.toml")
REFERENCE_SAMPLES = 1024  # in both halves together
LENSES = 20  # that a reference shows
SCALES = (7, 3)
SAMPLES = (4, 16)
WIDE, NARROW = "wide", "narrow"  # low views that fill their cells; low views of a finished view's width
SCENES = {  # file below one of the folders of scenes, by name; the group says whether methods were developed on it
    "helmet": ("helmet/FlightHelmet.gltf", "known"),
    "dragon": ("dragon/dragon.blend", "known"),
    "cloth": ("cloth.blend", "unseen"),
    "city": ("city.blend", "unseen"),
    "truck": ("CesiumMilkTruck/glTF/CesiumMilkTruck.gltf", "unseen"),
    "figures": ("figures.blend", "unseen"),
    "deep": ("deep.blend", "unseen"),
}


@dataclasses.dataclass(frozen=True, order=True)
class View:
    """One low-resolution render."""

    scale: int
    samples: int
    width: str = WIDE

    @property
    def name(self) -> str:
        """Its name in tables and files."""
        return f"s{self.scale}-spp{self.samples}-{self.width}"


VIEWS = tuple(View(scale, samples, width) for scale in SCALES for width in (WIDE, NARROW) for samples in SAMPLES)


def place(name: str, store: Store, folders: Sequence[Path]) -> Place | None:
    """Return a scene of SCENES where its file is below one of ``folders``."""
    file, group = SCENES[name]
    found = next((path for folder in folders if (path := folder / file).is_file()), None)
    scene = Scene(name, file, group, display=DISPLAY, scale=SCALES[0], lenses=LENSES)
    return Place(store, scene, found) if found else None


def folder_of(view: View) -> str:
    """Return the name of a render's folder."""
    return _wide(view).folder if view.width == WIDE else view.name


def job(place: Place, view: View) -> Request:
    """Return the job of a render."""
    return dataclasses.replace(place.job(_wide(view)), output=str(place.folder / folder_of(view)),
                               view_aperture=1.0 if view.width == WIDE else 1 / view.scale)


def _wide(view: View) -> Render:
    return Render(view.scale, view.samples)


def fill(place: Place) -> None:
    """Render what is missing of a scene."""
    place.store.render_all([place.reference(REFERENCE_SAMPLES), *(job(place, view) for view in VIEWS)])
