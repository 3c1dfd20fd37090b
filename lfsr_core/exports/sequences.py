"""Exports of an animation: every frame in the format, or one film of all."""

from __future__ import annotations

import dataclasses
from collections.abc import Iterator
from pathlib import Path

from lfsr_core.exports.format_names import default_target
from lfsr_core.exports.formats import DEFAULT, Exported, Format, find_format, write_whole
from lfsr_core.exports.frame_folders import frame_folders, one_display
from lfsr_core.exports.light_field import LightField, read_light_field
from lfsr_core.exports.options import ExportOptions
from lfsr_core.frames.frame import read_frame
from lfsr_core.progress import Progress


def export_sequence(folder: str | Path, name: str, target: str | Path | None = None,
                    options: ExportOptions = DEFAULT) -> Exported:
    """Write the finished frames of an animation in another format, or as one film where the format is one.

    Formats of one picture a frame number it by its frame; those of many files have a folder per frame, named as the
    frame's. Each frame appears whole or not at all.

    Parameters
    ----------
    folder : of frame folders
    name : of formats.FORMATS
    target : folder to write into, by default ``export/NAME`` in ``folder``
    options : what the format leaves to choose

    Raises
    ------
    LfsrError : where no frame is finished, displays differ, or as of ``formats.export``
    """
    chosen, folders = find_format(name, options), frame_folders(folder)
    one_display({path: read_frame(path) for path in folders})
    target = default_target(folder, name) if target is None else Path(target)
    if chosen.write_film is not None:
        files, notes = write_whole(target, chosen, lambda staged: chosen.write_film(
            _fields(folders), len(folders), staged, options))
    else:
        files, notes = _frame_by_frame(folders, chosen, target, options)
    options.progress("export", 1.0, name)
    return Exported(files, list(dict.fromkeys(notes)))


def _fields(folders: list[Path]) -> Iterator[LightField]:
    """One after the other: all views of an 8K animation would not fit into memory."""
    return map(read_light_field, folders)


def _frame_by_frame(folders: list[Path], chosen: Format, target: Path,
                    options: ExportOptions) -> tuple[list[Path], list[str]]:
    files: list[Path] = []
    notes: list[str] = []
    for number, folder in enumerate(folders):
        field = read_light_field(folder)
        if chosen.one_file:
            field = dataclasses.replace(field, name=f"{field.name}_{folder.name}")
        share = dataclasses.replace(options, progress=_part(options.progress, number, len(folders)))

        def write(staged: Path, field: LightField = field, share: ExportOptions = share) -> list[str]:
            return chosen.write(field, staged, share)

        written, said = write_whole(target if chosen.one_file else target / folder.name, chosen, write)
        files += written
        notes += said
    return files, notes


def _part(progress: Progress, number: int, count: int) -> Progress:
    """Progress of frame ``number`` of ``count``, as progress of all."""
    return lambda stage, fraction, _message: progress(stage, (number + fraction) / count,
                                                      f"frame {number + 1} of {count}")
