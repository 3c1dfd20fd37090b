"""Scene files (.blend, glTF and OBJ): how they are opened, what an image of them depends on, what cannot be read."""

import functools
import json
import math
import mmap
import os
import re
import struct
import tempfile
import time
from collections import defaultdict
from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Any

import bpy
import numpy as np

from lfsr_core.base.messages import LfsrError, Notice, Progress, Tell, did_you_mean, silent
from lfsr_core.base.system import file_stamp
from lfsr_core.frames.frame import FIT, check_scene
from lfsr_core.frames.scene_files import check_named_files, check_regular

from .array import rig
from .contents import nodes_of

SECONDS_IN_PANEL = 1.0  # of looking for damage before a button's question
MOST_SAID = 20  # files that get a notice each
HEAD = 2**16  # bytes, enough for the headers below
NO_FILE = "no regular file"  # a device or a pipe, which may never end
OGAWA_DATA = 2**63  # set in the place of data in Alembic's container, not in that of a group
NUMBER = re.compile(r"\d+(?=\D*$)")  # of the frame, in the name of a file of a sequence
OF_SCENE = {"COLLECTION", "OBJECT", "WORLD", "SCENE"}  # used by a scene; brushes, strips and compositors do no harm
TREES = {"MATERIAL", "WORLD", "LIGHT", "NODETREE", "TEXTURE"}
# Kinds for sentences, by the type of the data-block that names a file, or by the file's suffix.
KINDS = {"CACHEFILE": "geometry", "FONT": "font", ".ies": "light", ".osl": "script", ".oso": "script"}
MOST_NAMES, MOST_REASON = 5, 100  # of cameras; characters
MOST_PLACE = 1e15  # scene units: single precision squares what is farther to infinity
# Compressions of glTF by what the importer says where it cannot read them, and the command that decodes them. Blender
# 5.2 reads Meshopt where it has the library.
COMPRESSIONS = {r"meshopt_compression|Meshopt decoder": ("Meshopt", "copy"),
                r"draco\w*\.(so|dll|dylib)": ("Draco", "copy"), r"KHR_texture_basisu": ("KTX 2", "ktxdecompress")}


def check_files(scene: bpy.types.Scene, frame: int | None, allow: bool, say: Callable[[Notice], object]) -> None:
    """Say which files cannot be read that ``scene`` needs at ``frame``, None for its own.

    LfsrError if there are any, unless ``allow``.
    """
    files = unreadable(scene, frame)
    for notice in files[:MOST_SAID]:
        say(notice)
    if files and not (allow and all(notice.values["state"] != NO_FILE for notice in files)):
        raise LfsrError(f"{len(files)} of the scene's files cannot be read, such as {files[0].values['path']}: find or "
                        "replace what is missing or damaged, or allow missing files")


def paint_missing() -> None:
    """Make missing images and films gray, and flat where a normal map reads them: Blender shows them pink."""
    flat = {link.from_node.image for material in bpy.data.materials for node in nodes_of(material.node_tree)
            if node.type == "NORMAL_MAP" for link in node.inputs["Color"].links if link.from_node.type == "TEX_IMAGE"}
    for image in bpy.data.images:
        if (paths := [Path(path) for _, path in _files(image, 0)]) and not any(map(Path.is_file, paths)):
            image.source, image.generated_type = "GENERATED", "BLANK"
            image.generated_color = 0.5, 0.5, 1.0 if image in flat else 0.5, 1.0


