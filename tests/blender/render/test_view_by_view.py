"""The one-pass render against ordinary cameras, one per view: two ways to the same image."""

import dataclasses

import bpy
import mathutils
import numpy as np
import pytest

from blender_addon.render import cards, cycles
from blender_addon.render import view_by_view as views
from blender_addon.render.cards import distance_to_volume
from lfsr_core.images import image_files
from lfsr_core.optics.rays import RayLayout, from_views, to_views
from tests.support import scenes
from tests.support.scenes import ARRAY, FLAT, MINI, WAYS, add_box, add_lamp, add_plane, emission, encoded, front

SEEDS, SAMPLES, SCALE = 10, 4, 4
# A two-sided t of 18 degrees of freedom is above this for one pixel in a thousand.
T_ONE_IN_1000 = 3.92


def same_image(first, second, widest=1.25):
    """Share of pixels beyond the one-in-1000 t is at most five in 1000, and the mean is not shifted."""
    # Welch's t of every pixel and channel that varies; those that never vary must be equal.
    difference = first.mean(0) - second.mean(0)
    error = np.sqrt((first.var(0, ddof=1) + second.var(0, ddof=1)) / len(first))
    still = error < 1e-7
    t = np.where(still, np.where(np.abs(difference) < 1e-5, 0.0, np.inf),
                 difference / np.where(still, 1, error))[..., :3]
    finite = t[np.isfinite(t) & (t != 0)]
    return np.mean(np.abs(t) > T_ONE_IN_1000) < 0.005 and abs(finite.mean()) < 0.2 and finite.std() < widest


@pytest.mark.parametrize(("display", "scale"), [(MINI, SCALE), (FLAT, 2)])
def test_views_are_the_one_pass_image(tmp_path, display, scale):
    """SEEDS renders each way of the same layout; one view that is shifted by one is noticed."""
    layout, scene, stacks = RayLayout.for_display(display, ARRAY, scale), scenes.fresh_scene(), []
    add_box(scene, (0, 1.2, 0), (2.5, 0.1, 2.5))  # before, on and behind the plane, with light, shadow and gloss
    add_box(scene, (-0.4, 0, 0.1), (0.2, 0.3, 0.4))
    add_box(scene, (0.4, -0.7, -0.2), (0.2, 0.2, 0.2), emission((0.2, 0.6, 0.1)))
    add_lamp(scene, 120, 1.0, (0.5, -3, 2), (0.9, 0, 0))
    for render in (cycles.render_encoded, views.render_views):
        images = []
        for seed in range(SEEDS):
            render(scene, cycles.Shot(layout, front()), cycles.RenderSettings(SAMPLES, seed), tmp_path / "image.exr")
            images.append(image_files.read_layers(tmp_path / "image.exr")["color"])
        stacks.append(np.stack(images))
    assert stacks[0].std(0).max() > 0.05, "without noise the test would prove little"
    assert same_image(*stacks)
    shifted = [to_views(image, layout.lenses).copy() for image in stacks[1]]
    for image in shifted:
        image[0, 0] = image[0, 1]
    assert not same_image(stacks[0], np.stack([from_views(image) for image in shifted]))


@pytest.mark.parametrize("lens_list", [None, ((0, 0), (3, 15), (11, 2), (5, 9), (6, 6))])
@pytest.mark.parametrize("convention", ["centred", "paper"])
def test_positions_agree_pixel_by_pixel(scene, tmp_path, convention, lens_list):
    """Two planes at an angle, one pixel-centre sample: no statistics needed."""
    add_box(scene, (0, 30.5, 0), (60, 30, 60), scenes.position_emission())
    layout = RayLayout.for_display(MINI, ARRAY, SCALE, convention=convention, view_aperture=0.0, lens_list=lens_list)
    expected = encoded(scene, layout, tmp_path)["color"]
    views.render_views(scene, cycles.Shot(layout, front()), cycles.RenderSettings(1), tmp_path / "views.exr")
    shown = image_files.read_layers(tmp_path / "views.exr")["color"]
    assert shown.shape == expected.shape
    # The two cameras put the pixel centre half a step of the filter table off, of their own pixel: paper's are smaller.
    assert np.abs(shown - expected).max() <= (1e-4 if convention == "centred" else 5e-4) * ARRAY.distance


@pytest.mark.parametrize(("display", "scale"), [(MINI, SCALE), (FLAT, 2)])
def test_other_layers_come_view_by_view_too(scene, tmp_path, display, scale):
    """Also where pixels are not square."""
    add_box(scene, (0.2, 0, 0), (0.3, 0.3, 0.3), scenes.position_emission())
    layout = RayLayout.for_display(display, ARRAY, scale, view_aperture=0.0)
    settings = cycles.RenderSettings(1, layers=("albedo", "normal", "position", "index"), world_visible=True)
    views.render_views(scene, cycles.Shot(layout, front()), settings, tmp_path / "views.exr")
    cycles.render_encoded(scene, cycles.Shot(layout, front()), settings, tmp_path / "encoded.exr")
    shown, expected = (image_files.read_layers(tmp_path / f"{name}.exr") for name in ("views", "encoded"))
    assert set(shown) == set(expected) == {"color", "albedo", "normal", "position", "index", "path", "environment"}
    for name in ("position", "normal", "index"):
        assert np.mean(np.abs(shown[name] - expected[name]).max(-1) > 1e-3) < 0.02, name


