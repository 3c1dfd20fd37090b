"""The OSL shader for the rays of a panel's subpixels: its source and its parameters."""

from __future__ import annotations

import math
from pathlib import Path

from lfsr_core.optics.display import DisplayProfile
from lfsr_core.optics.panel.panel_rays import PanelLayout, subpixel_table
from lfsr_core.optics.panel.subpixel_rays import Geometry, elemental_lattice, elemental_waves
from lfsr_core.optics.sheet import Lenticular

from .osl_camera import with_constants

SOURCE = Path(__file__).with_name("panel_layout.osl")
Numbers = dict[str, int | float]


def panel_source(layout: PanelLayout) -> str:
    """Return the OSL source with the subpixels of ``layout`` as constants."""
    table = subpixel_table(layout)
    right, up = ([f"{value:.9f}" for value in offsets.ravel()] for offsets in (table.right, table.up))
    return with_constants(SOURCE, "OFFSETS", {"RIGHT": right, "UP": up})


def panel_parameters(layout: PanelLayout, clip_start: float = 0.0) -> Numbers:
    """Return the values of the shader's parameters for this kind of sheet; the others keep their defaults."""
    display, array, geometry = layout.display, layout.array, Geometry.of(layout.display)
    waves, phases = elemental_waves(display)
    (across, down), (part_x, part_y) = display.panel_pixels, display.pixel_layout.size
    of_sheet = _cylinders(display, display.lenticular, geometry) if display.lenticular else _lenses(display, geometry)
    return {
        "across": across, "down": down, "parts": display.pixel_layout.count, "pixel_x": geometry.pixel[0],
        "pixel_y": geometry.pixel[1], "part_x": part_x, "part_y": part_y,
        **{f"wave_{name}": float(value) for name, value in zip(("xx", "xy", "yx", "yy"), waves.ravel(), strict=True)},
        "phase_x": float(phases[0]), "phase_y": float(phases[1]),
        "unit_x": 2 * array.half_width / geometry.lens_plane[0],
        "unit_y": 2 * array.half_height / geometry.lens_plane[1], "camera_unit": array.spacing / geometry.spacing,
        "aperture": float(layout.aperture),
        "plane_distance": float(array.distance), "clip_start": float(clip_start)} | of_sheet


def _cylinders(display: DisplayProfile, sheet: Lenticular, geometry: Geometry) -> Numbers:
    nearer = geometry.distance / (geometry.distance + geometry.gap)
    return {"cylinders": 1, "flip_x": int(sheet.flip[0]), "flip_y": int(sheet.flip[1]), "slant": float(sheet.slant),
            "pitch_in_row": sheet.pitch_mm * math.hypot(1, sheet.slant), "pitch": sheet.pitch_mm * nearer,
            "zone": display.views[0] * geometry.spacing, "turned_views": int(sheet.reversed), "nearer": nearer}


def _lenses(display: DisplayProfile, geometry: Geometry) -> Numbers:
    sheet = display.lenslet
    assert sheet is not None
    images, lenses = (lattice.matrix(sheet.packing) for lattice in (elemental_lattice(sheet, geometry), sheet.lenses))
    metrics = {name: matrix.T @ matrix for name, matrix in (("image", images), ("lens_metric", lenses))}
    steps = {f"{name}_{pair}": float(metric["xy".index(pair[0]), "xy".index(pair[1])])
             for name, metric in metrics.items() for pair in ("xx", "xy", "yy")}
    plane = {f"lens_{name}": float(value) for name, value in zip(("xx", "xy", "yx", "yy"), lenses.ravel(), strict=True)}
    return {**steps, **plane, "shift_x": float(sheet.lenses.shift_mm[0]), "shift_y": float(sheet.lenses.shift_mm[1]),
            "throw_ratio": geometry.distance / geometry.gap}
