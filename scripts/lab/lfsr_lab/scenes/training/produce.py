"""One training scene into one file: build, expose, render, denoise, pack.

``scene_000012.npz`` holds, all float16 and scene-linear, rows from the top, pixels in view order, of pairs:

    lr_{spp}    (H/s, W/s, 10)  R G B A (premultiplied), albedo R G B (above 1 on emitters: clip it),
                                normal X Y Z (world space, zero where nothing was hit)
    oidn_{spp}, guided_{spp} (H/s, W/s, 3)  lr_{spp} over black, both pictures of the method oidn-both
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

from lfsr_core.arrays import Array
from lfsr_core.files import atomic_path
from lfsr_core.frames.low_res import LowResEIA
from lfsr_core.optics.eia import from_elemental_images, to_elemental_images
from lfsr_core.reconstruct.methods.denoise import denoise_both_ways
from lfsr_lab.scenes.training.capture import Capture, expose, half_floats, occupancy, tiles
from lfsr_lab.scenes.training.compose import compose
from lfsr_lab.scenes.training.device import use_device
from lfsr_lab.scenes.training.displays import TRAIN, choose_display, low_display
from lfsr_lab.scenes.training.stage import Stage

FORMAT = 4
REPEATS = {1: 4, 4: 3, 16: 2}  # renders of a low-resolution set by their samples; one of any other count
VALIDATION_EVERY = 10  # scenes
LEAST_OCCUPANCY, LEAST_OCCUPANCY_LOW, EXPOSURES, ATTEMPTS = 0.12, 0.25, (0.005, 200.0), 8


@dataclasses.dataclass(frozen=True)
class Recipe:
    """What decides the pixels of scene ``index``, and where and how they are made."""

    output: Path
    seed: int = 0
    display: str = "train"
    scale: int = 4
    spps: tuple[int, ...] = (1, 4, 16, 64)
    reference_spp: int = 512
    textures: tuple[Path, ...] = ()
    device: str = "CPU"
    threads: int | None = None
    compress: bool = False
    low_only: bool = False
    models: dict[Path, dict[str, str]] = dataclasses.field(default_factory=dict)

    def path(self, index: int) -> Path:
        """File of one scene."""
        return self.output / f"scene_{index:06d}.npz"

    def settings(self) -> dict[str, Any]:
        """What must not change between scenes of one folder."""
        pairs = {"format": FORMAT, "seed": self.seed, "display": self.display, "scale": self.scale,
                 "spps": list(self.spps), "reference_spp": self.reference_spp,
                 "textures": [path.name for path in self.textures]}
        names = "\n".join(fact["file"] for fact in self.models.values())
        models = f"{len(self.models)} of names with SHA-256 {hashlib.sha256(names.encode()).hexdigest()[:16]}"
        return pairs | ({"low_only": True, "models": models} if self.low_only else {})


class Clock:
    """Seconds per stage."""

    def __init__(self) -> None:
        self.seconds: dict[str, float] = {}

    @contextmanager
    def stage(self, name: str) -> Iterator[None]:
        """Add the block's time to ``name``."""
        started = time.perf_counter()
        yield
        self.seconds[name] = round(self.seconds.get(name, 0) + time.perf_counter() - started, 4)


def produce(recipe: Recipe, index: int) -> dict[str, float]:
    """Make one scene's file, whole or not at all; seconds per stage."""
    clock = Clock()
    capture, facts = _ready_scene(recipe, index, clock)
    arrays = (_render_low if recipe.low_only else _render_pairs)(recipe, capture, facts, clock)
    with clock.stage("write"):
        text = json.dumps(_meta(recipe, capture, facts, clock), allow_nan=False)
        _save(recipe.path(index), arrays | {"meta": np.array(text)}, recipe.compress)
    return clock.seconds


def _ready_scene(recipe: Recipe, index: int, clock: Clock) -> tuple[Capture, dict[str, Any]]:
    """A built and exposed scene that fills enough of the display; nearly empty or unlit ones are built anew."""
    for attempt in range(ATTEMPTS):
        with clock.stage("build"):
            stage, scale = build_scene(recipe, index, attempt)
            use_device(recipe.device, recipe.threads)
        capture = Capture(stage, scale, recipe.device)
        with clock.stage("expose"):
            exposure, share = expose(capture, _render_seed(stage.rng))
        least = LEAST_OCCUPANCY_LOW if recipe.low_only else LEAST_OCCUPANCY
        if share >= least and EXPOSURES[0] < exposure < EXPOSURES[1]:
            break
    return capture, {"index": index, "attempt": attempt, "exposure": exposure, "p": share, "seeds": {}}


