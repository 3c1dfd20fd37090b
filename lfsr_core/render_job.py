"""What Blender is asked to render: the job file of ``scripts/blender_entry.py``."""

from __future__ import annotations

import dataclasses
from pathlib import Path
from typing import Any

from lfsr_core.display import DisplayProfile
from lfsr_core.errors import LfsrError
from lfsr_core.rays import CONVENTIONS

KINDS = ("render", "reference")
LAYERS = ("albedo", "normal", "position", "index")
LAYOUTS = ("one-pass", "view-by-view")
SCENE_SUFFIXES = (".blend", ".glb", ".gltf", ".obj")
DEFAULT_LAYERS = ("albedo", "normal")  # what the denoiser wants to see
DEFAULT_SAMPLES, DEFAULT_REFERENCE_SAMPLES = 16, 1024


@dataclasses.dataclass(frozen=True)
class RenderJob:
    """One call of Blender; LfsrError on values that cannot be rendered.

    ``samples`` per pixel; a reference splits them evenly over its two halves.
    ``frame`` None: the scene's current one. ``subject`` None: everything but the
    world and a collection called Background. ``lens_list``: (row, column) pairs.
    ``clamp_indirect`` None: Cycles' default; 0: unclamped.
    """

    scene: Path
    display: DisplayProfile
    kind: str = "render"
    scale: int = 4
    samples: int = DEFAULT_SAMPLES
    layers: tuple[str, ...] = DEFAULT_LAYERS
    layout: str = "one-pass"
    convention: str = "centred"
    view_aperture: float = 1.0
    seed: int = 0
    frame: int | None = None
    subject: str | None = None
    lens_list: tuple[tuple[int, int], ...] | None = None
    device: str = "CPU"
    clamp_indirect: float | None = None
    world_visible: bool | None = None

    def __post_init__(self) -> None:
        _check_scene(self.scene)
        self.display.low_views(self.scale)
        _check_choices(self)
        _check_samples(self)
        if not 0 <= self.view_aperture <= 1:
            raise LfsrError(f"view aperture is {self.view_aperture:g}, but it must be between 0 and 1")

    def to_dict(self, output: Path) -> dict[str, Any]:
        """The job file's data; ``output`` is the folder Blender writes into."""
        data = {field.name: getattr(self, field.name) for field in dataclasses.fields(self)}
        data["spp"] = data.pop("samples")
        return data | {"scene": str(self.scene.resolve()), "output": str(output.resolve()),
                       "display": self.display.to_dict(), "layers": list(self.layers),
                       "lens_list": None if self.lens_list is None else [list(lens) for lens in self.lens_list]}


def _check_scene(scene: Path) -> None:
    if scene.suffix.lower() not in SCENE_SUFFIXES:
        raise LfsrError(f"scene {scene} is of no kind this program opens: give one of {', '.join(SCENE_SUFFIXES)}")
    if not scene.is_file():
        raise LfsrError(f"scene {scene} does not exist: check the path")


def _check_choices(job: RenderJob) -> None:
    for label, value, allowed in (("kind", job.kind, KINDS), ("layout", job.layout, LAYOUTS),
                                  ("convention", job.convention, CONVENTIONS)):
        if value not in allowed:
            raise LfsrError(f"{label} is {value!r}, but it must be one of {', '.join(allowed)}")
    for layer in job.layers:
        if layer not in LAYERS:
            raise LfsrError(f"layer {layer!r} is unknown: choose from {', '.join(LAYERS)}")


def _check_samples(job: RenderJob) -> None:
    least = 2 if job.kind == "reference" else 1
    if job.samples < least:
        reason = " (one for each half)" if job.kind == "reference" else ""
        raise LfsrError(f"samples per pixel is {job.samples}, but it must be at least {least}{reason}")
