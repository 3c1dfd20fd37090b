"""Look at the scene from its camera array before a render: is the subject in the frame, lit, and not too deep?

Rays through what is rendered tell that in a fraction of a second. A problem has a mend, which the dialog of a render
offers ticked, in the order of MENDS: each problem is looked for as if the mends before it were applied.
"""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Iterable, Iterator
from contextlib import suppress
from pathlib import Path

import bpy
import mathutils
import numpy as np

from lfsr_core.base.messages import LfsrError
from lfsr_core.optics.display import DisplayProfile
from lfsr_core.optics.rays import CameraArray

from ..scene import settings as scene_settings
from ..scene.array import edit, placement, rig
from ..scene.array.placement import Rays, as_rendered, through
from ..scene.contents import GEOMETRY, find_subject, has_output, nodes_of, rendered, rendered_layer, shows, with_copied
from ..scene.files import image_paths
from ..scene.light import DIM, SCENE_LIGHTS, has_emission, has_light, is_dim, world_radiance
from ..scene.settings import length
from ..scene.words import counted
from .problems import Problem

# Code of the problem: the operator's property that mends it, its title and description.
MENDS = {
    "cube": ("leave_out_cube", "Leave Out Cube", "Hide the cube of Blender's new file in renders"),
    "helper": ("leave_out_helpers", "Leave Out Helpers", "Hide what helps while modelling, as a box of wires, and "
               "what hides the picture with faces that EEVEE leaves out"),
    "frame": ("fit_objects", "Fit to Objects", "Move the camera array in front of the objects, or into the room"),
    "plane": ("move_plane", "Move Display Plane", "Move the display plane to the middle of the depth that is seen"),
    "deep": ("flatten_depth", "Flatten Depth", "Bring the views together, so that the display shows all depths sharp"),
    "alpha": ("show_materials", "Show Materials", "Set Alpha to 1 in what was imported with Alpha 0"),
    "colors": ("show_colors", "Show Vertex Colors", "Give what came without a material one that shows its colors"),
    "crease": ("shade_creases", "Shade Creases", "Darken corners and creases of what has no color, by a node Ambient "
               "Occlusion in its materials"),
    "dark": ("add_light", "Add World Light", "Light the images with one of Blender's world images, or a room with even "
             "light; the scene keeps its own light")}
STARTUP_LAMP = (4.07625, 1.00545, 5.90386)  # where a new file's lamp stands
STARTUP_CAMERAS = ((7.35889, -6.92579, 4.95831), (7.48113, -6.50764, 5.34367))  # and its camera; until Blender 2.79
# How a new file's camera is turned: nobody has aimed it, even if it was moved. It was rolled until Blender 2.79.
STARTUP_TURN, ROLL = mathutils.Euler((1.10932, 0.0, 0.81493)).to_quaternion(), 0.02
TINY, SMALL = 0.01, 0.1  # least fraction of the picture that the subject fills: of an aimed camera, of an unaimed one
CUT = 0.15  # part of the vertices outside the picture, from which a camera that was moved but not turned is wrong
SMALLER = 0.4  # of what it might fill from elsewhere, times the number of things that are seen
HEAVY, HIDDEN = 100, 0.25  # faces from which a mesh is more than a box, part of the picture that a box may hide
CLOSE = 0.02  # of the subject's size: the array is inside an object whose inner side is nearer than that
NARROW, FLAT = 0.25, 0.5  # part of the display's spacing of views, and disparity, below which an image is almost flat
MUCH, LEAST_GAIN = 1.1, 0.9  # disparity that is reported; a display plane is moved if less than this fraction is left
BRIGHT = 0.25  # fraction of the picture from which a sky keeps it from being almost black
CREASE, CREASED = 0.08, 0.04  # reach of a crease, of the picture's width; part of the rays around that meet one
PLAIN, GRAY, LIGHT = 0.9, 0.02, 0.5  # part of what is seen that has no color, and what a gray differs by and reaches
GLASS, TRANSMISSION, LOST = ("BSDF_GLASS", "BSDF_REFRACTION"), "Transmission Weight", 0.2  # of the rays to it
newest = 0  # session_uid of the last object that came with the file, which ``last`` notes when one is opened


