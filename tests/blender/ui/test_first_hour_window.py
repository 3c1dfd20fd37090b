"""An artist's first hour in a real window (see test_window.py): the array, the first render, the labels."""

import time

import numpy as np
import pytest

from tests.support.window.desktop import NEEDS_WINDOW, SECONDS_TO_RENDER, STATE, TASK, blender_window

pytestmark = NEEDS_WINDOW
CORNERS = """
from mathutils import Vector
array_view, area = addon.ui.array_view, bpy.context.area
region = next(region for region in area.regions if region.type == "WINDOW")
corners = array_view.frame_corners(bpy.context.scene, region, area.spaces.active.region_3d)
value = {"corners": [list(corner) for corner in corners],
         "free": array_view.free_part(area), "is_looking": array_view.is_looking(area.spaces.active, bpy.context.scene)}
"""
OWN_VIEW = """
space = bpy.context.space_data
value = [space.use_local_camera, space.camera and space.camera.name, space.overlay.show_camera_guides,
         space.region_3d.view_perspective, list(space.region_3d.view_location), space.region_3d.view_distance,
         list(space.region_3d.view_rotation), space.region_3d.view_camera_zoom]
"""
VIEW = """
import numpy as np
image = bpy.data.images["Light Field View"]
pixels = np.empty(len(image.pixels), np.float32)
image.pixels.foreach_get(pixels)
value = {"size": list(image.size), "brightest": float(pixels.reshape(-1, 4)[:, :3].max()),
         "icon": addon.jobs.images.icon(bpy.context.scene), "windows": len(bpy.context.window_manager.windows)}
"""
LOOK = "bpy.ops.lfsr.look_through('INVOKE_DEFAULT', True)"


@pytest.fixture(scope="module")
def window(tmp_path_factory):
    """One Blender with its new file, and the tab open."""
    with blender_window(tmp_path_factory.mktemp("first")) as window:
        window.open_tab()
        yield window


@pytest.fixture
def array(window):
    """The scene has an array at its camera."""
    window.run("addon.scene.array.rig.find(bpy.context.scene) or bpy.ops.lfsr.array_add('INVOKE_DEFAULT', True)")
    window.run("bpy.context.scene.lfsr.display = 'bupt-32in-8k'")


@pytest.mark.parametrize("display", ["bupt-32in-8k", "looking-glass-go"])
def test_the_view_through_the_array_has_the_displays_frame(window, array, display):
    window.run(f"bpy.context.scene.lfsr.display = {display!r}")
    before = window.run(OWN_VIEW)
    window.run(LOOK)
    seen = window.run(CORNERS)
    window.screenshot(f"array-view-{display}")
    (left, bottom), (right, top) = seen["corners"][0], seen["corners"][2]
    assert seen["is_looking"]
    free = seen["free"]
    assert free[0] <= left < right <= free[2] and free[1] <= bottom < top <= free[3], "nothing covers the frame"
    aspect = window.get("addon.scene.settings.display_of(bpy.context.scene).panel_mm")
    assert (right - left) / (top - bottom) == pytest.approx(aspect[0] / aspect[1], rel=0.01)
    assert max((right - left) / (free[2] - free[0]), (top - bottom) / (free[3] - free[1])) > 0.85, "it fills the view"
    window.run(LOOK)
    after = window.run(OWN_VIEW)
    assert after[:4] == before[:4]
    assert np.allclose(*[[*own[4], own[5], *own[6], own[7]] for own in (before, after)], atol=1e-4)


def test_a_view_that_turns_away_has_its_own_camera_again(window, array):
    before = window.run(OWN_VIEW)[:3]
    window.run(LOOK)
    window.run("bpy.context.space_data.region_3d.view_perspective = 'PERSP'")
    window.until("bpy.context.space_data.use_local_camera is False", 10)
    assert window.run(OWN_VIEW)[:3] == before
    # The scene's camera stays as it is made meanwhile.
    window.run(LOOK)
    window.run("first, bpy.context.scene.camera = bpy.context.scene.camera, None")
    window.run(LOOK)
    assert window.get("bpy.context.scene.camera is None and not bpy.context.space_data.use_local_camera")
    window.run("bpy.context.scene.camera = first")


def test_fit_to_the_view_frames_what_is_seen(window, array):
    window.run("bpy.ops.view3d.view_axis(type='FRONT'); bpy.ops.view3d.view_persportho()")
    window.settle()
    shown = "addon.ui.array_view.view_of(bpy.context.area, addon.scene.settings.display_of(bpy.context.scene))"
    view = window.run(f"v = {shown}; value = [[list(row) for row in v.matrix], v.half_width, v.is_perspective]")
    window.run("bpy.ops.lfsr.array_fit('INVOKE_DEFAULT', True, to='VIEW')")
    array_at = window.get("[list(row) for row in bpy.data.objects['Light Field Array'].matrix_world]")
    lens = window.get("bpy.data.cameras['Light Field Array'].sensor_width / 2 / "
                      "bpy.data.cameras['Light Field Array'].lens")
    assert view[2] and np.allclose(array_at, view[0], atol=1e-4) and lens == pytest.approx(view[1], rel=1e-3)
    window.run(LOOK)
    window.screenshot("fit-to-view")
    window.run(LOOK)


