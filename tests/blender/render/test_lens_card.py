"""The lens card against the OSL camera, in scenes with all that a path can meet; and nothing of it left behind."""

import dataclasses

import bpy
import mathutils
import numpy as np
import pytest

from blender_addon import compat
from blender_addon.render import cards
from blender_addon.render.cards import distance_to_volume
from lfsr_core.images import exr
from lfsr_core.optics.rays import RayLayout
from tests.blender.render.test_view_by_view import same_image
from tests.support.scenes import ARRAY, MINI, add_box, add_lamp, add_plane, emission, encoded, fresh_scene, front

SEEDS, SAMPLES = 10, 4
LAYOUT = RayLayout.for_display(MINI, ARRAY, 2)
LAYERS = ("albedo", "normal", "position", "index")


def material(shaders, output="Surface"):
    """Material of shader nodes, (type, {input: value}) each, mixed in equal parts."""
    made = bpy.data.materials.new("material")
    compat.use_nodes(made)
    tree = made.node_tree
    tree.nodes.clear()
    sockets = [_shader(tree, kind, values) for kind, values in shaders]
    while len(sockets) > 1:
        mix = tree.nodes.new("ShaderNodeMixShader")
        for number in (1, 2):
            tree.links.new(sockets.pop(0), mix.inputs[number])
        sockets.append(mix.outputs[0])
    tree.links.new(sockets[0], tree.nodes.new("ShaderNodeOutputMaterial").inputs[output])
    return made


def _shader(tree, kind, values):
    node = tree.nodes.new(kind)
    for name, value in values.items():
        node.inputs[name].default_value = value
    return node.outputs[0]


def room(half=2.5):
    """A wall, a lamp and a world."""
    scene = fresh_scene()
    scene.world = bpy.data.worlds.new("world")
    scene.world.color = (0.2, 0.25, 0.3)
    add_box(scene, (0, 1.2, 0), (half, 0.1, half))
    add_lamp(scene, 120, 1.0, (0.5, -3, 2), (0.9, 0, 0))
    return scene


def glass_film_and_mirror():
    """The mirror shows what is behind the viewer, where the card stands; films use up the transparent bounces."""
    scene = room()
    add_box(scene, (-0.5, 0, 0.1), (0.2, 0.3, 0.4), material([("ShaderNodeBsdfGlass", {"Roughness": 0.0})]))
    add_box(scene, (0.5, 0.2, 0.3), (0.3, 0.02, 0.3), material([("ShaderNodeBsdfGlossy", {"Roughness": 0.0})]))
    film = material([("ShaderNodeBsdfTransparent", {}), ("ShaderNodeBsdfDiffuse", {})])
    for number in range(4):
        add_box(scene, (0.3, -0.6 + 0.2 * number, -0.4), (0.3, 0.02, 0.2), film)
    scene.cycles.transparent_max_bounces = 3
    return scene


def fog_around_the_viewer():
    """A box of fog narrower than the card would be."""
    scene = room(1.0)
    add_box(scene, (0, 0, 0), (1.5, 9, 1.5), material([("ShaderNodeVolumeScatter", {"Density": 0.15})], "Volume"))
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
    scene = make()

    def renders(way, first, layout=LAYOUT, layers=LAYERS):
        """Layers of SEEDS renders, each (SEEDS, H, W, C)."""
        found = [encoded(scene, layout, tmp_path, way=way, samples=SAMPLES, layers=layers, world_visible=True,
                         seed=seed + first) for seed in range(SEEDS)]
        return {name: np.stack([each[name] for each in found]) for name in found[0]}

    osl, card = renders("one-pass", 0), renders("lens-card", 100)
    assert set(osl) == set(card) == {"color", "environment", *LAYERS}
    for name in set(osl) - {"index", "environment"}:
        assert same_image(osl[name], card[name]), name
    if make is glass_film_and_mirror:
        wrong = renders("lens-card", 100, dataclasses.replace(LAYOUT, spacing=1.2 * LAYOUT.spacing), ())
        assert not same_image(osl["color"], wrong["color"]), "a wrong spacing is noticed"


def test_position_is_zero_where_nothing_was_hit(scene, tmp_path):
    add_box(scene, (0, 0, 0), (0.3, 0.3, 0.3))
    layers = encoded(scene, LAYOUT, tmp_path, way="lens-card", layers=LAYERS)
    exr.check_complete(tmp_path / "image.exr")
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


def state(scene):
    """All data of the open file, by kind, and what a card changes."""
    data = {name: sorted(item.name for item in getattr(bpy.data, name))
            for name in ("objects", "meshes", "materials", "cameras", "node_groups", "collections")}
    return data, scene.camera, scene.cycles.transparent_max_bounces


def test_nothing_is_left_of_a_card_that_cannot_be_made(scene, monkeypatch):
    before = state(scene)
    monkeypatch.setattr(cards, "ray_group", lambda _: 1 / 0)
    with pytest.raises(ZeroDivisionError), cards.card_camera(scene, LAYOUT, front()):
        pass
    assert state(scene) == before


def test_distance_to_volume(scene):
    assert distance_to_volume(scene, mathutils.Vector()) == np.inf
    add_box(scene, (0, 0, 0), (0.1, 0.1, 0.1))
    assert distance_to_volume(scene, mathutils.Vector()) == np.inf, "no volume"
    fog = material([("ShaderNodeVolumeScatter", {})], "Volume")
    item = add_box(scene, (0, 0, 0), (2, 3, 4), fog)
    bpy.context.view_layer.update()
    assert distance_to_volume(scene, mathutils.Vector()) == pytest.approx(2)
    assert distance_to_volume(scene, mathutils.Vector((5, 0, 0))) == pytest.approx(3)
    item.hide_render = True
    bpy.context.view_layer.update()
    assert distance_to_volume(scene, mathutils.Vector()) == np.inf
