"""The live view in a real window: right, following, out of the way of the file, and gone without a trace.

    LFSR_WINDOW_BLENDER=DIR python -m pytest -m window tests/blender/ui/test_live_window.py
"""

import dataclasses
import shutil
import time

import numpy as np
import pytest

from lfsr_core.images.color import srgb_encode
from lfsr_core.images.image_files import read_layers, read_png
from lfsr_core.optics.display import load_display, write_profile
from lfsr_core.optics.eye import eye_place, eye_view
from lfsr_core.optics.panel.subpixel_rays import PanelLayout, panel_image
from lfsr_core.optics.rays import CameraArray, to_elemental_images
from tests.support.panels import cells, hexagonal, small
from tests.support.window.desktop import NEEDS_WINDOW, Window, blender_window
from tests.support.window.live_scenes import SAMPLES, SCENE, another_scene

pytestmark = NEEDS_WINDOW
SECONDS_TO_RENDER = 400
SECONDS_BETWEEN_PICTURES = 2
STATE = """
def state():
    scene = bpy.context.scene
    kinds = ("scenes", "objects", "meshes", "cameras", "materials", "node_groups", "worlds", "collections", "images",
             "screens")
    owners = {"scene": scene, "render": scene.render, "cycles": scene.cycles, "view": scene.view_settings,
              "space": bpy.context.space_data.shading, "region": bpy.context.space_data.region_3d}
    plain = {f"{name}.{item.identifier}": str(getattr(owner, item.identifier)) for name, owner in owners.items()
             for item in owner.bl_rna.properties if item.type in {"BOOLEAN", "INT", "FLOAT", "STRING"}
             and not getattr(item, "is_array", False)}
    held = {kind: sorted(item.name for item in getattr(bpy.data, kind)) for kind in kinds}
    windows = [[w.scene.name, w.screen.name, [a.type for a in w.screen.areas]]
               for w in bpy.context.window_manager.windows]
    return plain | held | {"windows": windows, "camera": scene.camera and scene.camera.name,
                           "marked": [item.name for item in live_scene.marked()]}
"""
IMPORTS = ("from bl_ext.user_default.lfsr.live import scene as live_scene, session as live\n" f"SAMPLES = {SAMPLES}\n")
LIVE = "next(s for s in bpy.data.scenes if 'lfsr_live' in s)"


@pytest.fixture(scope="module")
def blender(tmp_path_factory):
    """One Blender for all tests."""
    with blender_window(tmp_path_factory.mktemp("live")) as window:
        window.run(IMPORTS + SCENE + STATE)
        yield window


@pytest.fixture
def window(blender):
    """A fresh file, and no live view after the test."""
    fresh_file(blender)
    yield blender
    blender.run("live.stop()")
    blender.settle()


def fresh_file(window: Window) -> None:
    """The scene of these tests in a file of its own; with the file the 3D view is another one."""
    # A rendered image is shown in a window of its own, which stays.
    window.close_others()
    window.run("bpy.ops.wm.read_homefile(use_factory_startup=True)")
    window.settle()
    window.run(f"make_scene({str(window.folder / 'scene.blend')!r})")
    window.settle()


def start(window: Window, size: tuple[int, int] | None = None, kind: str = "panel") -> None:
    """Start the live view or the eye's, in a window of ``size`` in the screen's upper left corner."""
    assert window.get(f"list(bpy.ops.lfsr.live(kind={kind!r}))") == ["FINISHED"]
    window.settle()
    if size is not None:
        window.place(window.windows()[-1], *size)
        window.until(f"live.live({kind!r}).render.resolution_x == {size[0]}", 10)
    window.settle()


def resting(window: Window, name: str) -> np.ndarray:
    """Picture of the screen when two in a row are the same: all samples are there."""
    before, ends = None, time.monotonic() + SECONDS_TO_RENDER
    while True:
        now = read_png(window.screenshot(name))[..., :3]
        if before is not None and np.array_equal(now, before):
            return now
        assert time.monotonic() < ends
        before = now
        time.sleep(SECONDS_BETWEEN_PICTURES)


def part(picture: np.ndarray, window: Window, display) -> np.ndarray:
    """What the picture shows of the panel; the live window lies in the upper left corner."""
    width, height = display.panel_pixels
    left, bottom = window.get("list(live._on['panel'].view.region.corner)")
    top = window.get("live._on['panel'].view.region.size[1]") - bottom - height
    return picture[top:top + height, left:left + width]


