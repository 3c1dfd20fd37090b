"""The live scenes: they show the artist's scene, as their background set, through a card, and never change it.

One shows the panel's image, the other what an eye in front of the display sees. All their data is marked, so that it
can be found and removed, also after an undo or in a file that was recovered from a crash.

The viewport compositor interpolates inside each elemental image, as the method ``bilinear`` offline: encode as
``reconstruct.upscaler``, mix the four rendered views around each pixel linearly, and decode.
"""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Callable
from contextlib import suppress
from typing import Any

import bpy
import mathutils

from lfsr_core.base.messages import LfsrError
from lfsr_core.frames.frame import AUTO, CLAMP_INDIRECT, EVEN, OWN
from lfsr_core.optics.display import DisplayProfile
from lfsr_core.optics.eye import LiveRegion, Point, eye_card, eye_place, eye_region
from lfsr_core.optics.panel.panel_card import PanelCard, panel_card
from lfsr_core.optics.panel.subpixel_rays import PanelLayout
from lfsr_core.optics.rays import LensCard, RayLayout, lens_card

from .. import compat
from ..render.cards import Wiring, distance_to_volume, new_camera, new_card, new_panel_card, place_of
from ..scene.array import rig
from ..scene.light import DEFAULT_LIGHT, has_light, illuminate
from ..scene.settings import display_of, live_samples, live_scale, resolve

MARK, LIGHT = "lfsr_live", "lfsr_light"  # LIGHT: of the live scene and its lights, the setting that they follow
# Kinds of live view, and values of MARK.
PANEL, EYE = "panel", "eye"
NAMES = {PANEL: "LFSR Live", EYE: "LFSR Live Eye"}
KINDS = ("scenes", "objects", "meshes", "cameras", "materials", "node_groups", "lights", "worlds", "images")
# Settings of the artist's scene that decide how Cycles and Blender show it.
COPIED = ("render", "cycles", "view_settings", "display_settings")
COMPOSITOR = "LFSR Live"
ENCODE, DECODE, INTERPOLATE = f"{COMPOSITOR} Encode", f"{COMPOSITOR} Decode", f"{COMPOSITOR} Interpolation"


@dataclasses.dataclass(frozen=True)
class View:
    """What a live view shows; a change rebuilds the live scene."""

    region: LiveRegion
    layout: RayLayout | PanelLayout  # the rendered views, or the subpixels of a panel with a lens sheet
    profile: DisplayProfile
    follows: str  # name of the array's viewing position, which the card follows
    far: float  # distance from the world's origin, rounded up to a power of two
    clear: float  # distance to the nearest volume, rounded down to a power of two
    smooth: bool  # interpolated inside each elemental image
    eye: Point | None = None  # where the eye stands, None for the panel's image

    @property
    def kind(self) -> str:
        """PANEL or EYE."""
        return PANEL if self.eye is None else EYE


def view_of(scene: bpy.types.Scene, size: tuple[int, int], kind: str = PANEL) -> View:
    """Return the view of ``scene`` in a region of ``size``; LfsrError if it cannot be shown."""
    lfsr, profile = scene.lfsr, display_of(scene)
    scale = live_scale(scene, profile, kind == EYE)
    profile.low_views(scale)
    placed, array = rig.placement(scene, profile), rig.find(scene)
    if placed is None or array is None:
        raise LfsrError("the live view needs a camera array: press Add in Camera Array")
    if rig.is_mirrored(array):
        raise LfsrError(f"camera array {array.name!r} is mirrored by a negative scale, which the live view cannot "
                        "follow: make its scale, and its parents', positive")
    region, eye = LiveRegion(profile, size, scale), None
    if kind == EYE:
        region = eye_region(profile, size)
        eye = eye_place(profile, lfsr.live_eye_right, lfsr.live_eye_up, lfsr.live_eye_near)
    place, direct = array.matrix_world.translation, kind == PANEL and profile.is_woven
    layout = PanelLayout(profile, placed[0]) if direct else RayLayout.for_display(profile, placed[0], scale)
    return View(region, layout, profile, array.name, _above(place.length),
                _above(distance_to_volume(scene, place)) / 2,
                lfsr.live_smooth and kind == PANEL and region.scale > 1, eye)


def _above(length: float) -> float:
    return 2.0 ** math.ceil(math.log2(length)) if 0 < length < math.inf else length


def make(scene: bpy.types.Scene, view: View) -> bpy.types.Scene:
    """Return a new live scene of ``scene``; an error leaves nothing behind."""
    live = bpy.data.scenes.new(NAMES[view.kind])
    try:
        live[MARK], live[LIGHT] = view.kind, ""
        live.background_set = scene
        show(live, view)
    except BaseException:
        remove_all(view.kind)
        raise
    return live