LAYOUT = RayLayout.for_display(MINI, ARRAY, 2)
LAYERS = ("albedo", "normal", "position", "index")


def room(half=2.5):
    """A wall, a lamp and a world."""
    scene = scenes.fresh_scene()
    scene.world = bpy.data.worlds.new("world")
    scene.world.color = (0.2, 0.25, 0.3)
    add_box(scene, (0, 1.2, 0), (half, 0.1, half))
    add_lamp(scene, 120, 1.0, (0.5, -3, 2), (0.9, 0, 0))
    return scene


def glass_film_and_mirror():
    """The mirror shows what is behind the viewer, where the card stands; films use up the transparent bounces."""
    scene = room()
    add_box(scene, (-0.5, 0, 0.1), (0.2, 0.3, 0.4), scenes.mixed(("ShaderNodeBsdfGlass", {"Roughness": 0.0})))
    add_box(scene, (0.5, 0.2, 0.3), (0.3, 0.02, 0.3), scenes.mixed(("ShaderNodeBsdfGlossy", {"Roughness": 0.0})))
    film = scenes.mixed(("ShaderNodeBsdfTransparent", {}), ("ShaderNodeBsdfDiffuse", {}))
    for number in range(4):
        add_box(scene, (0.3, -0.6 + 0.2 * number, -0.4), (0.3, 0.02, 0.2), film)
    scene.cycles.transparent_max_bounces = 3
    return scene


def fog_around_the_viewer():
    """A box of fog narrower than the card would be."""
    scene, fog = room(1.0), scenes.mixed(("ShaderNodeVolumeScatter", {"Density": 0.15}), output="Volume")
    add_box(scene, (0, 0, 0), (1.5, 9, 1.5), fog)
    return scene


def catcher_and_hair():
    scene = room(1.0)
    add_box(scene, (0, 0, -0.6), (2, 2, 0.05)).is_shadow_catcher = True
    curves = bpy.data.hair_curves.new("hair")
    curves.add_curves([3] * 60)
    roots = np.random.default_rng(0).uniform(-0.5, 0.5, (60, 1, 3))
    ends = roots + np.array([[(0, 0, 0), (0, -0.1, 0.1), (0, 0, 0.3)]])
    curves.attributes["position"].data.foreach_set("vector", ends.astype("f4").ravel())
    curves.attributes.new("radius", "FLOAT", "POINT").data.foreach_set("value", np.full(180, 0.02, "f4"))
    scene.collection.objects.link(bpy.data.objects.new("hair", curves))
    return scene


@pytest.mark.parametrize("make", [glass_film_and_mirror, fog_around_the_viewer, catcher_and_hair])
def test_every_layer_is_the_osl_cameras(tmp_path, make):
    scene, is_newest = make(), bpy.app.version >= (5, 3, 0)

    def renders(way, first, layout=LAYOUT, layers=LAYERS):
        """Layers of SEEDS renders, each (SEEDS, H, W, C)."""
        frames = [encoded(scene, layout, tmp_path, way=way, samples=SAMPLES, layers=layers, world_visible=True,
                          seed=seed + first) for seed in range(SEEDS)]
        for frame in [frame for frame in frames if layers and is_newest]:
            frame["path"] *= frame["color"][..., 3:] == 1  # used there alone; since Blender 5.3 rays that miss have one
        return {name: np.stack([frame[name] for frame in frames]).round(4) for name in frames[0]}

    osl, card = renders("one-pass", 0), renders("lens-card", 100)
    assert set(osl) == set(card) == {"color", "environment", "path", *LAYERS}
    for name in set(osl) - {"index", "environment"}:
        # In the fog of Blender 5.3 albedo has few values, whose t are wider.
        assert same_image(osl[name], card[name], 1.3 if is_newest and name == "albedo" else 1.25), name
    if make is glass_film_and_mirror:
        wrong = renders("lens-card", 100, dataclasses.replace(LAYOUT, spacing=1.2 * LAYOUT.spacing), ())
        assert not same_image(osl["color"], wrong["color"]), "a wrong spacing is noticed"