def find(scene: bpy.types.Scene) -> Iterator[Problem]:
    """Problems of what the scene's array sees that a mend can remove; none without an array."""
    with suppress(LfsrError):  # what is broken is found by other checks
        display, subject = scene_settings.display_of(scene), find_subject(scene)
        if (placed := rig.placement(scene, display)) is None:
            return
        cube, others = startup_cube(scene), (tools := helpers(scene)) or culled_objects(scene)
        if cube is not None:
            yield _problem("cube", cube.name, "The cube of Blender's new file stands in the picture.")
        if others:
            more = f" and {counted(len(others) - 1, 'other object')}" if others[1:] else ""
            yield _problem("helper", others[0].name, f"{others[0].name}{more} " + (
                "would be rendered solid: drawn as wires, a Boolean's tool or a bone's shape." if tools else
                "hides the picture with its backs, which EEVEE leaves out."))
        hidden = {item for item in rendered(scene) if not item.visible_get()}
        with as_rendered(cube, *others):
            if all(item.type == "MESH" and not item.modifiers and not item.data.polygons
                   for item in edit.boxes_now(subject)):
                yield _problem("nothing", scene.name, f"Frame {scene.frame_current} shows no face: choose another, or "
                               "show points as spheres, by Mesh to Points in Geometry Nodes.")
                return
            yield from _found(scene, placed, display, subject, main_objects(scene, subject), hidden)


def _found(scene: bpy.types.Scene, placed: rig.Placement, display: DisplayProfile, subject: set[bpy.types.Object],
           main: list[bpy.types.Object], hidden: set[bpy.types.Object]) -> Iterator[Problem]:
    is_new, rays = _is_unaimed(scene), Rays(scene)  # an artist who has not aimed the camera has not placed lamps
    reason, best = _out_of_frame(scene, rays, placed, display, main, shown := with_copied(set(main)))
    if reason:
        is_new, placed = True, best or edit.in_front(scene, display, set(main))
        yield _problem("frame", main[0].name if main else scene.name, reason, placed)
    if clear := clear_materials(main):
        yield _problem("alpha", scene.name, f"{counted(len(clear), 'material')} came with Alpha 0: they show nothing.")
    if bare := without_material(main):
        yield _problem("colors", bare[0].name, f"{bare[0].name} has colors of its vertices, but no material: it would "
                       "be gray.")
    elif _has_plain_creases(rays, placed, shown):
        yield _problem("crease", scene.name, "Nothing that is seen has a color: corners and edges would hardly show.")
    if depths := depths_of(rays, placed, shown):
        widest = placement.narrowed(rays, (dataclasses.replace(placed[0], spacing=math.inf), placed[1]), display,
                                    placed[0].distance)
        part = rig.part_of_spacing(widest, display)
        if part < NARROW and disparity(widest, display.lenses, *depths) < FLAT:
            yield _problem("walls", scene.name, "What stands beside the array leaves its views "
                           f"{100 * part:.0f}\N{NO-BREAK SPACE}% of the display's spacing: the image is almost flat. "
                           "Move the camera away from it for more depth.")
        yield from _deep(rays, placed, display, *depths)
    seen = [hit[2] for hit in through(rays, placed, *edit.FEWER) if hit] if hidden else []
    item = max(hidden & {*seen}, key=seen.count, default=None)
    if item is not None and 2 * seen.count(item) > len(seen) and not any(  # the viewport may show a copy of it
            copy.is_instance and copy.object.original == item for copy in rays.depsgraph.object_instances):
        yield _problem("hidden", item.name, f"{item.name} fills most of the picture: renders show it, though the "
                       "viewport does not. Hide it in renders, too, unless it belongs there.")
    if scene.lfsr.light not in SCENE_LIGHTS or not has_light(scene):
        return
    pictures = [node.image for node in nodes_of(scene.world.node_tree if scene.world else None)
                if node.type == "TEX_ENVIRONMENT" and node.image]
    for image in pictures:
        if not all(map(Path.is_file, image_paths(image))):
            yield _problem("dark", scene.name, f"The world's image {image.name} is missing: gray light would come "
                           "from all sides. Add World Light changes the rendered images only.")
            return
    lamps = sorted((item for item in rendered(scene) if item.type == "LIGHT"), key=lambda item: item.name)
    is_imported = bool(reason) or startup_cube(scene) is not None  # the lamp of the new file was not placed for it
    own = [item for item in lamps if not is_imported
           or (item.matrix_world.translation - mathutils.Vector(STARTUP_LAMP)).length > 1e-3]
    startup = next((item for item in lamps if item not in own), None)
    exposed, is_plain = 2.0**scene.view_settings.exposure, not own and not has_emission(scene)
    is_alone = is_plain and world_radiance(scene.world) * exposed < DIM
    light = radiance = np.empty(0)
    if not is_alone:
        from ..render.frame_folder import light_seen  # reads EXR files, which the panel starts without

        with as_rendered(startup):  # without that lamp
            light, radiance = light_seen(scene, scene_settings.resolve(scene).request, placed)
    is_dark, sky = is_dim(light, radiance, is_composed=not is_new), 0.0
    if is_dark and not scene.render.film_transparent and world_radiance(scene.world) * exposed >= DIM:
        sky = through(rays, placed, *edit.FEWER).count(None) / math.prod(edit.FEWER)
    if is_dark and not is_alone and has_output(scene, "Volume"):
        yield _problem("fog", scene.name, "Hardly any light comes from what the array sees: the image will be dark. "
                       "Light from all sides would show a volume alone: aim lamps at the objects.")
    elif is_alone or (is_dark and (pictures or sky < BRIGHT)):  # what a picture shows is not known
        source = "a dim world" if startup is None else "the lamp of Blender's new file"
        yield _problem("dark", scene.name, f"Only {source} lights it. Add World Light changes the rendered images only."
                       if is_alone else "Hardly any light comes from what the array sees: the image will be almost "
                       "black. Add World Light changes the rendered images only"
                       f"{', which then do not show the sky' if sky else ''}; the scene keeps its own light.")
    elif world_radiance(scene.world, 0) and (glass := _lost_glass(rays, placed, shown)):
        yield _problem("dark", scene.name, f"{glass} is of glass, which shows what is around it: hardly anything in a "
                       "world of one color. Add World Light changes the rendered images only.")


