"""A reference is two halves with independent noise."""

import bpy
import numpy as np
import pytest

from blender_addon.render import frame_folder, output
from blender_addon.render.frame_folder import Opened, render_job
from blender_addon.scene import light
from lfsr_core.base.messages import Notice, silent
from lfsr_core.exports.light_field import read_views
from lfsr_core.frames.folder import is_same
from lfsr_core.frames.frame import LAYERS, LAYOUTS, read_frame
from lfsr_core.images import image_files
from lfsr_core.pipeline.merge import merge
from lfsr_core.pipeline.parts import Part
from lfsr_core.reconstruct.second_stage import finish_frame
from lfsr_core.reconstruct.upscaler import low_resolution
from tests.support.requests import make_request
from tests.support.scenes import MINI, add_box, add_camera, add_lamp, emission, mixed
from tests.support.told import Told


@pytest.fixture
def lit(scene):
    """A wall that fills the view and a box that shines before it, in noisy light, shadow and a world."""
    add_box(scene, (0, 1, 0), (5, 0.1, 5))
    add_box(scene, (0, 0, 0.2), (0.4, 0.3, 0.3), emission((0.2, 0.6, 0.1))).name = "box"
    add_lamp(scene)
    scene.world = bpy.data.worlds.new("world")
    add_camera(scene, (0, -3, 0), 0.9)
    return scene


LENSES = ((0, 0), (3, 4), (5, 8), (6, 9), (11, 15))


def images_of(scene, folder, tell=silent, **options):
    """Layers of every image, by the file's stem; with ``parts`` as the command renders."""
    request = make_request(str(folder), MINI, **{"samples": 4, "scale": 1, "world_visible": False} | options)
    render_job(scene, request, Opened(0.1, "the same file"), tell)
    images = {path.stem: image_files.read_layers(path) for path in folder.glob("*.exr")}
    assert not set(images) - {"lr_eia", "world", "reference_a", "reference_b"}
    return images


def colors(scene, folder, **options):
    return {name: layers["color"][..., :3] for name, layers in images_of(scene, folder, **options).items()}


def noise(image):
    """Differences between neighbouring pixels."""
    return image[:, 1:] - image[:, :-1]


def correlation(first, second):
    return np.corrcoef(noise(first).ravel(), noise(second).ravel())[0, 1]


def test_halves_and_candidates_have_independent_noise(lit, tmp_path):
    halves = colors(lit, tmp_path / "reference", kind="reference")
    assert set(halves) == {"reference_a", "reference_b"}
    low = colors(lit, tmp_path / "low", samples=2)["lr_eia"]
    same, other = (colors(lit, tmp_path / str(seed), samples=2, seed=seed)["lr_eia"] for seed in (0, 1))
    first, second = halves.values()
    assert first.mean() == pytest.approx(second.mean(), rel=0.02)
    np.testing.assert_array_equal(low, same)
    # The rest of the correlation is that of the edges in the image.
    edges = correlation(first, second)
    assert edges < 0.6 and max(correlation(low, image) for image in (first, second, other)) < edges + 0.1


@pytest.mark.parametrize(("options", "expected"), [
    ({"scale": 4}, ("albedo", "normal", "position")),
    ({"scale": 4, "layers": ("normal", "position")}, ("normal", "position", "albedo")),
    ({"scale": 1}, ()), ({"scale": 1, "kind": "reference"}, ())])
def test_the_second_stage_gets_albedo_normal_and_position_where_views_are_left_out(lit, tmp_path, options, expected):
    images = images_of(lit, tmp_path, **options)
    assert read_frame(tmp_path).layers == expected
    assert all({"albedo", "normal"} & set(layers) == {"albedo", "normal"} & set(expected) for layers in images.values())


def test_halves_share_the_samples_and_are_not_clamped(lit, tmp_path):
    seen = []

    def remember(*_):
        seen.append((lit.cycles.samples, lit.cycles.sample_clamp_indirect, lit.cycles.seed,
                     getattr(lit.cycles, "volume_biased", None)))

    bpy.app.handlers.render_pre.append(remember)
    try:
        colors(lit, tmp_path / "low", samples=1)
        colors(lit, tmp_path / "reference", samples=5, kind="reference")
        colors(lit, tmp_path / "own", samples=1, clamp_indirect=3.0)
    finally:
        bpy.app.handlers.render_pre.remove(remember)
    # Before each, a tiny one has looked for light, in which volumes take no time to prepare.
    assert all(quick in (None, samples == frame_folder.LIGHT_SAMPLES) for samples, *_, quick in seen) and len(seen) > 4
    seen = [settings for settings in seen if settings[0] != frame_folder.LIGHT_SAMPLES]
    assert [settings[:2] for settings in seen] == [(1, 10.0), (3, 0.0), (2, 0.0), (1, 3.0)]
    assert len({seed for _, _, seed, _ in seen[:3]}) == 3


