"""The low-resolution EIA of a frame as methods see it: opaque, by elemental images, with its auxiliary layers."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Mapping

import numpy as np

from lfsr_core.arrays import Array
from lfsr_core.errors import LfsrError
from lfsr_core.frames.frame import LOW_RES_FILE, Frame
from lfsr_core.optics.eia import to_elemental_images
from lfsr_core.optics.world_view import WorldView

RENDERED_LAYERS = ("albedo", "normal", "position")
LAYERS = (*RENDERED_LAYERS, "denoised", "noisy", "guided")


@dataclasses.dataclass(frozen=True)
class LowResEIA:
    """What a method sees of a low-resolution frame; (sy, sx, h, w, C) float32 arrays.

    Low view k' covers high views s·k' … s·k' + s - 1.
    """

    color: Array  # scene-linear RGB over the background, or before a ``world`` premultiplied; finite, >= 0
    alpha: Array  # coverage in [0, 1], C = 1
    samples: int  # per pixel, the noise level
    scale: int  # s, high-resolution views per low-resolution view along each axis with parallax
    # albedo, normal, position: where rendered, C = 3
    albedo: Array | None = None
    normal: Array | None = None
    position: Array | None = None
    denoised: Array | None = None  # colour as Cycles denoised it right after the render
    noisy: Array | None = None  # colour as rendered, where a denoiser has changed ``color``
    guided: Array | None = None  # colour denoised by the guides, beside ``color`` denoised without
    parallax: tuple[bool, bool] = (True, True)  # axes, (horizontal, vertical), along which the display's views differ
    # A world that is put behind the finished elemental images: what it hides of it (C = 3, in [0, 1]), which lens of
    # the display each is (sy, sx, 2), row and column, and what those see.
    opacity: Array | None = None
    places: Array | None = None
    world: WorldView | None = None

    @property
    def layers(self) -> dict[str, Array]:
        """The auxiliary layers that are there, by name of LAYERS."""
        return {name: layer for name in LAYERS if (layer := getattr(self, name)) is not None}

    @property
    def factors(self) -> tuple[int, int]:
        """High-resolution views per low-resolution view, (horizontal, vertical); 1 along an axis without parallax."""
        across, down = (self.scale if many else 1 for many in self.parallax)
        return across, down

    @property
    def finished_views(self) -> tuple[int, int]:
        """Views of a finished EI, (vertical, horizontal)."""
        return self.color.shape[2] * self.factors[1], self.color.shape[3] * self.factors[0]

    @property
    def rendered(self) -> Array:
        """Colour as rendered, before any denoiser."""
        return self.color if self.noisy is None else self.noisy

    def each(self, change: Callable[[Array], Array]) -> LowResEIA:
        """The same with every array changed in the same way, as by picking lenses."""
        arrays = {"color": self.color, "alpha": self.alpha, **self.layers}
        if self.opacity is not None:
            arrays |= {"opacity": self.opacity, "places": self.places}
        return dataclasses.replace(self, **{name: change(array) for name, array in arrays.items()})


def over_background(layers: Mapping[str, Array], frame: Frame) -> Array:
    """Opaque scene-linear colour (H, W, 3) >= 0 of a render: over the world where visible, else the display's colour.

    Cycles has already weighted the environment layer by what shows of it, so it
    is added as it is. A world apart is not there yet. LfsrError where that layer should be there and is not.
    """
    color = layers["color"]
    if frame.world_visible and "environment" not in layers:
        raise LfsrError("frame.json says that the world is visible, but the EXR has no environment layer: "
                        "render the frame again")
    if frame.world_apart:
        return np.maximum(color[..., :3], 0)
    if frame.world_visible:
        return np.maximum(color[..., :3] + layers["environment"], 0)
    if not any(frame.display.background):
        return np.maximum(color[..., :3], 0)
    background = np.asarray(frame.display.background, np.float32)
    return np.maximum(color[..., :3] + (1 - np.clip(color[..., 3:], 0, 1)) * background, 0)


def low_resolution(layers: Mapping[str, Array], frame: Frame, world: WorldView | None = None) -> LowResEIA:
    """What a method sees, from the layers of lr_eia.exr; LfsrError where their size is not the frame's.

    ``world``: what ``frames.world.read_world`` has found beside them.
    """
    width, height = frame.rays.size
    shape = layers["color"].shape
    if shape[:2] != (height, width):
        raise LfsrError(f"{LOW_RES_FILE} has {shape[1]}×{shape[0]} pixels, but frame.json says {width}×{height}: "
                        "render the frame again")

    images = {name: layers[name] for name in RENDERED_LAYERS if name in layers}
    images |= {"color": over_background(layers, frame), "alpha": np.clip(layers["color"][..., 3:], 0, 1)}
    if "denoised" in layers:
        alpha = layers["color"][..., 3:]
        images["denoised"] = over_background({**layers, "color": np.concatenate([layers["denoised"], alpha], 2)}, frame)
    if frame.world_apart:
        images["opacity"] = 1 - np.clip(layers["environment"], 0, 1)
        if "albedo" in images:  # Cycles adds the light of the world, which is white then
            images["albedo"] = np.maximum(images["albedo"] - layers["environment"], 0)
    tiles = {name: to_elemental_images(layer, frame.rays.tiles) for name, layer in images.items()}
    return LowResEIA(**tiles, samples=frame.samples, scale=frame.scale, parallax=frame.display.parallax, world=world,
                     places=frame.rays.shown_lenses if frame.world_apart else None)
