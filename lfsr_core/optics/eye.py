"""The simulated eye: what a viewer in front of the display sees of the panel's image.

Millimetres from the centre of the lens array: x rightwards, y upwards, z towards the viewer; the panel lies one gap
behind. Each lens is a pinhole. Lenses are spaced a little closer than elemental images, so that every lens sends view k
to the place of camera k at the viewing distance.

Behind a lens sheet, light is traced in the opposite direction to ``panel/subpixel_rays.py`` and shares no optics with
it, so that each checks the other: an eye looks at a point on the plane of the lenses; the lens there focuses on a point
of the panel; a subpixel lies there. A cylinder is a pinhole across its axis; along it light goes straight on.

An eye's card shows the same in a viewport: a lens card on which every lens of the display shows the view that the eye
sees. Its rays are those of the rendered views, with one colour per lens, and it costs one pixel per lens.
"""

import dataclasses
import itertools
import math

import numpy as np

from lfsr_core.base.arrays import Array, Mask
from lfsr_core.base.messages import LfsrError
from lfsr_core.optics.display import DisplayProfile, Lenticular, Pair
from lfsr_core.optics.panel.subpixel_rays import Geometry, subpixel_places, subpixel_rays
from lfsr_core.optics.rays import LensCard, RayLayout, flip_order, lens_card

Point = tuple[float, float, float]
PIXEL_SIZES = (8, 4, 2, 1)  # of a viewport
MIN_FILLED = 0.8  # fraction of the region, below which smaller pixels are used
INSIDE = 1 - 1e-3  # of a cell, so that no rounding leads to the next view
ROUNDING = 1e-6
SAMPLES = 24  # rays per pixel of the result
# Bases of the generalised golden ratio in four dimensions: points that fill the unit cube evenly.
GOLDEN = np.array([0.8566748838545029, 0.733891856627126, 0.6287067210378087, 0.5385972572236101])
PLACES = (0.25, 0.5, 0.75)  # of the viewing zone
POINTS = 20_000
BORDER = 0.9  # fraction of the panel that is measured: near its edge an eye at the side looks past the panel


def gap_mm(profile: DisplayProfile) -> float:
    """Distance from panel to lenses at which an elemental image fills the viewing angle."""
    return profile.lens_pitch_mm[0] / 2 / math.tan(math.radians(profile.viewing_angle_deg) / 2)