@pytest.mark.parametrize("changes", [{}, {"world_visible": True}, {"light": "city"}, {"light": "own"}])
def test_the_first_view_is_the_middle_of_the_image_which_keeps_its_bytes(lit, tmp_path, changes):
    first, told = tmp_path / "first.npy", []
    lit.render.engine, lit.render.use_persistent_data = "CYCLES", True  # as for all renders of one Blender
    if "light" in changes:
        light.add_light(lit)
    options = {"samples": 16, "scale": 1, "world_visible": False} | changes
    render_job(lit, make_request(str(tmp_path / "with"), MINI, first_view=str(first), **options), tell=told.append)
    assert Notice("first-view", {"path": str(first)}) in told
    without = colors(lit, tmp_path / "without", **options)["lr_eia"]
    np.testing.assert_array_equal(image_files.read_layers(tmp_path / "with" / "lr_eia.exr")["color"][..., :3], without)
    view = np.load(first)
    assert view.dtype == np.uint8 and view.shape == (1, 1, MINI.lenses[1], MINI.lenses[0], 3)
    finish_frame(tmp_path / "with", "none")
    views = read_views(tmp_path / "with").astype(float)
    error = [np.abs(view[0, 0] - other).mean() for other in (views[3:5, 3:5].mean((0, 1)), views[0, 0])]
    assert error[0] < min(8, error[1])


@pytest.mark.parametrize(("calm", "limit", "times"), [(1.0, 60, 1), (0.0, 60, 16), (0.0, 1e-3, 1)])
def test_a_noisy_first_view_gets_more_rays_unless_they_take_long(lit, tmp_path, monkeypatch, calm, limit, times):
    monkeypatch.setattr(frame_folder, "MOST_SECONDS", limit)
    request = make_request(str(tmp_path / "frame"), MINI, scale=4, scales=(4, 2),
                           first_view=str(tmp_path / "first.npy"), calm=calm).sampled(rays=1.0)
    told = []
    render_job(lit, request, tell=told.append)
    frame = read_frame(tmp_path / "frame")
    assert frame.samples == times * request.samples_at(frame.scale) and is_same(frame, request)
    assert (Notice("noisy", {"times": times}) in told) == (times > 1)
    long = [told for told in told if isinstance(told, Notice) and told.code == "noisy-long"]
    assert [(told.values["times"], told.values["taken"]) for told in long] == ([(16, 1)] if limit < 1 else [])


@pytest.mark.parametrize("layout", ["one-pass", "view-by-view"])
def test_braces_in_a_path_are_no_template(lit, tmp_path, layout):
    folder = tmp_path / "{scene} {x" / "{blend_name}}"
    folder.mkdir(parents=True)
    assert set(colors(lit, folder, samples=1, scale=4, layout=layout)) == {"lr_eia"}
    assert [path.name for path in tmp_path.iterdir()] == ["{scene} {x"]


def key(owner, path, value, frame=1):
    """A keyframe that says ``value`` at every frame."""
    before = getattr(owner, path)
    setattr(owner, path, value)
    owner.keyframe_insert(path, frame=frame)
    setattr(owner, path, before)


INDEXED = {"samples": 2, "scale": 4, "layers": ("index",), "world_visible": None}


def keyed_samples(scene):
    key(scene.cycles, "samples", 7)
    scene.cycles.seed = 5
    key(scene.cycles, "pixel_filter_type", "GAUSSIAN")


def driven_seed(scene):
    scene.cycles.driver_add("seed").driver.expression = "frame"


def keyed_in_a_strip(scene):
    key(scene.cycles, "seed", 41)
    data = scene.animation_data
    action, slot = data.action, data.action_slot
    data.action = None
    data.nla_tracks.new().strips.new("strip", 1, action).action_slot = slot


def animated_index(scene):
    key(bpy.data.objects["box"], "pass_index", 2)
    bpy.data.objects["item"].driver_add("pass_index").driver.expression = "1"


