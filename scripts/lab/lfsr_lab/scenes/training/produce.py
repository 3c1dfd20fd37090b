"""One training scene into one file: build, expose, render, pack.

``scene_000012.npz`` holds, all float16 and scene-linear, rows from the top, pixels in view order; renders of the same
samples differ by their seed, K from 0:

    color_{spp}_{K}, color_target    (H/s, W/s, 4)  R G B A (premultiplied); of the target indirect light is not clamped
    guides_{spp}_{K}, guides_target  (H/s, W/s, 6)  albedo R G B (above 1 on emitters: clip it), normal X Y Z (world
                                                    space, zero where nothing was hit)
    meta                             text, JSON: see ``_meta``; "validates" is true for every tenth scene
"""

from __future__ import annotations

import dataclasses
import hashlib
import json
import math
import tempfile
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import bpy
import numpy as np

from blender_addon.render.cycles import RenderSettings, Shot, render_encoded
from lfsr_core.base.arrays import Array
from lfsr_core.base.system import atomic_path
from lfsr_core.frames.frame import SUBPIXELS
from lfsr_core.images.image_files import read_layers
from lfsr_core.optics.display import load_display
from lfsr_core.optics.panel.subpixel_rays import PanelLayout
from lfsr_core.optics.rays import RayLayout
from lfsr_lab.scenes.training import layouts
from lfsr_lab.scenes.training.materials import light_open_scene
from lfsr_lab.scenes.training.stage import TRAIN, Stage, training_display

EXPOSURE_SAMPLES = 4
BRIGHTNESS = (0.05, 1.0)  # scene-linear, of the median foreground lens
OF_BRIGHT_LENS = 3.0  # times brighter, where another lens than the median counts
LEAST_COVERED = 0.02  # of a foreground lens
PANEL_TILE = (12, 6)  # pixels that count as a lens in an image of subpixels
LUMINANCE = np.array([0.2126, 0.7152, 0.0722])
LARGEST = 65504.0  # of float16


def render_low(stage: Stage, samples: int, seed: int, clamp: float | None = None) -> dict[str, Array]:
    """Render the low-resolution layers: color (RGBA), albedo, normal, each (H/s, W/s, C)."""
    return render(stage, stage.scale, RenderSettings(samples, seed, ("albedo", "normal"), clamp_indirect=clamp))


def render(stage: Stage, scale: int, settings: RenderSettings) -> dict[str, Array]:
    """Render the layers of the EIA at a scale, or of the panel's subpixels."""
    profile, array = stage.profile, stage.array
    shot = Shot(PanelLayout(profile, array), stage.matrix_world, SUBPIXELS) if stage.is_direct else \
        Shot(RayLayout.for_display(profile, array, scale), stage.matrix_world)
    with tempfile.TemporaryDirectory(prefix="lfsr-training-") as folder:
        path = Path(folder, "render.exr")
        render_encoded(bpy.context.scene, shot, settings, path)
        return read_layers(path)


def expose(stage: Stage, seed: int) -> tuple[float, float]:
    """Scale every light so that the stage's ``bright_lens`` has a random sensible brightness.

    Return the factor and the fraction of lenses that see anything.
    """
    wanted = stage.log_uniform(*BRIGHTNESS)
    wanted *= OF_BRIGHT_LENS if stage.bright_lens > 0.5 else 1.0
    lenses = lens_means(stage, render_low(stage, EXPOSURE_SAMPLES, seed)["color"])
    seen = lenses[lenses[..., 3] > LEAST_COVERED]
    brightness = np.quantile(seen[:, :3] @ LUMINANCE / seen[:, 3], stage.bright_lens) if len(seen) else 0.0
    factor = float(wanted / max(brightness, 1e-9))
    for owner, attribute in stage.dimmers:
        setattr(owner, attribute, getattr(owner, attribute) * factor)
    return factor, occupancy(lenses)


