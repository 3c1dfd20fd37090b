"""Folders of views: Stanford's names, JPEG Pleno's, plain PNG, and multi-part EXR."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import numpy as np
import OpenImageIO as oiio

from lfsr_core.arrays import Array
from lfsr_core.errors import LfsrError
from lfsr_core.exports.format_names import VIEW_TYPES
from lfsr_core.exports.light_field import LightField, camera_places, read_linear_views
from lfsr_core.exports.options import ExportOptions, kind
from lfsr_core.exports.pictures import save_png
from lfsr_core.images.exr import HALF_MAX

EXR_FILE = "views.exr"
MOST_PARTS = 1024  # what readers here and elsewhere take
PLENO_MAX = 1023


def write_stanford(field: LightField, folder: Path, options: ExportOptions) -> list[str]:
    """``out_ROW_COLUMN_Y_X_.png``: y downwards and x rightwards in millimetres on the display's scale."""
    spacing = field.frame.array.spacing * field.mm_per_unit
    count = options.views or field.count
    x, y = ((camera_places(n, wanted) - (n - 1) / 2) * spacing
            for n, wanted in zip(field.count, count, strict=True))
    for row, column, view in _each(field, options):
        save_png(folder / f"out_{row:02d}_{column:02d}_{y[row]:.6f}_{x[column]:.6f}_.png", view)
    return []


def write_pleno(field: LightField, folder: Path, options: ExportOptions) -> list[str]:
    """``COLUMN_ROW.ppm``, 16 bit with values to 1023, as in the JPEG Pleno test sets."""
    for row, column, view in _each(field, options):
        values = np.rint(view * np.float32(PLENO_MAX / 255)).astype(">u2")
        header = f"P6\n{view.shape[1]} {view.shape[0]}\n{PLENO_MAX}\n".encode()
        (folder / f"{column:03d}_{row:03d}.ppm").write_bytes(header + values.tobytes())
    return []


def write_views(field: LightField, folder: Path, options: ExportOptions) -> list[str]:
    """``view_ROW_COLUMN.png``, display values; or one EXR of scene-linear parts."""
    if kind(options, VIEW_TYPES) == "exr":
        return _write_exr(field, folder / EXR_FILE, options)
    for row, column, view in _each(field, options):
        save_png(folder / f"view_{row:03d}_{column:03d}.png", view)
    return []


def _each(field: LightField, options: ExportOptions) -> Iterator[tuple[int, int, Array]]:
    """Row, column and (sy, sx, 3) of every view asked for; progress goes on with each row."""
    views = field.resampled(options.views)
    for row, line in enumerate(views):
        options.progress("export", row / len(views), f"row {row + 1} of {len(views)}")
        yield from ((row, column, view) for column, view in enumerate(line))


def _write_exr(field: LightField, path: Path, options: ExportOptions) -> list[str]:
    """One part per view: its ``view`` and ``name`` are ``vROW_COLUMN``, half float."""
    linear = np.clip(read_linear_views(field), 0, HALF_MAX)
    columns, rows = (_nearest(n, wanted) for n, wanted in zip(field.count, options.views or field.count, strict=True))
    if len(columns) * len(rows) > MOST_PARTS:
        raise LfsrError(f"{len(columns)}x{len(rows)} views are more parts than the {MOST_PARTS} that programs read: "
                        "choose fewer with --views, as 9 or 9x9")
    parts = [(row, column) for row in rows for column in columns]
    specs = [_part(linear.shape[3], linear.shape[2], f"v{row:03d}_{column:03d}") for row, column in parts]
    output = oiio.ImageOutput.create(str(path))
    done = output.open(str(path), specs)
    for number, (row, column) in enumerate(parts):
        done = done and (not number or output.open(str(path), specs[number], "AppendSubimage"))
        done = done and output.write_image(np.ascontiguousarray(linear[row, column], np.float32))
    if not (done and output.close()):
        raise LfsrError(f"{path.name} cannot be written ({output.geterror().strip()}): choose another folder")
    return ["each part is one of the display's own views, the nearest where another number was asked for"] * (
        options.views not in (None, field.count))


def _nearest(count: int, wanted: int) -> list[int]:
    """Cameras nearest to ``wanted`` evenly spaced places."""
    return sorted({min(max(round(place), 0), count - 1) for place in camera_places(count, wanted)})


def _part(width: int, height: int, name: str) -> oiio.ImageSpec:
    spec = oiio.ImageSpec(width, height, 3, "half")
    spec.attribute("oiio:subimagename", name)
    spec.attribute("view", name)
    spec.attribute("compression", "zip")
    return spec
