"""The ways to a panel's image that are compared, each from a render to what the panel shows."""

from __future__ import annotations

import dataclasses
from pathlib import Path

import numpy as np

from lfsr_core.bench.displays.kinds import Kind
from lfsr_core.frames.frame import LOW_RES_FILE, Frame, read_frame
from lfsr_core.frames.low_res import LowResEIA, low_resolution
from lfsr_core.images.exr import clean, read_layers
from lfsr_core.images.srgb import srgb_encode
from lfsr_core.optics.display import DisplayProfile
from lfsr_core.optics.eia import flip_order, from_views
from lfsr_core.optics.panel.gather import gather_map
from lfsr_core.optics.panel.weave import weave
from lfsr_core.reconstruct.method_name import default_method
from lfsr_core.reconstruct.methods.denoise import GUIDES, clean_guides, denoise_eia
from lfsr_core.reconstruct.second_stage import finished_linear

OURS, DIRECT, USUAL = "ours", "every view", "usual"


@dataclasses.dataclass(frozen=True)
class Way:
    """How a panel's image is made."""

    name: str  # OURS, DIRECT or USUAL
    layout: str  # how it is rendered, see frames.frame.LAYOUTS
    sparse: bool  # whether views are divided by the kind's scale
    samples: tuple[int, ...]  # per pixel, at which it is measured

    def scale(self, kind: Kind) -> int:
        """By which it divides the views of a kind."""
        return kind.scale if self.sparse else 1


WAYS = (Way(OURS, "one-pass", True, (4, 16, 64)), Way(DIRECT, "one-pass", False, (1, 4, 16)),
        Way(USUAL, "view-by-view", False, (4,)))
NAMES = {
    OURS: "fewer views in one pass, the default method, the weave",
    DIRECT: "every view in one pass, OIDN, the weave",
    USUAL: "one render per view, OIDN per view, the nearest view",
}


def measured_at() -> list[tuple[Way, int]]:
    """Every way with every number of samples."""
    return [(way, samples) for way in WAYS for samples in way.samples]


def panel_image(folder: Path, way: Way) -> np.ndarray:
    """What the panel shows, (H, W, 3) uint8 sRGB, from the rendered frame in ``folder``."""
    frame = read_frame(folder)
    if way.name == USUAL:
        return shown(_view_by_view(folder, frame), frame.display, "nearest")
    method = default_method(frame.display.parallax) if way.name == OURS else "oidn"
    return shown(finished_linear(folder, method), frame.display)


def shown(linear: np.ndarray, display: DisplayProfile, sampling: str | None = None) -> np.ndarray:
    """The panel's image (H, W, 3) uint8 of a scene-linear light field (rows, columns, 3) in view order.

    ``sampling``: of display.WEAVES, None for the display's own; for a display that is woven.
    """
    eia = np.rint(srgb_encode(linear) * 255).astype(np.uint8)
    if display.is_woven:
        return weave(eia, gather_map(display, sampling or display.weave))
    return flip_order(eia, display.lenses) if display.ei_order == "flipped" else eia


def _view_by_view(folder: Path, frame: Frame) -> np.ndarray:
    """The light field with every view denoised as Blender does: on its own, by its albedo and normal."""
    low = low_resolution(clean(read_layers(folder / LOW_RES_FILE))[0], frame)
    py, px = low.color.shape[2:4]
    views = np.array([[_denoised(low, row, column) for column in range(px)] for row in range(py)])
    return from_views(views)


def _denoised(low: LowResEIA, row: int, column: int) -> np.ndarray:
    guides = {name: low.layers[name][:, :, row, column] for name in GUIDES if name in low.layers}
    return denoise_eia(low.color[:, :, row, column], **clean_guides(guides))
