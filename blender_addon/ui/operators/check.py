"""Buttons of the scene check: run it, select an object, fix a problem; what fixes do, by the code of the problem."""

from collections.abc import Callable
from functools import partial
from typing import Any

import bpy

from lfsr_core.base.messages import LfsrError
from lfsr_core.frames.frame import light_parts

from ...check import last, look
from ...check.problems import INFO
from ...compat import assign, use_nodes
from ...jobs import runtime
from ...render.cards import Wiring
from ...scene import contents
from ...scene import settings as scene_settings
from ...scene.array import rig
from ...scene.array.edit import add, in_front, put, remove
from ...scene.array.rig import Placement, check_editable
from ...scene.contents import BACKGROUND_COLLECTION, GEOMETRY, SWITCHES, find_subject, rendered, switched
from ...scene.light import DEFAULT_LIGHT, illuminate
from ...scene.words import counted, for_panel
from .base import UNDO, AsksForFile, Result, activate, reports_errors

SURFACES = ("MESH", "CURVE", "SURFACE", "FONT", "META")
Fix = Callable[[bpy.types.Scene, str], None]


def _existing(items: bpy.types.bpy_prop_collection, name: str, kind: str = "object") -> Any:
    """Return the one of ``items`` that is called ``name``; LfsrError if it is gone."""
    if (item := items.get(name)) is None:
        raise LfsrError(f"{kind} {name!r} is not there any more: check the scene again")
    return item


def _layer(scene: bpy.types.Scene, name: str) -> bpy.types.ViewLayer:
    return _existing(scene.view_layers, name, "view layer")


def _camera(name: str) -> bpy.types.Camera:
    item = _existing(bpy.data.objects, name)
    if item.type != "CAMERA":
        raise LfsrError(f"object {name!r} is no camera any more: check the scene again")
    check_editable(item.data)
    return item.data


def _set(group: str, **values: object) -> Fix:
    """Fix that sets properties of ``scene.group``."""
    return lambda scene, _target: assign(getattr(scene, group), values)


def _switch_off(switch: str, scene: bpy.types.Scene, target: str) -> None:
    for collection in switched(_layer(scene, target), switch):
        setattr(collection, switch, False)


def _light_images(scene: bpy.types.Scene, _target: str) -> None:
    from ...render.frame_folder import added_light  # reads EXR files, which the panel starts without

    name, scene.lfsr.light_strength = light_parts(added_light(scene, scene_settings.resolve(scene).request))
    scene.lfsr.light = name.upper()


def _leave_out(*items: bpy.types.Object) -> None:
    for item in items:
        check_editable(item)
        item.hide_render = item.hide_viewport = True
    bpy.context.view_layer.update()


def _fit(scene: bpy.types.Scene, _target: str, placed: Placement | None = None) -> None:
    display, subject = scene_settings.display_of(scene), find_subject(scene)
    put(scene, display, placed or in_front(scene, display, set(look.main_objects(scene, subject)) or subject))


def _to_background(scene: bpy.types.Scene, target: str) -> None:
    item = _existing(bpy.data.objects, target)
    background = (bpy.data.collections.get(BACKGROUND_COLLECTION) or bpy.data.collections.new(BACKGROUND_COLLECTION))
    check_editable(background)
    if background not in scene.collection.children_recursive:
        scene.collection.children.link(background)
    if item.name not in background.objects:
        background.objects.link(item)
    for collection in item.users_collection:
        if collection != background and collection.library is None:
            collection.objects.unlink(item)


def _use_defaults(scene: bpy.types.Scene, _target: str) -> None:
    try:
        scene_settings.display_of(scene)
    except LfsrError:
        scene.lfsr.property_unset("display")
    for name in ("scale", "method", "light", "light_strength", "subpixels"):
        scene.lfsr.property_unset(name)


def _show_subject(scene: bpy.types.Scene, _target: str) -> None:
    if not (items := [item for item in scene.objects if item.type in GEOMETRY]):
        raise LfsrError("the scene has nothing to render: add an object")
    for item in (*items, *scene.collection.children_recursive):
        if item.library is None:
            item.hide_render = False