def render_offline(window: Window, name: str, scale: str, method: str) -> np.ndarray:
    """The scene's image of that display and scale by the button; the same settings stay for the live view."""
    window.run("lfsr = bpy.context.scene.lfsr\n"
               f"lfsr.display, lfsr.scale, lfsr.method = {name!r}, {scale!r}, {method!r}")
    window.run("lfsr.live_scale, lfsr.output = lfsr.scale, '//offline'")
    shutil.rmtree(window.folder / "offline", ignore_errors=True)
    window.run("if bpy.context.selected_objects: bpy.ops.lfsr.array_fit('EXEC_DEFAULT', True)")
    assert window.get("list(bpy.ops.lfsr.render_eia('EXEC_DEFAULT', True))") == ["FINISHED"]  # asks nothing
    window.until("addon.jobs.session.current() is None", SECONDS_TO_RENDER)
    [image] = (window.folder / "offline").glob("**/eia.png")
    return read_png(image)


@pytest.mark.parametrize(("scene", "name", "scale", "size"), [
    ("monkey", "mini", "2", (128, 96)), ("monkey", "mini", "4", (304, 208)), ("monkey", "small", "4", (960, 560)),
    ("demo", "mini", "2", (128, 96)), ("cornell", "mini", "2", (128, 96))])
def test_it_is_the_offline_image(window, scene, name, scale, size):
    """The same samples offline, ``bilinear``: at most 2 of 255 apart in the mean, also at the edges of EIs."""
    if scene != "monkey":
        another_scene(window, scene)
    offline = render_offline(window, name, scale, "bilinear").astype(float)
    start(window, size)
    display = load_display(name)
    live = part(resting(window, f"live-{scene}-{name}-{scale}"), window, display).astype(float)
    assert (window.get("live.message()") == "") == (size == display.panel_pixels)
    difference = np.abs(live - offline)
    tiles = to_elemental_images(difference, display.lenses)
    edge = np.concatenate([tiles[:, :, 0], tiles[:, :, -1], tiles[..., 0, :], tiles[..., -1, :]], axis=2)
    print(f"{scene} {name} {scale}: mean {difference.mean((0, 1)).round(2)}, edges {edge.mean((0, 1, 2)).round(2)}")
    assert difference.mean((0, 1)).max() <= 2 and edge.mean((0, 1, 2)).max() <= 2
    for axis in (0, 1):
        for step in (-1, 1):
            assert np.abs(np.roll(live, step, axis) - offline).mean() > difference.mean()


@pytest.mark.parametrize("make", [cells, hexagonal])
def test_a_panel_with_a_lens_sheet_shows_its_subpixels(window, make):
    """The panel's image as direct subpixel rendering makes it."""
    size = (128, 96)
    display = dataclasses.replace(small(make()), panel_pixels=size, panel_mm=(64.0, 48.0))
    write_profile(window.folder / "own.toml", display)
    window.run(f"lfsr = bpy.context.scene.lfsr\nlfsr.profile_file = {str(window.folder / 'own.toml')!r}\n"
               "lfsr.display = 'FILE'\nlfsr.live_samples, lfsr.spacing = 128, 1\n"
               "bpy.context.scene.view_settings.view_transform = 'Standard'")
    start(window, size)
    live = resting(window, f"live-{make.__name__}")[:size[1], :size[0]].astype(float)
    assert window.get("live.message()") == ""
    window.run(TRACED)
    view = window.get("{'half': [view.layout.array.half_width, view.layout.array.half_height], 'distance': "
                      "view.layout.array.distance, 'spacing': view.layout.array.spacing}")
    layout = PanelLayout(display, CameraArray(view["distance"], *view["half"], view["spacing"]))
    traced = read_layers(window.folder / "traced.exr")["color"]
    offline = 255 * srgb_encode(np.clip(panel_image(layout, traced[..., :3]), 0, 1))
    difference = np.abs(live - offline)
    print(f"{make.__name__}: mean {difference.mean((0, 1)).round(2)}")
    assert difference.mean() < 0.5 * min(np.abs(np.roll(live, 1, axis) - offline).mean() for axis in (0, 1))
    assert live.mean((0, 1)) == pytest.approx(offline.mean((0, 1)), abs=1)


TRACED = """
from bl_ext.user_default.lfsr.scene.array import rig
from bl_ext.user_default.lfsr.render import cycles
view, scene = live._on["panel"].view, bpy.context.scene
shot = cycles.Shot(view.layout, rig.placement(scene, view.profile)[1], "subpixels")
folder = __import__("pathlib").Path(bpy.data.filepath).parent
cycles.render_encoded(scene, shot, cycles.RenderSettings(64), folder / "traced.exr")
"""


def test_start_and_stop_leave_everything_as_it_was(window):
    before = window.get("state()")
    start(window)
    during = window.get("state()")
    assert len(during["windows"]) == 2 and during["marked"]
    assert {key for key in before if key.split(".")[0] in {"scene", "render", "cycles", "view", "space", "region"}
            and during[key] != before[key]} <= {"scene.users"}
    window.run("bpy.ops.lfsr.live()")
    window.settle()
    assert window.get("state()") == before


