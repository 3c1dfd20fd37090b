"""Files that a scene needs and that cannot be read are said and refused, whatever reads them."""

import os
import shutil
import struct
from pathlib import Path

import bpy
import cv2
import numpy as np
import OpenImageIO as oiio
import pytest

from blender_addon import compat
from blender_addon.jobs.runtime import file_copy, save_copy
from blender_addon.scene.files import check_files, disk_cache, open_scene, paint_missing, unreadable
from lfsr_core.base.messages import Notice
from lfsr_core.images import image_files
from tests.support.scenes import add_box, add_camera, link
from tests.support.told import refuses


def half(whole):
    return whole[:len(whole) // 2]


def junk(_whole):
    return b"hello" * 99


@pytest.fixture
def item(scene):
    """A box with a material of nodes before a camera."""
    material = bpy.data.materials.new("material")
    compat.use_nodes(material)
    add_camera(scene)
    return add_box(scene, (0, 0, 0), (1, 1, 1), material)


def node(item, kind):
    return item.data.materials[0].node_tree.nodes.new(kind)


def picture(path):
    assert oiio.ImageBuf(np.random.default_rng(0).integers(0, 255, (32, 32, 3)).astype(np.uint8)).write(str(path))
    return path


def image(suffix):
    def use(item, folder):
        path = picture(folder / f"wood.{suffix}")
        node(item, "ShaderNodeTexImage").image = bpy.data.images.load(str(path))
        return path
    return use


def environment(item, folder):
    world = bpy.context.scene.world = bpy.data.worlds.new("world")
    compat.use_nodes(world)
    path = picture(folder / "sky.hdr")
    world.node_tree.nodes.new("ShaderNodeTexEnvironment").image = bpy.data.images.load(str(path))
    return path


def film(item, folder):
    path = folder / "film.mp4"
    writer = cv2.VideoWriter(str(path), cv2.VideoWriter_fourcc(*"mp4v"), 24, (32, 32))
    for _ in range(4):
        writer.write(np.zeros((32, 32, 3), np.uint8))
    writer.release()
    node(item, "ShaderNodeTexImage").image = bpy.data.images.load(str(path))
    return path


def volume(item, folder):
    made = bpy.data.objects.new("made", bpy.data.volumes.new("made"))
    bpy.context.scene.collection.objects.link(made)
    modifier = made.modifiers.new("mesh", "MESH_TO_VOLUME")
    modifier.object, modifier.resolution_mode, modifier.voxel_amount = item, "VOXEL_AMOUNT", 8
    path = folder / "cloud.vdb"
    made.evaluated_get(bpy.context.evaluated_depsgraph_get()).data.grids.save(filepath=str(path))
    made.modifiers.clear()
    made.data.filepath = str(path)
    return path


def alembic(item, folder):
    path = folder / "walk.abc"
    bpy.ops.wm.alembic_export(filepath=str(path))
    bpy.ops.cachefile.open(filepath=str(path))
    modifier = item.modifiers.new("cache", "MESH_SEQUENCE_CACHE")
    modifier.cache_file, modifier.object_path = bpy.data.cache_files[0], "/item/mesh"
    return path


def light(item, folder):
    path = folder / "lamp.ies"
    path.write_text("IESNA:LM-63-1995\nTILT=NONE\n1 1000 1 2 1 1 2 0 0 0\n1 1 100\n0 90\n0\n100 0\n")
    ies = node(item, "ShaderNodeTexIES")
    ies.mode, ies.filepath = "EXTERNAL", str(path)
    return path


def motion(suffix, content):
    def use(item, folder):
        path = folder / f"moves.{suffix}"
        path.write_bytes(content)
        modifier = item.modifiers.new("moves", "MESH_CACHE")
        modifier.cache_format, modifier.filepath = suffix.upper(), str(path)
        return path
    return use


def library(item, folder):
    path = folder / "library.blend"
    bpy.data.libraries.write(str(path), {item.data})
    bpy.context.scene.collection.objects.link(bpy.data.objects.new("linked", link(path, "meshes", [item.data.name])[0]))
    return path


def bake(item, folder):
    """Geometry Nodes' bake of the box, in a folder beside the scene."""
    tree = bpy.data.node_groups.new("tree", "GeometryNodeTree")
    for way in ("INPUT", "OUTPUT"):
        tree.interface.new_socket("Geometry", in_out=way, socket_type="NodeSocketGeometry")
    first, kept, last = (tree.nodes.new(kind) for kind in ("NodeGroupInput", "GeometryNodeBake", "NodeGroupOutput"))
    kept.bake_items.new("GEOMETRY", "Geometry")
    tree.links.new(first.outputs[0], kept.inputs["Geometry"])
    tree.links.new(kept.outputs["Geometry"], last.inputs[0])
    modifier = item.modifiers.new("bake", "NODES")
    modifier.node_group, modifier.bake_target = tree, "DISK"
    bpy.ops.wm.save_as_mainfile(filepath=str(folder / "scene.blend"))
    bpy.context.view_layer.update()
    bpy.context.view_layer.objects.active = item
    bpy.ops.object.geometry_node_bake_single(session_uid=item.session_uid, modifier_name="bake",
                                             bake_id=modifier.bakes[0].bake_id)
    (path,) = folder.glob("blendcache_scene/*/*/meta/*.json")
    return path


PC2 = struct.pack("<12siiffi", b"POINTCACHE2\0", 1, 8, 0, 1, 2) + bytes(12 * 8 * 2)
MDD = struct.pack(">2i", 2, 8) + bytes(4 * 2 + 12 * 8 * 2)
READ = {"png": image("png"), "jpg": image("jpg"), "exr": image("exr"), "tif": image("tif"), "webp": image("webp"),
        "world": environment, "film": film, "volume": volume, "alembic": alembic, "light": light,
        "pc2": motion("pc2", PC2), "mdd": motion("mdd", MDD), "library": library}


def noticed(path, state):
    (notice,) = unreadable(bpy.context.scene)
    assert (notice.code, notice.values["path"], notice.values["state"]) == ("file-unreadable", str(path), state)
    return notice.values["kind"]


@pytest.mark.parametrize("name", READ)
def test_every_missing_file_is_named(item, tmp_path, name):
    path = READ[name](item, tmp_path)
    bpy.context.view_layer.update()
    assert unreadable(bpy.context.scene) == []
    path.unlink()
    noticed(path, "missing")
    assert unreadable(bpy.context.scene, seconds=0) == unreadable(bpy.context.scene)


# Blender itself refuses a scene whose library is cut.
@pytest.mark.parametrize(("name", "damage"), [(name, damage) for name in [*READ, "bake"] for damage in (junk, half)
                                              if name != "alembic" and (name, damage) != ("library", half)])
def test_every_damaged_file_is_named(item, tmp_path, name, damage):
    path = (READ | {"bake": bake})[name](item, tmp_path)
    path.write_bytes(damage(path.read_bytes()))
    bpy.ops.wm.save_as_mainfile(filepath=str(tmp_path / "scene.blend"))
    open_scene(tmp_path / "scene.blend")
    noticed(path, "damaged")


@pytest.mark.parametrize("damage", [junk, half])
def test_damaged_geometry_that_ends_blender_is_not_read(item, tmp_path, damage):
    path = alembic(item, tmp_path)
    bpy.ops.wm.save_as_mainfile(filepath=str(tmp_path / "scene.blend"))
    path.write_bytes(damage(path.read_bytes()))
    refuses(f"needs {path}, which is damaged", open_scene, tmp_path / "scene.blend")


def test_a_bake_needs_its_data_which_a_copy_elsewhere_finds(item, tmp_path):
    path = bake(item, tmp_path)
    open_scene(save_copy(path.parent / "scene.blend"))
    assert unreadable(bpy.context.scene) == []
    (blob,) = path.parents[1].glob("blobs/*")
    blob.write_bytes(b"")
    os.utime(path, (1, 1))
    noticed(path, "damaged")
    shutil.rmtree(tmp_path / "blendcache_scene")
    assert noticed(path.parents[2], "missing") == "simulation"


@pytest.mark.parametrize("name", ["volume", "alembic", "png", "light"])
def test_a_pipe_is_not_waited_for(item, tmp_path, name):
    path = READ[name](item, tmp_path)
    bpy.ops.wm.save_as_mainfile(filepath=str(tmp_path / "scene.blend"))
    path.unlink()
    os.mkfifo(path)
    refuses(f"names {path}, which is no regular file", open_scene, tmp_path / "scene.blend")


@pytest.mark.parametrize("suffix", ["png", "jpg"])
def test_a_damaged_image_in_the_file_is_named_and_read_once(item, tmp_path, suffix, monkeypatch):
    path = image(suffix)(item, tmp_path)
    path.write_bytes(half(path.read_bytes()))
    bpy.data.images[0].pack()
    path.unlink()
    noticed(path, "damaged")
    monkeypatch.setattr(image_files, "why_unreadable", lambda _: pytest.fail("it is read again"))
    noticed(path, "damaged")


def test_a_sequence_is_read_at_its_frame(scene, item, tmp_path):
    for number in (1, 2, 3):
        picture(tmp_path / f"flame{number:04d}.png")
    shown = bpy.data.images.load(str(tmp_path / "flame0001.png"))
    shown.source, texture = "SEQUENCE", node(item, "ShaderNodeTexImage")
    texture.image, texture.image_user.frame_duration, texture.image_user.frame_start = shown, 9, 11
    assert [unreadable(scene, frame) for frame in (11, 12, 13)] == [[], [], []]
    assert unreadable(scene, 15)[0].values["path"] == str(tmp_path / "flame0005.png")
    texture.image_user.use_cyclic, texture.image_user.frame_duration = True, 3
    assert unreadable(scene, 15) == []
    (tmp_path / "flame0003.png").unlink()
    os.mkfifo(tmp_path / "flame0003.png")
    refuses("1 of the scene's files cannot be read", check_files, scene, 13, True, lambda _: None)
    (tmp_path / "flame0002.png").write_bytes(b"")
    assert unreadable(scene, 15)[0].values == {"kind": "image", "path": str(tmp_path / "flame0002.png"),
                                               "state": "damaged"}


def test_a_simulation_on_the_disk_is_needed(scene, item, tmp_path):
    bpy.ops.wm.save_as_mainfile(filepath=str(tmp_path / "scene.blend"))
    cache = item.modifiers.new("cloth", "CLOTH").point_cache
    cache.use_disk_cache, cache.frame_end = True, 2
    with bpy.context.temp_override(scene=scene, point_cache=cache, object=item):
        bpy.ops.ptcache.bake(bake=True)
    assert cache.is_baked and unreadable(scene) == []
    with file_copy() as copy:
        assert any(disk_cache(copy).iterdir()), "beside what is rendered, too"
    shutil.rmtree(tmp_path / "blendcache_scene")
    assert noticed(tmp_path / "blendcache_scene", "missing") == "simulation"


def test_every_missing_udim_tile_is_named(scene, item, tmp_path):
    tiles = bpy.data.images.new("skin", 8, 8, tiled=True)
    tiles.tiles.new(1002)
    tiles.filepath = str(tmp_path / "skin.<UDIM>.png")
    node(item, "ShaderNodeTexImage").image = tiles
    assert [Path(notice.values["path"]).name for notice in unreadable(scene)] == ["skin.1001.png", "skin.1002.png"]
    picture(tmp_path / "skin.1001.png")
    noticed(tmp_path / "skin.1002.png", "missing")


def test_what_no_pixel_depends_on_may_be_missing(scene, item, tmp_path):
    lost = bpy.data.images.new("lost", 4, 4)
    lost.source, lost.filepath, lost.use_fake_user = "FILE", str(tmp_path / "lost.png"), True
    (brush := bpy.data.brushes.new("brush")).texture = bpy.data.textures.new("texture", "IMAGE")
    brush.texture.image = scene.camera.data.background_images.new().image = lost
    sketch = bpy.data.objects.new("sketch", None)
    sketch.empty_display_type, sketch.data = "IMAGE", lost
    scene.collection.objects.link(sketch)
    assert unreadable(scene) == []
    item.modifiers.new("bumps", "DISPLACE").texture = brush.texture
    noticed(tmp_path / "lost.png", "missing")


def test_they_are_refused_unless_allowed(scene, item, tmp_path):
    READ["png"](item, tmp_path).unlink()
    said = []
    refuses("1 of .* cannot be read, such as .*wood.png: find or replace", check_files, scene, None, False, said.append)
    assert said == [Notice("file-unreadable", {"kind": "image", "path": str(tmp_path / "wood.png"),
                                               "state": "missing"})]
    check_files(scene, None, True, said.append)
    assert len(said) == 2


def test_missing_images_are_gray_or_flat_and_not_pink(scene, item, tmp_path):
    there, lost, bumps = (bpy.data.images.load(str(picture(tmp_path / f"{name}.png"))) for name in "abc")
    bumps.colorspace_settings.name = "Non-Color"
    texture, reader = node(item, "ShaderNodeTexImage"), node(item, "ShaderNodeNormalMap")
    texture.image, _ = bumps, item.active_material.node_tree.links.new(texture.outputs["Color"], reader.inputs["Color"])
    for path in (tmp_path / "b.png", tmp_path / "c.png", READ["film"](item, tmp_path)):
        path.unlink()
    paint_missing()
    assert unreadable(scene) == [] and there.source == "FILE"
    assert lost.pixels[0] == lost.pixels[1] == lost.pixels[2] and 0.2 < lost.pixels[0] < 0.9
    assert bumps.pixels[:3] == pytest.approx((0.5, 0.5, 1), abs=0.01), "no bumps"