def unreadable(scene: bpy.types.Scene, frame: int | None = None, seconds: float = math.inf) -> list[Notice]:
    """Return a notice of each file that cannot be read and that the image of ``scene`` needs at ``frame``.

    ``frame``: None for the scene's own; ``seconds``: about how long to look for damage, for which images and volumes
    are read to their ends, once until they change.
    """
    end, number, uses = time.monotonic() + seconds, scene.frame_current if frame is None else frame, defaultdict(set)
    for item, users in bpy.data.user_map().items():
        for user in users:
            uses[user].add(item)
    reached, waiting = {scene}, [scene]  # data-blocks that the image may depend on
    while waiting:
        user = waiting.pop()
        if user.id_type == "CAMERA" or (user.id_type == "OBJECT" and user.type == "EMPTY" and user.data):
            continue  # images in the viewport alone
        needed = {item for item in uses[user] if user.id_type != "SCENE" or item.id_type in OF_SCENE} - reached
        reached |= needed
        waiting += needed
    files = {Path(path): (kind, item) for item in reached for kind, path in _files(item, number)}
    states = {path: NO_FILE if path.exists() else "missing" for path in files if not (path.is_file() or path.is_dir())}
    for library in {item.library for item in reached} - {None}:
        path = Path(bpy.path.abspath(library.filepath))
        if library.is_missing or not (library.packed_file or path.is_file()):
            files[path], states[path] = ("linked", library), "damaged" if path.is_file() else "missing"
    there = [path for path in files if path not in states]
    with ThreadPoolExecutor() as pool:
        damaged = pool.map(lambda path: time.monotonic() < end and _is_damaged(str(path), file_stamp(path)), there)
    states |= {path: "damaged" for path, is_bad in zip(there, damaged, strict=True) if is_bad}
    for item in reached if seconds else ():
        path = Path(bpy.path.abspath(getattr(item, "filepath", "") or item.name, library=item.library))
        is_elsewhere = item.id_type == "VOLUME" and item.is_sequence and number != scene.frame_current
        if path not in states and not is_elsewhere and time.monotonic() < end and _is_damaged_inside(item):
            files[path], states[path] = (item.id_type.lower(), item), "damaged"
    return [Notice("file-unreadable", {"kind": files[path][0], "path": os.path.normpath(path), "state": states[path]})
            for path in sorted(states)]


def image_files() -> set[Path]:
    """Return the files that images are read from, with each tile of a UDIM image."""
    return {path for image in bpy.data.images for path in image_paths(image)}


def _files(item: bpy.types.ID, frame: int) -> Iterator[tuple[str, str | Path]]:
    """Yield kind and path of each file that a data-block is read from at ``frame``."""
    def place(path: str) -> str:
        return bpy.path.abspath(path, library=item.library)

    if item.id_type == "IMAGE":
        yield from (("image", path) for path in image_paths(item))
        if item.source == "MOVIE":
            yield "film", place(item.filepath)
    elif item.id_type == "VOLUME":
        if not item.packed_file and not item.is_sequence:  # Blender says what a sequence lacks
            yield "volume", place(item.filepath)
    elif item.id_type == "OBJECT":
        for modifier in (modifier for modifier in item.modifiers if modifier.show_render):
            if modifier.type == "MESH_CACHE":
                yield "geometry", place(modifier.filepath)
            elif modifier.type == "FLUID" and modifier.fluid_type == "DOMAIN":
                if modifier.domain_settings.has_cache_baked_any:
                    yield "simulation", place(modifier.domain_settings.cache_directory)
            elif modifier.type == "OCEAN" and modifier.is_cached:
                yield "simulation", place(modifier.filepath)
            elif modifier.type == "NODES":
                for bake in modifier.bakes:  # Blender does not store which are on the disk, only where
                    named = bake.directory if bake.use_custom_path else modifier.bake_directory
                    target = modifier.bake_target if bake.bake_target == "INHERIT" else bake.bake_target
                    if named and target == "DISK":
                        folder = Path(place(named)) / ("" if bake.use_custom_path else str(bake.bake_id))
                        yield from (("simulation", path) for path in sorted(folder.glob("meta/*.json")))
                        if not Path(place(named)).parent.exists():  # a bake that is deleted leaves it
                            yield "simulation", place(named)
            cache = getattr(getattr(modifier, "particle_system", modifier), "point_cache", None)
            if cache is not None and cache.use_external:
                yield "simulation", place(cache.filepath)
            elif cache is not None and cache.use_disk_cache and cache.is_baked:
                yield "simulation", disk_cache(Path(bpy.data.filepath))
    elif not getattr(item, "packed_file", None) and item.id_type in {*TREES, *KINDS}:
        for path in bpy.data.file_path_map(subset=[item])[item] - {"", "<builtin>"}:
            yield KINDS.get(item.id_type) or KINDS.get(Path(path).suffix.lower(), "needed"), place(path)
    if item.id_type in TREES:
        tree = item if item.id_type == "NODETREE" else item.node_tree
        for user in (item, *(tree.nodes if tree else ())):
            image = getattr(user, "image", None)
            if image is not None and image.source == "SEQUENCE" and not image.packed_file:
                # Its file at this frame of the scene, as Blender's BKE_image_user_frame_get has it.
                shown, path = user.image_user, Path(place(image.filepath))
                length, number = shown.frame_duration, frame - shown.frame_start + 1
                number = (number - 1) % length + 1 if shown.use_cyclic and length else min(max(number, 0), length)
                digits = len((NUMBER.search(path.name) or [""])[0])
                yield "image", path.with_name(NUMBER.sub(f"{number + shown.frame_offset:0{digits}d}", path.name))


