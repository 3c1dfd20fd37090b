"""Where the camera array stands: fitted to a subject, or at the scene's own camera."""

import itertools

import bpy
import mathutils
import numpy as np
import pytest
from bpy_extras.object_utils import world_to_camera_view

from blender_addon.jobs import folders, session
from blender_addon.render import frame_folder
from blender_addon.scene import contents
from blender_addon.scene import settings as scene_settings
from blender_addon.scene.array import edit, placement, rig
from blender_addon.scene.files import camera_notices
from blender_addon.ui.operators import render
from lfsr_core.base.messages import LfsrError, Notice, silent
from lfsr_core.frames.frame import read_frame
from lfsr_core.optics.display import builtin_names, load_display
from lfsr_core.optics.rays import CameraArray
from tests.support.requests import make_request
from tests.support.scenes import add_box, add_camera, add_lamp
from tests.support.told import refuses

SMALL = load_display("small")
# Not centred, not a cube, deepest in no axis.
CENTRE, HALF = np.array((1.0, 2.0, 3.0)), np.array((0.5, 0.3, 0.4))


@pytest.mark.parametrize("size", [1e-3, 1.0, 1e3])
@pytest.mark.parametrize("display", builtin_names())
def test_subject_fills_the_display_and_straddles_its_plane(display, size):
    profile, low, high = load_display(display), (CENTRE - HALF) * size, (CENTRE + HALF) * size
    array, matrix_world = placement.fit_array(low, high, profile)
    corners = np.array([*itertools.product(*zip(low, high, strict=True), [1.0])])  # (8, 4), in the world
    points = (np.array(mathutils.Matrix(matrix_world).inverted()) @ corners.T)[:3].T  # in the array's space
    assert (points[:, 2].min() + points[:, 2].max()) / 2 == pytest.approx(array.distance, rel=1e-4)
    on_plane = np.abs(points[:, :2] / points[:, 2:] * array.distance).max(0) / (array.half_width, array.half_height)
    assert on_plane.max() <= placement.FILL + 1e-3, "nothing is cut off in the central view"
    assert on_plane.max() >= placement.LEAST_FILL - 1e-3
    assert array == CameraArray.for_display(profile, 2 * array.half_width), "true proportions"
    if profile.depth_range_mm()[0] > 0.3 * profile.panel_mm[0]:  # deep enough for the box
        assert on_plane.max() == pytest.approx(placement.FILL, abs=1e-3)


def test_a_deep_subject_is_made_smaller_but_not_tiny_and_array_space_is_taken_to_the_world():
    profile = load_display("dense-8k")
    deep, _ = placement.fit_array(np.array((-0.2, -2, -0.1)), np.array((0.2, 2, 0.1)), profile)
    flat, _ = placement.fit_array(np.array((-0.2, -0.01, -0.1)), np.array((0.2, 0.01, 0.1)), profile)
    assert deep.half_width > 1.2 * flat.half_width
    medium, _ = placement.fit_array(np.array((-0.2, -0.12, -0.1)), np.array((0.2, 0.12, 0.1)), profile)
    assert min(profile.depth_range_mm()) / profile.panel_mm[0] * 2 * medium.half_width >= 0.12 * 0.999
    _, matrix_world = placement.fit_array(CENTRE - HALF, CENTRE + HALF, SMALL)
    matrix = np.array(matrix_world)
    assert matrix[:3, :3] @ (1, 0, 0) == pytest.approx((1, 0, 0), abs=1e-6)
    assert matrix[:3, :3] @ (0, 1, 0) == pytest.approx((0, 0, 1), abs=1e-6), "up is Z"
    assert matrix[:3, :3] @ (0, 0, 1) == pytest.approx((0, 1, 0), abs=1e-6), "forward is +Y: Blender's front view"