def _problem(code: str, target: str, reason: str, placed: rig.Placement | None = None) -> Problem:
    title = {"plane": "Depth", "deep": "Depth", "walls": "Depth", "dark": "Light", "fog": "Light"}.get(code, "")
    return Problem(code, target, reason, MENDS.get(code, ("", "", ""))[1], asks=True, title=title, placed=placed)


def startup_cube(scene: bpy.types.Scene) -> bpy.types.Object | None:
    """Return the cube of Blender's new file, where it was left in a scene of other things."""
    cube = scene.objects.get("Cube")
    others = any(item.type in GEOMETRY and item != cube for item in scene.objects)
    is_new = (cube is not None and others and cube.type == "MESH" and len(cube.data.vertices) == 8
              and cube in rendered(scene) and not cube.modifiers and _is_unaimed(scene)
              and cube.matrix_world == mathutils.Matrix.Identity(4) and tuple(cube.dimensions) == (2.0, 2.0, 2.0)
              and [slot.name for slot in cube.material_slots] in ([], ["Material"]))
    return cube if is_new else None


def helpers(scene: bpy.types.Scene) -> list[bpy.types.Object]:
    """Return objects without a material that are drawn as wires or bounds, are a Boolean's tool or a bone's shape.

    They help while modelling. So do boxes of wires that hide much of the picture. Empty where nothing else is shown.
    """
    tools = {modifier.object for item in scene.objects for modifier in item.modifiers if modifier.type == "BOOLEAN"}
    tools |= {bone.custom_shape for item in scene.objects if item.pose is not None for bone in item.pose.bones}
    shown = {item for item in rendered(scene) & {*rendered_layer(scene).objects} if item.type in GEOMETRY}
    drawn = {item for item in shown if item.display_type in ("WIRE", "BOUNDS")}
    bare = {item for item in tools & shown | drawn if not any(slot.material for slot in item.material_slots)
            and not rig.why_not_editable(item)
            and not any(modifier.type in ("FLUID", "PARTICLE_SYSTEM") for modifier in item.modifiers)}
    bare |= _hulls(scene, drawn - bare, *bare)
    return sorted(bare, key=lambda item: item.name) if shown - bare else []