@pytest.mark.parametrize(("animate", "layout"), [
    ((lambda scene: setattr(scene.timeline_markers.new("cut", frame=1), "camera", scene.camera), keyed_samples,
      driven_seed, animated_index), "one-pass"),
    ((keyed_samples, animated_index), "view-by-view"), ((keyed_in_a_strip,), "one-pass")])
def test_animated_settings_change_nothing(lit, tmp_path, animate, layout):
    options = INDEXED | {"layout": layout, "seed": 3}
    expected = images_of(lit, tmp_path / "plain", **options)
    for change in animate:
        change(lit)
    assert_same(images_of(lit, tmp_path / "animated", **options), expected)


def test_the_array_stands_where_a_marker_puts_the_camera_and_stays_an_array(lit, tmp_path):
    first, other = lit.camera, add_camera(lit, (0.2, -4, 0.1), 0.6)
    expected = images_of(lit, tmp_path / "plain", **INDEXED)
    lit.camera = first
    lit.timeline_markers.new("cut", frame=1).camera, lit.timeline_markers.new("back", frame=9).camera = other, first
    assert_same(images_of(lit, tmp_path / "marked", frame=1, **INDEXED), expected)
    assert lit.timeline_markers["cut"].camera == other


def test_a_driven_seed_leaves_the_halves_of_a_reference_apart_and_all_moves_again(lit, tmp_path):
    driven_seed(lit)
    keyed_samples(lit)
    halves = colors(lit, tmp_path / "reference", kind="reference", samples=2)
    assert not np.array_equal(halves["reference_a"], halves["reference_b"])
    assert not any(curve.mute for curve in lit.animation_data.drivers)
    lit.frame_set(9)
    assert (lit.cycles.seed, lit.cycles.samples) == (9, 7)


LONG = {"samples": 40, "scale": 2, "world_visible": None}


def assert_same(images, others):
    assert set(images) == set(others)
    for name, layers in images.items():
        assert set(layers) == set(others[name])
        for layer, pixels in layers.items():
            np.testing.assert_array_equal(pixels, others[name][layer], f"{name} {layer}", strict=True)


@pytest.mark.parametrize("options", [{}, {"lens_list": LENSES, "scale": 1}, {"layout": "lens-card"}])
def test_parts_are_the_whole_image(lit, tmp_path, monkeypatch, options):
    options = LONG | {"layers": LAYERS, "world_visible": True} | options
    whole = images_of(lit, tmp_path / "whole", **options)
    assert set(whole["lr_eia"]) == {"color", *LAYERS, "path", "environment"}
    # So short that bands also run out of time and are given up.
    monkeypatch.setenv("LFSR_SECONDS_PER_PART", "0.01")
    kept = tmp_path / "kept"
    assert_same(images_of(lit, tmp_path / "parts", parts=str(kept), **options), whole)
    names = sorted(path.name for path in kept.glob("*.exr"))
    assert len(names) >= 3
    for gone in names[1:-1:2]:
        (kept / gone).unlink()
    times = {name: (kept / name).stat().st_mtime_ns for name in names[::2]}
    assert_same(images_of(lit, tmp_path / "again", parts=str(kept), **options), whole)
    assert all((kept / name).stat().st_mtime_ns == time for name, time in times.items())


def test_a_short_render_keeps_nothing_and_a_finished_half_is_kept_while_the_other_is_rendered(lit, tmp_path,
                                                                                              monkeypatch):
    calls = []
    monkeypatch.setattr(output, "gaps", lambda *arguments: calls.append(arguments) or [])
    images_of(lit, tmp_path / "frame", told := Told(), parts=str(tmp_path / "kept"), **LONG)
    assert not (tmp_path / "kept").exists() and not calls and not told.notices
    monkeypatch.undo()
    options = {"kind": "reference", "samples": 8}
    whole = images_of(lit, tmp_path / "whole", **options)
    monkeypatch.setattr(output, "is_worth_storing", lambda seconds: True)
    kept = tmp_path / "kept"
    assert_same(images_of(lit, tmp_path / "parts", parts=str(kept), **options), whole)
    (half,) = kept.glob("*.exr")
    assert half.name.startswith("reference_a-")
    assert_same(images_of(lit, tmp_path / "again", parts=str(kept), **options), whole)