@pytest.mark.parametrize("by", ["button", "hand"])
def test_closed_windows_leave_no_screens(window, by):
    window.run("lfsr = bpy.context.scene.lfsr\nlfsr.display, lfsr.live_samples = 'mini', 1")
    before = window.get("state()")
    for kind in ("panel", "panel", "eye", "panel", "panel"):
        start(window, kind=kind)
        # A screen without a window manager does not make it full; that Blender runs the button is all there is to see.
        assert kind == "eye" or window.get("list(bpy.ops.lfsr.live_full_screen())") == ["FINISHED"]
        if by == "button":
            window.run(f"live.stop({kind!r})")
        else:
            window.close_others()
            window.until("not live.is_on() and not live.is_on('eye')", 30)
        window.settle()
    after = window.get("state()")
    assert {key for key in before if after[key] != before[key]} <= {"scene.users"}
    start(window)
    window.run("bpy.ops.lfsr.live(); bpy.ops.lfsr.live()")
    window.settle()
    assert window.get("len(bpy.data.screens)") == len(before["screens"]) + 2, "only those of the window that is open"


@pytest.mark.parametrize(("display", "wide"), [("small", 640), ("fhd", None)])
def test_the_eye_opens_beside_the_sidebar(window, display, wide):
    """Two thirds of the display where there is room; a rendered image in a window of its own stays there."""
    window.run(f"bpy.context.scene.lfsr.display = {display!r}\n"
               "bpy.context.preferences.view.render_display_type = 'WINDOW'")
    window.open_tab()
    left = window.get("[r.x for r in bpy.context.area.regions if r.type == 'UI'][0]")
    if wide is None:
        window.run("bpy.ops.render.view_show('INVOKE_DEFAULT')")
    start(window, kind="eye")
    window.screenshot(f"live-beside-{display}")
    types = window.get("[w.screen.areas[0].type for w in bpy.context.window_manager.windows][1:]")
    assert types == (["VIEW_3D"] if wide else ["IMAGE_EDITOR", "VIEW_3D"])
    x, width, height = window.get("[(w.x, w.width, w.height) for w in [live.find_window('eye')]][0]")
    panel = load_display(display).panel_pixels
    assert width / height == pytest.approx(panel[0] / panel[1], rel=0.02) and width <= 0.9 * left + 1
    if wide:
        assert width == pytest.approx(wide, abs=1) and x + width <= left


@pytest.mark.parametrize("place", [(0.0, 0.0, 1.0), (0.6, -0.4, 1.0), (-0.3, 0.2, 2.0)])
def test_the_eye_sees_the_light_field(window, place):
    """Through every lens the view that an eye there would see of the offline image of the same samples."""
    display, offline = load_display("mini"), render_offline(window, "mini", "2", "nearest")
    wanted = eye_view(offline, display, eye_place(display, *place), width=256).astype(float)
    start(window, (256, 192), "eye")
    first = window.get("live.live('eye').camera.session_uid")
    window.run("lfsr = bpy.context.scene.lfsr\n" f"lfsr.live_eye_right, lfsr.live_eye_up, lfsr.live_eye_near = {place}")
    if place != (0, 0, 1):
        window.until(f"live.live('eye').camera.session_uid != {first}", 10)
    seen = resting(window, "eye-{}-{}-{}".format(*place))[:192, :256].astype(float)
    difference = np.abs(seen - wanted)
    print(f"eye {place}: mean {difference.mean((0, 1)).round(2)}")
    assert difference.mean((0, 1)).max() <= 2
    for axis in (0, 1):
        assert np.abs(wanted[::-1 if axis == 0 else 1, ::-1 if axis else 1] - seen).mean() > 4 * difference.mean()
        assert np.abs(np.roll(seen, 8, axis) - wanted).mean() > difference.mean()


def test_panel_and_eye_together_and_one_after_the_other(window):
    before = window.get("state()")
    start(window)
    start(window, kind="eye")
    assert window.get("len(bpy.context.window_manager.windows)") == 3
    scenes = "sorted(s['lfsr_live'] for s in bpy.data.scenes if 'lfsr_live' in s)"
    assert window.get(scenes) == ["eye", "panel"]
    window.run("bpy.ops.lfsr.live()")
    window.settle()
    assert window.get(scenes) == ["eye"] and window.get("live.is_on('eye') and not live.is_on()")
    window.run(f"bpy.ops.wm.save_as_mainfile(filepath={str(window.folder / 'eye.blend')!r}, copy=True)")
    window.settle()
    assert window.get(f"{scenes}") == ["eye"]
    window.run("bpy.ops.lfsr.live(kind='eye')")
    window.settle()
    after = window.get("state()")
    # Blender keeps a count of users from the window that showed the scene during the save.
    assert {key for key in before if after[key] != before[key]} <= {"scene.users"}


