"""Find the photographs of training scenes, and shrink them so that they load in milliseconds."""

from __future__ import annotations

from pathlib import Path

import OpenImageIO as oiio

from lfsr_core.base.errors import LfsrError

SUFFIXES = {".jpg", ".jpeg", ".png"}
QUALITY, SIZE = 80, 1024  # of the JPEG, of its longest side in pixels


def find_textures(folder: str | Path | None) -> tuple[Path, ...]:
    """Return the photographs of a folder sorted by name; none without a folder."""
    if folder is None:
        return ()
    found = tuple(sorted(path for path in Path(folder).glob("*") if path.suffix.lower() in SUFFIXES))
    if not found:
        raise LfsrError(f"{folder} holds no .jpg or .png file, expected the training photographs: check --textures")
    return found


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