def test_own_camera_keeps_place_direction_and_angle_and_the_display_where_it_focuses(scene):
    box, camera = add_box(scene, tuple(CENTRE), tuple(HALF)), add_camera(scene)
    scene.render.resolution_x, scene.render.resolution_y = 1600, 900
    array, matrix_world = placement.place_array(scene, SMALL, {box})
    assert matrix_world == rig.from_blender(camera.matrix_world)
    assert np.arctan(array.half_width / array.distance) * 2 == pytest.approx(0.6, rel=1e-5)
    assert array.distance == pytest.approx(7 - HALF[1], abs=0.05), "only the box's front is seen"
    assert array.spacing == pytest.approx(SMALL.camera_spacing_mm * array.distance / SMALL.viewing_distance_mm)
    camera.data.dof.use_dof, camera.data.dof.focus_distance = True, 4.5
    assert placement.place_array(scene, SMALL, {box})[0].distance == pytest.approx(4.5)
    camera.data.dof.focus_object, box.matrix_world = box, mathutils.Matrix.Translation((0, -1, 0))
    bpy.context.view_layer.update()
    assert placement.place_array(scene, SMALL, {box})[0].distance == pytest.approx(4.0)


@pytest.mark.parametrize(("kind", "size", "high", "part"), [  # of the frame's height that rays on the box fill
    *((kind, (900, 1600), 5, 1) for kind in ("PERSP", "ORTHO")), ("PERSP", (1600, 1200), 5, 1),
    ("ORTHO", (900, 1600), 2.4, 1 - 4 / 17 + 2 / 18)])
def test_all_that_a_camera_sees_is_on_the_display(scene, kind, size, high, part):
    box, camera = add_box(scene, tuple(CENTRE), (0.5, HALF[1], high)), add_camera(scene)
    camera.data.type, (scene.render.resolution_x, scene.render.resolution_y) = kind, size
    array, matrix = placement.place_array(scene, SMALL, {box})
    corner = camera.data.view_frame(scene=scene)[0]
    assert array.half_height == pytest.approx(part * corner.y * (array.distance / -corner.z if kind == "PERSP" else 1))
    turned = np.array(matrix)[:3]
    assert turned[:, :3] == pytest.approx(np.array(rig.from_blender(camera.matrix_world))[:3, :3], abs=1e-6)
    assert turned @ (0, 0, array.distance, 1) == pytest.approx(CENTRE - (0, HALF[1], 0), abs=0.05)
    box.hide_viewport, wall = True, add_box(scene, (1, 9, 3), (20, 0.1, 20))
    add_box(scene, tuple(CENTRE), tuple(HALF))
    cut = placement.place_array(scene, SMALL, {wall})[0]
    assert cut.half_width == pytest.approx(corner.x * (cut.distance / -corner.z if kind == "PERSP" else 1)), "backdrop"


@pytest.mark.parametrize("kind", ["PERSP", "ORTHO"])
def test_the_middle_of_a_shifted_picture_is_the_middle_of_the_display(scene, kind):
    box, camera = add_box(scene, tuple(CENTRE), tuple(HALF)), add_camera(scene)
    camera.data.type, camera.data.ortho_scale, camera.data.shift_x, camera.data.shift_y = kind, 4, 0.1, -0.25
    array, matrix = placement.place_array(scene, SMALL, {box})
    seen = world_to_camera_view(scene, camera, mathutils.Vector(np.array(matrix)[:3] @ (0, 0, array.distance, 1)))
    assert tuple(seen)[:2] == pytest.approx((0.5, 0.5), abs=1e-5)


def test_near_and_far_have_equal_parallax_from_the_own_camera(scene):
    near, far = add_box(scene, (0.4, -2, 3), (0.5, 0.01, 3)), add_box(scene, (1, 5, 3), (9, 0.01, 9))
    add_camera(scene)
    distance = placement.place_array(scene, SMALL, {near, far})[0].distance
    assert 1 / 2.99 - 1 / distance == pytest.approx(1 / distance - 1 / 9.99, rel=0.02)


