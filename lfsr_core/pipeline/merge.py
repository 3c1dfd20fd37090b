"""Merge the parts of a frame that several machines rendered.

Rows of lenses are joined: the result has the same bytes as the whole render where seed and device are the same.
References of different seeds are averaged, their first and their second halves separately.
"""

from collections.abc import Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from lfsr_core.base.arrays import Array
from lfsr_core.base.messages import LfsrError, Progress, Tell, silent
from lfsr_core.base.system import staging_folder, system_errors
from lfsr_core.frames.folder import RENDERED_FILES, FrameFolder, first_difference, has_other_size, phrases
from lfsr_core.frames.frame import DEVICES_JOINED, FRAME_FILE, REFERENCE_FILES, WORLD_FILE, Frame, write_frame
from lfsr_core.images import image_files
from lfsr_core.optics.rays import check_cover, pixel_rows, rows_text

FREE = {"rows", "seconds", "device", "gpus", "content", "notes"}  # fields in which the parts of one frame may differ


def part_folders(folders: Sequence[Path]) -> list[Path]:
    """Return ``folders``; a folder that is no part itself is replaced by the parts in it, if there are any."""
    parts: list[Path] = []
    for folder in folders:
        inner = [] if (folder / FRAME_FILE).exists() else [path.parent for path in folder.glob(f"*/{FRAME_FILE}")]
        parts += sorted(inner) or [folder]
    return parts


class _Part(NamedTuple):
    folder: Path
    frame: Frame
    kind: str


def merge(folders: Sequence[str | Path], output: str | Path, tell: Tell = silent) -> Frame:
    """Join parts by rows of lenses, or average whole references of other seeds, and return the frame in ``output``.

    ``folders``: parts of ``lfsr render --rows`` or ``lfsr reference --rows``, in any order; or whole references. The
    frame has the seconds of all parts together. LfsrError where a part is missing, given twice, incomplete, or of
    another frame.
    """
    parts = []
    for folder in map(FrameFolder, folders):
        frame, kinds = folder.part, [kind for kind in RENDERED_FILES if folder.holds(kind)]
        if not kinds:
            raise LfsrError(f"{folder.path} has a frame.json, but neither render nor reference: render this part again")
        parts.append(_Part(folder.path, frame, kinds[0]))
    if not parts:
        raise LfsrError("there are no parts to merge: name their folders")
    kind, seeds = parts[0].kind, dict[int, Path]()
    rows = {part.folder: part.frame.rows for part in parts if part.frame.rows is not None}
    for part in parts:
        if rows and part.folder not in rows:
            raise LfsrError(f"{part.folder} is a whole frame, but the others are parts of one: leave it out")
        if not rows and part.kind != "reference":
            raise LfsrError(f"{part.folder} is a whole render, not a part of one: merge parts of `lfsr render --rows`, "
                            "or references of other seeds")
    free, (first, *others) = FREE if rows else FREE | {"seed", "seeds", "samples"}, parts
    for part in others:
        if part.kind != kind:
            raise LfsrError(f"{part.folder} holds a {part.kind}, but {first.folder} a {kind}: leave one out")
        facts, wanted = ({name: value for name, value in vars(of.frame).items() if name not in free}
                         for of in (part, first))
        if name := first_difference(facts, wanted):
            here, there = phrases(name, facts[name], wanted[name])
            raise LfsrError(f"{part.folder} was rendered with {here}, but {first.folder} with {there}: "
                            "render one of them again like the other")
        if has_other_size(first.frame.content, part.frame.content):
            raise LfsrError(f"{part.folder} was rendered from another version of {part.frame.scene} than "
                            f"{first.folder}: render one of them again")
    if rows:
        check_cover([rows[part.folder] for part in parts], first.frame.display.lenses[1])
        width, height = first.frame.rays.size[0], first.frame.rays.views[1]
        for part in parts:
            top, below = pixel_rows(rows[part.folder], height)
            for path in (part.folder / name for name in RENDERED_FILES[kind]):
                if (size := image_files.size(path)) != (width, below - top):
                    raise LfsrError(f"{path} has {size[0]}×{size[1]} pixels, but rows {rows_text(rows[part.folder])} "
                                    f"have {width}×{below - top}: render this part again")
        parts.sort(key=lambda part: rows[part.folder])
        frame = _merged(parts, rows=None)
    else:
        for part, seed in ((source, seed) for source in parts for seed in source.frame.seeds or (source.frame.seed,)):
            if seed in seeds:
                raise LfsrError(f"{seeds[seed]} and {part.folder} have the same seed {seed}, and so the same noise: "
                                "leave one of them out, or render it with another --seed")
            seeds[seed] = part.folder
        frame = _merged(parts, samples=sum(part.frame.samples for part in parts), seed=min(seeds),
                        seeds=tuple(sorted(seeds)))
    target = FrameFolder(output)
    target.check_free(kind)
    for part in (part for part in parts if target.path.resolve().is_relative_to(part.folder.resolve())):
        raise LfsrError(f"{target.path} is, or lies in, the part {part.folder}, which must not be lost: choose another "
                        "folder")
    with staging_folder(target.path) as staging, system_errors(target.path):
        staged = staging / "frame"
        staged.mkdir()
        for number, name in enumerate(RENDERED_FILES[kind]):
            tell(Progress("merge", number / len(RENDERED_FILES[kind]), name))
            # As the whole render would be stored: a reference as 16-bit floats, unless it has positions.
            half = name in REFERENCE_FILES and "position" not in frame.layers
            if rows:
                image_files.join_rows([part.folder / name for part in parts], staged / name, half=half)
                continue
            # Means weighted by samples, except "index", which is that of the first part.
            counts = [(part.frame.samples + 1 - number) // 2 for part in parts]
            layers = dict[str, Array]()
            for part, count in zip(parts, counts, strict=True):
                added = image_files.read_layers(part.folder / name)
                shapes, wanted = ({key: of.shape for key, of in group.items()} for group in (added, layers or added))
                if shapes != wanted:
                    raise LfsrError(f"{part.folder / name} has other layers or another size than the first reference: "
                                    "render it again")
                for layer in added.keys() - {"index"}:
                    added[layer] = layers.get(layer, 0) + added[layer] * np.float32(count / sum(counts))
                layers = layers | added | {"index": layers["index"]} if "index" in layers else added
            image_files.write_layers(staged / name, layers, half=half)
        if frame.world_apart:
            image_files.write_layers(staged / WORLD_FILE, image_files.read_layers(parts[0].folder / WORLD_FILE))
        for part in (part for part in parts if FrameFolder(part.folder).readable != part.frame):
            raise LfsrError(f"{part.folder} was rendered again while it was merged: merge the parts again")
        write_frame(staged, frame)
        target.publish(staged)
    tell(Progress("merge", 1.0))
    return frame


def _merged(parts: list[_Part], **changes: Any) -> Frame:
    """Return the first part's frame with ``changes``, the seconds of all parts and every device."""
    frames = [part.frame for part in parts]
    seconds = {name: round(sum(frame.seconds.get(name, 0.0) for frame in frames), 3) for name in frames[0].seconds}
    devices = {name for frame in frames for name in frame.device.split(DEVICES_JOINED)}
    notes = tuple({str(note): note for frame in frames for note in frame.notes}.values())
    fields = {**changes, "notes": notes, "seconds": seconds, "device": DEVICES_JOINED.join(sorted(devices)),
              "gpus": tuple(sorted({address for frame in frames for address in frame.gpus}))}
    return Frame(**(vars(frames[0]) | fields))