def test_position_is_zero_where_nothing_was_hit(scene, tmp_path):
    add_box(scene, (0, 0, 0), (0.3, 0.3, 0.3)).cycles.use_distance_cull = True  # from a camera behind the card
    scene.render.use_simplify, scene.cycles.use_distance_cull, scene.cycles.distance_cull_margin = True, True, 0.01
    layers = encoded(scene, LAYOUT, tmp_path, way="lens-card", layers=LAYERS)
    image_files.check_complete(tmp_path / "image.exr")
    assert [path.name for path in tmp_path.iterdir()] == ["image.exr"], "the layer was written anew"
    missed = layers["color"][..., 3] == 0
    assert 0.1 < missed.mean() < 0.9
    for name in LAYERS:
        assert not layers[name][missed].any(), name
    assert (np.abs(layers["position"][~missed]) <= 0.31).all()


def test_camera_rays_stay_camera_rays(scene, tmp_path):
    """What only the camera sees is seen; a path has passed one transparent surface more, which a shader can tell."""
    for column, (name, expected) in enumerate({"Is Camera Ray": 1, "Is Transmission Ray": 0, "Ray Depth": 0,
                                               "Transparent Depth": 1}.items()):
        shown = emission((0, 0, 0))
        tree = shown.node_tree
        shader = next(node for node in tree.nodes if node.bl_idname == "ShaderNodeEmission")
        tree.links.new(tree.nodes.new("ShaderNodeLightPath").outputs[name], shader.inputs["Color"])
        plane = mathutils.Matrix.Translation((0, 0.5 + column, 0)) @ mathutils.Matrix.Rotation(np.pi / 2, 4, "X")
        item = add_plane(scene, plane, shown)
        assert encoded(scene, LAYOUT, tmp_path, way="lens-card")["color"][..., :3] == pytest.approx(expected), name
        bpy.data.objects.remove(item)


def test_distance_to_volume_and_nothing_left_of_a_card_that_cannot_be_made(scene, monkeypatch):
    assert distance_to_volume(scene, mathutils.Vector()) == np.inf
    add_box(scene, (0, 0, 0), (0.1, 0.1, 0.1))
    assert distance_to_volume(scene, mathutils.Vector()) == np.inf, "no volume"
    item = add_box(scene, (0, 0, 0), (2, 3, 4), scenes.mixed(("ShaderNodeVolumeScatter", {}), output="Volume"))
    for item.hide_viewport, item.hide_render, place, expected in (
            (False, False, 0, 2), (False, False, 5, 3), (True, False, 0, 2), (False, True, 0, np.inf)):
        bpy.context.view_layer.update()  # what is hidden in the viewport has no evaluated mesh
        assert distance_to_volume(scene, mathutils.Vector((place, 0, 0))) == pytest.approx(expected)
    before = scenes.snapshot()
    monkeypatch.setattr(cards, "ray_group", lambda _: 1 / 0)
    with pytest.raises(ZeroDivisionError), cards.card_camera(scene, LAYOUT, front()):
        pass
    assert scenes.snapshot() == before


SPARSE = RayLayout.for_display(MINI, ARRAY, 4)


def rendered(scene, folder, way, clip):
    shot = cycles.Shot(dataclasses.replace(SPARSE, array=dataclasses.replace(ARRAY, clip=clip)), front(), way)
    render = views.render_views if way == "view-by-view" else cycles.render_encoded
    render(scene, shot, cycles.RenderSettings(4, layers=("position",)), folder / "image.exr")
    layers = image_files.read_layers(folder / "image.exr")
    return layers["color"], layers["position"]


@pytest.mark.parametrize("way", [*WAYS, "view-by-view"])
def test_things_before_and_behind_the_clipped_depths_are_not_seen(scene, tmp_path, way):
    upright, near = mathutils.Matrix.Rotation(np.pi / 2, 4, "X"), 0.3 * ARRAY.distance
    # Cycles clips by the ray through a lens's centre, and the apertures of this display are wide.
    start = near * (1.5 if way == "view-by-view" else 1.01)
    add_plane(scene, mathutils.Matrix.Translation((0, near - ARRAY.distance, 0)) @ upright, emission((1, 0, 0)))
    add_box(scene, (0, 0, 0), (0.3, 0.01, 0.3), emission((0, 1, 0)))
    add_plane(scene, mathutils.Matrix.Translation((0, 3 * ARRAY.distance, 0)) @ upright, emission((0, 0, 1)))
    color, _ = rendered(scene, tmp_path, way, None)
    assert color[..., 0].min() > 0.99, "the wall hides everything"
    color, _ = rendered(scene, tmp_path, way, (start, 10 * ARRAY.distance))
    assert color[..., 0].max() == 0 and color[..., 1].max() > 0.99 and color[..., 2].max() > 0.99
    color, position = rendered(scene, tmp_path, way, (start, 2 * ARRAY.distance))
    assert color[..., 0].max() == 0 and color[..., 1].max() > 0.99
    assert color[..., 2].max() == 0 and (color[..., 3] == 0).any(), "nothing is seen where only the far wall is"
    assert not position[color[..., 3] == 0].any()