def test_an_array_beside_a_wall_has_narrower_views_and_its_display_plane_stays(scene):
    box, wall = add_box(scene, tuple(CENTRE), tuple(HALF)), add_box(scene, (2.0, -5, 3), (0.1, 4, 9))
    camera = add_camera(scene)
    camera.data.dof.use_dof, camera.data.dof.focus_distance = True, 6.7
    bpy.context.view_layer.update()
    array, _ = placement.place_array(scene, SMALL, {box, wall})
    reach = SMALL.views[0] * array.spacing / 2
    assert reach <= 0.9 and reach == pytest.approx(0.9 * placement.WALL_MARGIN, rel=0.05)
    assert np.arctan(array.half_width / array.distance) * 2 == pytest.approx(0.6, rel=1e-5)
    part = array.spacing / CameraArray.for_display(SMALL, 2 * array.half_width, array.distance).spacing
    assert array.distance == pytest.approx(6.7) and 0.1 < part < 0.5
    said, notice = list[Notice](), Notice("walls-near", {"part": pytest.approx(part)})
    assert frame_of(scene, said.append).array.spacing == array.spacing and notice in said
    own, _ = edit.add(scene, SMALL), said.clear()
    assert frame_of(scene, said.append) and rig.spacing_of(own) == pytest.approx(part) and notice not in said
    wall.location.x = 99
    assert rig.spacing_of(edit.fit_to_camera(scene, SMALL)) == pytest.approx(1)


def test_camera_that_cannot_become_an_array_is_refused(scene):
    box, camera = add_box(scene, tuple(CENTRE), tuple(HALF)), add_camera(scene)
    camera.data.type = "PANO"
    refuses("type PANO, but a camera array needs a perspective or", placement.place_array, scene, SMALL, {box})
    camera.data.type, camera.rotation_euler = "PERSP", (-np.pi / 2, 0, 0)
    bpy.context.view_layer.update()
    refuses("does not see the subject", placement.place_array, scene, SMALL, {box})


def test_bounds_see_modifiers_and_instances(scene):
    array = add_box(scene, (0, 0, 0), (0.5, 0.5, 0.5)).modifiers.new("array", "ARRAY")
    array.count, array.relative_offset_displace = 3, (1, 0, 0)
    inside = bpy.data.collections.new("inside")
    inside.objects.link(add_box(scene, (0, 0, 0), (0.1, 0.1, 0.1)))
    scene.collection.objects.unlink(inside.objects[0])
    empty = bpy.data.objects.new("instance", None)
    empty.instance_type, empty.instance_collection, empty.location = "COLLECTION", inside, (0, 0, 4)
    scene.collection.objects.link(empty)
    bpy.ops.mesh.primitive_circle_add(location=(9, 0, 0))  # edges alone, which are not rendered
    bpy.ops.mesh.primitive_cone_add(location=(0, 9, 0), radius1=0)  # faces without an area
    low, high = placement.bounds(contents.find_subject(scene))
    assert low == pytest.approx((-0.5, -0.5, -0.5)) and high == pytest.approx((2.5, 0.5, 4.1))
    assert placement.bounds({empty})[1] == pytest.approx((0.1, 0.1, 4.1)), "what shows the instance is enough"


def test_array_is_fitted_to_the_whole_animation_whatever_the_frame(scene):
    box = add_box(scene, (0, 0, 0), (0.5, 0.5, 0.5))
    for number, place in ((1, 0), (40, 6)):
        box.location.x = place
        box.keyframe_insert("location", frame=number)
    fits = []
    for number in (1, 40, 200):
        scene.frame_set(number, subframe=0.25)
        fits.append(placement.place_array(scene, SMALL, {box}))
        assert (scene.frame_current, scene.frame_subframe) == (number, 0.25)
    low, high = np.array((-0.5, -0.5, -0.5)), np.array((6.5, 0.5, 0.5))
    (array, matrix), (expected, at) = fits[0], placement.fit_array(low, high, SMALL)
    assert fits[0] == fits[1] == fits[2] and np.allclose(matrix, at) and vars(array) == pytest.approx(vars(expected))