def eye_view(panel: Array, profile: DisplayProfile, eye_mm: Point, width: int = 960) -> Array:
    """Return what an eye sees of the panel's image: about one pixel per lens, black beyond the panel.

    From outside the viewing zone an eye sees the elemental image of a neighbouring lens, as on a real display.
    ``panel``: (H, W, C) in panel order, as in eia.png; with a lens sheet (H, W, 3) uint8, as in panel.png; ``eye_mm``:
    (x, y, z) of the eye. Returns (rows·n, columns·n, C) with each pixel repeated n times, the largest n that fits
    ``width`` pixels, or 1. LfsrError if the eye is behind the lenses or the image has another size than the panel.
    """
    columns, rows = profile.panel_pixels
    if panel.shape[:2] != (rows, columns):
        raise LfsrError(f"the panel's image has {panel.shape[1]}×{panel.shape[0]} pixels, but display "
                        f"{profile.name!r} has {columns}×{rows}: upscale the folder again")
    if not (eye_mm[2] > 0 and all(map(math.isfinite, eye_mm))):
        raise LfsrError(f"the eye is at {eye_mm} mm, but it must be in front of the display, with z above 0")
    if profile.is_woven:
        # About one pixel per lens across, black beyond the panel.
        sheet, (width_mm, height_mm) = profile.sheet, Geometry.of(profile).lens_plane
        across = max(1, round(profile.panel_mm[0] / sheet.pitch_mm if isinstance(sheet, Lenticular)
                              else width_mm / sheet.lenses.pitch_mm[0]))
        down = max(1, round(across * profile.panel_mm[1] / profile.panel_mm[0]))
        x, y = ((np.arange(across) + 0.5) / across - 0.5) * width_mm, (0.5 - (np.arange(down) + 0.5) / down) * height_mm
        seen = np.rint(seen_at(panel, profile, eye_mm, x, y)).astype(np.uint8)
    else:
        # The driver of a "direct" display reverses each elemental image before the panel shows it.
        eia = flip_order(panel, profile.lenses) if profile.ei_order == "direct" else panel
        column, row = _seen_pixel(profile, eye_mm, 0), rows - 1 - _seen_pixel(profile, eye_mm, 1)[::-1]
        seen = eia[np.clip(row, 0, rows - 1)[:, None], np.clip(column, 0, columns - 1)]
        seen[(row < 0) | (row >= rows)] = 0
        seen[:, (column < 0) | (column >= columns)] = 0
    times = max(1, width // seen.shape[1])
    return seen.repeat(times, axis=0).repeat(times, axis=1)


def _seen_pixel(profile: DisplayProfile, eye_mm: Point, axis: int) -> Array:
    """Panel pixel seen through each lens along one axis, counted in the axis's direction; may be off the panel."""
    lenses, length, pixels = profile.lenses[axis], profile.panel_mm[axis], profile.panel_pixels[axis]
    gap, distance = gap_mm(profile), profile.viewing_distance_mm
    ei_center = ((np.arange(lenses) + 0.5) / lenses - 0.5) * length
    lens = ei_center * distance / (distance + gap)
    on_panel = lens + (lens - eye_mm[axis]) * gap / eye_mm[2]
    return np.asarray(np.floor((on_panel / length + 0.5) * pixels).astype(int))


@dataclasses.dataclass(frozen=True)
class SeenSubpixels:
    """Subpixels that rays from an eye reach; arrays of one shape."""

    row: Array  # of the panel's image, from the top
    column: Array  # of the panel's image
    channel: Array  # 0 red, 1 green, 2 blue; -1 where a pixel shows all three
    on_panel: Mask  # elsewhere the other arrays hold the nearest pixel


def seen_at(panel: Array, profile: DisplayProfile, eye_mm: Point, x: Array, y: Array) -> Array:
    """Return what an eye sees of a panel's image at evenly spaced places: float (rows, columns, 3), 0 to 255.

    ``x`` (columns,), ``y`` (rows,): millimetres from the middle of the lenses, y up. Each value is a mean around its
    place, black beyond the panel.
    """
    light, count = np.zeros((len(y), len(x), 3)), np.zeros((len(y), len(x), 3))
    # A lens focuses on a whole pixel, or it would show one colour; a cylinder passes many rows anyway.
    wide = 0.0 if profile.pixel_layout.count == 1 else 1.0 if profile.lenslet else 1 / 3
    for sample in range(SAMPLES):
        place = np.modf(0.5 + sample * GOLDEN)[0] - 0.5  # in [-1/2, 1/2)⁴: in the pixel, in the focus
        across, down = (axis + place[number] * (axis[-1] - axis[0]) / max(len(axis) - 1, 1)
                        for number, axis in enumerate((x, y)))
        points_x, points_y = np.meshgrid(across, down)
        seen = trace(profile, eye_mm, points_x, points_y, (place[2] * wide, place[3] * wide))
        values = panel[seen.row, seen.column] * seen.on_panel[..., None]
        shown = (seen.channel[..., None] == np.arange(3)) | (seen.channel[..., None] < 0)
        light += values * shown
        count += shown
    return np.asarray(_filled(light) / np.maximum(_filled(count), 1e-12))


def trace(profile: DisplayProfile, eye_mm: Point, x: Array, y: Array,
          spread: tuple[float, float] = (0.0, 0.0)) -> SeenSubpixels:
    """Subpixels that an eye sees at points (x, y) on the plane of the lenses, millimetres from its middle, y up.

    ``spread``: pixels (right, up) by which the focus is moved.
    """
    sheet, geometry = profile.sheet, Geometry.of(profile)
    (across, down), (width, height), behind = profile.panel_pixels, profile.panel_mm, geometry.gap / eye_mm[2]
    if isinstance(sheet, Lenticular):
        (normal, along), nearer = sheet.directions, geometry.nearer
        # The panel's lower left corner lies ``center`` pitches beyond a border of two elemental images; their centres
        # are half a pitch further, and from the viewing distance the axes are seen in front of these.
        start = (-width / 2 * normal[0] - height / 2 * normal[1]) + (sheet.center + 0.5) * sheet.pitch_mm
        pitch, off = sheet.pitch_mm * nearer, x * normal[0] + y * normal[1]
        axis = start * nearer + np.round((off - start * nearer) / pitch) * pitch
        length = x * along[0] + y * along[1]
        focus = axis + (axis - eye_mm[0] * normal[0] - eye_mm[1] * normal[1]) * behind
        length = length + (length - eye_mm[0] * along[0] - eye_mm[1] * along[1]) * behind
        on_x, on_y = focus * normal[0] + length * along[0], focus * normal[1] + length * along[1]
    else:
        matrix, (shift_x, shift_y) = sheet.lenses.matrix(sheet.packing), sheet.lenses.shift_mm
        right, up = x - shift_x, y - shift_y
        around = np.round(np.einsum("ij,j...->i...", np.linalg.inv(matrix), np.stack([right, up])))
        best = np.full(np.shape(right), np.inf)
        center_x, center_y = np.zeros_like(best), np.zeros_like(best)
        for one, two in itertools.product((-1, 0, 1), repeat=2):
            at_x = matrix[0, 0] * (around[0] + one) + matrix[0, 1] * (around[1] + two)
            at_y = matrix[1, 0] * (around[0] + one) + matrix[1, 1] * (around[1] + two)
            far = (at_x - right) ** 2 + (at_y - up) ** 2
            center_x, center_y = np.where(far < best, at_x, center_x), np.where(far < best, at_y, center_y)
            best = np.minimum(best, far)
        center_x, center_y = center_x + shift_x, center_y + shift_y
        on_x = center_x + (center_x - eye_mm[0]) * behind
        on_y = center_y + (center_y - eye_mm[1]) * behind
    on_x, on_y = on_x + spread[0] * geometry.pixel[0], on_y + spread[1] * geometry.pixel[1]
    column = np.floor((on_x / width + 0.5) * across).astype(int)
    row = np.floor((0.5 - on_y / height) * down).astype(int)
    on_panel = (column >= 0) & (column < across) & (row >= 0) & (row < down)
    column = across - 1 - column if profile.flip[0] else column
    row = down - 1 - row if profile.flip[1] else row
    row, column = np.clip(row, 0, down - 1), np.clip(column, 0, across - 1)
    if (subpixels := profile.pixel_layout).count == 1:
        return SeenSubpixels(row, column, np.full(row.shape, -1), on_panel)
    if subpixels.cells:
        # The nearest subpixel of this pixel and of the eight around it.
        best, nearest = np.full(on_x.shape, np.inf), [np.zeros(on_x.shape, int) for _ in range(3)]
        for one, two, channel in itertools.product((-1, 0, 1), (-1, 0, 1), range(3)):
            place = np.clip(row + one, 0, down - 1), np.clip(column + two, 0, across - 1), channel
            at_x, at_y = subpixel_places(profile, channel, *place[:2])
            far = (at_x - on_x) ** 2 + (at_y - on_y) ** 2
            nearest = [np.where(far < best, new, old) for new, old in zip(place, nearest, strict=True)]
            best = np.minimum(best, far)
        return SeenSubpixels(nearest[0], nearest[1], nearest[2], on_panel)
    third = np.floor(((on_x / width + 0.5) * across % 1) * 3).astype(int).clip(0, 2)
    return SeenSubpixels(row, column, third if subpixels.stripes == "rgb" else 2 - third, on_panel)


def _filled(values: Array) -> Array:
    """Add a little of the eight neighbours, so that a channel that no ray of a pixel reached takes theirs."""
    padded = np.pad(values, ((1, 1), (1, 1), (0, 0)))
    rows, columns = values.shape[:2]
    around = sum(padded[y:y + rows, x:x + columns] for y in range(3) for x in range(3)) - values
    return np.asarray(values + 1e-6 * around)


@dataclasses.dataclass(frozen=True)
class ViewSpread:
    """Fractions of the light that an eye at the centre of a view sees, mean over the panel and places in the zone."""

    own: float  # from that view
    neighbours: float  # from the views beside it
    others: float  # from any other view: crosstalk
    error: float  # mean difference of the views seen from the eye's, in views across: 0 if the weave is correct


def view_spread(profile: DisplayProfile) -> ViewSpread:
    """Measure a display with a lens sheet by ``POINTS`` rays from each of ``PLACES``."""
    random, parts, geometry = np.random.default_rng(0), [], Geometry.of(profile)
    for place in PLACES:
        view = [round(place * (count - 1)) for count in profile.views]
        # An eye at the centre of that view looks at random points.
        across, down = ((number - (count - 1) / 2) * geometry.spacing
                        for number, count in zip(view, profile.views, strict=True))
        x, y = ((random.random(POINTS) - 0.5) * size * BORDER for size in geometry.lens_plane)
        seen = trace(profile, (across, -down, geometry.distance), x, y)
        off = np.zeros((2, POINTS))  # distances, in views across and down, of what it sees there
        for channel in range(3):
            rays = subpixel_rays(profile, channel, seen.row, seen.column)
            chosen = seen.channel == channel if seen.channel.min() >= 0 else np.arange(POINTS) % 3 == channel
            for axis, shown in enumerate((rays.view_x, rays.view_y)):
                off[axis] = np.where(chosen, np.clip(shown, 0, profile.views[axis] - 1) - view[axis], off[axis])
        off = off[:, seen.on_panel]
        on_place = np.clip(1 - np.abs(off), 0, None).prod(0)
        beside = sum(np.clip(1 - np.abs(off - step), 0, None) for step in (-1, 0, 1)).prod(0)
        parts.append((on_place.mean(), (beside - on_place).mean(), (1 - beside).mean(), off[0].mean()))
    return ViewSpread(*map(float, np.mean(parts, 0)))


@dataclasses.dataclass(frozen=True)
class LiveRegion:
    """A region of the screen that shows a panel, or its middle; pairs are (horizontal, vertical) in pixels."""

    profile: DisplayProfile
    size: Pair  # of the region
    scale: int  # a rendered pixel covers scale × scale pixels of the region, from its lower left corner on

    @property
    def drawn(self) -> Pair:
        """Size of the part of the region, from its lower left corner, that whole rendered pixels fill."""
        return self.size[0] // self.scale * self.scale, self.size[1] // self.scale * self.scale

    @property
    def corner(self) -> Pair:
        """Lower left corner of the panel, in pixels from that of the region; below 0 if the panel is larger.

        A multiple of ``scale``, so that each rendered pixel is one view of one lens.
        """
        left, bottom = ((drawn - pixels) // (2 * self.scale) * self.scale
                        for drawn, pixels in zip(self.drawn, self.profile.panel_pixels, strict=True))
        return left, bottom

    @property
    def shift(self) -> tuple[float, float]:
        """Pixels from the region's centre to the panel's, rightwards and upwards."""
        across, up = (self.corner[axis] + (self.profile.panel_pixels[axis] - self.size[axis]) / 2 for axis in (0, 1))
        return across, up

    def sentence(self) -> str | None:
        """What is wrong with the region and what to do; None if nothing is."""
        (width, height), (wide, high) = self.size, self.profile.panel_pixels
        if (width, height) == (wide, high):
            return None
        start = f"the live window shows {width}×{height} pixels, but display {self.profile.name!r} has {wide}×{high}"
        if self.drawn != self.size:
            return (f"{start}, and its sides are not multiples of the pixel size {self.scale}, so that views mix: make "
                    "the window full screen on the display, or change its size")
        if width >= wide and height >= high:
            return f"{start}: the image is in the middle of a border; make the window full screen on the display"
        return (f"{start}: a centred part is shown; drag the window to the display, make it full screen, and set that "
                "screen's scaling to 100 % and its resolution to the panel's")


def eye_place(profile: DisplayProfile, right: float, up: float, near: float) -> Point:
    """Return the place (x, y, z) of an eye, in millimetres from the display's centre.

    ``right`` and ``up`` are fractions of half the viewing zone (-1 to 1 inside it), ``near`` of the viewing distance.
    """
    across, high = (count * profile.camera_spacing_mm / 2 for count in profile.views)
    return right * across, up * high, near * profile.viewing_distance_mm


def eye_region(profile: DisplayProfile, size: tuple[int, int]) -> LiveRegion:
    """Return a region of ``size`` in which each lens is a rectangle of whole pixels; LfsrError if it is too small."""
    pitch_x, pitch_y = profile.lens_pitch_mm
    most = min(length / lenses / side for length, lenses, side in zip(
        size, profile.lenses, profile.lens_pitch_mm, strict=True))
    for pixel in PIXEL_SIZES:
        sides = (pixel * math.floor(most * pitch_x / pixel + ROUNDING),
                 pixel * math.floor(most * pitch_y / pixel + ROUNDING))
        if min(sides) > 0 and (pixel == 1 or min(sides) >= MIN_FILLED * most * min(pitch_x, pitch_y)):
            pixels = sides[0] * profile.lenses[0], sides[1] * profile.lenses[1]
            plain = dataclasses.replace(profile, views=sides, panel_pixels=pixels, panel_mm=pixels, lenslet=None,
                                        lenticular=None, subpixels=None)
            return LiveRegion(plain, size, pixel)
    raise LfsrError(f"the eye's window shows {size[0]}×{size[1]} pixels, but display {profile.name!r} has "
                    f"{profile.lenses[0]}×{profile.lenses[1]} lenses: make the window larger")


def eye_card(layout: RayLayout, profile: DisplayProfile, eye_mm: Point, region: LiveRegion,
             radius: float = math.inf) -> LensCard:
    """Return the lens card that shows the rendered views of ``layout`` to an eye.

    ``eye_mm``: (x, y, z) from the middle of the lens array, towards the viewer. ``region``: from ``eye_region``.
    ``radius``: as in ``lens_card``.
    """
    times_x, times_y = (side // region.scale for side in region.profile.views)
    lenses = layout.lenses[0] * times_x, layout.lenses[1] * times_y
    fine = lens_card(dataclasses.replace(layout, lenses=lenses, views=(1, 1)), radius)
    # Pixels that the eye sees through each lens, rightwards and downwards, which may lie off the panel.
    plain = dataclasses.replace(profile, panel_pixels=profile.eia_pixels, lenslet=None, lenticular=None, subpixels=None)
    across, up = _seen_pixel(plain, eye_mm, 0), _seen_pixel(plain, eye_mm, 1)
    # Per axis (lenses · times, 2): the elemental image, and the rendered view, counted as in ``rays.py``. An eye on the
    # right sees the pixels left of a lens's centre.
    columns, rows = (np.repeat([pixel // count, (count - 1 - pixel % count) * rendered // count], times, axis=1).T
                     for pixel, count, rendered, times in zip(
                         (across, plain.panel_pixels[1] - 1 - up[::-1]), profile.views, layout.views,
                         (times_x, times_y), strict=True))
    grid = np.stack(np.broadcast_arrays(columns[None], rows[:, None]), axis=-1)  # row, column, image or view, axis
    image, view = grid.reshape(-1, 2, 2).swapaxes(0, 1)
    shown = ((image >= 0) & (image < layout.lenses)).all(1)
    cells = view[:, None] + 0.5 + INSIDE * (np.clip(fine.cells, 0, 1) - 0.5)
    whole = lens_card(layout, radius)
    targets = np.clip(image, 0, np.array(layout.lenses) - 1) * np.array(whole.lens_step) + whole.targets[0]
    return dataclasses.replace(whole, pixel=fine.pixel, corners=fine.corners[shown], cells=cells[shown],
                               targets=targets[shown])