def lens_means(stage: Stage, image: Array) -> Array:
    """Mean of each elemental image, or of each tile of an image of subpixels, (rows, columns, C)."""
    sx, sy = stage.profile.lenses
    if stage.is_direct:
        sx, sy = image.shape[1] // PANEL_TILE[0], image.shape[0] // PANEL_TILE[1]
    image = np.nan_to_num(image.astype(np.float32))
    return image.reshape(sy, image.shape[0] // sy, sx, image.shape[1] // sx, -1).mean((1, 3))


def occupancy(means: Array) -> float:
    """Fraction of lenses that see anything."""
    return float((means[..., 3] > 0).mean())


def half_floats(image: Array) -> Array:
    """float16, clipped to its range, without NaN or infinity."""
    return np.clip(np.nan_to_num(image, posinf=LARGEST, neginf=0.0), -LARGEST, LARGEST).astype(np.float16)


FORMAT = 4
REPEATS = {1: 4, 4: 3, 16: 2}  # renders by their samples; one of any other count
VALIDATION_EVERY = 10  # scenes
LEAST_OCCUPANCY, EXPOSURES, ATTEMPTS = 0.25, (0.005, 200.0), 8


@dataclasses.dataclass(frozen=True)
class Recipe:
    """Settings of a set of scenes, their sources and their folder."""

    output: Path
    seed: int = 0
    display: str = "train"
    scale: int = 4  # where the display is no TRAIN
    spps: tuple[int, ...] = (1, 4, 16)
    reference_spp: int = 256
    textures: tuple[Path, ...] = ()
    threads: int | None = None
    models: dict[Path, dict[str, str]] = dataclasses.field(default_factory=dict)

    def path(self, index: int) -> Path:
        return self.output / f"scene_{index:06d}.npz"

    def settings(self) -> dict[str, Any]:
        """Settings that all scenes of one folder must share."""
        names = "\n".join(fact["file"] for fact in self.models.values())
        models = f"{len(self.models)} of names with SHA-256 {hashlib.sha256(names.encode()).hexdigest()[:16]}"
        return {"format": FORMAT, "seed": self.seed, "display": self.display, "scale": self.scale,
                "spps": list(self.spps), "reference_spp": self.reference_spp,
                "textures": [path.name for path in self.textures], "low_only": True, "models": models}


@contextmanager
def _timed(seconds: dict[str, float], name: str) -> Iterator[None]:
    """Add the block's time to ``seconds[name]``."""
    started = time.perf_counter()
    yield
    seconds[name] = round(seconds.get(name, 0) + time.perf_counter() - started, 4)


def produce(recipe: Recipe, index: int) -> dict[str, float]:
    """Make one scene's file, whole or not at all; return the seconds of each stage."""
    stage, facts = _ready_scene(recipe, index)
    arrays = _render(recipe, stage, facts)
    facts["p"] = occupancy(lens_means(stage, arrays["color_target"]))
    with _timed(facts["seconds"], "write"):
        text = json.dumps(_meta(recipe, stage, facts), allow_nan=False)
        with atomic_path(recipe.path(index)) as temporary, temporary.open("wb") as file:
            np.savez_compressed(file, **arrays, meta=np.array(text))
    return facts["seconds"]


def _ready_scene(recipe: Recipe, index: int) -> tuple[Stage, dict[str, Any]]:
    """Build and expose a scene, again while it is nearly empty or unlit; return it and the facts of its header."""
    seconds: dict[str, float] = {}
    for attempt in range(ATTEMPTS):
        with _timed(seconds, "build"):
            stage = build_scene(recipe, index, attempt)
        with _timed(seconds, "expose"):
            exposure, occupied = expose(stage, _render_seed(stage.rng))
        if occupied >= LEAST_OCCUPANCY and EXPOSURES[0] < exposure < EXPOSURES[1]:
            break
    return stage, {"index": index, "attempt": attempt, "exposure": exposure, "seeds": {}, "seconds": seconds}


def build_scene(recipe: Recipe, index: int, attempt: int) -> Stage:
    """Build scene ``index`` in an empty Blender: the same whatever was built before it."""
    bpy.ops.wm.read_homefile(use_empty=True, use_factory_startup=True)
    rng = np.random.default_rng([recipe.seed, index, attempt])
    profile, scale = training_display(rng) if recipe.display == TRAIN else (load_display(recipe.display), recipe.scale)
    stage = Stage.for_display(rng, profile, scale, recipe.textures, recipe.models)
    compose(stage)
    # The scene is rendered several times: keep textures and acceleration structure between renders.
    bpy.context.scene.render.use_persistent_data = True
    if recipe.threads:
        bpy.context.scene.render.threads_mode, bpy.context.scene.render.threads = "FIXED", recipe.threads
    return stage


def _render(recipe: Recipe, stage: Stage, facts: dict[str, Any]) -> dict[str, Array]:
    """Independent low-resolution renders of each count of samples, and the clean one that is the target."""
    names = {f"{samples}_{k}": samples for samples in recipe.spps for k in range(REPEATS.get(samples, 1))}
    arrays = {}
    for name, samples in (names | {"target": recipe.reference_spp}).items():
        with _timed(facts["seconds"], "target" if name == "target" else "low"):
            seed = facts["seeds"][name] = _render_seed(stage.rng)
            layers = render_low(stage, samples, seed, 0.0 if name == "target" else None)
        arrays[f"color_{name}"] = half_floats(layers["color"])
        arrays[f"guides_{name}"] = half_floats(np.concatenate([layers["albedo"], layers["normal"]], -1))
    return arrays


def _render_seed(rng: np.random.Generator) -> int:
    return int(rng.integers(2 ** 31 - 1))


def _meta(recipe: Recipe, stage: Stage, facts: dict[str, Any]) -> dict[str, Any]:
    """Return the header: how to read the arrays and how to make them again."""
    return recipe.settings() | facts | {
        "validates": facts["index"] % VALIDATION_EVERY == VALIDATION_EVERY - 1, "is_direct": stage.is_direct,
        "scale": stage.scale, "lenses": list(stage.profile.lenses), "views": list(stage.profile.views),
        "profile": stage.profile.to_dict(), "array": dataclasses.asdict(stage.array),
        "matrix_world": [list(row) for row in stage.matrix_world], "convention": "centred",
        "view_aperture": 1.0, "layout": stage.notes[0]["name"], "scene": stage.notes, "device": "CPU",
        "blender": bpy.app.version_string}


FROM_ABOVE = ("hero", "assembly", "pile", "woods", "bouquet", "meadow", "crowd")
OWN_BACKGROUND = ("wall", "street", "window")


def compose(stage: Stage) -> None:
    """Fill the stage with one random layout and its light; the first note is the layout's."""
    choices = layouts.LAYOUTS
    name = stage.pick({name: weight for name, (weight, _) in choices.items()})
    stage.note("layout", name=name, front=stage.front, behind=stage.behind)
    choices[name][1](stage)
    if name not in ("room", *layouts.LIT):
        light_open_scene(stage)
        if name not in OWN_BACKGROUND and stage.chance(0.15):
            layouts.backdrop(stage)
        elif name in FROM_ABOVE and stage.chance(0.6):
            stage.pitch = stage.rng.uniform(0, math.radians(35))
            stage.note("pitch", angle=stage.pitch)
    if stage.chance(0.07):
        layouts.fog(stage)
