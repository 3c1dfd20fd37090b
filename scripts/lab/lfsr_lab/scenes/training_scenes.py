"""Training scenes: many small, varied, seeded scenes and their renders, one file each.

    python scripts/lab/lfsr_lab/scenes/training_scenes.py --prepare-textures PHOTOS SMALL
    python scripts/lab/lfsr_lab/scenes/training_scenes.py --prepare-models /usr/share/sweethome3d/furniture MODELS
    python scripts/lab/lfsr_lab/scenes/training_scenes.py --output DIR --count 400 --textures SMALL --models MODELS

Needs bpy, numpy and OpenImageIO. Scene I of seed S does not depend on which other scenes are made. A second
run makes only the missing scenes. Several processes can fill one folder: give each its own --first and --count. The
file format is described in training/produce.py: the low-resolution EIA several times with few samples and once clean.
MODELS holds OBJ and glTF models with a licenses.json. --prepare-models makes it from Debian's sweethome3d-furniture.
"""

from __future__ import annotations

import argparse
import sys
import traceback
from collections.abc import Sequence
from pathlib import Path

# Where lfsr_lab and lfsr_core are: installed side by side, or in a clone, scripts/lab and the root.
sys.path.extend(str(Path(__file__).resolve().parents[level]) for level in (2, 4))

from lfsr_core.base.errors import LfsrError
from lfsr_core.base.files import read_json, write_json
from lfsr_core.optics.display import load_display
from lfsr_core.process.protocol import EXIT_BAD_INPUT, emit
from lfsr_lab.scenes.shared.script import leave, script_arguments
from lfsr_lab.scenes.training.models import find_models, find_textures, prepare_models, prepare_textures
from lfsr_lab.scenes.training.produce import Recipe, produce
from lfsr_lab.scenes.training.stage import TRAIN

SETTINGS_FILE = "settings.json"


def parse(arguments: Sequence[str]) -> argparse.Namespace:
    parser = argparse.ArgumentParser(prog="training_scenes.py", description=__doc__.splitlines()[0])
    parser.add_argument("--output", type=Path, help="folder of the scene files")
    parser.add_argument("--first", type=int, default=0, help="number of the first scene")
    parser.add_argument("--count", type=int, default=1, help="how many scenes")
    parser.add_argument("--seed", type=int, default=0, help="seed of the whole set")
    parser.add_argument("--display", default="train", help="train (varies), a built-in display or a .toml file")
    parser.add_argument("--scale", type=int, default=4, help="scale of the renders for a display that does not vary")
    parser.add_argument("--low-only", action="store_true", help=argparse.SUPPRESS)  # of earlier versions, now always
    parser.add_argument("--spps", default="1,4,16", help="samples per pixel of the renders (%(default)s)")
    parser.add_argument("--reference-spp", type=int, default=256, help="samples of the clean target (%(default)s)")
    parser.add_argument("--models", type=Path, help="folder of OBJ and glTF models")
    parser.add_argument("--textures", type=Path, help="folder of small photographs")
    parser.add_argument("--threads", type=int, help="CPU threads")
    parser.add_argument("--prepare-textures", nargs=2, metavar=("PHOTOS", "SMALL"), help="only shrink photographs")
    parser.add_argument("--prepare-models", nargs=2, metavar=("ARCHIVES", "MODELS"),
                        help="only unpack the models of Sweet Home 3D's .sh3f files")
    return parser.parse_args(arguments)


def recipe_of(options: argparse.Namespace) -> Recipe:
    """Return the checked recipe of the command line."""
    if options.output is None:
        raise LfsrError("--output is missing: name the folder of the scene files")
    if options.reference_spp < 1:
        raise LfsrError(f"--reference-spp is {options.reference_spp}, but the clean target needs at least 1")
    if options.display != TRAIN:
        load_display(options.display).low_views(options.scale)
    return Recipe(options.output, options.seed, options.display, options.scale, _samples(options.spps),
                  options.reference_spp, find_textures(options.textures), options.threads, find_models(options.models))


def _samples(text: str) -> tuple[int, ...]:
    counts = tuple(int(part) if part.strip().isdecimal() else 0 for part in text.split(","))
    if 0 in counts:
        raise LfsrError(f"--spps is {text!r}, but it must be whole numbers above 0 with commas, like 1,4,16")
    return counts


def claim_folder(recipe: Recipe) -> None:
    """Record the settings of a new folder; LfsrError if it was begun with other ones."""
    path = recipe.output / SETTINGS_FILE
    if path.exists() and read_json(path, "settings of training scenes") != recipe.settings():
        raise LfsrError(f"{recipe.output} holds scenes of other settings (see {SETTINGS_FILE} there): "
                        "choose another --output or the same settings")
    write_json(path, recipe.settings())


def missing_scenes(recipe: Recipe, first: int, count: int) -> list[int]:
    """Return the numbers without a file, after removing what killed runs left of them."""
    missing = [index for index in range(first, first + count) if not recipe.path(index).exists()]
    for index in missing:
        for remains in recipe.output.glob(f".{recipe.path(index).stem}-*"):
            remains.unlink()
    return missing


def run(options: argparse.Namespace) -> int:
    """Do what the command line says; return how many scenes failed."""
    if options.prepare_textures:
        emit(stage="textures", count=prepare_textures(*options.prepare_textures))
        return 0
    if options.prepare_models:
        emit(stage="models", count=prepare_models(*options.prepare_models))
        return 0
    recipe = recipe_of(options)
    claim_folder(recipe)
    missing = missing_scenes(recipe, options.first, options.count)
    emit(stage="start", scenes=len(missing), complete=options.count - len(missing))
    failed = [index for index in missing if not attempt(recipe, index)]
    emit(stage="done", made=len(missing) - len(failed), failed=failed)
    return len(failed)


def attempt(recipe: Recipe, index: int) -> bool:
    """Make one scene and report its seconds; return False where it failed. LfsrError passes through."""
    try:
        emit(stage="scene", index=index, seconds=produce(recipe, index))
    except LfsrError:
        raise
    except Exception as error:
        # One bad scene must not end a run of thousands; it is reported and counted.
        traceback.print_exc(file=sys.stderr)
        emit(stage="failed", index=index, message=f"{type(error).__name__}: {error}")
        return False
    return True


def main() -> int:
    try:
        return 1 if run(parse(script_arguments())) else 0
    except LfsrError as error:
        emit(stage="error", message=str(error))
        return EXIT_BAD_INPUT


if __name__ == "__main__":
    leave(main())
