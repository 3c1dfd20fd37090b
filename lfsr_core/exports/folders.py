"""Folders of views: as PNG, multi-part EXR, or as in Stanford's archive, JPEG Pleno and the HCI benchmark."""

from __future__ import annotations

import math
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import OpenImageIO as oiio

from lfsr_core.base.arrays import Array
from lfsr_core.base.errors import LfsrError
from lfsr_core.base.notices import Notice, Progress
from lfsr_core.exports.light_field import LightField, camera_places, central_disparity
from lfsr_core.exports.options import VIEW_TYPES, ExportOptions, chosen_type
from lfsr_core.frames.frame import EIA_LINEAR_FILE
from lfsr_core.images.exr import HALF_MAX
from lfsr_core.images.png import write_png
from lfsr_core.optics.eia import to_views
from lfsr_core.reconstruct.second_stage import read_finished_linear

EXR_FILE = "views.exr"
MOST_PARTS = 1024  # that readers here and elsewhere accept
PLENO_MAX = 1023
SENSOR_MM = 35.0  # arbitrary: the focal length follows from it
DISPARITY_FILE, PARAMETERS_FILE = "gt_disp_lowres.pfm", "parameters.cfg"


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
    """Write ``view_ROW_COLUMN.png`` of display values, or an EXR of scene-linear half-float parts ``vROW_COLUMN``."""
    if chosen_type(options, VIEW_TYPES) == "png":
        for row, column, view in each_view(field, options):
            write_png(folder / f"view_{row:03d}_{column:03d}.png", view)
        return
    path, image = str(folder / EXR_FILE), read_finished_linear(field.folder)
    if image is None:
        raise LfsrError(f"{field.folder} has no {EIA_LINEAR_FILE}, which scene-linear views need: finish the "
                        "frame with a linear EXR, or export PNG")
    linear = np.clip(to_views(image, field.display.lenses), 0, HALF_MAX)
    columns, rows = (sorted({min(max(round(place), 0), n - 1) for place in camera_places(n, wanted)})
                     for n, wanted in zip(field.count, options.views or field.count, strict=True))
    if len(columns) * len(rows) > MOST_PARTS:
        raise LfsrError(f"{len(columns)}x{len(rows)} views are more parts than the {MOST_PARTS} that programs read: "
                        "choose fewer, such as 9 or 9x9")
    parts = [(row, column) for row in rows for column in columns]
    specs = []
    for row, column in parts:
        specs.append(spec := oiio.ImageSpec(linear.shape[3], linear.shape[2], 3, "half"))
        name = f"v{row:03d}_{column:03d}"
        for key, value in {"oiio:subimagename": name, "view": name, "compression": "zip"}.items():
            spec.attribute(key, value)
    output = oiio.ImageOutput.create(path)
    done = output.open(path, specs)
    for number, (row, column) in enumerate(parts):
        done = done and (not number or output.open(path, specs[number], "AppendSubimage"))
        done = done and output.write_image(np.ascontiguousarray(linear[row, column], np.float32))
    if not (output.close() and done):
        raise LfsrError(f"{EXR_FILE} cannot be written ({output.geterror().strip()}): choose another folder")
    if options.views not in (None, field.count):
        options.tell(Notice("views-nearest"))


def each_view(field: LightField, options: ExportOptions) -> Iterator[tuple[int, int, Array]]:
    """Row, column and (sy, sx, 3) of every view to export; reports progress after each row."""
    views = field.resampled(options.views)
    for row, line in enumerate(views):
        options.tell(Progress("export", row / len(views), f"row {row + 1} of {len(views)}"))
        yield from ((row, column, view) for column, view in enumerate(line))


def write_hci(field: LightField, folder: Path, options: ExportOptions) -> None:
    """Write ``input_Cam%03i.png`` row by row from the top left, the parameters and the disparity."""
    (across, down), (x, y) = options.views or field.count, field.count
    if across * y != down * x:
        raise LfsrError(f"views are {across}x{down} of {x}x{y}, but HCI folders have one distance between cameras "
                        "across and down: choose numbers in the same proportion")
    for row, column, view in each_view(field, options):
        write_png(folder / f"input_Cam{row * across + column:03d}.png", view)
    disparity = central_disparity(field)
    if disparity is not None:
        disparity = disparity * np.float32(x / across)  # between the exported views
        # PFM starts with the bottom row; -1 says little-endian.
        header = f"Pf\n{disparity.shape[1]} {disparity.shape[0]}\n-1\n".encode()
        (folder / DISPARITY_FILE).write_bytes(header + disparity[::-1].astype("<f4").tobytes())
    (width, height), array, mm = field.display.lenses, field.frame.array, field.mm_per_unit
    focus, baseline = array.distance * mm, array.spacing * mm * field.count[0] / across
    # The sensor is as wide as the longer side of an image, as the benchmark's programs expect.
    side = 2 * mm * max(array.half_width, array.half_height)
    focal = focus * SENSOR_MM / side
    matrix = np.asarray(field.frame.matrix_world, float)
    axes = matrix[:3, :3] / np.linalg.norm(matrix[:3, :3], axis=0)
    place = (*matrix[:3, 3] * mm / 1000,  # of the central camera in the world: metres, and angles (XYZ)
             math.atan2(axes[2, 1], axes[2, 2]), math.asin(float(np.clip(-axes[2, 0], -1, 1))),
             math.atan2(axes[1, 0], axes[0, 0]))
    names = [f"center_cam_{name}" for name in ("x_m", "y_m", "z_m", "rx_rad", "ry_rad", "rz_rad")]
    nearest, farthest = (0.0, 0.0) if disparity is None else (float(disparity.max()), float(disparity.min()))
    sections: dict[str, dict[str, str | float]] = {
        "intrinsics": {"focal_length_mm": focal, "image_resolution_x_px": width, "image_resolution_y_px": height,
                       "sensor_size_mm": SENSOR_MM, "fstop": 100.0},
        "extrinsics": {"num_cams_x": across, "num_cams_y": down, "baseline_mm": baseline,
                       "focus_distance_m": focus / 1000, **dict(zip(names, map(float, place), strict=True)),
                       "offset": baseline * focal / (focus / 1000) / 1000 / SENSOR_MM * max(width, height)},
        "meta": {"scene": field.name, "category": "lfsr", "date": "", "version": "v0", "authors": "", "contact": "",
                 "cycles_seed": field.frame.seed, "disp_min": farthest, "disp_max": nearest,
                 "frustum_disp_min": farthest, "frustum_disp_max": nearest, "depth_map_scale": 1.0}}
    parameters = "\n".join(f"[{title}]\n" + "".join(
        f"{key} = {value:.9g}\n" if isinstance(value, float) else f"{key} = {value}\n"
        for key, value in entries.items()) for title, entries in sections.items())
    (folder / PARAMETERS_FILE).write_text(parameters, encoding="ascii", errors="replace")
    if disparity is None:
        options.tell(Notice("disparity-missing"))
