"""The live scenes: scenes of their own that show the artist's as their background set, through a lens card.

One shows the panel's image, one what an eye before the display sees; each is there while its window is.
The artist's scene is never changed. Everything here is marked, so that all of it can be found and removed again,
also after an undo brought it back or a file was recovered that was saved in the middle of a crash.
"""

from __future__ import annotations

import dataclasses
import math

import bpy
import mathutils

from lfsr_core.errors import LfsrError
from lfsr_core.frames.job import CLAMP_INDIRECT
from lfsr_core.optics.display import DisplayProfile
from lfsr_core.optics.eye_card import Place, eye_card, eye_place, eye_region
from lfsr_core.optics.lens_card import LensCard, lens_card
from lfsr_core.optics.live_region import LiveRegion
from lfsr_core.optics.rays import RayLayout

from .. import compat
from ..array import rig
from ..render import devices
from ..render.lens_card import new_camera, new_card, place_of
from ..scene.volumes import distance_to_volume
from ..settings.scene_settings import display_of
from . import nodes

MARK = "lfsr_live"
# What is shown; also the value of MARK, so that what belongs to one is found.
PANEL, EYE = "panel", "eye"
NAMES = {PANEL: "LFSR Live", EYE: "LFSR Live Eye"}
KINDS = ("scenes", "objects", "meshes", "cameras", "materials", "node_groups")
# Of the artist's scene, what decides how Cycles and Blender show it.
COPIED = ("render", "cycles", "view_settings", "display_settings")


@dataclasses.dataclass(frozen=True)
class View:
    """What the live view shows; the scene is made again where one of these changes."""

    region: LiveRegion
    # The rendered views, and the display.
    layout: RayLayout
    profile: DisplayProfile
    # Name of the array's viewing position, which the card follows.
    follows: str
    # From the world's origin, rounded up to a power of two.
    far: float
    # To the nearest volume; rounded down to a power of two.
    clear: float
    # Where the eye stands; None: the panel is shown.
    eye: Place | None = None

    @property
    def kind(self) -> str:
        """PANEL or EYE."""
        return PANEL if self.eye is None else EYE


def view_of(scene: bpy.types.Scene, size: tuple[int, int], kind: str = PANEL) -> View:
    """What ``scene`` asks for in a region of ``size``; LfsrError where it cannot be shown."""
    profile = display_of(scene)
    if kind == PANEL and profile.is_woven:
        raise LfsrError(f"display {profile.name!r} weaves its panel's image from the light field, which the live view "
                        "cannot do: choose another display, or press Show One Eye")
    scale = int(scene.lfsr.live_scale)
    profile.low_views(scale)
    placed = rig.placement(scene, profile)
    if placed is None:
        raise LfsrError("the scene has no camera array for the live view to look through: press Add in Camera Array")
    found = rig.find(scene)
    place = found.matrix_world.translation
    region = LiveRegion(profile, size, scale) if kind == PANEL else eye_region(profile, size)
    return View(region, RayLayout.for_display(profile, placed[0], scale), profile, found.name, _above(place.length),
                _above(distance_to_volume(scene, place)) / 2, None if kind == PANEL else _eye_of(scene, profile))


def _eye_of(scene: bpy.types.Scene, profile: DisplayProfile) -> Place:
    lfsr = scene.lfsr
    return eye_place(profile, lfsr.live_eye_right, lfsr.live_eye_up, lfsr.live_eye_near)


def _above(length: float) -> float:
    return 2.0 ** math.ceil(math.log2(length)) if 0 < length < math.inf else length


def make(scene: bpy.types.Scene, view: View) -> bpy.types.Scene:
    """The live scene of ``scene``; whole or not at all."""
    live = bpy.data.scenes.new(NAMES[view.kind])
    try:
        live[MARK] = view.kind
        live.background_set = scene
        show(live, view)
    except BaseException:
        remove_all(view.kind)
        raise
    return live


def show(live: bpy.types.Scene, view: View) -> None:
    """Let ``live`` show ``view``, in place of what it showed."""
    _remove([item for item in marked(view.kind) if not isinstance(item, bpy.types.Scene)])
    follow(live)
    region = view.region
    live.render.preview_pixel_size = str(region.scale)
    live.render.resolution_x, live.render.resolution_y = region.size
    live.render.use_border = region.drawn != region.size
    # Half a pixel more, for Cycles rounds down.
    live.render.border_max_x, live.render.border_max_y = (
        min(1.0, (region.drawn[axis] + 0.5) / region.size[axis]) for axis in (0, 1))
    _add_card(live, view)
    if nodes.can_interpolate():
        before = set(bpy.data.node_groups)
        tree = nodes.live_group(region, view.kind == PANEL and live.background_set.lfsr.live_smooth)
        for group in set(bpy.data.node_groups) - before:
            group[MARK] = view.kind
        live.compositing_node_group = tree
        nodes.set_scene(tree, live)


