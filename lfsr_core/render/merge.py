"""Parts of a frame that several machines rendered, joined into the folder that one machine would have made.

Rows of lenses go below each other: the result is the whole render, to the byte where seed and device are the same.
References of other seeds are averaged, each half into its own.
"""

from __future__ import annotations

import dataclasses
import itertools
from collections.abc import Callable, Sequence
from pathlib import Path

import numpy as np

from lfsr_core.errors import LfsrError
from lfsr_core.files import system_errors
from lfsr_core.frames.frame import FRAME_FILE, REFERENCE_FILES, WORLD_FILE, Frame, read_part, write_frame
from lfsr_core.frames.identity import first_difference, phrases
from lfsr_core.images import exr
from lfsr_core.optics.lens_rows import check_cover, pixel_rows, rows_text
from lfsr_core.progress import Progress, silent
from lfsr_core.render.process import DERIVED_FILES, RENDERED_FILES, check_folder
from lfsr_core.render.staging import publish, staging_folder

# Where parts of one frame may differ.
FREE = {"rows", "seconds", "device", "content"}
FREE_SEEDS = FREE | {"seed", "samples"}
DEVICES_JOINED = "+"
Fill = Callable[[list["_Found"], str, Path], None]


def part_folders(folders: Sequence[Path]) -> list[Path]:
    """``folders``, those that hold no part themselves replaced by the folders in them that do."""
    found: list[Path] = []
    for folder in folders:
        inner = [] if (folder / FRAME_FILE).exists() else [path.parent for path in folder.glob(f"*/{FRAME_FILE}")]
        found += sorted(inner) or [folder]
    return found


@dataclasses.dataclass(frozen=True)
class _Found:
    folder: Path
    frame: Frame
    kind: str


def merge(folders: Sequence[str | Path], output: str | Path, progress: Progress = silent) -> Frame:
    """Join parts by rows of lenses, or whole references of other seeds, into one folder.

    Parameters
    ----------
    folders : parts as ``lfsr render --rows`` or ``lfsr reference --rows`` made them, in any order; or whole references
    output : the folder to write
    progress : called with (stage, fraction, message)

    Returns
    -------
    The frame, its seconds the sum of the parts'.

    Raises
    ------
    LfsrError : where a part is missing, there twice, not whole, or of another frame
    """
    output, found = Path(output), [_found(Path(folder)) for folder in folders]
    if not found:
        raise LfsrError("there are no parts to merge: name their folders")
    by_rows = any(part.frame.rows is not None for part in found)
    frame = _by_rows(found) if by_rows else _by_samples(found)
    check_folder(output, found[0].kind)
    _write(found, _join if by_rows else _average, output, frame, progress)
    return frame


def _found(folder: Path) -> _Found:
    """A part that is whole, as far as its files are there; its pixels are checked when they are read."""
    frame = read_part(folder)
    for kind, names in RENDERED_FILES.items():
        if all((folder / name).is_file() for name in names):
            return _Found(folder, frame, kind)
    raise LfsrError(f"{folder} has a frame.json, but neither render nor reference: render this part again")


def _by_rows(found: list[_Found]) -> Frame:
    whole = next((part for part in found if part.frame.rows is None), None)
    if whole:
        raise LfsrError(f"{whole.folder} is a whole frame, but the others are parts of one: leave it out")
    _check_same(found, FREE)
    check_cover((part.frame.rows for part in found), found[0].frame.display.lenses[1])
    _check_sizes(found)
    found.sort(key=lambda part: part.frame.rows)
    return dataclasses.replace(found[0].frame, rows=None, seconds=_seconds(found), device=_devices(found))


def _by_samples(found: list[_Found]) -> Frame:
    """Whole references: the average of independent ones is one of all their samples."""
    other = next((part for part in found if part.kind != "reference"), None)
    if other:
        raise LfsrError(f"{other.folder} is a whole render and no part of one: merge parts of `lfsr render --rows`, "
                        "or references of other seeds")
    _check_same(found, FREE_SEEDS)
    seeds: dict[int, Path] = {}
    for part in found:
        if part.frame.seed in seeds:
            raise LfsrError(f"{seeds[part.frame.seed]} and {part.folder} have the same seed {part.frame.seed}, and so "
                            "the same noise: render one of them with another --seed")
        seeds[part.frame.seed] = part.folder
    return dataclasses.replace(found[0].frame, samples=sum(part.frame.samples for part in found), seed=min(seeds),
                               seconds=_seconds(found), device=_devices(found))


