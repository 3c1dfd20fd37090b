"""The one-pass render against ordinary cameras, one per view: two ways to the same image."""

import numpy as np
import pytest

from blender_addon.render import cycles, output
from blender_addon.render import view_by_view as views
from lfsr_core.images import exr
from lfsr_core.optics import eia
from lfsr_core.optics.rays import RayLayout
from tests.support.scenes import (
    ARRAY,
    FLAT,
    MINI,
    add_box,
    add_lamp,
    emission,
    encoded,
    fresh_scene,
    front,
    position_emission,
)

SEEDS, SAMPLES, SCALE = 10, 4, 4
# A two-sided t of 18 degrees of freedom is above this for one pixel in a thousand.
T_ONE_IN_1000 = 3.92


def lit_scene():
    """Boxes before, on and behind the display plane, with light, shadow and gloss."""
    scene = fresh_scene()
    add_box(scene, (0, 1.2, 0), (2.5, 0.1, 2.5))
    add_box(scene, (-0.4, 0, 0.1), (0.2, 0.3, 0.4))
    add_box(scene, (0.4, -0.7, -0.2), (0.2, 0.2, 0.2), emission((0.2, 0.6, 0.1)))
    add_lamp(scene, 120, 1.0, (0.5, -3, 2), (0.9, 0, 0))
    return scene


def t_values(first, second):
    """Welch's t of every pixel and channel that varies; those that never vary must be equal."""
    difference = first.mean(0) - second.mean(0)
    error = np.sqrt((first.var(0, ddof=1) + second.var(0, ddof=1)) / len(first))
    still = error < 1e-7
    return np.where(still, np.where(np.abs(difference) < 1e-5, 0.0, np.inf), difference / np.where(still, 1, error))


def same_image(first, second):
    """Share of pixels beyond the one-in-1000 t is at most five in 1000, and the mean is not shifted."""
    t = t_values(first, second)[..., :3]
    finite = t[np.isfinite(t) & (t != 0)]
    return np.mean(np.abs(t) > T_ONE_IN_1000) < 0.005 and abs(finite.mean()) < 0.2 and finite.std() < 1.25


@pytest.mark.parametrize(("display", "scale"), [(MINI, SCALE), (FLAT, 2)])
def test_views_are_the_one_pass_image(tmp_path, display, scale):
    """SEEDS renders each way of the same layout; one view that is shifted by one is noticed."""
    layout, scene = RayLayout.for_display(display, ARRAY, scale), lit_scene()
    found = []
    for render in (cycles.render_encoded, views.render_views):
        images = []
        for seed in range(SEEDS):
            render(scene, cycles.Shot(layout, front()), cycles.RenderSettings(SAMPLES, seed), tmp_path / "image.exr")
            images.append(exr.read_layers(tmp_path / "image.exr")["color"])
        found.append(np.stack(images))
    assert found[0].std(0).max() > 0.05, "without noise the test would prove little"
    assert same_image(*found)
    shifted = [eia.to_views(image, layout.lenses).copy() for image in found[1]]
    for image in shifted:
        image[0, 0] = image[0, 1]
    assert not same_image(found[0], np.stack([eia.from_views(image) for image in shifted]))


@pytest.mark.parametrize("lens_list", [None, ((0, 0), (3, 15), (11, 2), (5, 9), (6, 6))])
@pytest.mark.parametrize("convention", ["centred", "paper"])
def test_positions_agree_pixel_by_pixel(scene, tmp_path, convention, lens_list):
    """Two planes at an angle, one pixel-centre sample: no statistics needed."""
    add_box(scene, (0, 30.5, 0), (60, 30, 60), position_emission())
    layout = RayLayout.for_display(MINI, ARRAY, SCALE, convention=convention, view_aperture=0.0, lens_list=lens_list)
    expected = encoded(scene, layout, tmp_path)["color"]
    views.render_views(scene, cycles.Shot(layout, front()), cycles.RenderSettings(1), tmp_path / "views.exr")
    shown = exr.read_layers(tmp_path / "views.exr")["color"]
    assert shown.shape == expected.shape
    # The two cameras put the pixel centre half a step of the filter table off, of their own pixel: paper's are smaller.
    tolerance = (1e-4 if convention == "centred" else 5e-4) * ARRAY.distance
    assert np.abs(shown - expected).max() <= tolerance


@pytest.mark.parametrize(("display", "scale"), [(MINI, SCALE), (FLAT, 2)])
def test_other_layers_come_view_by_view_too(scene, tmp_path, display, scale):
    """Also where pixels are not square."""
    add_box(scene, (0.2, 0, 0), (0.3, 0.3, 0.3), position_emission())
    layout = RayLayout.for_display(display, ARRAY, scale, view_aperture=0.0)
    settings = cycles.RenderSettings(1, layers=("albedo", "normal", "position", "index"), world_visible=True)
    views.render_views(scene, cycles.Shot(layout, front()), settings, tmp_path / "views.exr")
    cycles.render_encoded(scene, cycles.Shot(layout, front()), settings, tmp_path / "encoded.exr")
    shown, expected = (exr.read_layers(tmp_path / f"{name}.exr") for name in ("views", "encoded"))
    assert set(shown) == set(expected) == {"color", "albedo", "normal", "position", "index", "environment"}
    for name in ("position", "normal", "index"):
        assert np.mean(np.abs(shown[name] - expected[name]).max(-1) > 1e-3) < 0.02, name


PERSPECTIVE = """
shader perspective(float tangent = 1.0, float aspect = 1.0, output point position = 0.0,
                   output vector direction = 0.0, output color throughput = 1.0)
{
  point raster = camera_shader_raster_position();
  direction = normalize(vector((raster[0] * 2 - 1) * tangent, (raster[1] * 2 - 1) * tangent * aspect, 1.0));
}
"""


def test_osl_perspective_is_blenders_own(tmp_path):
    """The same rays and random numbers: equal up to rounding, but for a few pixels that flip at an edge.

    Bounds: mean difference 1e-4 of the mean value, at most 1 % of the pixels off by over 1 %.
    """
    scene, width, height = lit_scene(), 96, 72
    images = []
    for custom in (False, True):
        with cycles.temporary_camera(scene, front(), ARRAY.distance) as camera:
            camera.data.lens, camera.data.sensor_width = 30.0, 36.0
            if custom:
                cycles.set_shader(camera.data, PERSPECTIVE, {"tangent": 36 / 2 / 30, "aspect": height / width})
            with cycles.cycles_settings(scene, cycles.RenderSettings(8), (width, height)):
                output.render_to(scene, tmp_path / "image.exr")
        images.append(exr.read_layers(tmp_path / "image.exr")["color"])
    difference = np.abs(images[0] - images[1])
    assert images[0].mean() > 0.1
    assert difference.mean() <= 1e-4 * images[0].mean()
    assert np.mean(difference.max(-1) > 0.01 * images[0].mean()) <= 0.01