def test_frames_that_stand_for_an_animation(scene):
    assert list(placement.sample_frames(scene)) == list(placement.visited(scene, (3, 5))) == [1], "nothing moves"
    box = add_box(scene, (0, 0, 0), (0.5, 0.5, 0.5))
    for number in (1, 1000):
        box.keyframe_insert("location", frame=number)
    scene.frame_start, scene.frame_end = 1, 1000
    many = list(placement.sample_frames(scene))
    assert len(many) == placement.MOST_FRAMES and (many[0], many[-1]) == (1, 1000)
    assert list(placement.visited(scene, (3, 5))) == [3, 5] and scene.frame_current == 1


@pytest.mark.parametrize("turn", [(0, 0), (0, 0.6), (0.5, 0.6), (-0.4, -0.7)])
def test_a_camera_sees_through_a_wall_that_it_clips_and_no_ray_of_its_array_starts_behind_that(scene, turn):
    box, wall = add_box(scene, tuple(CENTRE), tuple(HALF)), add_box(scene, (0, 0, 0), (20, 0.02, 20))
    wall.location, wall.rotation_euler, camera = (1, -4.85, 3), (turn[0], 0, turn[1]), add_camera(scene)
    refuses("does not see the subject but item.001: turn", placement.place_array, scene, SMALL, {box})
    camera.data.clip_start = 0.5
    array, matrix = placement.place_array(scene, SMALL, {box})
    start, reach = array.clip_start / array.distance, np.multiply(SMALL.views, array.spacing) / 2
    ends = [(*((1 - start) * reach * view + start * np.multiply(array.half_size, lens)), array.clip_start, 1)
            for view in itertools.product((-1, 1), repeat=2) for lens in itertools.product((-1, 1), repeat=2)]
    seen = np.linalg.inv(wall.matrix_world) @ np.array(matrix) @ np.transpose(ends)
    assert seen[1].min() > 0.02 and array.spacing > 0.004
    camera.data.clip_end = 3.0
    refuses("does not see the subject", placement.place_array, scene, SMALL, {box})


def scaled(scene, item, scale):
    """Placement of SMALL at the scene's camera while ``item`` has a scale."""
    item.scale = scale
    bpy.context.view_layer.update()
    return placement.place_array(scene, SMALL, contents.find_subject(scene))


@pytest.mark.parametrize("scale", [(-1, 1, 1), (-2, 3, 0.5)])
def test_mirror_of_a_camera_is_undone(scene, scale):
    add_box(scene, tuple(CENTRE), tuple(HALF))
    camera = add_camera(scene)
    assert camera_notices(scene, None, is_imported=False) == []
    plain, (array, matrix) = scaled(scene, camera, (1, 1, 1)), scaled(scene, camera, scale)
    assert (array.distance, np.ravel(matrix)) == (pytest.approx(plain[0].distance), pytest.approx(np.ravel(plain[1])))
    assert camera_notices(scene, None, is_imported=False) == [Notice("camera-mirrored", {"camera": "camera"})]


@pytest.mark.parametrize("scale", [(0, 0, 0), (0, 1, 1), (1, 1, 0)])
@pytest.mark.parametrize("whose", ["camera", "parent"])
def test_camera_without_a_direction_is_one_sentence(scene, scale, whose):
    add_box(scene, tuple(CENTRE), tuple(HALF))
    camera, parent = add_camera(scene), bpy.data.objects.new("parent", None)
    scene.collection.objects.link(parent)
    camera.parent = parent
    camera.data.dof.use_dof, camera.data.dof.focus_object = True, scene.objects["item"]
    with pytest.raises(LfsrError, match="'camera' has no direction.*set the scale to 1"):
        scaled(scene, {"camera": camera, "parent": parent}[whose], scale)