def follow(live: bpy.types.Scene) -> None:
    """Take over what may have changed in the artist's scene and needs no new card."""
    scene = live.background_set
    for name in COPIED:
        _copy(getattr(scene, name), getattr(live, name), _own_values(scene).get(name, {}))
    for name, value in (("world", scene.world), ("frame_current", scene.frame_current)):
        if getattr(live, name) != value:
            setattr(live, name, value)


def marked(kind: str | None = None) -> list[bpy.types.ID]:
    """All data of ours in the open file, or of one ``kind`` of view."""
    return [item for name in KINDS for item in getattr(bpy.data, name)
            if MARK in item and kind in (None, item[MARK])]


def remove_all(kind: str | None = None) -> None:
    """Remove it; scenes first, so that no window shows what is gone."""
    _remove(marked(kind))


def _remove(items: list[bpy.types.ID]) -> None:
    if items:
        bpy.data.batch_remove(items)


def _own_values(scene: bpy.types.Scene) -> dict[str, dict[str, object]]:
    """Settings in which the live scene differs from the artist's."""
    lfsr = scene.lfsr
    render = {"engine": "CYCLES", "preview_pixel_size": None, "use_border": None,
              "film_transparent": scene.render.film_transparent or scene.world is None,
              "pixel_aspect_x": 1.0, "pixel_aspect_y": 1.0, "resolution_x": None, "resolution_y": None,
              "resolution_percentage": 100, "use_multiview": False, "filepath": None, "border_max_x": None,
              "border_max_y": None, "border_min_x": 0.0, "border_min_y": 0.0} | compat.whole_textures()
    cycles = {"preview_samples": lfsr.live_samples, "use_preview_adaptive_sampling": False,
              "use_preview_denoising": lfsr.live_denoise and devices.has_denoiser(),
              "preview_denoising_start_sample": lfsr.live_denoise_start, "preview_denoising_input_passes": "RGB",
              "pixel_filter_type": "BOX", "sample_clamp_direct": 0.0, "sample_clamp_indirect": CLAMP_INDIRECT,
              "use_camera_cull": False, "film_transparent_glass": False,
              # The card is one more surface that a path passes through.
              "transparent_max_bounces": scene.cycles.transparent_max_bounces + 1}
    # Reading a denoiser that this Blender was built without is warned about.
    absent = {} if devices.has_denoiser() else {"preview_denoiser": None}
    return {"render": render, "cycles": cycles | {"denoiser": None} | absent}


def _copy(source: bpy.types.bpy_struct, target: bpy.types.bpy_struct, own: dict[str, object]) -> None:
    """Simple settings of ``source``, but those of ``own``; None leaves the target's; equal ones stay untouched."""
    for item in source.bl_rna.properties:
        name = item.identifier
        if item.is_readonly or item.type not in {"BOOLEAN", "INT", "FLOAT", "ENUM"} or own.get(name, 0) is None:
            continue
        value = own[name] if name in own else getattr(source, name)
        plain = tuple(value) if getattr(item, "is_array", False) else value
        now = getattr(target, name)
        if (tuple(now) if getattr(item, "is_array", False) else now) != plain:
            try:
                setattr(target, name, plain)
            except (TypeError, AttributeError):   # a choice that this scene does not have now
                continue


def _add_card(live: bpy.types.Scene, view: View) -> None:
    card, distance = _card(view), view.layout.array.distance
    made: list[bpy.types.ID] = []
    try:
        place = place_of(view.layout, view.far)
        camera, screen = new_camera(made, card, view.layout, place), new_card(made, card, distance, place)
    finally:
        for item in made:
            item[MARK] = view.kind
    for item in (camera, screen):
        live.collection.objects.link(item)
    _aim(camera, view.region, card.pixel / view.region.scale)
    # Both stand where the array stands; how far behind is in the mesh and in the camera's own place.
    screen.data.transform(mathutils.Matrix.Translation((0, 0, place.gap / 2)))
    camera.parent, camera.location = screen, (0, 0, place.gap)
    _follow_object(screen, bpy.data.objects[view.follows])
    live.camera = camera


def _card(view: View) -> LensCard:
    layout = view.layout
    if view.eye is not None:
        return eye_card(layout, view.profile, view.eye, view.region, view.clear)
    card = lens_card(layout, view.clear)
    if view.profile.ei_order == "flipped":
        card = dataclasses.replace(card, cells=layout.views - card.cells)
    return card


def _aim(camera: bpy.types.Object, region: LiveRegion, pixel: float) -> None:
    """Let the camera's frame be the region, with the card where the panel belongs; ``pixel`` is the panel's."""
    camera.data.ortho_scale = region.size[0] * pixel
    # Shares of the frame's width, both: the camera itself must not move, for its place is the rays' origin.
    camera.data.shift_x, camera.data.shift_y = (-length / region.size[0] for length in region.shift)


def _follow_object(item: bpy.types.Object, target: bpy.types.Object) -> None:
    """Without the target's scale, as rays leave it out."""
    for kind in ("COPY_LOCATION", "COPY_ROTATION"):
        item.constraints.new(kind).target = target
