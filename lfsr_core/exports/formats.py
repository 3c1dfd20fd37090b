"""Export finished frames and animations in other formats."""

import contextlib
import dataclasses
import fnmatch
import functools
from collections.abc import Callable
from pathlib import Path
from typing import NamedTuple

from lfsr_core.base.messages import LfsrError, Notice, Progress, Tell, did_you_mean
from lfsr_core.base.system import check_name, replace_files, staging_folder, system_errors
from lfsr_core.exports import images
from lfsr_core.exports.light_field import read_light_field
from lfsr_core.exports.options import FORMATS, ExportOptions, default_target
from lfsr_core.frames.folder import frame_folders, is_sequence, one_display
from lfsr_core.frames.frame import read_frame

DEFAULT = ExportOptions()


class Writer(NamedTuple):
    """How a format is written: a function that fills an empty folder."""

    # Writes one frame: (LightField, folder, ExportOptions); or a film: (iterator of them, their number or None for a
    # single frame, folder, ExportOptions).
    write: Callable[..., None]
    numbered: tuple[str, ...] = ()  # patterns of numbered files: an export removes those of an earlier one
    one_file: bool = False  # one file per frame, so that all files of an animation go into one folder
    is_film: bool = False  # whether all frames are written at once


WRITERS = {  # by the names of ``options.FORMATS``
    "quilt": Writer(images.write_quilt, one_file=True),
    "quilt-film": Writer(images.write_quilt_film, ("*_qs*_*.png",), is_film=True),
    "rgbd": Writer(images.write_rgbd, one_file=True),
    **{name: Writer(functools.partial(images.write_stereo, layout), one_file=True)
       for name, layout in images.LAYOUTS.items()},
    "wiggle": Writer(functools.partial(images.write_motion, images.WIGGLE), ("*_wiggle_*.png",), is_film=True),
    "sway": Writer(functools.partial(images.write_motion, images.SWAY), ("*_sway_*.png",), is_film=True),
    "views": Writer(images.write_views, ("view_*_*.png",)),
    "hci": Writer(images.write_hci, ("input_Cam*.png", images.DISPARITY_FILE)),
    "stanford": Writer(images.write_stanford, ("out_*_*_*_*_.png",)),
    "pleno": Writer(images.write_pleno, ("[0-9][0-9][0-9]_[0-9][0-9][0-9].ppm",))}


def export(folder: str | Path, name: str, target: str | Path | None = None,
           options: ExportOptions = DEFAULT) -> list[Path]:
    """Write a finished frame, or the finished frames of an animation, in another format; return the files.

    An animation becomes one film where the format is a film. Else each frame is exported on its own: into a folder
    named as the frame's, or, in formats of one file, into one folder with the frame's name in that of the file.

    ``folder``: finished frame folder, or a folder of frame folders; ``name``: one of FORMATS; ``target``: folder to
    write into, by default ``export/NAME`` in ``folder``. LfsrError for bad input; no export is half-written then, and
    an earlier one stays.
    """
    if name not in FORMATS:
        raise LfsrError(f"unknown format {name!r}: {did_you_mean(name, FORMATS)}Choose from {', '.join(FORMATS)}")
    chosen, has = WRITERS[name], FORMATS[name].options
    for option, value in vars(options).items():
        if value is not None and option not in (*has, "tell", "shape"):
            raise LfsrError(f"format {name!r} has no option {option!r}, only {', '.join(has)}: leave it out")
    target = default_target(folder, name) if target is None else Path(target)
    paths = frame_folders(folder) if is_sequence(folder) else None
    one_display({path: read_frame(path) for path in paths or [Path(folder)]})
    if chosen.is_film:
        # One at a time: an 8K animation would not fit into memory.
        fields = map(read_light_field, paths or [Path(folder)])
        written = _write(target, chosen, lambda staged: chosen.write(fields, paths and len(paths), staged, options))
    elif paths is None:
        written = _write(target, chosen, lambda staged: chosen.write(read_light_field(folder), staged, options))
    else:
        written = []
        for number, path in enumerate(paths):
            def tell(told: Progress | Notice, number: int = number) -> None:
                options.tell(told if isinstance(told, Notice) else Progress(
                    told.stage, (number + told.fraction) / len(paths), f"frame {number + 1} of {len(paths)}"))

            def write(staged: Path, path: Path = path, tell: Tell = tell) -> None:
                field = read_light_field(path)
                named = dataclasses.replace(field, name=f"{field.name}_{path.name}") if chosen.one_file else field
                chosen.write(named, staged, dataclasses.replace(options, tell=tell))

            written += _write(target if chosen.one_file else target / path.name, chosen, write)
    options.tell(Progress("export", 1.0, name))
    return written


def _write(target: Path, chosen: Writer, write: Callable[[Path], None]) -> list[Path]:
    """Let ``write`` fill an empty folder, and move its files into ``target``, all or none."""
    check_name(target)
    if target.exists() and not target.is_dir():
        raise LfsrError(f"{target} is a file, but an export goes into a folder: choose another name")
    new = not target.parent.exists()
    try:
        with staging_folder(target) as work, system_errors(target):
            staged = work / "export"
            staged.mkdir()
            write(staged)
            names = sorted(path.name for path in staged.iterdir())
            numbered = [pattern for pattern in chosen.numbered if fnmatch.filter(names, pattern)]
            target.mkdir(exist_ok=True)
            replace_files(staged, target, [path.name for pattern in numbered for path in target.glob(pattern)])
    except BaseException:
        if new:  # removed after an error, if it is empty
            with contextlib.suppress(OSError):
                target.parent.rmdir()
        raise
    return [target / name for name in names]
