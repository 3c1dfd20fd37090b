"""Real models one behind another, deeper than a display can show, as .blend files: to measure the scale by depth.

    python scripts/lab/lfsr_lab/scenes/deep_scenes.py MODELS DIR

MODELS has FlightHelmet.gltf, GlassVaseFlowers.gltf, japaneseMaple.obj and head.glb in it, or in folders of it. The
scenes are ``row``, ``grove`` and ``steps``; docs/results/stress.md says how they are measured.
"""

import sys
from pathlib import Path

# Where lfsr_lab and lfsr_core are: installed side by side, or in a clone, scripts/lab and the root.
sys.path.extend(str(Path(__file__).resolve().parents[level]) for level in (2, 4))

import bpy
from mathutils import Vector

from lfsr_core.base.messages import LfsrError
from lfsr_core.process.child import EXIT_BAD_INPUT, emit
from lfsr_lab.scenes.shared.objects import add_object, leave, save, script_paths, settle, world

HELMET, VASE, TREE, HEAD = "FlightHelmet.gltf", "GlassVaseFlowers.gltf", "japaneseMaple.obj", "head.glb"
# Model, place of its middle (y away from the viewer), longest side, turn in radians.
Item = tuple[str, tuple[float, float, float], float, float]
SCENES: dict[str, tuple[str, list[Item]]] = {  # HDRI and models
    "row": ("city", [(HELMET, (-0.8, -2.2, -0.1), 1.0, 0.3), (VASE, (0, -0.4, 0), 1.1, 0.0),
            (HEAD, (0.7, 1.4, 0), 1.0, 0.0), (TREE, (-0.3, 3.0, 0.2), 1.8, 0.0)]),
    "grove": ("forest", [(TREE, (-0.9, -1.8, 0), 1.0, 0.0), (TREE, (0.5, -0.6, 0), 1.2, 1.0),
              (TREE, (-0.4, 0.8, 0.1), 1.4, 2.0), (TREE, (0.8, 2.4, 0.2), 1.8, 3.0)]),
    "steps": ("courtyard", [(VASE, (-1, -0.9, -0.2), 0.9, 0.0), (HELMET, (0, 0, -0.1), 1.0, 0.0),
              (VASE, (0.9, 1.0, 0.1), 1.0, 2.0)])}


def build(models: Path, light: str, items: list[Item]) -> None:
    """One of the scenes in an empty Blender, everything packed."""
    bpy.ops.wm.read_homefile(use_empty=True, use_factory_startup=True)
    world(light, 1.0)
    bpy.context.scene.render.film_transparent = True
    for name, at, size, turn in items:
        holder = add_object(None, None, name)
        load(model_path(models, name)).parent = holder
        settle(holder, at, size, (0, 0, turn))
    bpy.ops.file.pack_all()


def model_path(models: Path, name: str) -> Path:
    """The file ``name`` somewhere in ``models``."""
    paths = sorted(models.rglob(name))
    if not paths:
        raise LfsrError(f"{models} has no {name}: name the folder that holds the models")
    return paths[0]


def load(path: Path) -> bpy.types.Object:
    """A model's meshes under an object that puts their middle at its origin and makes their longest side 1."""
    before = set(bpy.data.objects)
    read = bpy.ops.wm.obj_import if path.suffix == ".obj" else bpy.ops.import_scene.gltf
    read(filepath=str(path))
    added = [item for item in bpy.data.objects if item not in before]
    for item in [item for item in added if item.type in ("CAMERA", "LIGHT")]:
        added.remove(item)
        bpy.data.objects.remove(item)
    bpy.context.view_layer.update()
    corners = [item.matrix_world @ Vector(corner) for item in added if item.type == "MESH" for corner in item.bound_box]
    low, high = (Vector(map(limit, zip(*corners, strict=True))) for limit in (min, max))
    root = add_object(None, None, path.stem)
    root.scale = (1 / max(high - low),) * 3
    root.location = -(low + high) / 2 * root.scale.x
    for item in added:
        if item.parent is None:
            item.parent = root
    return root


def main(models: Path, folder: Path) -> int:
    """Write every scene into ``folder``; exit code: 0, 2 without the models."""
    try:
        for name, (light, items) in SCENES.items():
            build(models, light, items)
            folder.mkdir(parents=True, exist_ok=True)
            save(folder / f"{name}.blend")
    except LfsrError as error:
        emit(stage="error", message=str(error))
        return EXIT_BAD_INPUT
    return 0


if __name__ == "__main__":
    leave(main(**script_paths(__doc__, models="MODELS", folder="DIR")))
