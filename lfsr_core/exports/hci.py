"""The layout of the HCI 4D light field benchmark: views, parameters.cfg, the middle view's disparity."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np

from lfsr_core.arrays import Array
from lfsr_core.errors import LfsrError
from lfsr_core.exports.disparity import central_disparity
from lfsr_core.exports.light_field import LightField
from lfsr_core.exports.options import ExportOptions
from lfsr_core.exports.pictures import save_png

SENSOR_MM = 35.0  # any size will do: the focal length follows from it
DISPARITY_FILE, PARAMETERS_FILE = "gt_disp_lowres.pfm", "parameters.cfg"
NO_POSITION = ("no disparity was written, because the frame has no position layer: render it with "
               "--layers albedo,normal,position")


def write(field: LightField, folder: Path, options: ExportOptions) -> list[str]:
    """Write ``input_Cam%03i.png`` row by row from the top left, the parameters and the disparity; the notes."""
    _check_spacing(field, options)
    views = field.resampled(options.views)
    for row, line in enumerate(views):
        options.progress("export", row / len(views), f"row {row + 1} of {len(views)}")
        for column, view in enumerate(line):
            save_png(folder / f"input_Cam{row * len(line) + column:03d}.png", view)
    step = field.count[0] / views.shape[1]  # dense views between the exported ones
    disparity = central_disparity(field)
    if disparity is not None:
        disparity = disparity * np.float32(step)
        write_pfm(folder / DISPARITY_FILE, disparity)
    (folder / PARAMETERS_FILE).write_text(_parameters(field, views, disparity), encoding="ascii", errors="replace")
    return [NO_POSITION] if disparity is None else []


def _check_spacing(field: LightField, options: ExportOptions) -> None:
    """LfsrError unless the cameras are as far apart down as across: the benchmark has one baseline."""
    (across, down), (x, y) = options.views or field.count, field.count
    if across * y != down * x:
        raise LfsrError(f"views are {across}x{down} of {x}x{y}, but HCI folders have one distance between cameras "
                        "across and down: choose numbers in the same proportion")


def write_pfm(path: Path, values: Array) -> None:
    """Write (H, W) float32 as little-endian PFM, whose rows go from the bottom."""
    header = f"Pf\n{values.shape[1]} {values.shape[0]}\n-1\n".encode()
    path.write_bytes(header + values[::-1].astype("<f4").tobytes())


def _parameters(field: LightField, views: Array, disparity: Array | None) -> str:
    down, across, height, width, _ = views.shape
    array, mm = field.frame.array, field.mm_per_unit
    focus, baseline = array.distance * mm, array.spacing * mm * field.count[0] / across
    # The sensor is as wide as the longer side, as the benchmark reads it.
    side = 2 * mm * max(array.half_width, array.half_height)
    focal = focus * SENSOR_MM / side
    nearest, farthest = (0.0, 0.0) if disparity is None else (float(disparity.max()), float(disparity.min()))
    sections = {
        "intrinsics": {"focal_length_mm": focal, "image_resolution_x_px": width, "image_resolution_y_px": height,
                       "sensor_size_mm": SENSOR_MM, "fstop": 100.0},
        "extrinsics": {"num_cams_x": across, "num_cams_y": down, "baseline_mm": baseline,
                       "focus_distance_m": focus / 1000} | _pose(field) | {
                       "offset": baseline * focal / (focus / 1000) / 1000 / SENSOR_MM * max(width, height)},
        "meta": {"scene": field.name, "category": "lfsr", "date": "", "version": "v0", "authors": "", "contact": "",
                 "cycles_seed": field.frame.seed, "disp_min": farthest, "disp_max": nearest,
                 "frustum_disp_min": farthest, "frustum_disp_max": nearest, "depth_map_scale": 1.0}}
    return "\n".join(f"[{title}]\n" + "".join(f"{key} = {_text(value)}\n" for key, value in entries.items())
                     for title, entries in sections.items())


def _pose(field: LightField) -> dict[str, float]:
    """Place in metres and angles (XYZ) of the camera in the middle, in the world."""
    matrix = np.asarray(field.frame.matrix_world, float)
    x, y, z = matrix[:3, 3] * field.mm_per_unit / 1000
    axes = matrix[:3, :3] / np.linalg.norm(matrix[:3, :3], axis=0)
    angles = (math.atan2(axes[2, 1], axes[2, 2]), math.asin(float(np.clip(-axes[2, 0], -1, 1))),
              math.atan2(axes[1, 0], axes[0, 0]))
    names = ("center_cam_x_m", "center_cam_y_m", "center_cam_z_m",
             "center_cam_rx_rad", "center_cam_ry_rad", "center_cam_rz_rad")
    return dict(zip(names, map(float, (x, y, z, *angles)), strict=True))


def _text(value: str | float) -> str:
    return f"{value:.9g}" if isinstance(value, float) else str(value)