def _add_array(scene: bpy.types.Scene, _target: str) -> None:
    if rig.find(scene) is not None:
        remove(scene)
    add(scene, scene_settings.display_of(scene))


def _show_materials(scene: bpy.types.Scene, _target: str) -> None:
    for material in look.clear_materials(rendered(scene)):
        for node in material.node_tree.nodes:
            if node.type == "BSDF_PRINCIPLED":
                node.inputs["Alpha"].default_value = 1.0


def _show_colors(scene: bpy.types.Scene, _target: str) -> None:
    material = bpy.data.materials.new("Vertex Colors")
    use_nodes(material)
    wiring = Wiring(material.node_tree)
    shader = next(node for node in wiring.tree.nodes if node.type == "BSDF_PRINCIPLED")  # its name may be translated
    wiring.link(wiring.node("ShaderNodeVertexColor").outputs["Color"], shader.inputs["Base Color"])
    for item in look.without_material(rendered(scene)):
        item.data.materials.clear()
        item.data.materials.append(material)


def _shade_creases(scene: bpy.types.Scene, _target: str) -> None:
    display, bare = scene_settings.display_of(scene), bpy.data.materials.new("Clay")
    use_nodes(bare)
    for item in contents.with_copied(rendered(scene)):
        if item.type in SURFACES and not rig.why_not_editable(item.data):
            if not item.material_slots:
                item.data.materials.append(bare)
            for slot in item.material_slots:
                slot.material = slot.material or bare
    array, _ = rig.placement(scene, display) or in_front(scene, display, find_subject(scene))
    for material in contents.materials(scene):
        if (shader := look.plain_shader(material)) is not None and not rig.why_not_editable(material):
            color, wiring = shader.inputs["Base Color"], Wiring(material.node_tree)
            node = wiring.node("ShaderNodeAmbientOcclusion", Color=tuple(color.default_value),
                               Distance=look.CREASE * 2 * array.half_width)
            node.samples = 4  # of Blender's 16: they take as long as all other rays together
            wiring.link(node.outputs["Color"], color)


def _use_one_layer(scene: bpy.types.Scene, target: str) -> None:
    used = _layer(scene, target)
    for layer in scene.view_layers:
        layer.use = layer == used


FIXES: dict[str, Fix] = {
    "cube": lambda _scene, target: _leave_out(_existing(bpy.data.objects, target)),
    "helper": lambda scene, _target: _leave_out(*look.helpers(scene) or look.culled_objects(scene)),
    "plane": lambda scene, _target: look.move_plane(scene), "deep": lambda scene, _target: look.flatten(scene),
    "frame": _fit, "alpha": _show_materials, "colors": _show_colors, "crease": _shade_creases, "dark": _light_images,
    "array": _add_array,
    "light": lambda scene, _target: setattr(illuminate(scene, DEFAULT_LIGHT)[0], "name", "Light Field World"),
    "engine": _set("render", engine="CYCLES"), "script": _set("cycles", device="CPU", shading_system=True),
    "dirty": lambda _scene, target: _existing(bpy.data.images, target, "image").pack(), "background": _to_background,
    "denoise": lambda scene, _target: runtime.use_replacement(scene, scene_settings.resolve(scene)),
    "display": _use_defaults, "subject": _show_subject, "filter": _set("cycles", pixel_filter_type="BOX"),
    "border": _set("render", use_border=False), "aspect": _set("render", pixel_aspect_x=1, pixel_aspect_y=1),
    "clamp": _set("cycles", sample_clamp_direct=0, sample_clamp_indirect=10),
    "focus": lambda _scene, target: setattr(_camera(target).dof, "use_dof", False),
    "shift": lambda _scene, target: assign(_camera(target), {"shift_x": 0.0, "shift_y": 0.0}),
    "world": lambda scene, target: setattr(_layer(scene, target), "world_override", None),
    "override": lambda scene, target: setattr(_layer(scene, target), "material_override", None),
    "layers": _use_one_layer, "rig": _add_array, **{switch: partial(_switch_off, switch) for switch in SWITCHES},
    "compositor": _set("render", use_compositing=False), "sequencer": _set("render", use_sequencer=False),
    "view": _set("view_settings", use_curve_mapping=False, use_white_balance=False),
    "catcher": _set("render", film_transparent=True), "motion": _set("render", use_motion_blur=False)}
