"""Find objects that the display cannot show well: too near, too far, too thin, or not marked as background.

Scenes can have tens of thousands of objects: what is measured of all of them is measured at once.
"""

from collections.abc import Iterator

import bpy
import numpy as np

from lfsr_core.base.messages import LfsrError

from ..scene import settings as scene_settings
from ..scene.array import placement, rig
from ..scene.array.edit import bounds, boxes_now
from ..scene.contents import find_subject
from ..scene.settings import length
from ..scene.words import capitalized
from .problems import ERROR, Problem

COVERS, TOLERANCE = 0.8, 1e-3  # of the display, across and down, that a background covers; of the display's distance


def find(scene: bpy.types.Scene) -> Iterator[Problem]:
    """Problems of the visible objects of the subject, by name, or of the array that cannot be placed."""
    if (array := rig.find(scene)) is None:
        return
    try:
        placed = rig.placement(scene, scene_settings.display_of(scene))
    except LfsrError as error:
        yield Problem("rig", array.name, f"{capitalized(str(error))}.", "Add Again", ERROR, is_object=True)
        return
    try:
        subject, settings = find_subject(scene), scene_settings.resolve(scene)
    except LfsrError:
        return  # said by another check
    with placement.as_rendered():
        boxes = boxes_now(subject)
    if placed is None or not boxes:
        return
    cameras, toward = placed[0], np.linalg.inv(np.array(placed[1]))
    items = sorted(boxes, key=lambda item: item.name)
    corners = [boxes[item] @ toward[:3, :3].T + toward[:3, 3] for item in items]
    # Points beside or behind the viewing position are off the display, far out: the object surrounds the viewer.
    half, margin = np.array([cameras.half_width, cameras.half_height]) / cameras.distance, TOLERANCE * cameras.distance
    seen = [box[:, :2] / np.maximum(box[:, 2:], 1e-6 * cameras.distance) / half for box in corners]
    # Distances (n,) along the view, and corners (n, 2) of the rectangles that objects cover.
    (nearest, farthest), (low, high) = bounds(corners)[..., 2].T, bounds(seen).swapaxes(0, 1)
    visible = (farthest > 0) & (low < 1).all(1) & (high > -1).all(1)  # to an eye in front of the display
    distance, (near, far) = cameras.distance, rig.usable_depth(cameras, settings.display)
    # A floor or a room begins beside the viewer, or in front of the usable depth, and ends behind the display.
    through = (farthest > np.where(nearest <= 0, distance, far)) & (nearest < near)
    covers = ((np.minimum(high, 1) - np.maximum(low, -1)) / 2 > COVERS).all(1)
    background = through | (covers & (farthest > far + margin))
    # Width of one pixel of the rendered array: of a lens, or of a cell of views.
    depths = np.minimum(np.maximum(distance, nearest), farthest)
    least = np.maximum(2 * cameras.half_width / settings.display.lenses[0] * depths / distance,
                       settings.sampling.scale * cameras.spacing * np.abs(depths - distance) / distance)
    is_only = not (visible & ~background).any()  # without another subject nothing would be left before it
    for row in np.flatnonzero(visible):
        item = items[row]
        if background[row]:
            if is_only or settings.subpixels:  # where nothing is reconstructed, marking it saves no time
                continue
            yield _problem("background", item, "It fills the display or its whole depth, so every lens counts as "
                           "foreground. Objects in a collection called Background are reconstructed faster.",
                           "Move to Background")
            continue
        if nearest[row] < near - margin:
            yield _problem("depth", item, f"It reaches {length(scene, distance - nearest[row])} before the "
                           f"display, which shows {length(scene, distance - near)} sharp.")
        elif farthest[row] > far + margin:
            yield _problem("depth", item, f"It reaches {length(scene, farthest[row] - distance)} behind the "
                           f"display, which shows {length(scene, far - distance)} sharp.")
        thickness = sorted(item.dimensions)[1]  # of a rod; of a sheet, its shorter side
        if 0 < thickness < least[row]:
            yield _problem("thin", item, f"It is {length(scene, thickness)} thick, but at its depth the rendered views "
                           f"show nothing finer than {length(scene, least[row])}. Choose a smaller scale or move it "
                           "nearer to the display plane.")


def _problem(code: str, item: bpy.types.Object, reason: str, fix: str = "") -> Problem:
    return Problem(code, item.name, reason, fix, is_object=True)