def show(live: bpy.types.Scene, view: View) -> None:
    """Let ``live`` show ``view`` instead of what it showed."""
    _remove([item for item in marked(view.kind) if LIGHT not in item])
    region = view.region
    live.render.preview_pixel_size = str(region.scale)
    follow(live)
    live.render.resolution_x, live.render.resolution_y = region.size
    live.render.use_border = region.drawn != region.size
    # Half a pixel more, since Cycles rounds down.
    live.render.border_max_x, live.render.border_max_y = (
        min(1.0, (region.drawn[axis] + 0.5) / region.size[axis]) for axis in (0, 1))
    array, made = view.layout.array, list[bpy.types.ID]()
    place, before = place_of(array, view.far), set(bpy.data.node_groups)
    try:
        card: PanelCard | LensCard
        if isinstance(view.layout, PanelLayout):
            card = panel = panel_card(view.layout, view.clear, of_subpixels=False)
            screen = new_panel_card(made, panel, array.distance, place)
        else:
            lenses = lens_card(view.layout, view.clear)
            if view.eye is not None:
                lenses = eye_card(view.layout, view.profile, view.eye, region, view.clear)
            elif view.profile.ei_order == "flipped":
                lenses = dataclasses.replace(lenses, cells=view.layout.views - lenses.cells)
            card, screen = lenses, new_card(made, lenses, array.distance, place)
        camera = new_camera(made, region.size[0] * card.pixel / region.scale, card.spreads, place)
        for item in (camera, screen):
            live.collection.objects.link(item)
        # Its frame is shifted, by fractions of its width, so that the card is in the panel's place. The camera must not
        # move: its place is the rays' origin.
        camera.data.shift_x, camera.data.shift_y = (-length / region.size[0] for length in region.shift)
        # The card follows the array; the distances behind it are in the mesh and in the camera's own location.
        screen.data.transform(mathutils.Matrix.Translation((0, 0, place.gap / 2)))
        camera.parent, camera.location = screen, (0, 0, place.gap)
        # Without the array's scale, as the rays.
        for kind in ("COPY_LOCATION", "COPY_ROTATION"):
            screen.constraints.new(kind).target = bpy.data.objects[view.follows]
        live.camera = camera
        if can_interpolate():
            # Its render over the display's background, interpolated where that is asked for.
            wiring = _Wiring(COMPOSITOR)
            layers = wiring.node("CompositorNodeRLayers")
            layers.scene = live
            image = wiring.node("CompositorNodeAlphaOver", Background=(*region.profile.background, 1.0),
                                Foreground=layers.outputs["Image"]).outputs[0]
            if view.smooth:
                image = wiring.group(_interpolation(region), image)
            live.compositing_node_group = wiring.finish(image)
    finally:
        for item in (*made, *set(bpy.data.node_groups) - before):
            item[MARK] = view.kind


def follow(live: bpy.types.Scene) -> None:
    """Copy what may have changed in the artist's scene and needs no new card."""
    scene = live.background_set
    lfsr, light = scene.lfsr, resolve(scene).request.light
    if live[LIGHT] != light:
        _remove([item for item in marked(live[MARK]) if LIGHT in item and item != live])
        needed = OWN if has_light(scene) else DEFAULT_LIGHT  # a render alone tells whether there is enough
        for item in illuminate(live, needed if light == AUTO else light, scene):
            item[MARK], item[LIGHT] = live[MARK], light
        live[LIGHT] = light
    is_lit = live.world is not None and MARK in live.world
    # Settings in which the live scene differs from the artist's; None: the live scene keeps its value.
    kept = ("preview_pixel_size", "use_border", "resolution_x", "resolution_y", "border_max_x", "border_max_y")
    render = {"engine": "CYCLES", "film_transparent": is_lit or scene.render.film_transparent or scene.world is None,
              "pixel_aspect_x": 1.0, "pixel_aspect_y": 1.0, "resolution_percentage": 100, "use_multiview": False,
              "border_min_x": 0.0, "border_min_y": 0.0} | dict.fromkeys(kept) | compat.whole_textures()
    cycles = {"preview_samples": live_samples(scene, live[MARK] == EYE), "use_preview_adaptive_sampling": False,
              "use_preview_denoising": lfsr.live_denoise and compat.has_denoiser(),
              "preview_denoising_start_sample": 1, "preview_denoising_input_passes": "RGB",
              "pixel_filter_type": "BOX", "sample_clamp_direct": 0.0, "sample_clamp_indirect": CLAMP_INDIRECT,
              "use_camera_cull": False, "use_distance_cull": False,
              "diffuse_bounces": 0 if light == EVEN else scene.cycles.diffuse_bounces,
              # The card is one more surface that a path passes through.
              "transparent_max_bounces": scene.cycles.transparent_max_bounces + 1}
    # Blender warns of reading a denoiser that it was built without.
    absent = ("denoiser",) if compat.has_denoiser() else ("denoiser", "preview_denoiser")
    own: dict[str, dict[str, Any]] = {"render": render, "cycles": cycles | dict.fromkeys(absent)}
    for group in COPIED:
        source, target, changed = getattr(scene, group), getattr(live, group), own.get(group, {})
        for item in source.bl_rna.properties:
            name = item.identifier
            if (item.is_readonly or item.type not in {"BOOLEAN", "INT", "FLOAT", "ENUM"}
                    or changed.get(name, 0) is None):
                continue
            value, now = changed[name] if name in changed else getattr(source, name), getattr(target, name)
            if getattr(item, "is_array", False):
                value, now = tuple(value), tuple(now)
            if value != now:
                with suppress(TypeError, AttributeError):  # a choice that this scene does not have now
                    setattr(target, name, value)
    for name, value in (("world", live.world if is_lit else scene.world), ("frame_current", scene.frame_current)):
        if getattr(live, name) != value:
            setattr(live, name, value)


