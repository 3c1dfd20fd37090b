"""Real models for training scenes: unpack those of Sweet Home 3D, and load models of a folder as objects."""

from __future__ import annotations

import re
import zipfile
from pathlib import Path

import bpy
import numpy as np
import OpenImageIO as oiio
from mathutils import Matrix

from lfsr_core.base.messages import LfsrError
from lfsr_core.base.system import read_json, write_json
from lfsr_lab.scenes.shared.objects import joined

SUFFIXES = {".obj", ".glb", ".gltf"}
LICENSES_FILE = "licenses.json"  # {model's path in the folder: {"license": ..., "author": ...}}
TESTED = ("maple", "FlightHelmet", "GlassVaseFlowers")  # in names of models that scenes of the tests show
MOST_BYTES = 6_000_000  # larger models take seconds to load
CLEAR = 0.7  # opacity below which a surface may become glass


def find_models(folder: str | Path | None) -> dict[Path, dict[str, str]]:
    """Return the models of a folder and its subfolders with license and author; none without a folder."""
    if folder is None:
        return {}
    folder = Path(folder)
    licenses = read_json(folder / LICENSES_FILE, "licenses of the models") if (folder / LICENSES_FILE).exists() else {}
    models = {path: {"file": path.relative_to(folder).as_posix()} for path in sorted(folder.rglob("*"))
              if path.suffix.lower() in SUFFIXES}
    if not models:
        raise LfsrError(f"{folder} holds no .obj, .glb or .gltf file: check --models")
    return {path: fact | licenses.get(fact["file"], {"license": "not recorded"}) for path, fact in models.items()}


def prepare_models(archives: str | Path, target: str | Path) -> int:
    """Unpack the OBJ models of every .sh3f archive and record their licenses; return how many there are."""
    paths, target = sorted(Path(archives).glob("*.sh3f")), Path(target)
    if not paths:
        raise LfsrError(f"{archives} holds no .sh3f file: install the package sweethome3d-furniture")
    licenses: dict[str, dict[str, str]] = {}
    for path in paths:
        licenses |= _unpack(path, target)
    write_json(target / LICENSES_FILE, licenses)
    return len(licenses)


def _unpack(path: Path, target: Path) -> dict[str, dict[str, str]]:
    """Write an archive's models of moderate size into a folder of its name; return their licenses."""
    with zipfile.ZipFile(path) as archive:
        text = archive.read("PluginFurnitureCatalog.properties").decode("latin-1")
        fields = dict(re.findall(r"^([\w#]+)=(.*?)\s*$", text, re.MULTILINE))
        terms, models = re.sub(r"\s+", " ", fields["license"]), {}
        for key, name in fields.items():
            model = name.lstrip("/")
            if not key.startswith("model#") or any(tested.lower() in model.lower() for tested in TESTED):
                continue
            members = [item for item in archive.namelist() if item.startswith(model.rpartition("/")[0] + "/")]
            is_small = model.endswith(".obj") and archive.getinfo(model).file_size <= MOST_BYTES
            if is_small and _is_whole(archive, members):
                archive.extractall(target / path.stem, members)
                author = fields.get(key.replace("model", "creator"), "not named")
                models[f"{path.stem}/{model}"] = {"license": terms, "author": author}
    return models


def _is_whole(archive: zipfile.ZipFile, members: list[str]) -> bool:
    """Whether every texture that the materials name is among the members, in the materials' own folder."""
    for library in (item for item in members if item.endswith(".mtl")):
        named = re.findall(r"^\s*map_\w+\s+(.*?)\s*$", archive.read(library).decode("latin-1"), re.MULTILINE)
        if any(f"{library.rpartition('/')[0]}/{name}" not in members for name in named):
            return False
    return True


def load_model(path: Path) -> bpy.types.Object:
    """Return a model as one upright mesh object with its materials, centred, its longest side 2."""
    before = set(bpy.data.objects)
    if path.suffix.lower() == ".obj":
        bpy.ops.wm.obj_import(filepath=str(path), use_split_objects=False)
    else:
        bpy.ops.import_scene.gltf(filepath=str(path))
    added = [item for item in bpy.data.objects if item not in before]
    if not any(item.type == "MESH" and item.data.polygons for item in added):
        raise LfsrError(f"{path} holds no faces: remove it from the models")
    bpy.context.view_layer.update()
    model = joined(added)
    mesh = model.data
    points = np.empty(len(mesh.vertices) * 3, np.float32)
    mesh.vertices.foreach_get("co", points)
    low, high = points.reshape(-1, 3).min(0), points.reshape(-1, 3).max(0)
    scale = 2 / max(float((high - low).max()), 1e-9)
    mesh.transform(Matrix.Scale(scale, 4) @ Matrix.Translation([float(-x) for x in (low + high) / 2]))
    return model


def glaze(thing: bpy.types.Object) -> None:
    """Make half-transparent surfaces glass."""
    for material in thing.data.materials:
        shader = material and next((node for node in material.node_tree.nodes if node.type == "BSDF_PRINCIPLED"), None)
        if shader and not shader.inputs["Alpha"].is_linked and shader.inputs["Alpha"].default_value < CLEAR:
            for name, value in (("Alpha", 1.0), ("Transmission Weight", 1.0), ("Roughness", 0.0)):
                shader.inputs[name].default_value = value


PHOTOGRAPHS = {".jpg", ".jpeg", ".png"}
QUALITY, SIZE = 80, 1024  # of the JPEG, of its longest side in pixels


def find_textures(folder: str | Path | None) -> tuple[Path, ...]:
    """Return the photographs of a folder sorted by name; none without a folder."""
    if folder is None:
        return ()
    photographs = tuple(sorted(path for path in Path(folder).glob("*") if path.suffix.lower() in PHOTOGRAPHS))
    if not photographs:
        raise LfsrError(f"{folder} holds no .jpg or .png file, expected the training photographs: check --textures")
    return photographs


def prepare_textures(source: str | Path, target: str | Path) -> int:
    """Write a small JPEG of each photograph; return how many."""
    paths = find_textures(source)
    Path(target).mkdir(parents=True, exist_ok=True)
    for path in paths:
        _shrink(path, Path(target, path.stem + ".jpg"))
    return len(paths)


def _shrink(path: Path, target: Path) -> None:
    image = oiio.ImageBuf(str(path))
    if image.has_error or image.nchannels < 1:
        raise LfsrError(f"{path} cannot be read as an image ({image.geterror()}): remove or replace it")
    width, height = image.oriented_width, image.oriented_height
    image = oiio.ImageBufAlgo.reorient(image)
    image = oiio.ImageBufAlgo.channels(image, (0, 1, 2) if image.nchannels >= 3 else (0, 0, 0))
    factor = min(1.0, SIZE / max(width, height))
    extent = oiio.ROI(0, max(1, round(width * factor)), 0, max(1, round(height * factor)), 0, 1, 0, 3)
    small = oiio.ImageBufAlgo.resize(image, filtername="triangle", roi=extent)
    small.specmod().attribute("Compression", f"jpeg:{QUALITY}")
    if not small.write(str(target), oiio.UINT8):
        raise LfsrError(f"{target} cannot be written ({small.geterror()}): choose another folder")