def build_scene(recipe: Recipe, index: int, attempt: int) -> tuple[Stage, int]:
    """Scene ``index`` in an empty Blender, the same whatever was built before it, and the scale of its renders."""
    bpy.ops.wm.read_homefile(use_empty=True, use_factory_startup=True)
    rng = np.random.default_rng([recipe.seed, index, attempt])
    profile, scale = low_display(rng) if recipe.low_only and recipe.display == TRAIN else (
        choose_display(recipe.display, rng), recipe.scale)
    stage = Stage.for_display(rng, profile, scale, recipe.textures, models=recipe.models, is_varied=recipe.low_only,
                              is_direct=profile.is_woven and scale == 1)
    stage.layout = compose(stage)
    # The same scene is rendered several times: keep textures and acceleration structure between renders.
    bpy.context.scene.render.use_persistent_data = True
    return stage, scale


def _render_low(recipe: Recipe, capture: Capture, facts: dict[str, Any], clock: Clock) -> dict[str, Array]:
    """Independent low-resolution renders of each count of samples, and the clean one that is the target."""
    names = {f"{samples}_{k}": samples for samples in recipe.spps for k in range(REPEATS.get(samples, 1))}
    arrays = {}
    for name, samples in (names | {"target": recipe.reference_spp}).items():
        with clock.stage("target" if name == "target" else "low"):
            seed = facts["seeds"][name] = _render_seed(capture.stage.rng)
            layers = capture.low(samples, seed, 0.0 if name == "target" else None)
        arrays[f"color_{name}"] = half_floats(layers["color"])
        arrays[f"guides_{name}"] = half_floats(np.concatenate([layers["albedo"], layers["normal"]], -1))
    facts["p"] = occupancy(arrays["color_target"], tiles(capture.stage, arrays["color_target"]))
    return arrays


def _render_pairs(recipe: Recipe, capture: Capture, facts: dict[str, Any], clock: Clock) -> dict[str, Array]:
    arrays = {}
    for samples in recipe.spps:
        with clock.stage("low"):
            seed = facts["seeds"][f"lr_{samples}"] = _render_seed(capture.stage.rng)
            layers = capture.low(samples, seed)
        with clock.stage("oidn"):
            pictures = _denoised(layers, capture.stage.profile.lenses, (samples, recipe.scale))
            arrays |= {f"{name}_{samples}": half_floats(image) for name, image in pictures.items()}
        arrays[f"lr_{samples}"] = half_floats(np.concatenate([layers[k] for k in ("color", "albedo", "normal")], -1))
    for half in ("ref_a", "ref_b"):
        with clock.stage("high"):
            seed = facts["seeds"][half] = _render_seed(capture.stage.rng)
            arrays[half] = half_floats(capture.high(recipe.reference_spp // 2, seed))
    facts["p"] = occupancy(arrays["ref_a"], capture.stage.profile.lenses)
    return arrays


def _denoised(layers: dict[str, Array], lenses: tuple[int, int],
              render: tuple[int, int]) -> dict[str, Array]:
    """Both pictures of ``oidn-both``, of (samples, scale). Over black, premultiplied colour is the picture itself."""
    images = {name: to_elemental_images(np.nan_to_num(layers[name], posinf=0.0), lenses)
              for name in ("color", "albedo", "normal")}
    low = LowResEIA(np.maximum(images["color"][..., :3], 0), images["color"][..., 3:], *render,
                    albedo=images["albedo"][..., :3], normal=images["normal"][..., :3])
    both = denoise_both_ways(low)
    return {"oidn": from_elemental_images(both.color), "guided": from_elemental_images(both.guided)}


def _render_seed(rng: np.random.Generator) -> int:
    return int(rng.integers(2 ** 31 - 1))


def _meta(recipe: Recipe, capture: Capture, facts: dict[str, Any], clock: Clock) -> dict[str, Any]:
    """Enough to read the arrays and to make them again."""
    stage = capture.stage
    low = {"scale": capture.scale, "validates": facts["index"] % VALIDATION_EVERY == VALIDATION_EVERY - 1,
           "is_direct": stage.is_direct}
    return recipe.settings() | facts | (low if recipe.low_only else {}) | {
        "lenses": list(stage.profile.lenses), "views": list(stage.profile.views),
        "profile": stage.profile.to_dict(), "array": dataclasses.asdict(stage.array),
        "matrix_world": [list(row) for row in stage.matrix_world], "convention": "centred", "view_aperture": 1.0,
        "channels": {"color": ["R", "G", "B", "A"], "guides": ["albedo.R", "albedo.G", "albedo.B", "normal.X",
                                                                "normal.Y", "normal.Z"]} if recipe.low_only else {
                     "lr": ["R", "G", "B", "A", "albedo.R", "albedo.G", "albedo.B", "normal.X", "normal.Y", "normal.Z"],
                     "oidn": ["R", "G", "B"], "guided": ["R", "G", "B"],
                     "ref": ["R", "G", "B", "A"]},
        "layout": stage.layout, "scene": stage.notes, "device": recipe.device, "blender": bpy.app.version_string,
        "seconds": clock.seconds}


def _save(path: Path, arrays: dict[str, Array], compress: bool) -> None:
    with atomic_path(path) as temporary, temporary.open("wb") as file:
        (np.savez_compressed if compress else np.savez)(file, **arrays)