PRESS = "list(bpy.ops.lfsr.render_eia('INVOKE_DEFAULT', True))"


def test_one_press_in_a_new_file_makes_an_image_in_the_panel(window):
    window.run("bpy.ops.wm.read_homefile(app_template='')")
    window.run("bpy.context.scene.lfsr.method = 'bilinear'")   # this Blender has no Open Image Denoise
    window.open_tab()
    window.screenshot("panel-at-first")
    started = time.monotonic()
    assert window.get(PRESS) == ["FINISHED"]
    window.until(f"{TASK} is None", SECONDS_TO_RENDER)
    print(f"image after {time.monotonic() - started:.1f} s")
    shown = window.run(VIEW)
    window.screenshot("panel-with-view")
    assert shown["size"] == [480, 270] and shown["brightest"] > 0.2 and shown["icon"] and shown["windows"] == 1
    assert ", about " in window.get("addon.ui.drawing.image_text(bpy.context.scene)"), "the machine was measured"
    kept = window.folder / "kept" / "first.blend"
    kept.parent.mkdir()
    window.run(f"bpy.ops.wm.save_as_mainfile(filepath={str(kept)!r})")
    assert (kept.parent / "lightfield" / "first" / "Scene" / "0001" / "eia.png").is_file(), "it moved beside the file"


def test_what_was_imported_is_mended_with_a_second_press(window):
    window.run("bpy.ops.wm.read_homefile(app_template='')")
    window.run("bpy.ops.mesh.primitive_monkey_add(size=0.02, location=(30, 20, 0))")   # selected, as imports are
    window.run("bpy.context.scene.lfsr.method, bpy.context.scene.lfsr.display = 'bilinear', 'mini'")
    assert window.get(PRESS) == ["RUNNING_MODAL"]
    window.screenshot("look-asks")
    window.xdotool("key", "Return")
    window.until(f"{TASK} is not None", SECONDS_TO_RENDER)
    window.until(f"{TASK} is None", SECONDS_TO_RENDER)
    window.screenshot("look-mended")
    assert window.run(VIEW)["brightest"] > 0.2 and window.get("bpy.data.objects['Cube'].hide_render")
    place = window.get("list(bpy.data.objects['Light Field Array'].matrix_world.translation)")
    assert np.linalg.norm(np.subtract(place, (30, 20, 0))) < 0.2, "the array stands before it"


def test_an_image_begins_with_a_first_view(window):
    window.run("bpy.ops.wm.read_homefile(app_template='')")
    window.run("bpy.context.scene.lfsr.method, bpy.context.scene.lfsr.display = 'bilinear', 'bupt-32in-8k'")
    window.run("bpy.context.scene.lfsr.rays = 64; addon.jobs.images.forget()\n"
               "addon.jobs.runtime.preferences_of_addon().seconds_per_path = 0")  # of an image that takes long is asked
    assert window.get(PRESS) == ["FINISHED"]
    window.until(f"{TASK} is None or addon.jobs.images.icon(bpy.context.scene)", SECONDS_TO_RENDER)
    assert "first view" in window.get(f"{STATE}.message") and window.get(TASK + " is not None")
    window.screenshot("first-view")
    assert window.run(VIEW)["brightest"] > 0.2
    window.run("bpy.ops.lfsr.cancel()")


def test_cheapest_settings_are_found_and_what_is_said_can_be_read(window):
    """Every text of the panels that are closed at first; the pictures are for a person to read."""
    window.close_others()
    window.run("bpy.ops.wm.read_homefile(app_template=''); bpy.context.scene.lfsr.display = 'first-look'")
    window.open_tab()
    window.run(OPEN)
    window.run("bpy.ops.lfsr.plan('INVOKE_DEFAULT', True)")
    began, said = time.monotonic(), set()
    while window.get(f"{TASK} is not None"):
        said.add(window.get(f"{STATE}.plan_text"))
    print(f"cheapest settings after {time.monotonic() - began:.1f} s")
    answer = window.get(f"{STATE}.plan_text")
    assert "reaches SSIM 0.95" in answer and said <= {"", answer}, "only what was measured is said"
    window.screenshot("cheapest-found")
    window.run("bpy.ops.screen.userpref_show('INVOKE_DEFAULT', section='ADDONS')")
    window.run("bpy.context.window_manager.addon_search = 'Light Field'\n"
               "bpy.ops.preferences.addon_expand(module=addon.__name__)")
    window.screenshot("preferences")
    window.close_others()


# A panel keeps whether it is open, so others with the same contents are added.
OPEN = """
for name in ("LFSR_PT_plan", "LFSR_PT_reference"):
    panel = getattr(bpy.types, name)
    bpy.utils.register_class(type(f"{name}_open", panel.__bases__, {
        "bl_idname": f"{name}_open", "bl_label": panel.bl_label, "bl_order": -1, "bl_options": set(),
        "draw": panel.draw}))
"""