def test_a_save_in_the_middle_holds_nothing_of_it(window):
    path = str(window.folder / "middle.blend")
    plain = window.run(f"bpy.ops.wm.save_as_mainfile(filepath={path!r}, copy=True)\n" + HELD.format(path=path))
    start(window)
    assert window.run(f"bpy.ops.wm.save_as_mainfile(filepath={path!r}, copy=True)\n" + HELD.format(path=path)) == plain
    window.settle()
    assert window.get("live.is_on()") and window.get(f"live.find_window().scene == {LIVE}")
    # Also where another window shows the live scene, or the live window another editor.
    window.run(f"bpy.context.window.scene = {LIVE}; live.find_window().screen.areas[0].type = 'IMAGE_EDITOR'")
    assert window.run(f"bpy.ops.wm.save_as_mainfile(filepath={path!r}, copy=True)\n" + HELD.format(path=path)) == plain
    window.settle()
    assert window.get("bpy.context.window.scene.name") == "Scene" and window.get("live.is_on()")
    zoom = "live.find_window().screen.areas[0].spaces.active.region_3d.view_camera_zoom"
    exact = window.get(zoom)
    window.run(f"{zoom} += 20")
    window.until(f"{zoom} == {exact}", 10)


HELD = """
with bpy.data.libraries.load({path!r}) as (source, _):
    value = {{kind: sorted(getattr(source, kind)) for kind in dir(source) if kind not in ("screens", "workspaces")}}
"""


def test_undo_in_the_middle_and_after(window):
    window.run("bpy.ops.ed.undo_push(message='before')")
    start(window)
    window.run("bpy.ops.mesh.primitive_cube_add('EXEC_DEFAULT', True)")
    window.settle()
    for step in ("undo", "undo", "redo"):
        window.run(f"bpy.ops.ed.{step}()")
        window.settle()
        window.until("sum('lfsr_live' in s for s in bpy.data.scenes) == 1", 10)
        window.until(f"live.find_window().scene == {LIVE}", 10)
        assert window.get(f"{LIVE}.background_set.name") == "Scene"
    window.run("bpy.ops.lfsr.live()")
    for step in ("undo", "redo"):
        window.run(f"bpy.ops.ed.{step}()")
        window.settle()
        assert window.get("live_scene.marked() == [] and len(bpy.context.window_manager.windows) == 1")


def test_another_file_and_a_disabled_extension_end_it(window):
    start(window)
    window.run("bpy.ops.wm.read_homefile(use_factory_startup=True)")
    window.settle()
    assert window.get("not live.is_on() and live_scene.marked() == [] and len(bpy.context.window_manager.windows) == 1")
    fresh_file(window)
    start(window)
    window.run("bpy.ops.preferences.addon_disable(module='bl_ext.user_default.lfsr')")
    window.settle()
    assert window.get("not live.is_on() and live_scene.marked() == [] and len(bpy.context.window_manager.windows) == 1")
    window.run("bpy.ops.preferences.addon_enable(module='bl_ext.user_default.lfsr')\n" + IMPORTS)


def test_edits_are_followed(window):
    window.run("bpy.context.scene.lfsr.live_samples = 16")
    start(window, (128, 96))
    first = resting(window, "edit-1")[:96, :128].astype(int)
    window.run("bpy.data.materials['Paint'].node_tree.nodes['Principled BSDF'].inputs['Base Color'].default_value "
               "= (0.05, 0.1, 0.8, 1)")
    painted = resting(window, "edit-2")[:96, :128].astype(int)
    assert (painted - first)[..., 2].max() > 60 and (painted - first)[..., 0].min() < -60
    window.run("next(item for item in bpy.data.objects if 'lfsr_spacing' in item).rotation_euler.z += 1")
    assert np.abs(resting(window, "edit-3")[:96, :128].astype(int) - painted).mean() > 5
    window.run("bpy.context.scene.lfsr.live_scale = '4'")
    window.until(f"{LIVE}.render.preview_pixel_size == '4'", 10)


def test_playback_is_followed(window):
    start(window, (128, 96))
    window.run("bpy.context.scene.frame_set(12)")
    assert window.get(f"{LIVE}.frame_current") == 12
    window.run("bpy.ops.screen.animation_play()")
    window.until("bpy.context.scene.frame_current > 15", 30)
    window.run("bpy.ops.screen.animation_cancel(restore_frame=False)")
    window.settle()
    assert window.get(f"{LIVE}.frame_current == bpy.context.scene.frame_current")