def _hulls(scene: bpy.types.Scene, drawn: set[bpy.types.Object], *left_out: bpy.types.Object) -> set[bpy.types.Object]:
    """Return those ``drawn`` as wires that are boxes, not smoke or heavy things, if they hide much of the picture."""
    hulls = {item for item in drawn if item.type == "MESH" and not item.modifiers and len(item.data.polygons) < HEAVY
             and not rig.why_not_editable(item) and not any(
                 "VOLUME" in node.type or node.type in (*GLASS, "BSDF_TRANSPARENT") for slot in item.material_slots
                 if slot.material for node in nodes_of(slot.material.node_tree))}
    if not hulls or (placed := rig.placement(scene, scene_settings.display_of(scene))) is None:
        return set()
    with as_rendered(*left_out):
        rays, eye = Rays(scene), mathutils.Matrix(placed[1]).translation

        def holds(place: mathutils.Vector, way: mathutils.Vector) -> bool:
            hit = rays.beyond(place, way)
            return hit is not None and (hit[2] not in hulls or (hit[1].dot(way) < 0 and holds(hit[0], way)))
        hidden = [hit is not None and hit[1] and hit[2] in hulls and holds(hit[0], hit[0] - eye)
                  for hit in through(rays, placed, *edit.FEWER)]
    return hulls if sum(hidden) > HIDDEN * len(hidden) else set()


@as_rendered()
def culled_objects(scene: bpy.types.Scene) -> list[bpy.types.Object]:
    """Return what hides most of an aimed camera's picture with its backs, which EEVEE leaves out."""
    placed, camera = rig.placement(scene, scene_settings.display_of(scene)), scene.camera
    if placed is None or camera is None or camera.type != "CAMERA" or _is_unaimed(scene):
        return []
    is_eevee = scene.render.engine.startswith("BLENDER_EEVEE")
    culled = {material for material in bpy.data.materials if is_eevee and material.use_backface_culling}
    hits = through(Rays(scene), placed, *edit.FEWER) if culled else []
    seen = [(hit[2], not hit[1] and hit[2].active_material in culled
             and all(slot.material in culled for slot in hit[2].material_slots)) for hit in hits if hit is not None]
    return [item for item in dict(seen) if seen.count((item, True)) > len(hits) / 2
            and (item, False) not in seen and len(edit.boxes_now(find_subject(scene))) > 1]


def _is_unaimed(scene: bpy.types.Scene) -> bool:
    camera = scene.camera
    return (camera is not None and camera.type == "CAMERA" and not camera.animation_data
            and camera.matrix_world.to_quaternion().rotation_difference(STARTUP_TURN).angle < ROLL)


def main_objects(scene: bpy.types.Scene, subject: set[bpy.types.Object]) -> list[bpy.types.Object]:
    """Return the main objects of a picture, largest first, without floors: those that came since the file was opened.

    Of a camera that was aimed, or where nothing came, all are.
    """
    others = {startup_cube(scene), *helpers(scene)}
    boxes = {item: box for item, box in edit.boxes_now(subject).items() if item not in others}
    boxes = {item: box for item, box in boxes.items() if not _is_lamp(item)} or boxes
    chosen = [item for item in boxes if item.session_uid > newest] if _is_unaimed(scene) else []
    chosen = edit.main_part({item: boxes[item] for item in chosen or boxes})
    sizes = np.linalg.norm(np.ptp(edit.bounds([boxes[item] for item in chosen]), axis=1), axis=-1)
    return [chosen[number] for number in np.argsort(-sizes, kind="stable")]


def clear_materials(items: Iterable[bpy.types.Object]) -> set[bpy.types.Material]:
    """Return materials that show nothing, of what came since the file was opened."""
    slots = (slot for item in items if item.session_uid > newest for slot in item.material_slots)
    return {slot.material for slot in slots if slot.material and not shows(slot.material)}


def without_material(items: Iterable[bpy.types.Object]) -> list[bpy.types.Object]:
    """Return what came since the file was opened with colors of its vertices and no material, as a scan."""
    return [item for item in items if item.type == "MESH" and item.session_uid > newest and item.data.color_attributes
            and not any(item.data.materials)]


def plain_shader(material: bpy.types.Material) -> bpy.types.Node | None:
    """Return the shader of a material that nobody has given a color: a light gray one, of no metal or glass."""
    output = material.node_tree.get_output_node("CYCLES") if material.node_tree else None
    shader = next((link.from_node for link in output.inputs["Surface"].links), None) if output else None
    if shader is None or shader.type != "BSDF_PRINCIPLED" or shader.inputs["Base Color"].is_linked:
        return None
    color = shader.inputs["Base Color"].default_value[:3]
    is_solid = not any(shader.inputs[name].default_value for name in ("Metallic", TRANSMISSION))
    return shader if is_solid and min(color) >= LIGHT and max(color) - min(color) < GRAY else None