def test_what_a_camera_sees_instead_of_its_subject_is_named(scene):
    box, wall = add_box(scene, (0, 0, 0), (0.5, 0.5, 0.5)), add_box(scene, (0, -2, 0), (9, 0.1, 9))
    wall.name, camera = "Wall", add_camera(scene, (0, -6, 0))
    camera.data.dof.use_dof, camera.data.dof.focus_distance = True, 4.0

    def notice(chosen):
        bpy.context.view_layer.update()
        return placement.unseen_notice(scene, SMALL, placement.place_array(scene, SMALL, chosen), chosen)

    assert notice({wall}) is notice({box, wall}) is None
    assert notice({box}) == Notice("array-blind", {"seen": ["Wall"], "place": "hidden"})
    camera.data.clip_end = 3.0
    assert notice({box}) == Notice("array-blind", {"seen": [], "place": "beyond"})
    camera.data.clip_end, wall.location.y = 100.0, -9
    assert notice({box}) is None
    for axis, where in ((0, "left"), (0, "right"), (2, "below"), (2, "above")):
        camera.location = (0, -6, 0)
        camera.location[axis] = {"left": 30, "right": -30, "below": 30, "above": -30}[where]
        assert notice({box}).values["place"] == where
    camera.location = (0, 6, 0)
    assert notice({box}).values["place"] == "behind"


def test_a_sheet_along_the_middle_view_is_seen_by_others(scene):
    sheet = add_box(scene, (0, 0, 0), (0.5, 0.5, 0.0))
    bpy.context.view_layer.update()
    placed = placement.place_array(scene, SMALL, {sheet})
    assert not len(placement.seen_depths(scene, placed, {sheet}))
    assert placement.unseen_notice(scene, SMALL, placed, {sheet}) is None
    side_by_side = load_display("looking-glass-go")
    assert placement.unseen_notice(
        scene, side_by_side, placement.place_array(scene, side_by_side, {sheet}), {sheet}).values["seen"] == []


def test_rays_that_miss_a_scaled_ball_meet_nothing(scene):
    bpy.ops.mesh.primitive_uv_sphere_add(radius=0.5)
    bpy.context.object.scale = 0.24, 0.26, 0.3
    bpy.context.view_layer.update()
    rays, eye = placement.Rays(scene), mathutils.Vector((5, -5, 4))
    turned = (-eye).to_track_quat("-Z", "Y")
    ways = [turned @ mathutils.Vector((x, y, -1)) for x, y in np.mgrid[-20:21, -20:21].reshape(2, -1).T / 200]
    places = [hit[0] for way in ways if (hit := rays.cast(eye, way)) is not None]
    assert len(places) > 10 and np.linalg.norm(places, axis=1).max() < 0.2


def test_hair_volumes_and_a_subject_that_only_renders_show_are_left_to_the_render(scene):
    """Rays do not meet them."""
    points = bpy.data.objects.new("points", bpy.data.pointclouds.new("points"))
    scene.collection.objects.link(points)
    box, camera = add_box(scene, (0, 0, 0), (0.5, 0.5, 0.5)), add_camera(scene, (0, -6, 0))
    box.hide_viewport = camera.data.dof.use_dof = True
    bpy.context.view_layer.update()
    for chosen in ({points}, {box, camera}):
        assert placement.unseen_notice(scene, SMALL, placement.place_array(scene, SMALL, chosen), chosen) is None


def frame_of(scene, say=silent, **options):
    job = make_request("nowhere", SMALL, world_visible=False, **{"scales": (4, 2, 1)} | options)
    with frame_folder.prepared(scene, job, say) as frame:
        return frame