def disk_cache(file: Path) -> Path:
    """Return the folder beside a .blend, named after it, where Blender keeps simulations on the disk."""
    return file.parent / f"blendcache_{file.stem}"


def image_paths(image: bpy.types.Image) -> Iterator[Path]:
    """Yield the files that an image is read from, each tile of a UDIM image; none of what is packed, or ours."""
    if not image.filepath or image.packed_file or "lfsr_image" in image:
        return
    named = bpy.path.abspath(image.filepath, library=image.library)
    if image.source == "FILE":
        yield Path(named)
    elif image.source == "TILED":
        for tile in image.tiles:
            row, column = divmod(tile.number - 1001, 10)
            yield Path(named.replace("<UDIM>", str(tile.number)).replace("<UVTILE>", f"u{column + 1}_v{row + 1}"))


def _is_damaged_inside(item: bpy.types.ID) -> bool:
    """True if packed data is damaged, or Blender cannot read a file that no other reader knows."""
    if item.id_type == "VOLUME":
        grids = item.evaluated_get(bpy.context.evaluated_depsgraph_get()).grids
        return not grids.load() or not all([grid.load() for grid in grids])
    if item.id_type != "IMAGE" or item.source in {"GENERATED", "VIEWER", "SEQUENCE"}:
        return False
    for packed in item.packed_files:
        content = packed.packed_file.data
        # The name depends on the content, so that ``_is_damaged`` reads the same content only once.
        path = Path(tempfile.gettempdir(), f"lfsr-{os.getpid()}-{hash(content):x}{Path(packed.filepath).suffix}")
        try:
            path.write_bytes(content)
            if _is_damaged(str(path), ""):
                return True
        finally:
            path.unlink(missing_ok=True)
    return not (item.packed_file or Path(item.filepath).suffix.lower()[1:] in _read_suffixes()) and not item.size[0]


def _read_suffixes() -> frozenset[str]:
    """Suffixes of the images that OpenImageIO reads; none in a Blender whose Python lacks it, where Blender decides."""
    try:
        from lfsr_core.images.image_files import readable_suffixes
    except ImportError:
        return frozenset()
    return readable_suffixes()


@functools.cache
def _is_damaged(path: str, _stamp: str) -> bool:
    """True if a file does not hold what its suffix says; other files and folders are left to Blender."""
    suffix = Path(path).suffix.lower()
    if not Path(path).is_file():
        return False
    if suffix[1:] in _read_suffixes():
        from lfsr_core.images.image_files import why_unreadable

        return bool(why_unreadable(path))
    with Path(path).open("rb") as file:
        head, size = file.read(HEAD), Path(path).stat().st_size
    try:
        match suffix:
            case ".ies" if b"TILT=INCLUDE" not in head:
                numbers = head.rpartition(b"TILT=NONE")[2].split()
                vertical, horizontal = map(int, numbers[3:5])
                return len(numbers) < 13 + vertical + horizontal + vertical * horizontal
            case ".abc":
                return not head.startswith(b"\x89HDF") and not _is_whole_ogawa(path)
            case ".json":  # of a bake, which names pieces of files beside its folder
                blobs = Path(path).parents[1] / "blobs"
                return not all((blobs / piece["name"]).stat().st_size >= piece["start"] + piece["size"]
                               for piece in _pieces(json.loads(Path(path).read_bytes())))
            case ".mdd":
                frames, points = struct.unpack_from(">2i", head)
                return size < 8 + 4 * frames + 12 * frames * points
            case ".pc2":
                points, frames = struct.unpack_from("<16xi8xi", head)
                return not head.startswith(b"POINTCACHE2") or size < 32 + 12 * points * frames
    except (struct.error, ValueError, TypeError, OSError, RecursionError):
        return True
    return False


