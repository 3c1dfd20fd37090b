"""One training scene into one file: build, expose, render, denoise, pack.

``scene_000012.npz`` holds, all float16 and scene-linear, rows from the top, pixels in view order, of pairs:

    lr_{spp}    (H/s, W/s, 10)  R G B A (premultiplied), albedo R G B (above 1 on emitters: clip it),
                                normal X Y Z (world space, zero where nothing was hit)
    oidn_{spp}, guided_{spp} (H/s, W/s, 3)  lr_{spp} over black, both images of the method oidn-both
    ref_a, ref_b (H, W, 4)      two independent full-resolution halves, R G B A
    meta        ()              text, JSON: see ``_meta``

and of a low-resolution set, where renders of the same samples differ by their seed, K from 0:

    color_{spp}_{K}, color_target    (H/s, W/s, 4)  R G B A as above; of the target indirect light is not clamped
    guides_{spp}_{K}, guides_target  (H/s, W/s, 6)  albedo R G B, normal X Y Z
    meta                             as above; "validates" is true for every tenth scene
"""

from __future__ import annotations

import dataclasses
import hashlib
import json
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import bpy
import numpy as np

from blender_addon.render.cycles import RenderSettings
from lfsr_core.arrays import Array
from lfsr_core.files import atomic_path
from lfsr_core.frames.low_res import LowResEIA
from lfsr_core.optics.display import load_display
from lfsr_core.optics.eia import from_elemental_images, to_elemental_images
from lfsr_core.reconstruct.methods.denoise import denoise_both_ways
from lfsr_lab.scenes.training import capture
from lfsr_lab.scenes.training.compose import compose
from lfsr_lab.scenes.training.displays import TRAIN, low_display, training_display
from lfsr_lab.scenes.training.stage import Stage

FORMAT = 4
REPEATS = {1: 4, 4: 3, 16: 2}  # renders of a low-resolution set by their samples; one of any other count
VALIDATION_EVERY = 10  # scenes
LEAST_OCCUPANCY, LEAST_OCCUPANCY_LOW, EXPOSURES, ATTEMPTS = 0.12, 0.25, (0.005, 200.0), 8


@dataclasses.dataclass(frozen=True)
class Recipe:
    """Settings of a set of scenes, their sources and their folder."""

    output: Path
    seed: int = 0
    display: str = "train"
    scale: int = 4
    spps: tuple[int, ...] = (1, 4, 16, 64)
    reference_spp: int = 512
    textures: tuple[Path, ...] = ()
    threads: int | None = None
    low_only: bool = False
    models: dict[Path, dict[str, str]] = dataclasses.field(default_factory=dict)

    def path(self, index: int) -> Path:
        """File of one scene."""
        return self.output / f"scene_{index:06d}.npz"

    def settings(self) -> dict[str, Any]:
        """Settings that all scenes of one folder must share."""
        pairs = {"format": FORMAT, "seed": self.seed, "display": self.display, "scale": self.scale,
                 "spps": list(self.spps), "reference_spp": self.reference_spp,
                 "textures": [path.name for path in self.textures]}
        names = "\n".join(fact["file"] for fact in self.models.values())
        models = f"{len(self.models)} of names with SHA-256 {hashlib.sha256(names.encode()).hexdigest()[:16]}"
        return pairs | ({"low_only": True, "models": models} if self.low_only else {})


@contextmanager
def _timed(seconds: dict[str, float], name: str) -> Iterator[None]:
    """Add the block's time to ``seconds[name]``."""
    started = time.perf_counter()
    yield
    seconds[name] = round(seconds.get(name, 0) + time.perf_counter() - started, 4)


def produce(recipe: Recipe, index: int) -> dict[str, float]:
    """Make one scene's file, whole or not at all; return the seconds of each stage."""
    stage, facts = _ready_scene(recipe, index)
    arrays = (_render_low if recipe.low_only else _render_pairs)(recipe, stage, facts)
    facts["p"] = capture.occupancy(capture.lens_means(stage, arrays["color_target" if recipe.low_only else "ref_a"]))
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
            exposure, occupied = capture.expose(stage, _render_seed(stage.rng))
        least = LEAST_OCCUPANCY_LOW if recipe.low_only else LEAST_OCCUPANCY
        if occupied >= least and EXPOSURES[0] < exposure < EXPOSURES[1]:
            break
    return stage, {"index": index, "attempt": attempt, "exposure": exposure, "seeds": {}, "seconds": seconds}