def _seconds(found: list[_Found]) -> dict[str, float]:
    return {name: round(sum(part.frame.seconds.get(name, 0.0) for part in found), 3)
            for name in found[0].frame.seconds}


def _devices(found: list[_Found]) -> str:
    """Parts of other devices have other noise, and the same picture."""
    names = {name for part in found for name in part.frame.device.split(DEVICES_JOINED)}
    return DEVICES_JOINED.join(sorted(names))


def _check_same(found: list[_Found], free: set[str]) -> None:
    """LfsrError where a part is of another frame than the first."""
    first = found[0]
    for part in found[1:]:
        if part.kind != first.kind:
            raise LfsrError(f"{part.folder} holds a {part.kind}, but {first.folder} a {first.kind}: leave one out")
        ours, theirs = ({name: value for name, value in vars(of.frame).items() if name not in free}
                        for of in (first, part))
        if name := first_difference(theirs, ours):
            here, there = phrases(name, theirs[name], ours[name])
            raise LfsrError(f"{part.folder} was rendered with {here}, but {first.folder} with {there}: "
                            "render one of them again like the other")
        if first.frame.content and part.frame.content and first.frame.content != part.frame.content:
            raise LfsrError(f"{part.folder} was rendered from {part.frame.scene} with another content than "
                            f"{first.folder}: render the one again like the other")


def _write(found: list[_Found], fill: Fill, output: Path, frame: Frame, progress: Progress) -> None:
    with staging_folder(output) as staging, system_errors(output):
        staged = staging / "frame"
        staged.mkdir()
        names = RENDERED_FILES[found[0].kind]
        for number, name in enumerate(names):
            progress("merge", number / len(names), name)
            fill(found, name, staged / name)
        if frame.world_apart:
            exr.write_layers(staged / WORLD_FILE, exr.read_layers(found[0].folder / WORLD_FILE))
        write_frame(staged, frame)
        publish(staged, output, DERIVED_FILES)
    progress("merge", 1.0, "")


def _check_sizes(found: list[_Found]) -> None:
    """LfsrError where an image has not the rows that its part says."""
    for part, name in itertools.product(found, RENDERED_FILES[found[0].kind]):
        layout = part.frame.rays
        first, last = pixel_rows(part.frame.rows, layout.views[1])
        size, wanted = exr.size(part.folder / name), (layout.size[0], last - first)
        if size != wanted:
            raise LfsrError(f"{part.folder / name} has {size[0]}×{size[1]} pixels, but rows "
                            f"{rows_text(part.frame.rows)} have {wanted[0]}×{wanted[1]}: render this part again")


def _join(found: list[_Found], name: str, path: Path) -> None:
    frame = found[0].frame
    exr.join_rows([part.folder / name for part in found], path, half=_is_half(frame, name))


def _average(found: list[_Found], name: str, path: Path) -> None:
    """Colours by their samples; what the first sample decided is the first part's."""
    half = REFERENCE_FILES.index(name)
    weights = np.array([(part.frame.samples + 1 - half) // 2 for part in found], np.float64)
    layers = exr.read_layers(found[0].folder / name)
    for layer in (layer for layer in layers if layer != "index"):
        layers[layer] = layers[layer] * np.float32(weights[0] / weights.sum())
    for part, weight in zip(found[1:], weights[1:], strict=True):
        _add(layers, exr.read_layers(part.folder / name), np.float32(weight / weights.sum()), part.folder / name)
    exr.write_layers(path, layers, half=_is_half(found[0].frame, name))


def _add(layers: exr.Layers, others: exr.Layers, weight: np.float32, path: Path) -> None:
    if {name: pixels.shape for name, pixels in layers.items()} != {name: p.shape for name, p in others.items()}:
        raise LfsrError(f"{path} has other layers or another size than the first reference: render it again")
    for layer in (layer for layer in layers if layer != "index"):
        layers[layer] += others[layer] * weight


def _is_half(frame: Frame, name: str) -> bool:
    """True where the whole render would be stored as 16-bit floats: a reference, unless it has positions."""
    return name in REFERENCE_FILES and "position" not in frame.layers