def _has_plain_creases(rays: Rays, placed: rig.Placement, shown: set[bpy.types.Object]) -> bool:
    hits = [hit for hit in through(rays, placed, *edit.FEWER) if hit is not None and hit[2] in shown]
    if not hits or sum(hit[3][1] is None or plain_shader(hit[3][1]) is not None for hit in hits) <= PLAIN * len(hits):
        return False
    return bool((edit.around(rays, hits) < CREASE * 2 * placed[0].half_width).mean() > CREASED)


def _is_lamp(item: bpy.types.Object) -> bool:
    """Return True for a flat box or a plane of one colour that only shines, as photographers light with."""
    nodes = {node.type for slot in item.material_slots if slot.material for node in nodes_of(slot.material.node_tree)}
    return (item.type == "MESH" and len(item.data.polygons) <= 6 and nodes == {"EMISSION", "OUTPUT_MATERIAL"}
            and min(item.dimensions) < edit.FLAT * max(item.dimensions))


def depths_of(rays: Rays, placed: rig.Placement, shown: set[bpy.types.Object]) -> tuple[float, ...]:
    """Nearest and farthest depth at which the middle of an array sees what is ``shown``; empty where it sees none."""
    depths = placement.seen_depths(rays.scene, placed, shown, rays)
    return tuple(map(float, np.percentile(depths, (2, 98)))) if len(depths) else ()


def _out_of_frame(scene: bpy.types.Scene, rays: Rays, placed: rig.Placement, display: DisplayProfile,
                  main: list[bpy.types.Object], shown: set[bpy.types.Object]) -> tuple[str, rig.Placement | None]:
    """Why the picture does not show the main objects as it should, "" if it does, and a better place if known."""
    if not (boxes := edit.boxes_now(set(main))):
        return "", None
    eye, hits = mathutils.Matrix(placed[1]), through(rays, placed)
    seen = [hit for hit in hits if hit is not None and hit[2] in shown]
    share = len(seen) / len(hits)
    aside = eye.inverted() @ scene.camera.matrix_world.translation if _is_unaimed(scene) else mathutils.Vector((9,) * 3)
    is_unaimed = (aside.xy if aside.z > 1 else aside).length < 1e-3  # the eye of a parallel camera lies far behind it
    [(low, high)] = edit.bounds([np.concatenate([*boxes.values()])])
    name = main[0].name if len(main) == 1 else f"{main[0].name} with {counted(len(main) - 1, 'other object')}"

    def is_in_box(place: rig.Placement) -> bool:
        at = np.array(place[1])[:3, 3]
        return bool((at > low).all() and (at < high).all())
    inner = [(hit[2], (hit[0] - eye.translation).length) for hit in hits if hit is not None and not hit[1]]
    if len(inner) > len(hits) / 2 and is_in_box(placed) and np.median([far for _, far in inner]) < (
            0.5 if is_unaimed else CLOSE) * math.dist(low, high):
        best = edit.in_front(scene, display, set(main))
        if not is_in_box(best):
            return f"The array stands inside {inner[0][0].name}.", best
    # A camera that was aimed stays where rays do not meet what it shows, or where the objects would be no larger.
    if not (seen or is_unaimed) and (hits.count(None) <= len(hits) / 2 or has_output(scene, "Displacement")):
        return "", None
    if is_unaimed or share < TINY:
        best = edit.in_front(scene, display, set(main))
        better = [hit for hit in through(rays, best) if hit is not None and hit[2] in shown]
        if not is_unaimed and len(better) <= len(seen):
            return "", None
        worth, most = (len(shares) * len({hit[3] for hit in shares}) for shares in (seen, better))
        is_wrong = share < SMALL or worth < most * SMALLER or (is_in_box(best) and not is_in_box(placed))
        if is_unaimed:
            points = [*placement.world_points(set(main))] if len(main) <= edit.FEW_OBJECTS else []
            local = (np.concatenate(points or [*boxes.values()]) - eye.translation) @ np.array(eye.to_3x3())
            is_cut = (np.abs(local[:, :2]) * placed[0].distance > local[:, 2:] * placed[0].half_size).any(1)
            is_moved = all(math.dist(scene.camera.matrix_world.translation, at) > 0.01 for at in STARTUP_CAMERAS)
            is_wrong |= bool(is_cut.mean() > CUT if is_moved else is_cut.any())
        if is_wrong:
            return (f"The camera of the new file was not aimed at {name}." if is_unaimed else "The array sees nothing "
                    f"of {name}." if not seen else f"{name} fills less than 1% of the picture."), best
    return "", None


