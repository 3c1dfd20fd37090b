"""Views, parameters.cfg and central disparity, as in the HCI 4D light field benchmark."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np

from lfsr_core.base.arrays import Array
from lfsr_core.base.errors import LfsrError
from lfsr_core.base.notices import Notice
from lfsr_core.exports.disparity import central_disparity
from lfsr_core.exports.folders import each_view
from lfsr_core.exports.light_field import LightField
from lfsr_core.exports.options import ExportOptions
from lfsr_core.images.png import write_png

SENSOR_MM = 35.0  # arbitrary: the focal length follows from it
DISPARITY_FILE, PARAMETERS_FILE = "gt_disp_lowres.pfm", "parameters.cfg"


def write(field: LightField, folder: Path, options: ExportOptions) -> None:
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
    parameters = _parameters(field, (across, down), disparity)
    (folder / PARAMETERS_FILE).write_text(parameters, encoding="ascii", errors="replace")
    if disparity is None:
        options.tell(Notice("disparity-missing"))


def _parameters(field: LightField, views: tuple[int, int], disparity: Array | None) -> str:
    """Text of parameters.cfg; ``views``: exported cameras (across, down)."""
    (across, down), (width, height) = views, field.display.lenses
    array, mm = field.frame.array, field.mm_per_unit
    focus, baseline = array.distance * mm, array.spacing * mm * field.count[0] / across
    # The sensor is as wide as the longer side of an image, as the benchmark's programs expect.
    side = 2 * mm * max(array.half_width, array.half_height)
    focal = focus * SENSOR_MM / side
    nearest, farthest = (0.0, 0.0) if disparity is None else (float(disparity.max()), float(disparity.min()))
    sections: dict[str, dict[str, str | float]] = {
        "intrinsics": {"focal_length_mm": focal, "image_resolution_x_px": width, "image_resolution_y_px": height,
                       "sensor_size_mm": SENSOR_MM, "fstop": 100.0},
        "extrinsics": {"num_cams_x": across, "num_cams_y": down, "baseline_mm": baseline,
                       "focus_distance_m": focus / 1000, **_pose(field),
                       "offset": baseline * focal / (focus / 1000) / 1000 / SENSOR_MM * max(width, height)},
        "meta": {"scene": field.name, "category": "lfsr", "date": "", "version": "v0", "authors": "", "contact": "",
                 "cycles_seed": field.frame.seed, "disp_min": farthest, "disp_max": nearest,
                 "frustum_disp_min": farthest, "frustum_disp_max": nearest, "depth_map_scale": 1.0}}
    return "\n".join(f"[{title}]\n" + "".join(f"{key} = {_text(value)}\n" for key, value in entries.items())
                     for title, entries in sections.items())


def _pose(field: LightField) -> dict[str, float]:
    """Location in metres and angles (XYZ) of the central camera in the world."""
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
