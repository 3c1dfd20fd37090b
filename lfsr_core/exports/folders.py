"""Folders of views: Stanford's names, JPEG Pleno's, plain PNG, and multi-part EXR."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import numpy as np
import OpenImageIO as oiio

from lfsr_core.base.arrays import Array
from lfsr_core.base.errors import LfsrError
from lfsr_core.base.notices import Notice, Progress
from lfsr_core.exports.format_names import VIEW_TYPES
from lfsr_core.exports.light_field import LightField, camera_places, read_linear_views
from lfsr_core.exports.options import ExportOptions, chosen_type
from lfsr_core.images.exr import HALF_MAX
from lfsr_core.images.png import write_png

EXR_FILE = "views.exr"
MOST_PARTS = 1024  # that readers here and elsewhere accept
PLENO_MAX = 1023


def write_stanford(field: LightField, folder: Path, options: ExportOptions) -> None:
    """Write ``out_ROW_COLUMN_Y_X_.png``, y downwards and x rightwards in millimetres on the display."""
    spacing = field.frame.array.spacing * field.mm_per_unit
    count = options.views or field.count
    x, y = ((camera_places(n, wanted) - (n - 1) / 2) * spacing
            for n, wanted in zip(field.count, count, strict=True))
    for row, column, view in each_view(field, options):
        write_png(folder / f"out_{row:02d}_{column:02d}_{y[row]:.6f}_{x[column]:.6f}_.png", view)


def write_pleno(field: LightField, folder: Path, options: ExportOptions) -> None:
    """Write ``COLUMN_ROW.ppm``, 16 bit with values to 1023, as in the JPEG Pleno test sets."""
    for row, column, view in each_view(field, options):
        values = np.rint(view * np.float32(PLENO_MAX / 255)).astype(">u2")
        header = f"P6\n{view.shape[1]} {view.shape[0]}\n{PLENO_MAX}\n".encode()
        (folder / f"{column:03d}_{row:03d}.ppm").write_bytes(header + values.tobytes())


def write_views(field: LightField, folder: Path, options: ExportOptions) -> None:
    """Write ``view_ROW_COLUMN.png`` of display values, or one EXR of scene-linear parts."""
    if chosen_type(options, VIEW_TYPES) == "exr":
        _write_exr(field, folder / EXR_FILE, options)
        return
    for row, column, view in each_view(field, options):
        write_png(folder / f"view_{row:03d}_{column:03d}.png", view)


def each_view(field: LightField, options: ExportOptions) -> Iterator[tuple[int, int, Array]]:
    """Row, column and (sy, sx, 3) of every view to export; reports progress after each row."""
    views = field.resampled(options.views)
    for row, line in enumerate(views):
        options.tell(Progress("export", row / len(views), f"row {row + 1} of {len(views)}"))
        yield from ((row, column, view) for column, view in enumerate(line))


def _write_exr(field: LightField, path: Path, options: ExportOptions) -> None:
    """Write one half-float part per view, whose ``view`` and ``name`` are ``vROW_COLUMN``."""
    linear = np.clip(read_linear_views(field), 0, HALF_MAX)
    columns, rows = (_nearest(n, wanted) for n, wanted in zip(field.count, options.views or field.count, strict=True))
    if len(columns) * len(rows) > MOST_PARTS:
        raise LfsrError(f"{len(columns)}x{len(rows)} views are more parts than the {MOST_PARTS} that programs read: "
                        "choose fewer with --views, such as 9 or 9x9")
    parts = [(row, column) for row in rows for column in columns]
    specs = [_part(linear.shape[3], linear.shape[2], f"v{row:03d}_{column:03d}") for row, column in parts]
    output = oiio.ImageOutput.create(str(path))
    done = output.open(str(path), specs)
    for number, (row, column) in enumerate(parts):
        done = done and (not number or output.open(str(path), specs[number], "AppendSubimage"))
        done = done and output.write_image(np.ascontiguousarray(linear[row, column], np.float32))
    if not (output.close() and done):
        raise LfsrError(f"{path.name} cannot be written ({output.geterror().strip()}): choose another folder")
    if options.views not in (None, field.count):
        options.tell(Notice("views-nearest"))


def _nearest(count: int, wanted: int) -> list[int]:
    """Cameras nearest to ``wanted`` evenly spaced places."""
    return sorted({min(max(round(place), 0), count - 1) for place in camera_places(count, wanted)})


def _part(width: int, height: int, name: str) -> oiio.ImageSpec:
    spec = oiio.ImageSpec(width, height, 3, "half")
    for key, value in {"oiio:subimagename": name, "view": name, "compression": "zip"}.items():
        spec.attribute(key, value)
    return spec