OUTSIDE_SCENE = ("dirty", "focus", "shift")  # fixes that change more than the scene
# Fixes that Blender's own operators do, some after asking for a file.
OPERATORS: dict[str, tuple[str, dict[str, object]]] = {
    "cycles": ("screen.userpref_show", {"section": "ADDONS"}),
    "unsaved": ("wm.save_mainfile", {}), "texture": ("file.find_missing_files", {}),
    "autoexec": ("wm.revert_mainfile", {"use_scripts": True}),
    "output": ("lfsr.choose_output", {}), "disk": ("lfsr.choose_output", {}),
    "temporary": ("screen.userpref_show", {"section": "FILE_PATHS"})}


class LFSR_OT_check_scene(bpy.types.Operator):
    """List what will go wrong with this scene on this display"""

    bl_idname = "lfsr.check_scene"
    bl_label = "Check Scene"

    @reports_errors
    def execute(self, context: bpy.types.Context) -> Result:
        problems = last.check(context.scene)
        if serious := [problem for problem in problems if problem.severity != INFO]:
            self.report({"WARNING"}, f"{counted(len(serious), 'problem')} found, first {serious[0].target}: "
                        f"{for_panel(serious[0].reason)}")
        else:
            ignored = f"; renders ignore {counted(len(problems), 'setting')}" if problems else ""
            self.report({"INFO"}, f"No problems found{ignored}")
        return {"FINISHED"}


class LFSR_OT_check_select(bpy.types.Operator):
    """Select the objects that have the problem"""

    bl_idname = "lfsr.check_select"
    bl_label = "Select Objects with Problem"
    bl_options = UNDO

    code: bpy.props.StringProperty(name="Code", description="Kind of problem")
    target: bpy.props.StringProperty(name="Name", description="Object to select, empty for all with the problem")

    @reports_errors
    def execute(self, context: bpy.types.Context) -> Result:
        names = [self.target] if self.target else [problem.target for problem in last.problems(self.code)]
        if not (items := [_existing(bpy.data.objects, name) for name in names]):
            raise LfsrError("no object has this problem any more: check the scene again")
        activate(context, items[0])
        for item in items:
            if item.name in context.view_layer.objects:
                item.select_set(True)
        return {"FINISHED"}


class LFSR_OT_check_fix(bpy.types.Operator):
    """Fix the problem"""

    bl_idname = "lfsr.check_fix"
    bl_label = "Fix Problem"
    bl_options = UNDO

    code: bpy.props.StringProperty(name="Code", description="Kind of problem")
    target: bpy.props.StringProperty(name="Name", description="What has the problem, empty for all that have it")

    @reports_errors
    def execute(self, context: bpy.types.Context) -> Result:
        if self.code not in FIXES:
            raise LfsrError(f"problem {self.code!r} cannot be fixed by a button: choose one of {', '.join(FIXES)}")
        if self.code not in OUTSIDE_SCENE:
            check_editable(context.scene)
        every = [problem.target for problem in last.problems(self.code)]
        for target in [self.target] if self.target or len(every) < 2 else every:
            FIXES[self.code](context.scene, target)
        last.check(context.scene)
        return {"FINISHED"}


class LFSR_OT_choose_output(AsksForFile, bpy.types.Operator):
    """Choose another folder for the images of this scene"""

    bl_idname = "lfsr.choose_output"
    bl_label = "Choose Output Folder"
    bl_options = UNDO

    directory: bpy.props.StringProperty(name="Folder", description="Folder for the images of this scene",
        subtype="DIR_PATH", options={"SKIP_SAVE", "PATH_SUPPORTS_BLEND_RELATIVE"})
    filter_folder: bpy.props.BoolProperty(
        name="Folders", description="Show folders only", default=True, options={"HIDDEN"})

    @reports_errors
    def execute(self, context: bpy.types.Context) -> Result:
        check_editable(context.scene)
        context.scene.lfsr.output = self.directory
        last.check(context.scene)
        return {"FINISHED"}


CLASSES = (LFSR_OT_check_scene, LFSR_OT_check_select, LFSR_OT_check_fix, LFSR_OT_choose_output)
