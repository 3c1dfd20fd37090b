"""What writes each format of ``lfsr export``: whole or not at all."""

from __future__ import annotations

import contextlib
import dataclasses
import fnmatch
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import NamedTuple

from lfsr_core.errors import LfsrError, did_you_mean
from lfsr_core.exports import folders, hci, quilt, stereo, sway
from lfsr_core.exports.format_names import default_target
from lfsr_core.exports.light_field import LightField, read_light_field
from lfsr_core.exports.options import ExportOptions
from lfsr_core.files import check_name, system_errors
from lfsr_core.render.staging import publish, staging_folder

DEFAULT = ExportOptions()


class Exported(NamedTuple):
    """What an export wrote."""

    files: list[Path]
    notes: list[str]  # sentences that the user should know


@dataclasses.dataclass(frozen=True)
class Format:
    """One way to hand a light field on."""

    # Fills an empty folder; returns sentences that the user should know.
    write: Callable[[LightField, Path, ExportOptions], list[str]]
    options: tuple[str, ...]  # names of the options that it looks at
    numbered: tuple[str, ...] = ()  # patterns of files of which an earlier export may have more: those go
    one_file: bool = False  # of a frame: those of an animation lie in one folder
    # Fills an empty folder with one film of so many frames; None where each frame is written on its own.
    write_film: Callable[[Iterator[LightField], int, Path, ExportOptions], list[str]] | None = None


FORMATS = {
    "quilt": Format(quilt.write, ("views", "grid", "width"), one_file=True),
    "hci": Format(hci.write, ("views",), ("input_Cam*.png", hci.DISPARITY_FILE)),
    "stanford": Format(folders.write_stanford, ("views",), ("out_*_*_*_*_.png",)),
    "stereo": Format(stereo.write, ("eyes_mm", "width"), one_file=True),
    "views": Format(folders.write_views, ("views", "type"), ("view_*_*.png",)),
    "sway": Format(sway.write, ("width", "type", "seconds", "fps"), ("*_sway_*.png",),
                   write_film=sway.write_film),
    "pleno": Format(folders.write_pleno, ("views",), ("[0-9][0-9][0-9]_[0-9][0-9][0-9].ppm",)),
}


def export(folder: str | Path, name: str, target: str | Path | None = None,
           options: ExportOptions = DEFAULT) -> Exported:
    """Write a finished frame in another format.

    Parameters
    ----------
    folder : finished frame folder
    name : of FORMATS, format_names describes them
    target : folder to write into, by default ``export/NAME`` in the frame folder
    options : what the format leaves to choose

    Raises
    ------
    LfsrError : for bad input; nothing half-written is left then, and an earlier export stays
    """
    chosen = find_format(name, options)
    target = default_target(folder, name) if target is None else Path(target)
    written = write_whole(target, chosen, lambda staged: chosen.write(read_light_field(folder), staged, options))
    options.progress("export", 1.0, name)
    return written


def write_whole(target: Path, chosen: Format, write: Callable[[Path], list[str]]) -> Exported:
    """Let ``write`` fill an empty folder and move its files into ``target``, all or none.

    LfsrError where ``target`` cannot be written.
    """
    check_name(target)
    if target.exists() and not target.is_dir():
        raise LfsrError(f"{target} is a file, but an export goes into a folder: choose another name")
    with _no_empty_folder(target.parent), staging_folder(target) as work, system_errors(target):
        staged = work / "export"
        staged.mkdir()
        notes = write(staged)
        files = sorted(path.name for path in staged.iterdir())
        publish(staged, target, _left_by_earlier(target, files, chosen.numbered))
    return Exported([target / file for file in files], notes)


@contextlib.contextmanager
def _no_empty_folder(folder: Path) -> Iterator[None]:
    """A folder that was made for nothing goes again."""
    new = not folder.exists()
    try:
        yield
    except BaseException:
        if new:
            with contextlib.suppress(OSError):
                folder.rmdir()
        raise


def _left_by_earlier(target: Path, files: list[str], patterns: tuple[str, ...]) -> list[str]:
    """Names in ``target`` that are numbered like ``files``."""
    written = [pattern for pattern in patterns if fnmatch.filter(files, pattern)]
    return [path.name for pattern in written for path in target.glob(pattern)]


def find_format(name: str, options: ExportOptions) -> Format:
    """The format of this name; LfsrError where there is none, or for an option that it has not."""
    if name not in FORMATS:
        raise LfsrError(f"unknown format {name!r}: {did_you_mean(name, FORMATS)}Choose from {', '.join(FORMATS)}")
    for option in options.given():
        if option not in FORMATS[name].options:
            raise LfsrError(f"format {name!r} has no option {option!r}, only "
                            f"{', '.join(FORMATS[name].options)}: leave it out")
    return FORMATS[name]
