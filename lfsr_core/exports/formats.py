"""Export finished frames and animations in other formats."""

from __future__ import annotations

import contextlib
import dataclasses
import fnmatch
import functools
from collections.abc import Callable, Iterator
from pathlib import Path

from lfsr_core.base.errors import LfsrError, did_you_mean
from lfsr_core.base.files import check_name, replace_files, system_errors
from lfsr_core.base.notices import Notice, Progress, Tell
from lfsr_core.exports import folders, hci, quilt, rgbd, stereo, sway
from lfsr_core.exports.format_names import default_target
from lfsr_core.exports.frame_folders import frame_folders, is_sequence, one_display
from lfsr_core.exports.light_field import LightField, read_light_field
from lfsr_core.exports.options import ExportOptions
from lfsr_core.frames.frame import read_frame
from lfsr_core.pipeline.staging import staging_folder

DEFAULT = ExportOptions()


@dataclasses.dataclass(frozen=True)
class Format:
    """A format; its functions fill an empty folder."""

    write: Callable[[LightField, Path, ExportOptions], None]  # writes one frame
    options: tuple[str, ...]  # names of the options that it has
    numbered: tuple[str, ...] = ()  # patterns of numbered files: an export removes those of an earlier one
    one_file: bool = False  # one file per frame, so that all files of an animation go into one folder
    # writes the frames of an animation, and their number, as one film; None where frames are written one by one
    write_film: Callable[[Iterator[LightField], int, Path, ExportOptions], None] | None = None


def _motion(motion: sway.Motion, *more: str) -> Format:
    return Format(functools.partial(sway.write, motion), ("width", "type", "seconds", "fps", *more),
                  (f"*_{motion.name}_*.png",), write_film=functools.partial(sway.write_film, motion))


FORMATS = {
    "quilt": Format(quilt.write, ("views", "grid", "width", "preset"), one_file=True),
    "quilt-film": Format(quilt.write_one_frame, ("views", "grid", "width", "preset", "type", "fps"), ("*_qs*_*.png",),
                         write_film=quilt.write_film),
    "rgbd": Format(rgbd.write, ("width",), one_file=True),
    **{name: Format(functools.partial(stereo.write, layout), ("eyes_mm", "width"), one_file=True)
       for name, layout in stereo.LAYOUTS.items()},
    "wiggle": _motion(sway.WIGGLE, "eyes_mm"),
    "sway": _motion(sway.SWAY),
    "views": Format(folders.write_views, ("views", "type"), ("view_*_*.png",)),
    "hci": Format(hci.write, ("views",), ("input_Cam*.png", hci.DISPARITY_FILE)),
    "stanford": Format(folders.write_stanford, ("views",), ("out_*_*_*_*_.png",)),
    "pleno": Format(folders.write_pleno, ("views",), ("[0-9][0-9][0-9]_[0-9][0-9][0-9].ppm",)),
}


def export(folder: str | Path, name: str, target: str | Path | None = None,
           options: ExportOptions = DEFAULT) -> list[Path]:
    """Write a finished frame, or the finished frames of an animation, in another format; return the files.

    An animation becomes one film where the format is a film. Else each frame is exported on its own: into a folder
    named as the frame's, or, in formats of one file, into one folder with the frame's name in that of the file.

    Parameters
    ----------
    folder : finished frame folder, or a folder of frame folders
    name : format, one of FORMATS; ``format_names`` describes them
    target : folder to write into, by default ``export/NAME`` in ``folder``
    options : options of the format

    Raises
    ------
    LfsrError : for bad input; no export is half-written then, and an earlier one stays
    """
    chosen = _find(name, options)
    target = default_target(folder, name) if target is None else Path(target)
    if is_sequence(folder):
        written = _export_animation(frame_folders(folder), chosen, target, options)
    else:
        written = _write(target, chosen, lambda staged: chosen.write(read_light_field(folder), staged, options))
    options.tell(Progress("export", 1.0, name))
    return written


def _find(name: str, options: ExportOptions) -> Format:
    """Format of this name; LfsrError for an unknown name, or an option that the format does not have."""
    if name not in FORMATS:
        raise LfsrError(f"unknown format {name!r}: {did_you_mean(name, FORMATS)}Choose from {', '.join(FORMATS)}")
    for option in options.given():
        if option not in FORMATS[name].options:
            raise LfsrError(f"format {name!r} has no option {option!r}, only "
                            f"{', '.join(FORMATS[name].options)}: leave it out")
    return FORMATS[name]


def _export_animation(paths: list[Path], chosen: Format, target: Path, options: ExportOptions) -> list[Path]:
    one_display({path: read_frame(path) for path in paths})
    write_film = chosen.write_film
    if write_film is not None:
        fields = map(read_light_field, paths)  # one at a time: an 8K animation would not fit into memory
        return _write(target, chosen, lambda staged: write_film(fields, len(paths), staged, options))
    files: list[Path] = []
    for number, path in enumerate(paths):
        field = read_light_field(path)
        if chosen.one_file:
            field = dataclasses.replace(field, name=f"{field.name}_{path.name}")
        given = dataclasses.replace(options, tell=functools.partial(_tell_of_all, options.tell, number, len(paths)))
        files += _write(target if chosen.one_file else target / path.name, chosen,
                        functools.partial(_write_one, chosen, field, given))
    return files


def _write_one(chosen: Format, field: LightField, options: ExportOptions, staged: Path) -> None:
    chosen.write(field, staged, options)


def _tell_of_all(tell: Tell, number: int, count: int, told: Progress | Notice) -> None:
    """Tell the progress of frame ``number`` of ``count`` as that of all frames."""
    tell(told if isinstance(told, Notice) else
         Progress(told.stage, (number + told.fraction) / count, f"frame {number + 1} of {count}"))


def _write(target: Path, chosen: Format, write: Callable[[Path], None]) -> list[Path]:
    """Let ``write`` fill an empty folder, and move its files into ``target``, all or none."""
    check_name(target)
    if target.exists() and not target.is_dir():
        raise LfsrError(f"{target} is a file, but an export goes into a folder: choose another name")
    with _new_folder(target.parent), staging_folder(target) as work, system_errors(target):
        staged = work / "export"
        staged.mkdir()
        write(staged)
        names = sorted(path.name for path in staged.iterdir())
        numbered = [pattern for pattern in chosen.numbered if fnmatch.filter(names, pattern)]
        target.mkdir(exist_ok=True)
        replace_files(staged, target, [path.name for pattern in numbered for path in target.glob(pattern)])
    return [target / name for name in names]


@contextlib.contextmanager
def _new_folder(folder: Path) -> Iterator[None]:
    """Remove ``folder`` after an error, if it is empty and did not exist before."""
    new = not folder.exists()
    try:
        yield
    except BaseException:
        if new:
            with contextlib.suppress(OSError):
                folder.rmdir()
        raise
