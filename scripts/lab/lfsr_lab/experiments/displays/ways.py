"""The ways to a panel's image that are compared, each from a render to what the panel shows."""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping
from pathlib import Path

import numpy as np

from lfsr_core.base.arrays import Array
from lfsr_core.frames.frame import LOW_RES_FILE, SUBPIXELS, Frame, read_frame, read_rendered
from lfsr_core.images.exr import read_finite
from lfsr_core.images.srgb import srgb_encode
from lfsr_core.optics.depth_scale import scales_up_to
from lfsr_core.optics.display import DisplayProfile
from lfsr_core.optics.eia import flip_order, from_views, to_elemental_images
from lfsr_core.optics.panel.gather import gather_map
from lfsr_core.optics.panel.weave import weave
from lfsr_core.reconstruct.methods import DEFAULT_METHOD, SUBPIXEL_METHODS, MethodName, oidn
from lfsr_core.reconstruct.second_stage import finished_linear
from lfsr_core.reconstruct.subpixels import linear_panel_image

GUIDES = ("albedo", "normal")


@dataclasses.dataclass(frozen=True)
class Way:
    """How a panel's image is made."""

    name: str
    folder: str  # of its renders, without samples
    layout: str  # how it is rendered, see frames.frame.LAYOUTS
    samples: tuple[int, ...]  # per pixel of the render, at which it is measured
    meaning: str

    def scales(self, profile: DisplayProfile) -> tuple[int, ...]:
        """Return the scales that the scene's depth chooses from, as `lfsr render` does, largest first; empty: 1."""
        if self != OURS:
            return ()
        method = MethodName.parse(DEFAULT_METHOD)
        return method.scales_of(scales_up_to(profile))


OURS = Way("default", "ours", "one-pass", (4, 16, 64),
           "fewer views in one pass, as many as `lfsr render` chooses, the default method, the weave")
EVERY_VIEW = Way("every view", "every-view", "one-pass", (1, 4, 16), "every view in one pass, OIDN, the weave")
SUBPIXEL = Way("direct subpixels", "straight", SUBPIXELS, (1, 4, 16),
               "rays of the panel's subpixels, each a pixel of the render, OIDN, no weave")
USUAL = Way("view by view", "every-view", "view-by-view", (4,), "one render per view, OIDN per view, the nearest view")
WAYS = (OURS, EVERY_VIEW, SUBPIXEL, USUAL)


def measured_at(profile: DisplayProfile) -> list[tuple[Way, int]]:
    """Return every way that a display has, with every number of samples."""
    return [(way, samples) for way in WAYS for samples in way.samples if way != SUBPIXEL or profile.is_woven]


def panel_image(folder: Path, way: Way) -> Array:
    """Return what the panel shows, (H, W, 3) uint8 sRGB, from the rendered frame in ``folder``."""
    if way == SUBPIXEL:
        return traced(folder, LOW_RES_FILE, SUBPIXEL_METHODS[0])
    frame = read_frame(folder)
    if way == USUAL:
        return shown(_view_by_view(folder, frame), frame.display, "nearest")
    return shown(finished_linear(folder, DEFAULT_METHOD), frame.display)


def traced(folder: Path, name: str, method: str = "none") -> Array:
    """Return what the panel shows of the file ``name`` of a render of its subpixels, (H, W, 3) uint8 sRGB."""
    layers, frame = read_finite(folder / name)[0], read_rendered(folder)
    return _encoded(linear_panel_image(layers, frame, MethodName.parse(method)))


def shown(linear: Array, display: DisplayProfile, sampling: str | None = None) -> Array:
    """Return the panel's image (H, W, 3) uint8 of a scene-linear light field (rows, columns, 3) in view order.

    ``sampling``: of display.WEAVES, None for the display's own; for a display that is woven.
    """
    eia = _encoded(linear)
    if display.is_woven:
        return weave(eia, gather_map(display, sampling or display.weave))
    return flip_order(eia, display.lenses) if display.ei_order == "flipped" else eia


def _encoded(linear: Array) -> Array:
    return np.rint(srgb_encode(linear) * 255).astype(np.uint8)


def _view_by_view(folder: Path, frame: Frame) -> Array:
    """Return the light field with every view denoised as Blender does: on its own, by its albedo and normal."""
    layers = read_finite(folder / LOW_RES_FILE)[0]
    images = {name: to_elemental_images(layers[name][..., :3], frame.rays.tiles)
              for name in ("color", *GUIDES) if name in layers}
    py, px = images["color"].shape[2:4]
    return from_views(np.array([[_denoised({name: image[:, :, row, column] for name, image in images.items()})
                                 for column in range(px)] for row in range(py)]))


def _denoised(view: Mapping[str, Array]) -> Array:
    guides = clean_guides({name: view[name] for name in GUIDES if name in view})
    return oidn.denoise(view["color"], guides.get("albedo"), guides.get("normal"), hdr=True, clean_aux=bool(guides),
                        quality="balanced")


def clean_guides(guides: Mapping[str, Array]) -> dict[str, Array]:
    """Return noisy "albedo" and "normal" of one view (H, W, 3) without their noise, as Blender does it."""
    places = {"albedo": (0.0, 1.0), "normal": (1.0, 0.5)}  # from values to those in [0, 1]: (value + first) · second
    return {name: oidn.denoise(np.clip((guide + places[name][0]) * places[name][1], 0, 1), hdr=True, quality="fast")
            / places[name][1] - places[name][0] for name, guide in guides.items()}