def boxes(scene, depths):
    """Lit boxes side by side at these distances from the camera, all as large to see."""
    add_lamp(scene)  # or an image of light is prepared for each frame, which takes long
    add_camera(scene, (0, 0, 0), angle=0.6)
    for number, depth in enumerate(depths):
        add_box(scene, ((number - (len(depths) - 1) / 2) * 0.2 * depth, depth, 0), (0.09 * depth, 0.01, 0.15 * depth))


@pytest.mark.parametrize(("depths", "scale"), [((5.0, 5.1), 4), ((1.0, 20.0), 2)])
def test_deep_scenes_get_a_smaller_scale(scene, depths, scale):
    boxes(scene, depths)
    scene.objects[-1].hide_viewport = True  # renders show it
    frame = frame_of(scene)
    assert frame.scale == scale and frame.scale_reason.values["scale"] == scale
    frame.display.low_views(frame.scale)


def test_a_scale_that_was_asked_for_stays_samples_follow_from_the_rays_and_fixed_ones_stay(scene):
    boxes(scene, (1.0, 20.0))
    assert [(frame.scale, frame.scale_reason) for frame in (frame_of(scene, scales=()),
            frame_of(scene, kind="reference"))] == [(4, None), (1, None)]
    deep = [(frame.scale, frame.samples) for frame in (frame_of(scene, rays=4.0), frame_of(scene, samples=64))]
    assert deep == [(1, 4), (1, 64)] and frame_of(scene, samples=64).scale_reason.values["rays"] == 4


def test_a_few_frames_of_an_animation_decide_together(scene):
    boxes(scene, (5.0, 5.0))
    moved = scene.objects[-1]
    for number, factor in ((1, 1.0), (9, 0.2)):  # from the camera: as large to see
        moved.scale = (factor,) * 3
        moved.keyframe_insert("scale", frame=number)
    scene.frame_set(1)
    first, last = (frame_of(scene, frame=number).array for number in (1, 9))
    assert first == last, "the display plane does not move while the camera stands still"
    scene.camera.data.dof.use_dof, scene.camera.data.dof.focus_distance = True, 5.0
    alone, together = frame_of(scene, rays=4.0), frame_of(scene, rays=4.0, frames=(1, 9))
    assert together.scale < alone.scale and (scene.frame_current, together.frame) == (1, 1)
    assert frame_of(scene, rays=4.0, frame=9, frames=(1, 9)).scale == together.scale
    scene.camera.data.dof.use_dof = not scene.camera.keyframe_insert("location", frame=1)
    first, last = (frame_of(scene, frame=number).array for number in (1, 9))
    assert first != last, "one that moves is measured where it is"


def test_a_frame_without_an_array_does_not_count(scene):
    boxes(scene, (5.0, 5.1))
    for number, turned in ((1, 0.0), (9, 3.0)):
        scene.camera.rotation_euler.x = 1.5708 + turned
        scene.camera.keyframe_insert("rotation_euler", frame=number)
    scene.frame_set(1)
    assert frame_of(scene, frames=(1, 9)).scale == frame_of(scene).scale


def test_the_panel_leaves_the_choice_to_blender_and_gives_an_animation_one_scale(artist, monkeypatch):
    job = folders.requested(artist)[0]
    assert (job.sampling.scale, job.sampling.scales, job.sampling.rays) == (2, (), None)
    artist.lfsr.scale, artist.lfsr.samples, artist.lfsr.rays = scene_settings.AUTO_SCALE, 0, 0.5
    auto = folders.requested(artist)[0]
    assert (auto.sampling.scale, auto.sampling.scales, auto.sampling.samples, auto.sampling.rays) == (2, (2,), 2, 0.5)
    artist.frame_end = 2
    monkeypatch.setattr(placement, "seen_depths", lambda *_: pytest.fail("Blender's window waits for it"))
    made = session.run("Animation", render.animation_job(artist)).result["made"]
    first, last = (read_frame(frame["folder"]) for frame in made)
    assert first.scale == last.scale and first.scale_reason.values["scale"] == first.scale
    assert first.samples == max(1, round(0.5 * first.scale**2))