def marked(kind: str | None = None) -> list[bpy.types.ID]:
    """Return the data of all live scenes in the open file, or of one ``kind``."""
    return [item for name in KINDS for item in getattr(bpy.data, name) if MARK in item and kind in (None, item[MARK])]


def remove_all(kind: str | None = None) -> None:
    """Remove the data of all live scenes, or of one ``kind``; windows that show them get another scene."""
    _remove(marked(kind))


def _remove(items: list[bpy.types.ID]) -> None:
    for window in bpy.context.window_manager.windows:
        if window.scene in items:  # Blender crashes where a window shows a scene that is removed, or none is left
            others = (scene for scene in bpy.data.scenes if MARK not in scene)
            window.scene = window.scene.background_set or next(others, None) or bpy.data.scenes.new("Scene")
    if items:
        bpy.data.batch_remove(items)


def can_interpolate() -> bool:
    """Return True if this Blender's viewport compositor has the nodes; 4.5 lacks one."""
    return (all(hasattr(bpy.types, f"CompositorNode{name}") for name in ("ImageCoordinates", "MapUV"))
            and "compositing_node_group" in bpy.types.Scene.bl_rna.properties)


def _interpolation(region: LiveRegion) -> bpy.types.NodeTree:
    """Group from an image with one colour per rendered view to one with a colour per pixel."""
    wiring = _Wiring(INTERPOLATE)
    image = wiring.color(wiring.input("Image", "NodeSocketColor"), _scalar(ENCODE, _encode))
    # Vectors have z = 1, so that they can divide.
    views, corner = ((float(pair[0]), float(pair[1]), 1.0) for pair in (region.profile.views, region.corner))
    step = (region.scale,) * 3
    # Lower left corner of the pixel's elemental image on the panel, and the pixel's place in it in rendered views.
    coordinates = wiring.node("CompositorNodeImageCoordinates", Image=wiring.source)
    middle = wiring.vector("ADD", wiring.vector("SUBTRACT", coordinates.outputs["Pixel"], corner), (0.5, 0.5, 0))
    tile = wiring.vector("MULTIPLY", wiring.vector("FLOOR", wiring.vector("DIVIDE", middle, views)), views)
    inside = wiring.vector("DIVIDE", wiring.vector("SUBTRACT", middle, tile), step)
    place = wiring.vector("SUBTRACT", inside, (0.5, 0.5, 0))
    before = wiring.vector("FLOOR", place)
    fraction = wiring.node("ShaderNodeSeparateXYZ", Vector=wiring.vector("SUBTRACT", place, before)).outputs
    last = [count // region.scale - 1 for count in region.profile.views]

    def view(across: int, up: int) -> bpy.types.NodeSocket:
        """Return the colour of a rendered view of the tile, without interpolation, by its place in the image."""
        number = wiring.vector("ADD", before, (across, up, 0))
        number = wiring.vector("MINIMUM", wiring.vector("MAXIMUM", number, (0, 0, 0)), (*last, 0))
        middle = wiring.vector("MULTIPLY", wiring.vector("ADD", number, (0.5, 0.5, 0)), step)
        there = wiring.vector("ADD", wiring.vector("ADD", tile, middle), corner)
        # z is the alpha that Map UV returns.
        uv = wiring.vector("MULTIPLY_ADD", there, (1 / region.size[0], 1 / region.size[1], 0), (0, 0, 1))
        return wiring.node("CompositorNodeMapUV", Image=image, UV=uv, Interpolation="Nearest",
                           **{"Extension X": "Extend", "Extension Y": "Extend"}).outputs[0]

    rows = [wiring.mix(fraction["X"], view(0, up), view(1, up)) for up in (0, 1)]
    return wiring.finish(wiring.color(wiring.mix(fraction["Y"], *rows), _scalar(DECODE, _decode)))


def _scalar(name: str, fill: Callable[[_Wiring, bpy.types.NodeSocket], bpy.types.NodeSocket]) -> bpy.types.NodeTree:
    """Group that computes ``fill`` of one number."""
    wiring = _Wiring(name)
    return wiring.finish(fill(wiring, wiring.input("Value", "NodeSocketFloat")), "NodeSocketFloat")


def _encode(wiring: _Wiring, value: bpy.types.NodeSocket) -> bpy.types.NodeSocket:
    """Return √x up to 1, 1 + ½·ln x above."""
    dark = wiring.scalar("SQRT", wiring.scalar("MINIMUM", wiring.scalar("MAXIMUM", value, 0.0), 1.0))
    bright = wiring.scalar("LOGARITHM", wiring.scalar("MAXIMUM", value, 1.0), 2.718281828459045)
    return wiring.scalar("MULTIPLY_ADD", bright, 0.5, dark)


def _decode(wiring: _Wiring, value: bpy.types.NodeSocket) -> bpy.types.NodeSocket:
    """Return the inverse of ``_encode``: x² up to 1, e^(2·(x − 1)) above."""
    dark = wiring.scalar("POWER", wiring.scalar("MINIMUM", value, 1.0), 2.0)
    above = wiring.scalar("MAXIMUM", wiring.scalar("MULTIPLY_ADD", value, 2.0, -2.0), 0.0)
    return wiring.scalar("MULTIPLY", dark, wiring.scalar("EXPONENT", above))


class _Wiring(Wiring):
    """Wiring of a new compositor tree."""

    def __init__(self, name: str) -> None:
        super().__init__(bpy.data.node_groups.new(name, "CompositorNodeTree"))
        self.source: bpy.types.NodeSocket | None = None

    def input(self, name: str, kind: str) -> bpy.types.NodeSocket:
        """Add an input to the tree, and return its socket, which is the ``source`` too."""
        self.tree.interface.new_socket(name, in_out="INPUT", socket_type=kind)
        self.source = self.node("NodeGroupInput").outputs[0]
        return self.source

    def finish(self, value: bpy.types.NodeSocket, kind: str = "NodeSocketColor") -> bpy.types.NodeTree:
        """Make ``value`` the tree's output, and return the tree."""
        name = "Image" if kind == "NodeSocketColor" else "Value"
        self.tree.interface.new_socket(name, in_out="OUTPUT", socket_type=kind)
        self.link(value, self.node("NodeGroupOutput").inputs[0])
        return self.tree

    def group(self, tree: bpy.types.NodeTree, value: bpy.types.NodeSocket) -> bpy.types.NodeSocket:
        """Return the result of a group."""
        node = self.node("CompositorNodeGroup")
        node.node_tree = tree
        self.link(value, node.inputs[0])
        return node.outputs[0]

    def mix(self, fraction: bpy.types.NodeSocket, first: bpy.types.NodeSocket,
            second: bpy.types.NodeSocket) -> bpy.types.NodeSocket:
        """Return two colours mixed; ``fraction``: of the second."""
        node = self.node("ShaderNodeMix")
        node.data_type = "RGBA"
        sockets = {socket.identifier: socket for socket in (*node.inputs, *node.outputs)}
        for name, value in (("Factor_Float", fraction), ("A_Color", first), ("B_Color", second)):
            self.link(value, sockets[name])
        return sockets["Result_Color"]

    def color(self, image: bpy.types.NodeSocket, scalar: bpy.types.NodeTree) -> bpy.types.NodeSocket:
        """Return ``scalar`` of red, green and blue."""
        split = self.node("CompositorNodeSeparateColor", Image=image).outputs
        mapped = {name: self.group(scalar, split[name]) for name in ("Red", "Green", "Blue")}
        return self.node("CompositorNodeCombineColor", **mapped, Alpha=1.0).outputs[0]
