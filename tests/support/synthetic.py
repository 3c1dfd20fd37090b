"""Frame folders without Blender: a smooth light field, box-sampled at any scale."""

import dataclasses
from collections.abc import Callable
from pathlib import Path

import numpy as np

from lfsr_core.cli import main
from lfsr_core.frames.frame import LOW_RES_FILE, REFERENCE_FILES, SUBPIXELS, WORLD_FILE, Frame, write_frame
from lfsr_core.images.color import ColorSettings
from lfsr_core.images.image_files import read_layers, write_layers
from lfsr_core.optics.display import DisplayProfile, load_display
from lfsr_core.optics.rays import CameraArray
from lfsr_core.optics.world_view import WorldImage
from lfsr_core.reconstruct.upscaler import finished_layout
from tests.support.card_rays import pixel_rays
from tests.support.reference_rays import panel_rays

MINI = load_display("mini")
# Sixteen columns of eight views; a row of lenses for every second row of pixels of MINI.
FLAT = dataclasses.replace(MINI, name="flat", panel_pixels=(128, 48), panel_mm=(256.0, 96.0), lenses=(16, 48),
                           views=(8, 1))
IDENTITY = tuple(tuple(float(row == column) for column in range(4)) for row in range(4))


def light_field(display: DisplayProfile = MINI) -> np.ndarray:
    """EIA (H, W, 4) in view order of a disc of waves behind the display plane; different in every direction."""
    frame = frame_of(1, display)
    return _seen(frame, *pixel_rays(frame.rays))


def traced_panel(display: DisplayProfile) -> np.ndarray:
    """(H, W · 3, 4), what rays of the panel's subpixels see of the same."""
    frame = frame_of(1, display, layout=SUBPIXELS)
    width, height = frame.subpixels.size
    across, up = np.meshgrid((np.arange(width) + 0.5) / width, 1 - (np.arange(height) + 0.5) / height)
    return _seen(frame, *panel_rays(frame.subpixels, across, up))


def _seen(frame: Frame, origin: np.ndarray, direction: np.ndarray) -> np.ndarray:
    depth = 1.2 * frame.array.distance
    x, y = ((origin + direction * (depth / direction[..., 2:]))[..., axis] for axis in (0, 1))
    color = np.stack([0.5 + 0.4 * np.sin(9 * x + 2), 0.5 + 0.4 * np.cos(7 * y), 0.5 + 0.3 * np.sin(5 * (x + y))], -1)
    alpha = (np.hypot(x - 0.15, y + 0.1) < 0.4)[..., None]
    return np.concatenate([color * alpha, alpha], axis=-1).astype(np.float32)


def frame_of(scale: int, display: DisplayProfile = MINI, **changes) -> Frame:
    """Frame of that light field."""
    array = CameraArray.for_display(display, width=1.6)
    return Frame(**{"display": display, "scale": scale, "array": array, "matrix_world": IDENTITY, "samples": 16,
                    "color": ColorSettings(), "seconds": {"render": 1.0}} | changes)


def write_render(folder: Path, scale: int = 2, display: DisplayProfile = MINI, **changes) -> Path:
    """Folder as the render stage leaves it."""
    high = light_field(display)
    height, width, _ = high.shape
    across, down = (scale if many else 1 for many in display.parallax)
    low = high.reshape(height // down, down, width // across, across, 4).mean((1, 3))
    write_layers(folder / LOW_RES_FILE, {"color": low})
    write_frame(folder, frame_of(scale, display, **changes))
    return folder


def write_apart(folder: Path, world: float | None = None,
                paint: Callable[[np.ndarray], np.ndarray] = lambda color: color) -> Path:
    """A render whose world lies beside it: a gradient, or of one colour; ``paint`` changes what it shows."""
    write_render(folder, world_visible=True, world_apart=True)
    color = paint(read_layers(folder / LOW_RES_FILE)["color"])
    write_layers(folder / LOW_RES_FILE, {"color": color, "environment": np.repeat(1 - color[..., 3:], 3, -1)})
    width, height = WorldImage.of(finished_layout(frame_of(2))).size
    right, down = np.meshgrid(np.linspace(0.1, 0.9, width), np.linspace(0.2, 0.6, height))
    picture = np.stack([right, down, right * down], -1) if world is None else np.full((height, width, 3), world)
    write_layers(folder / WORLD_FILE, {"color": picture.astype(np.float32)})
    return folder


def write_traced(folder: Path, display: DisplayProfile, **changes) -> Path:
    """Folder as the render stage leaves it with the layout subpixels."""
    write_layers(folder / LOW_RES_FILE, {"color": traced_panel(display)})
    write_frame(folder, frame_of(1, display, layout=SUBPIXELS, **changes))
    return folder


def write_reference(folder: Path, noise: float = 0.05, display: DisplayProfile = MINI, **changes) -> Path:
    """Folder of two independently noisy halves, of all lenses or of ``lens_list``."""
    frame, high = frame_of(1, display, **changes), light_field(display)
    if frame.lens_list is not None:
        high = tiles(high, frame)
    random = np.random.default_rng(1)
    for name in REFERENCE_FILES:
        half = high.copy()
        half[..., :3] += half[..., 3:] * random.normal(0, noise, half[..., :3].shape).astype(np.float32)
        write_layers(folder / name, {"color": np.maximum(half, 0)})
    write_frame(folder, frame)
    return folder


def tiles(image: np.ndarray, frame: Frame) -> np.ndarray:
    """The listed lenses of an EIA side by side, as RayLayout places them."""
    (px, py), (across, down) = frame.display.views, frame.rays.tiles
    result = np.zeros((down * py, across * px, image.shape[2]), np.float32)
    for tile in range(across * down):
        row, column = frame.lens_list[min(tile, len(frame.lens_list) - 1)]
        y, x = tile // across * py, tile % across * px
        result[y:y + py, x:x + px] = image[row * py:(row + 1) * py, column * px:(column + 1) * px]
    return result


def fails(arguments: list[str], capsys) -> str:
    """The one sentence on standard error of a run that must be refused."""
    assert main(arguments) == 2
    captured = capsys.readouterr()
    assert captured.out == ""
    assert captured.err.count("\n") == 1, captured.err
    return captured.err
