"""The second stage after direct subpixel rendering, which renders no light field.

The render is denoised, in which every subpixel has a pixel with three colours, rather than the panel image, in which
it has one: three times the pixels, but 1.6 to 3.2 dB more accurate (docs/notebook/displays.md).
"""

from __future__ import annotations

from collections.abc import Mapping
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import numpy as np

from lfsr_core.base.arrays import Array
from lfsr_core.base.cores import usable_cores
from lfsr_core.base.errors import LfsrError
from lfsr_core.base.notices import Notice, Progress, Tell, silent
from lfsr_core.frames.finish import Finish, Report
from lfsr_core.frames.foreground import foreground_pixels, unseen_notices
from lfsr_core.frames.frame import LOW_RES_FILE, PANEL_FILE, SUBPIXELS, Frame
from lfsr_core.frames.low_res import over_background
from lfsr_core.images.exposure import exposure_notices
from lfsr_core.images.exr import read_finite, replaced_notices
from lfsr_core.images.png import write_png
from lfsr_core.images.view_transform import ViewTransform
from lfsr_core.optics.panel.panel_rays import panel_image
from lfsr_core.reconstruct.assembly import StageClock, peak_bytes
from lfsr_core.reconstruct.methods import AS_RENDERED, SUBPIXEL_METHODS, MethodName
from lfsr_core.reconstruct.methods.denoise import denoise_eia, span
from lfsr_core.reconstruct.methods.oidn import Note, Wanted

NEED_LENSES = ("dilate", "weights", "linear_exr", "temporal_averaging")
ROWS_AT_ONCE, MOST_WORKERS = 64, 8


def check_subpixels_finish(finish: Finish) -> None:
    """LfsrError where the method or one of its options needs elemental images."""
    if MethodName.parse(finish.method).text not in SUBPIXEL_METHODS:
        raise LfsrError(f"method {finish.method!r} needs elemental images, which the layout {SUBPIXELS} does not have: "
                        f"choose one of {', '.join(SUBPIXEL_METHODS)}")
    for name in (name for name in NEED_LENSES if getattr(finish, name)):
        raise LfsrError(f"--{name.replace('_', '-')} is for elemental images, which the layout {SUBPIXELS} does not "
                        "have: leave it out")


def finish_subpixels(folder: Path, staged: Path, frame: Frame, finish: Finish, tell: Tell = silent) -> Report:
    """Write the panel.png of a frame folder after direct subpixel rendering into the folder ``staged``."""
    check_subpixels_finish(finish)
    clock, said, method = StageClock(frame.seconds), list[Notice](), MethodName.parse(finish.method)
    tell(Progress("load", 0.0, LOW_RES_FILE))
    with clock("load"):
        layers, replaced = read_finite(folder / LOW_RES_FILE)
    tell(Progress("denoise", 0.0, method.text))
    with clock("upscale"):
        image = linear_panel_image(layers, frame, method, said.append)
    tell(Progress("color", 0.0, PANEL_FILE))
    with clock("color"):
        show = ViewTransform(frame.color, image.shape[0] * image.shape[1])
        pixels = np.empty(image.shape, np.uint8)

        def work(start: int) -> None:
            rows = slice(start, start + ROWS_AT_ONCE)
            pixels[rows] = show.to_uint8(image[rows])

        with ThreadPoolExecutor(min(usable_cores(), MOST_WORKERS)) as pool:
            list(pool.map(work, range(0, len(image), ROWS_AT_ONCE)))
    with clock("write"):
        write_png(staged / PANEL_FILE, pixels)
    background = show.to_uint8(np.asarray(frame.display.background, np.float32)[None])[0]
    notes = (*frame.notes, *replaced_notices(replaced, layers["color"][..., 3].size), *said,
             *(unseen_notices(layers) or exposure_notices(pixels, background)))
    return Report(
        finish=finish, method=method.text, display=frame.display.name, scale=frame.scale, samples=frame.samples,
        seconds=clock.rounded, peak_bytes=peak_bytes(),
        foreground_fraction=float(foreground_pixels(layers).mean()), notes=notes,
        replaced_pixels=replaced, layout=frame.layout, device=frame.device)


def linear_panel_image(layers: Mapping[str, Array], frame: Frame, method: MethodName,
                       note: Note = silent) -> Array:
    """Panel image (H, W, 3), scene-linear, from the layers of a direct subpixel rendering; ``note``: see ``oidn``.

    LfsrError where the layers and the frame differ in size.
    """
    assert frame.subpixels is not None, "a frame of direct subpixel rendering has them"
    (width, height), shape = frame.subpixels.size, layers["color"].shape
    if shape[:2] != (height, width):
        raise LfsrError(f"{LOW_RES_FILE} has {shape[1]}×{shape[0]} pixels, but frame.json says {width}×{height}: "
                        "render the frame again")
    shown = over_background(layers, frame)
    if method.text != AS_RENDERED:
        # Of the rectangle that shows more than the background.
        seen = (shown != np.asarray(frame.display.background, np.float32)).any(-1)
        part = span(seen.any(1), 1), span(seen.any(0), 1)
        if shown[part].size:
            shown = shown.copy()
            shown[part] = denoise_eia(shown[part], device=Wanted.of(frame.device, frame.gpus), note=note)
    return panel_image(frame.subpixels, shown)