def test_parts_of_other_inputs_are_removed(lit, tmp_path, monkeypatch):
    monkeypatch.setenv("LFSR_SECONDS_PER_PART", "0.02")
    image, options = tmp_path / "wood.png", LONG
    image.write_bytes(b"1")
    bpy.data.images.new("wood", 4, 4).filepath = str(image)
    bpy.data.images["wood"].source = "FILE"
    for number, (change, other) in enumerate([({}, None), ({"seed": 3}, "settings"), ({"layers": ("albedo",)},
                                              "settings"), ({}, "images or linked files")]):
        if number == 3:
            image.write_bytes(b"22")
        options = options | change
        images = images_of(lit, tmp_path / str(number), told := Told(), parts=str(tmp_path / "kept"), **options)
        assert told.notices == ([Notice("parts-removed", {"input": other})] if other else [])
    assert_same(images, images_of(lit, tmp_path / "alone", **options))


@pytest.mark.parametrize("rows", [7, 270, 1080, 4320])
def test_a_border_is_the_rows_that_were_meant(rows):
    """As Blender and Cycles cut it: to whole pixels, from single-precision fractions."""
    for first in range(0, rows, max(1, rows // 97)):
        for size in (1, 2, rows - first):
            values = output.border(Part(first, min(first + size, rows)), rows)
            low, high = (int(np.float32(values[name]) * np.float32(rows)) for name in ("border_min_y", "border_max_y"))
            assert (rows - high, rows - low) == (first, min(first + size, rows))


@pytest.mark.parametrize("options", [{}, {"layout": "lens-card"}, {"kind": "reference", "scale": 1, "samples": 8},
                                     {"short": "0.02"}])
def test_rows_of_lenses_are_the_whole_image(lit, tmp_path, monkeypatch, options):
    """Rendered one by one and merged; also where each of them is made of bands."""
    monkeypatch.setenv("LFSR_SECONDS_PER_PART", short := options.get("short", "60"))
    shown = {} if options.get("kind") else {"layers": LAYERS, "world_visible": True}
    options = LONG | shown | {name: value for name, value in options.items() if name != "short"}
    whole, rows = images_of(lit, tmp_path / "whole", **options), [(1, 3), (4, 4), (5, 12)]
    for number, part in enumerate(rows):
        # One part at once, the others in bands: Blender's file beside ours.
        monkeypatch.setenv("LFSR_SECONDS_PER_PART", "60" if number == 1 else short)
        images_of(lit, tmp_path / f"part{number}", rows=part, parts=str(tmp_path / f"kept{number}"), **options)
    if not options.get("kind"):
        assert image_files.size(tmp_path / "part0" / "lr_eia.exr") == (64, 12)
    merge([tmp_path / f"part{number}" for number in (2, 0, 1)], tmp_path / "merged")
    assert_same({path.stem: image_files.read_layers(path) for path in (tmp_path / "merged").glob("*.exr")}, whole)


@pytest.mark.parametrize("layout", LAYOUTS[:3])
def test_depth_in_a_mirror_is_that_of_what_it_shows(scene, tmp_path, layout):
    add_box(scene, (0, 1, 0), (9, 1, 9), mixed(("ShaderNodeBsdfGlossy", {"Roughness": 0.0, "Color": (1,) * 4})))
    add_box(scene, (0, -10, 0), (99, 2, 99), emission((1, 1, 1)))  # behind the camera
    add_box(scene, (0, -1.1, -9.1), (9, 0.1, 9), emission((1, 0, 0)))  # in the lower half
    add_camera(scene, (0, -6, 0)).data.clip_start = 0.5
    layers = images_of(scene, tmp_path, scale=2, layout=layout)["lr_eia"]
    frame, shares = read_frame(tmp_path), []
    for changes in ({}, {"path": 0 * layers["path"]}, {"color": 0.9 * layers["color"]}):  # the last: partly covered
        slopes = low_resolution(layers | changes, frame).slope[..., -1:]
        depths = frame.array.distance / (1 - slopes * 2 * frame.array.half_width / MINI.lenses[0] / frame.rays.spacing)
        shares.append([np.isclose(depths, depth, rtol=0.01).mean() for depth in (4.8, 6, 14)])
    np.testing.assert_allclose(shares, [[0.5, 0, 0.4], *[[0.5, 0.5, 0]] * 2], atol=0.1, err_msg="box, mirror, wall")
