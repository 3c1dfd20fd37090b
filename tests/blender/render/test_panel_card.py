"""Every subpixel's ray, decoded from a scene that shows its own world position, against panel_rays.py."""

import dataclasses

import bpy
import mathutils
import numpy as np
import pytest

from blender_addon.render import cycles, output
from blender_addon.render.cards import card_camera
from blender_addon.scene.array import rig
from blender_addon.scene.overrides import overridden
from lfsr_core.frames.frame import SUBPIXELS
from lfsr_core.images import exr
from lfsr_core.optics.panel.subpixel_rays import PanelLayout, panel_rays
from lfsr_core.optics.rays import CameraArray
from tests.blender.render.test_ray_layout import ARRAY_TO_WORLD, CENTRE, plane_in_array, where_they_meet
from tests.support.panels import SHEETS, large, lenticular
from tests.support.scenes import POSITION_OFFSET, add_plane, position_emission

MIRRORED = lenticular(subpixels={"stripes": "bgr"})
MIRRORED = dataclasses.replace(
    MIRRORED, lenticular=dataclasses.replace(MIRRORED.lenticular, flip=(True, True), reversed=True))
DISPLAYS = {**{name: make() for name, make in SHEETS.items()}, "mirrored": MIRRORED,
            "white": lenticular(subpixels={"stripes": "white"})}


def small(display):
    """Fewer of its pixels, of the same pitch."""
    return dataclasses.replace(display, panel_pixels=(48, 32), panel_mm=(24.0, 16.0), viewing_distance_mm=60.0)


def shown_hits(scene, layout, folder, matrix_world, **settings):
    shot = cycles.Shot(layout, matrix_world, SUBPIXELS)
    cycles.render_encoded(scene, shot, cycles.RenderSettings(**{"samples": 1} | settings), folder / "panel.exr")
    color = exr.read_layers(folder / "panel.exr")["color"]
    assert (color[..., 3] == 1).all(), "a ray missed the plane, which fills the view"
    return color[..., :3] - POSITION_OFFSET


@pytest.mark.parametrize("name", DISPLAYS)
def test_every_subpixel_hits_where_panel_rays_says(scene, tmp_path, name):
    display = small(DISPLAYS[name])
    array = CameraArray.for_display(display, 2.0)
    layout, plane = PanelLayout(display, array, aperture=0.0), plane_in_array(0.7 * array.distance, 0.2)
    add_plane(scene, plane, position_emission())
    (width, height), (right, down) = layout.size, CENTRE
    across, up = np.meshgrid((np.arange(width) + right) / width, 1 - (np.arange(height) + down) / height)
    expected = where_they_meet(plane, *panel_rays(layout, across, up))
    error = np.linalg.norm(shown_hits(scene, layout, tmp_path, ARRAY_TO_WORLD.tolist()) - expected, axis=-1)
    assert error.max() <= 2e-5 * array.distance, f"{error.max() / array.distance:.1e} of the distance"


@pytest.mark.parametrize("name", ["cells", "hexagonal"])
def test_samples_fill_the_subpixel_and_the_lens(scene, tmp_path, name):
    """Beyond the plane of the lenses, where both count: as far around the middle as in panel_rays.py."""
    display = small(DISPLAYS[name])
    array = CameraArray.for_display(display, 2.0)
    layout, looking_down = PanelLayout(display, array), rig.from_blender(mathutils.Matrix())
    means, depth = [], 2 * array.distance
    for square in (False, True):
        for item in list(scene.collection.objects):
            bpy.data.objects.remove(item)
        add_plane(scene, mathutils.Matrix.Translation((0, 0, -depth)), position_emission(square))
        means.append(shown_hits(scene, layout, tmp_path, looking_down, samples=64)[..., :2])
    found = means[1] + POSITION_OFFSET - means[0] ** 2
    # Of most subpixels: some lie behind two lenses.
    assert np.median(found, (0, 1)) == pytest.approx(np.median(spread(layout, depth), (0, 1)), rel=0.05)


def spread(layout, depth):
    """Variance (H, W, 2) of where the rays of pixels pass a plane, in panel_rays.py."""
    (width, height), random = layout.size, np.random.default_rng(0)
    draws = random.random((4, 64, height, width))
    origin, direction = panel_rays(layout, (np.arange(width) + draws[0]) / width,
                                   1 - (np.arange(height)[:, None] + draws[1]) / height, draws[2], draws[3])
    return (origin + direction / direction[..., 2:] * depth)[..., :2].var(0)


@pytest.mark.parametrize("shown", [(0, 0), (1, 1)])
def test_at_the_corner_of_an_8k_panel_the_phase_is_right_to_a_thousandth_of_a_cylinder(scene, tmp_path, shown):
    """In single precision, 1,400 cylinders, the array turned and moved; the camera plane shows the phase."""
    display = large(cells=False)
    layout = PanelLayout(display, CameraArray.for_display(display, 2.0), aperture=0.0)
    plane, size = plane_in_array(0.05 * layout.array.distance, 0.0), np.array((96, 24))
    add_plane(scene, plane, position_emission())
    first = (np.array(layout.size) - size) * shown
    ends = [(first + extra) / layout.size for extra in (0.01, size + 0.01)]
    path = tmp_path / "corner.exr"
    with (card_camera(scene, layout, ARRAY_TO_WORLD.tolist()),
          cycles.cycles_settings(scene, cycles.RenderSettings(1), layout.size),
          overridden(scene.render, {"use_border": True, "use_crop_to_border": True, "border_min_x": ends[0][0],
                                    "border_min_y": ends[0][1], "border_max_x": min(1, ends[1][0]),
                                    "border_max_y": min(1, ends[1][1])})):
        output.render_to(scene, path)
    hits = exr.read_layers(path)["color"][..., :3] - POSITION_OFFSET
    rows, columns = np.indices(hits.shape[:2])
    error = hits - where_they_meet(plane, *panel_rays(layout, (first[0] + columns + CENTRE[0]) / layout.size[0],
                                                      (first[1] + len(hits) - rows - CENTRE[1]) / layout.size[1]))
    phase = error @ ARRAY_TO_WORLD[:3, 0] / (display.views[0] * layout.array.spacing)
    assert hits.shape[:2] == (24, 96) and np.abs(phase).max() < 1e-3, "of one cylinder"