def disparity(array: CameraArray, lenses: tuple[int, int], near: float, far: float,
              distance: float | None = None) -> float:
    """Return the largest disparity, in lenses from view to view, of depths from ``near`` to ``far``.

    A display shows at most 1 sharp. ``distance``: of the display plane, by default the array's.
    """
    plane, pitch = distance or array.distance, min(2 * array.half_width / lenses[0], 2 * array.half_height / lenses[1])
    return array.spacing / pitch * max((plane - near) / near, (far - plane) / far)


def _deep(rays: Rays, placed: rig.Placement, display: DisplayProfile, near: float, far: float) -> Iterator[Problem]:
    scene, array, at = rays.scene, placed[0], placed[0].distance
    if (now := disparity(array, display.lenses, near, far)) <= MUCH:
        return
    first, last = rig.usable_depth(array, display)
    text = (f"The depth reaches {length(scene, max(at - near, 0.0))} before the display and "
            f"{length(scene, max(far - at, 0.0))} behind it. The display shows {length(scene, at - first)} and "
            f"{'any depth' if math.isinf(last) else length(scene, last - at)}.")
    plane = placement.balanced(near, far)
    moved = disparity(placement.narrowed(rays, placed, display, plane), display.lenses, near, far, plane)
    if moved < LEAST_GAIN * now:
        yield _problem("plane", scene.name, text)
        now = moved
    if now > MUCH:
        yield _problem("deep", scene.name, f"{text} Flattened to {100 / now:.0f}\N{NO-BREAK SPACE}%, with views closer "
                       "together, all of it is sharp; what is seen from the middle stays as it is.")


def flatten(scene: bpy.types.Scene) -> None:
    """Bring the array's views so close together that the display shows all of the depth that is seen."""
    (array, _), near, far = _seen(scene)
    now = disparity(array, scene_settings.display_of(scene).lenses, near, far)
    rig.set_spacing(scene, rig.spacing_of(rig.find(scene)) / max(now, 1.0))


@as_rendered()
def move_plane(scene: bpy.types.Scene) -> None:
    """Move the display plane to where what is nearest and what is farthest have the same parallax."""
    placed, near, far = _seen(scene)
    plane, display = placement.balanced(near, far), scene_settings.display_of(scene)
    rig.set_spacing(scene, rig.part_of_spacing(placement.narrowed(Rays(scene), placed, display, plane), display))
    rig.set_distance(scene, plane)


@as_rendered()
def _seen(scene: bpy.types.Scene) -> tuple[rig.Placement, float, float]:
    placed = rig.placement(scene, scene_settings.display_of(scene))
    main = main_objects(scene, find_subject(scene))
    depths = depths_of(Rays(scene), placed, with_copied(set(main))) if placed else ()
    if placed is None or not depths:
        raise LfsrError("the camera array sees nothing of the subject: fit it to the objects first")
    return placed, depths[0], depths[1]


def _lost_glass(rays: Rays, placed: rig.Placement, shown: set[bpy.types.Object]) -> str:
    """Name of an object of glass, if nothing is behind much of what the array sees of what is ``shown``, else ""."""
    eye = mathutils.Matrix(placed[1]).translation
    hits = [hit for hit in through(rays, placed) if hit is not None and hit[2] in shown]

    def is_lost(place: mathutils.Vector, way: mathutils.Vector, material: bpy.types.Material | None) -> bool:
        nodes = nodes_of(material.node_tree if material else None)
        if not any(node.type in GLASS or (TRANSMISSION in node.inputs and node.inputs[TRANSMISSION].default_value > 0.5)
                   for node in nodes):
            return False
        hit = rays.beyond(place, way)
        return hit is None or is_lost(hit[0], way, rays.thing(hit)[1])
    lost = [hit[2].name for hit in hits if is_lost(hit[0], hit[0] - eye, hit[3][1])]
    return lost[0] if len(lost) > LOST * len(hits) else ""