def _is_whole_ogawa(path: str) -> bool:
    """True if an Alembic file was finished and holds all groups and data that follow from its root by their offsets."""
    with open(path, "rb") as file, mmap.mmap(file.fileno(), 0, access=mmap.ACCESS_READ) as content:
        if content[:6] != b"Ogawa\xff":
            return False
        waiting, seen = list(struct.unpack_from("<Q", content, 8)), set[int]()
        while waiting:
            if (place := waiting.pop()) in seen or not place & ~OGAWA_DATA:  # shared, or empty
                continue
            seen.add(place)
            (count,) = struct.unpack_from("<Q", content, place & ~OGAWA_DATA)
            if (place & ~OGAWA_DATA) + 8 + count * (1 if place & OGAWA_DATA else 8) > len(content):
                return False
            if not place & OGAWA_DATA:
                waiting += struct.unpack_from(f"<{count}Q", content, place + 8)
    return True


def _pieces(data: Any) -> Iterator[dict[str, Any]]:
    """Yield the pieces of files that the JSON of a bake names."""
    inside = data.values() if isinstance(data, dict) else data if isinstance(data, list) else ()
    if isinstance(data, dict) and {"name", "start", "size"} <= data.keys():
        yield data
    for value in inside:
        yield from _pieces(value)


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
    if name not in scenes:
        raise LfsrError(f"the file has no scene {name!r}: choose one of {', '.join(scenes)}")
    return shown(scenes[name])


def shown(scene: bpy.types.Scene) -> bpy.types.Scene:
    """Show ``scene`` in the window: else Blender evaluates the scene that was open when the file was saved."""
    bpy.context.window.scene = scene
    return scene


def _open_blend(path: str, tell: Tell) -> None:
    """Open a .blend; the files that it names are looked at before Blender evaluates the scene, which reads them.

    LfsrError where it names a device, a pipe, or damaged geometry, which crashes Blender; ``tell`` gets the geometry.
    """
    wrong = []

    @bpy.app.handlers.persistent
    def look(*_: object) -> None:
        try:
            for named in bpy.utils.blend_paths(absolute=True, packed=False, local=False):
                check_regular(path, named)
            for cache in bpy.data.cache_files:
                for place in (cache.filepath, *(layer.filepath for layer in cache.layers)):
                    read = Path(bpy.path.abspath(place, library=cache.library))
                    for file in read.parent.glob(NUMBER.sub("*", read.name)) if cache.is_sequence else [read]:
                        check_regular(path, file)
                        if _is_damaged(str(file), file_stamp(file)):
                            raise LfsrError(f"scene {path} needs {file}, which is damaged: export that file again")
                    tell(Progress("open", detail=f"{path} with {read}"))
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
    scene.timeline_markers.clear()  # they may bind other cameras
    scene.camera = camera


def cameras(scene: bpy.types.Scene) -> list[bpy.types.Object]:
    """Return the scene's cameras in the order of its objects."""
    return [item for item in scene.objects if item.type == "CAMERA"]


def camera_notices(scene: bpy.types.Scene, asked: str | None, is_imported: bool) -> list[Notice]:
    """Return notices about the camera at which the array stands.

    ``asked``: name that was asked for, None for none; ``is_imported``: whether the file's format has no active camera.
    """
    camera, others = rig.find(scene) or scene.camera, [item.name for item in cameras(scene) if item != scene.camera]
    if camera is None:
        return [Notice("camera-missing", {"others": others})] if asked is None else []
    is_choice = is_imported and asked is None and scene.camera is not None
    chosen = [Notice("camera-chosen", {"camera": scene.camera.name, "others": others})] if is_choice else []
    return [*chosen, *([Notice("camera-mirrored", {"camera": camera.name})] if rig.is_mirrored(camera) else [])]
