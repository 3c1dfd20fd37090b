"""The second stage: from a rendered frame folder to the finished EIA.

Three arguments are for the laboratory: ``step``, elemental images per call of the method, None for as many as suit it;
``selection``, False to count every lens as foreground; ``upscaler``, a network in place of the method's upscaler.
"""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Mapping
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import numpy as np

from lfsr_core.base.arrays import Array
from lfsr_core.base.cores import usable_cores
from lfsr_core.base.errors import LfsrError
from lfsr_core.base.notices import Notice, Progress, Tell, silent
from lfsr_core.frames.finish import Finish, Report
from lfsr_core.frames.frame import (
    EIA_FILE,
    EIA_LINEAR_FILE,
    LOW_RES_FILE,
    MASK_FILE,
    PANEL_FILE,
    SUBPIXELS,
    Frame,
    read_frame,
    read_rendered,
)
from lfsr_core.frames.low_res import (
    LowResEIA,
    foreground_mask,
    foreground_pixels,
    low_resolution,
    over_background,
    read_world,
    unseen_notices,
)
from lfsr_core.images.exr import HALF_MAX, read_finite, read_layers, replaced_notices, write_layers
from lfsr_core.images.png import write_mask, write_png
from lfsr_core.images.view_transform import ViewTransform, exposure_notices
from lfsr_core.optics.eia import flip_order, to_elemental_images
from lfsr_core.optics.panel.subpixel_rays import panel_image
from lfsr_core.optics.panel.weave import cached_gather_map, weave
from lfsr_core.reconstruct.assembly import Assembly, StageClock, filled, finish_lenses, peak_bytes, place, upscale_all
from lfsr_core.reconstruct.averaging import Neighbour, average_frames, averaging_notices, neighbours_of, read_low
from lfsr_core.reconstruct.methods import (
    AS_RENDERED,
    METHODS,
    PLAIN_METHOD,
    SUBPIXEL_METHODS,
    Method,
    MethodName,
    load_method,
)
from lfsr_core.reconstruct.methods.denoise import denoise_eia, span
from lfsr_core.reconstruct.methods.oidn import Note, Wanted
from lfsr_core.reconstruct.upscaler import Upscaler

FILL_METHOD = PLAIN_METHOD
MOST_JUDGED = 200  # elemental images that decide whether the image is nearly black or white
NEED_LENSES = ("dilate", "weights", "linear_exr", "temporal_averaging")
ROWS_AT_ONCE, MOST_WORKERS = 64, 8