def build_scene(recipe: Recipe, index: int, attempt: int) -> Stage:
    """Build scene ``index`` in an empty Blender: the same whatever was built before it."""
    bpy.ops.wm.read_homefile(use_empty=True, use_factory_startup=True)
    rng = np.random.default_rng([recipe.seed, index, attempt])
    if recipe.low_only and recipe.display == TRAIN:
        profile, scale = low_display(rng)
    else:
        scale = recipe.scale
        profile = training_display(rng) if recipe.display == TRAIN else load_display(recipe.display)
    stage = Stage.for_display(rng, profile, scale, recipe.textures, models=recipe.models, is_varied=recipe.low_only)
    compose(stage)
    # The scene is rendered several times: keep textures and acceleration structure between renders.
    bpy.context.scene.render.use_persistent_data = True
    if recipe.threads:
        bpy.context.scene.render.threads_mode, bpy.context.scene.render.threads = "FIXED", recipe.threads
    return stage


def _render_low(recipe: Recipe, stage: Stage, facts: dict[str, Any]) -> dict[str, Array]:
    """Independent low-resolution renders of each count of samples, and the clean one that is the target."""
    names = {f"{samples}_{k}": samples for samples in recipe.spps for k in range(REPEATS.get(samples, 1))}
    arrays = {}
    for name, samples in (names | {"target": recipe.reference_spp}).items():
        with _timed(facts["seconds"], "target" if name == "target" else "low"):
            seed = facts["seeds"][name] = _render_seed(stage.rng)
            layers = capture.render_low(stage, samples, seed, 0.0 if name == "target" else None)
        arrays[f"color_{name}"] = capture.half_floats(layers["color"])
        arrays[f"guides_{name}"] = capture.half_floats(np.concatenate([layers["albedo"], layers["normal"]], -1))
    return arrays


def _render_pairs(recipe: Recipe, stage: Stage, facts: dict[str, Any]) -> dict[str, Array]:
    """Low-resolution renders, raw and denoised, and both halves of the full-resolution reference."""
    arrays: dict[str, Array] = {}
    for samples in recipe.spps:
        with _timed(facts["seconds"], "low"):
            seed = facts["seeds"][f"lr_{samples}"] = _render_seed(stage.rng)
            layers = capture.render_low(stage, samples, seed)
        with _timed(facts["seconds"], "oidn"):
            denoised = _denoised(layers, stage.profile.lenses, (samples, recipe.scale))
        images = denoised | {"lr": np.concatenate([layers[name] for name in ("color", "albedo", "normal")], -1)}
        arrays |= {f"{name}_{samples}": capture.half_floats(image) for name, image in images.items()}
    for half in ("ref_a", "ref_b"):
        with _timed(facts["seconds"], "high"):
            seed = facts["seeds"][half] = _render_seed(stage.rng)
            settings = RenderSettings(recipe.reference_spp // 2, seed, clamp_indirect=0.0)
            arrays[half] = capture.half_floats(capture.render(stage, 1, settings)["color"])
    return arrays


def _denoised(layers: dict[str, Array], lenses: tuple[int, int], render: tuple[int, int]) -> dict[str, Array]:
    """Both images of ``oidn-both`` over black; ``render``: samples and scale."""
    images = {name: to_elemental_images(np.nan_to_num(layers[name], posinf=0.0), lenses)
              for name in ("color", "albedo", "normal")}
    low = LowResEIA(np.maximum(images["color"][..., :3], 0), images["color"][..., 3:], *render,
                    albedo=images["albedo"][..., :3], normal=images["normal"][..., :3])
    both = denoise_both_ways(low)
    return {"oidn": from_elemental_images(both.color), "guided": from_elemental_images(np.asarray(both.guided))}


def _render_seed(rng: np.random.Generator) -> int:
    return int(rng.integers(2 ** 31 - 1))


def _meta(recipe: Recipe, stage: Stage, facts: dict[str, Any]) -> dict[str, Any]:
    """Return the header: how to read the arrays and how to make them again."""
    low = {"validates": facts["index"] % VALIDATION_EVERY == VALIDATION_EVERY - 1, "is_direct": stage.is_direct}
    return recipe.settings() | facts | (low if recipe.low_only else {}) | {
        "scale": stage.scale, "lenses": list(stage.profile.lenses), "views": list(stage.profile.views),
        "profile": stage.profile.to_dict(), "array": dataclasses.asdict(stage.array),
        "matrix_world": [list(row) for row in stage.matrix_world], "convention": "centred", "view_aperture": 1.0,
        "layout": stage.notes[0]["name"], "scene": stage.notes, "device": "CPU",
        "blender": bpy.app.version_string}
