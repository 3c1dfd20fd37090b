"""Training scenes: many small, varied, seeded scenes and their renders, one file each.

    python scripts/lab/lfsr_lab/scenes/training_scenes.py --prepare-textures PHOTOS SMALL
    python scripts/lab/lfsr_lab/scenes/training_scenes.py --prepare-models /usr/share/sweethome3d/furniture MODELS
    python scripts/lab/lfsr_lab/scenes/training_scenes.py --output DIR --count 400 --textures SMALL --models MODELS

Needs bpy, numpy and OpenImageIO. Scene I of seed S does not depend on which other scenes are made. A second
run makes only the missing scenes. Several processes can fill one folder: give each its own --first and --count. The
file format is described in training/produce.py: the low-resolution EIA several times with few samples and once clean.
MODELS holds OBJ and glTF models with a licenses.json. --prepare-models makes it from Debian's sweethome3d-furniture.
"""

import argparse
import sys
import traceback
from collections.abc import Sequence
from pathlib import Path

# Where lfsr_lab and lfsr_core are: installed side by side, or in a clone, scripts/lab and the root.
sys.path.extend(str(Path(__file__).resolve().parents[level]) for level in (2, 4))

from lfsr_core.base.messages import LfsrError
from lfsr_core.base.system import read_json, write_json
from lfsr_core.optics.display import load_display
from lfsr_core.process.child import EXIT_BAD_INPUT, emit
from lfsr_lab.scenes.shared.objects import leave, script_arguments
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
    parser.add_argument("--spps", default="1,4,16", help="samples per pixel of the renders (%(default)s)")
    parser.add_argument("--reference-spp", type=int, default=256, help="samples of the clean target (%(default)s)")
    parser.add_argument("--models", type=Path, help="folder of OBJ and glTF models")
    parser.add_argument("--textures", type=Path, help="folder of small photographs")
    parser.add_argument("--threads", type=int, help="CPU threads")
    parser.add_argument("--prepare-textures", nargs=2, metavar=("PHOTOS", "SMALL"), help="only shrink photographs")
    parser.add_argument("--prepare-models", nargs=2, metavar=("ARCHIVES", "MODELS"),
                        help="only unpack the models of Sweet Home 3D's .sh3f files")
    return parser.parse_args(arguments)


def run(options: argparse.Namespace) -> int:
    """Do what the command line says; return how many scenes failed."""
    if options.prepare_textures:
        emit(stage="textures", count=prepare_textures(*options.prepare_textures))
        return 0
    if options.prepare_models:
        emit(stage="models", count=prepare_models(*options.prepare_models))
        return 0
    if options.output is None:
        raise LfsrError("--output is missing: name the folder of the scene files")
    if options.reference_spp < 1:
        raise LfsrError(f"--reference-spp is {options.reference_spp}, but the clean target needs at least 1")
    if options.display != TRAIN:
        load_display(options.display).low_views(options.scale)
    counts = tuple(int(part) if part.strip().isdecimal() else 0 for part in options.spps.split(","))
    if 0 in counts:
        raise LfsrError(f"--spps is {options.spps!r}, but it must be whole numbers above 0 with commas, like 1,4,16")
    recipe = Recipe(options.output, options.seed, options.display, options.scale, counts, options.reference_spp,
                    find_textures(options.textures), options.threads, find_models(options.models))
    path = recipe.output / SETTINGS_FILE
    if path.exists() and read_json(path, "settings of training scenes") != recipe.settings():
        raise LfsrError(f"{recipe.output} holds scenes of other settings (see {SETTINGS_FILE} there): "
                        "choose another --output or the same settings")
    write_json(path, recipe.settings())
    wanted = range(options.first, options.first + options.count)
    missing, failed = [index for index in wanted if not recipe.path(index).exists()], []
    for remains in (file for index in missing for file in recipe.output.glob(f".{recipe.path(index).stem}-*")):
        remains.unlink()  # of runs that were killed
    emit(stage="start", scenes=len(missing), complete=options.count - len(missing))
    for index in missing:
        try:
            emit(stage="scene", index=index, seconds=produce(recipe, index))
        except LfsrError:
            raise
        except Exception as error:  # one bad scene must not end a run of thousands; it is reported and counted
            traceback.print_exc(file=sys.stderr)
            emit(stage="failed", index=index, message=f"{type(error).__name__}: {error}")
            failed.append(index)
    emit(stage="done", made=len(missing) - len(failed), failed=failed)
    return len(failed)


def main() -> int:
    try:
        return 1 if run(parse(script_arguments())) else 0
    except LfsrError as error:
        emit(stage="error", message=str(error))
        return EXIT_BAD_INPUT


if __name__ == "__main__":
    leave(main())