def finish_into(folder: str | Path, staged: Path, finish: Finish | str, tell: Tell = silent, *,
                step: int | None = None, selection: bool = True, upscaler: Upscaler | None = None) -> Report:
    """Write the images of a finished frame folder into ``staged``, and return the report; ``folder`` is only read.

    They are eia.png, mask.png, eia.exr where it is asked for, and panel.png for a display with a lens sheet; after
    direct subpixel rendering panel.png alone. LfsrError for bad input.
    """
    finish, rendered = Finish.of(finish), read_rendered(folder)
    if rendered.subpixels:
        return finish_subpixels(Path(folder), staged, rendered, finish, tell)
    work = _begin(folder, finish, upscaler)
    frame, clock, show = work.frame, work.clock, _view_transform(work)
    ready = _prepare(work, tell, selection)
    pixels, linear = _panel_images(work, ready.assembly, show, tell, step)
    if frame.display.is_woven:
        tell(Progress("weave", 0.0, PANEL_FILE))
        with clock("map"):
            mapped = cached_gather_map(frame.display)
        with clock("weave"):
            panel = weave(pixels, mapped)
        with clock("write"):
            write_png(staged / PANEL_FILE, panel)
    tell(Progress("write", 0.0, EIA_FILE))
    assembly = ready.assembly
    with clock("write"):
        write_png(staged / EIA_FILE, pixels)
        write_mask(staged / MASK_FILE, assembly.mask)
        if linear is not None:
            write_layers(staged / EIA_LINEAR_FILE, {"color": linear}, half=True)
    lenses = np.argwhere(assembly.mask | assembly.fill)
    rows, columns = lenses[::len(lenses) // MOST_JUDGED + 1].T
    judged = to_elemental_images(pixels, frame.rays.tiles)[rows, columns]
    notes = (*filter(None, [frame.scale_reason]), *frame.notes,
             *replaced_notices(ready.replaced, assembly.low.alpha.size),
             *(ready.unseen or exposure_notices(judged, show.to_uint8(work.background[None])[0])),
             *assembly.low.notes, *averaging_notices(ready.neighbours))
    return Report(
        finish=finish, method=work.method.name.text, display=frame.display.name, scale=frame.scale,
        samples=frame.samples,
        seconds=clock.rounded, peak_bytes=peak_bytes(), foreground_fraction=float(assembly.mask.mean()), notes=notes,
        replaced_pixels=ready.replaced, layout=frame.layout, device=frame.device,
        neighbours=tuple(each.number for each in ready.neighbours), averaged=ready.averaged)


def finished_panel(folder: str | Path, finish: Finish | str, tell: Tell = silent, *, step: int | None = None,
                   selection: bool = True, upscaler: Upscaler | None = None) -> Array:
    """Pixels of eia.png, (H, W, 3) uint8 in panel order; writes nothing."""
    work = _begin(folder, Finish.of(finish), upscaler)
    show = _view_transform(work)
    return _panel_images(work, _prepare(work, tell, selection).assembly, show, tell, step)[0]


def finished_linear(folder: str | Path, finish: Finish | str, tell: Tell = silent, *, step: int | None = None,
                    selection: bool = True, upscaler: Upscaler | None = None) -> Array:
    """Finished EIA, (H, W, 3) float32, scene-linear, in view order; writes nothing."""
    return linear_and_mask(folder, finish, tell, step=step, selection=selection, upscaler=upscaler)[0]


def linear_and_mask(folder: str | Path, finish: Finish | str, tell: Tell = silent, *, step: int | None = None,
                    selection: bool = True, upscaler: Upscaler | None = None) -> tuple[Array, Array]:
    """EIA like that of ``finished_linear``, and its foreground mask (sy, sx); writes nothing."""
    work = _begin(folder, Finish.of(finish), upscaler)
    assembly = _prepare(work, tell, selection).assembly
    result = filled(assembly.size, work.background)

    def put(lenses: Array, images: Array) -> None:
        place(result, work.frame.rays.tiles, lenses, images, flipped=False)

    upscale_all(assembly, step, put, work.clock, tell)
    return result, assembly.mask


def finished_lenses(low: LowResEIA, mask: Array, finish: Finish | str, lenses: Array, *,
                    upscaler: Upscaler | None = None, block: int | None = None) -> Array:
    """Finished EIs (n, py, px, 3) float32, scene-linear, of a few ``lenses`` (n, 2), as in a whole frame.

    ``low``: as rendered, before any prefilter. ``mask`` (n,) bool: lenses in the foreground; the others are filled in.
    ``block``: see ``pooling.Pooling``.
    """
    finish = Finish.of(finish)
    name = MethodName.parse(finish.method)
    method = load_method(name if upscaler else name.at_scale(low.scale), finish.weights, upscaler=upscaler,
                             block=block)
    ready = method.prepare(low)
    images = np.empty((len(lenses), *low.finished_views, low.color.shape[-1]), np.float32)
    for wanted, chosen in ((mask, method.upscaler), (~mask, _filler(method, low.scale))):
        if wanted.any():
            images[wanted] = finish_lenses(chosen, ready, lenses[wanted])
    return images


def read_finished_linear(folder: str | Path) -> Array | None:
    """Read the EIA of ``finished_linear`` from eia.exr, to half precision; None where there is no such file.

    LfsrError where the file is damaged or has another size than the frame.
    """
    path, frame = Path(folder) / EIA_LINEAR_FILE, read_frame(folder)
    if not path.exists():
        return None
    pixels, tiles = read_layers(path)["color"][..., :3].astype(np.float32), frame.rays.tiles
    size = tuple(count * views for count, views in zip(tiles[::-1], frame.display.views[::-1], strict=True))
    if pixels.shape[:2] != size:
        raise LfsrError(f"{path} has {pixels.shape[1]}×{pixels.shape[0]} pixels, but its frame {size[1]}×{size[0]}: "
                        "finish the frame again with a linear EXR")
    return flip_order(pixels, tiles) if frame.display.ei_order == "flipped" else pixels


@dataclasses.dataclass(frozen=True)
class _Work:
    """A frame on its way through the second stage."""

    folder: Path
    frame: Frame
    finish: Finish
    method: Method
    clock: StageClock

    @property
    def background(self) -> Array:
        """Colour (3,) float32 of the display's background, scene-linear."""
        return np.asarray(self.frame.display.background, np.float32)


@dataclasses.dataclass(frozen=True)
class _Ready:
    """A frame before its first lens is finished."""

    assembly: Assembly
    replaced: int  # pixels that were not finite
    unseen: list[Notice]  # where the subject is not seen
    neighbours: list[Neighbour]  # for temporal averaging
    averaged: float | None  # fraction of the image that was averaged


def _begin(folder: str | Path, finish: Finish, upscaler: Upscaler | None) -> _Work:
    """Read the frame, and load what the finish's method is at its scale."""
    frame, name = read_frame(folder), MethodName.parse(finish.method)
    if upscaler is None:
        name.check_scale(frame.scale)
        name = name.at_scale(frame.scale)
    return _Work(Path(folder), frame, finish, load_method(name, finish.weights, upscaler=upscaler),
                 StageClock(frame.seconds))


def _view_transform(work: _Work) -> ViewTransform:
    with work.clock("color"):
        return ViewTransform(work.frame.color, math.prod((*work.frame.rays.tiles, *work.frame.display.views)))


def _filler(method: Method, scale: int) -> Upscaler:
    """Upscaler of the lenses beside the foreground."""
    made: Upscaler = method.upscaler if scale == 1 else METHODS[FILL_METHOD].make(None)
    return made


def _prepare(work: _Work, tell: Tell, selection: bool) -> _Ready:
    frame, clock, method, count = work.frame, work.clock, work.method, work.finish.temporal_averaging
    averaged, neighbours = None, neighbours_of(work.folder, frame, count) if count else []
    tell(Progress("load", 0.0, LOW_RES_FILE))
    with clock("load"):
        layers, replaced = read_finite(work.folder / LOW_RES_FILE)
        low = low_resolution(layers, frame, read_world(work.folder, frame))
    if count:
        tell(Progress("average", 0.0, "neighbouring frames"))
        with clock("average"):
            low, averaged = average_frames(low, (read_low(each.folder) for each in neighbours if each.usable))
    with clock("mask"):
        unseen, mask = unseen_notices(layers), foreground_mask(layers, frame.rays.tiles, work.finish.dilate)
        mask = np.zeros_like(mask) if unseen else mask
        mask = mask if selection else np.ones_like(mask)
        fill = ~mask & (low.alpha.any(axis=(2, 3, 4)) | frame.world_visible)
    tell(Progress("upscale", 0.0, "+".join(method.name.prefilters)))
    with clock("upscale"):
        low = method.prepare(low)
    assembly = Assembly(low, mask, fill, method.upscaler, _filler(method, frame.scale))
    return _Ready(assembly, replaced, unseen, neighbours, averaged)


def _panel_images(work: _Work, assembly: Assembly, show: ViewTransform, tell: Tell,
                  step: int | None) -> tuple[Array, Array | None]:
    """Finished EIA in panel order: uint8 as Blender shows it and, where asked for, scene-linear float16."""
    frame, clock, size = work.frame, work.clock, assembly.size
    with clock("assemble"):
        pixels = filled(size, show.to_uint8(work.background[None])[0])
        linear = filled(size, work.background.astype(np.float16)) if work.finish.linear_exr else None
    grid, flipped = frame.rays.tiles, frame.display.ei_order == "flipped"

    def put(lenses: Array, images: Array) -> None:
        with clock("color"):
            shown = show.to_uint8(images)
        with clock("assemble"):
            place(pixels, grid, lenses, shown, flipped)
            if linear is not None:
                place(linear, grid, lenses, np.minimum(images, HALF_MAX), flipped)

    upscale_all(assembly, step, put, clock, tell)
    return pixels, linear


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
