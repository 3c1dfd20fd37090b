"""Open scene files: .blend, glTF and OBJ."""

from __future__ import annotations

import re
from collections.abc import Callable
from pathlib import Path

import bpy
import numpy as np

from lfsr_core.base.messages import LfsrError, Notice, Tell, did_you_mean, silent
from lfsr_core.frames.frame import FIT, check_scene
from lfsr_core.frames.scene_files import check_named_files

from .array import rig
from .files import check_opened

MOST_NAMES = 5
MOST_REASON = 100  # characters
MOST_PLACE = 1e15  # scene units: single precision squares what is farther to infinity
# Compressions of glTF by what the importer says where it cannot read them, and the command that decodes them. Blender
# 5.2 reads Meshopt where it has the library.
COMPRESSIONS = {r"meshopt_compression|Meshopt decoder": ("Meshopt", "copy"),
                r"draco\w*\.(so|dll|dylib)": ("Draco", "copy"),
                r"KHR_texture_basisu": ("KTX 2", "ktxdecompress")}


def open_scene(path: str | Path, tell: Tell = silent) -> bpy.types.Scene:
    """Open a .blend, or import .glb, .gltf or .obj into an empty file; LfsrError if that fails."""
    path = check_scene(path)
    if outside := check_named_files(path):
        tell(Notice("files-outside", {"names": outside}))
    try:
        if (suffix := Path(path).suffix.lower()) != ".blend":
            bpy.ops.wm.read_factory_settings(use_empty=True)
            bpy.context.scene.render.engine = "CYCLES"  # such a file names none
            READERS[suffix](path)
        else:
            _open_blend(path, tell)
    except LfsrError:
        raise
    except (RuntimeError, ValueError, KeyError, OSError) as error:
        for pattern, (name, command) in COMPRESSIONS.items():
            if re.search(pattern, str(error)):
                raise LfsrError(f"scene {path} is compressed with {name}, which this Blender cannot read: decode "
                                f"it with `gltf-transform {command} {Path(path).name} NEW.glb`") from None
        # The last line of an importer's traceback says why; Blender adds where it called the importer.
        lines = [line.strip() for line in str(error).splitlines() if line.strip() and not line.startswith("Location: ")]
        reason = lines[-1][:MOST_REASON] if lines else type(error).__name__
        raise LfsrError(f"scene {path} cannot be read ({reason}): check that the file is complete") from None
    for mesh in bpy.data.meshes:
        places = np.empty(3 * len(mesh.vertices), np.float32)
        mesh.vertices.foreach_get("co", places)
        if not (np.abs(places) < MOST_PLACE).all():
            raise LfsrError(f"scene {path} has a mesh {mesh.name!r} whose vertices are not finite, or farther than "
                            f"{MOST_PLACE:g} away: correct the mesh")
    return bpy.context.scene


def choose_scene(name: str) -> bpy.types.Scene:
    """Make the scene of the full name ``name`` in the open file the current one; LfsrError if there is none."""
    scenes = {scene.name_full: scene for scene in bpy.data.scenes}
    scene = scenes.get(name)
    if scene is None:
        raise LfsrError(f"the file has no scene {name!r}: choose one of {', '.join(scenes)}")
    return _shown(scene)


def local_scene(scene: bpy.types.Scene) -> bpy.types.Scene:
    """Return ``scene``, made local where it is linked, so that a camera can be added; its objects stay linked."""
    return scene if scene.library is None else _shown(scene.make_local())


def _shown(scene: bpy.types.Scene) -> bpy.types.Scene:
    """Show ``scene`` in the window: Blender evaluates the scene that was open when the file was saved otherwise."""
    bpy.context.window.scene = scene
    return scene


def _open_blend(path: str, tell: Tell) -> None:
    """Open a .blend; the files that it names are looked at before Blender evaluates the scene, which reads them."""
    wrong = []

    @bpy.app.handlers.persistent
    def look(*_: object) -> None:
        try:
            check_opened(path, tell)
        except LfsrError as error:  # nothing is left to evaluate
            wrong.append(error)
            for scene in bpy.data.scenes:
                scene.sequence_editor_clear()
            bpy.data.batch_remove([*bpy.data.objects, *bpy.data.cache_files])

    bpy.app.handlers.load_post.append(look)
    try:
        bpy.ops.wm.open_mainfile(filepath=path, load_ui=False)
    finally:
        bpy.app.handlers.load_post.remove(look)
    if wrong:
        raise wrong[0]


def _import_gltf(path: str) -> None:
    bpy.ops.import_scene.gltf(filepath=path)
    # The importer makes none of the file's cameras active. An array can stand at perspective cameras only.
    scene = bpy.context.scene
    scene.camera = next((item for item in scene.objects if item.type == "CAMERA" and item.data.type == "PERSP"), None)


READERS: dict[str, Callable[[str], object]] = {
    ".glb": _import_gltf, ".gltf": _import_gltf, ".obj": lambda path: bpy.ops.wm.obj_import(filepath=path)}


def choose_camera(scene: bpy.types.Scene, name: str) -> None:
    """Make the camera ``name`` the active one; FIT leaves the scene without an active camera.

    The scene's own camera array is ignored from then on. LfsrError if the scene has no such camera.
    """
    camera = next((item for item in cameras(scene) if item.name == name), None)
    if camera is None and name != FIT:
        names = [item.name for item in cameras(scene)]
        others = f"{did_you_mean(name, names)}Choose one of {', '.join(names[:MOST_NAMES])}" if names else "It has none"
        raise LfsrError(f"the scene has no camera {name!r}: {others}, or {FIT} to place the array in front of the "
                        "subject")
    if not rig.is_array(camera):
        rig.forget(scene)
    scene.camera = camera


def cameras(scene: bpy.types.Scene) -> list[bpy.types.Object]:
    """Return the scene's cameras in the order of its objects."""
    return [item for item in scene.objects if item.type == "CAMERA"]


def camera_notices(scene: bpy.types.Scene, asked: str | None, is_imported: bool) -> list[Notice]:
    """Return what to know of the camera that the array stands at.

    ``asked``: name that was asked for, None for none; ``is_imported``: whether the file's format has no active camera.
    """
    camera = rig.find(scene) or scene.camera
    others = [item.name for item in cameras(scene) if item != scene.camera]
    if camera is None:
        return [Notice("camera-missing", {"others": others})] if asked is None else []
    is_choice = is_imported and asked is None and scene.camera is not None
    chosen = [Notice("camera-chosen", {"camera": scene.camera.name, "others": others})] if is_choice else []
    return [*chosen, *([Notice("camera-mirrored", {"camera": camera.name})] if rig.is_mirrored(camera) else [])]
