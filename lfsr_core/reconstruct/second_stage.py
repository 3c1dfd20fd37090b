"""The second stage: from a rendered frame folder to the finished EIA."""

from __future__ import annotations

import dataclasses
import functools
import math
from pathlib import Path

import numpy as np

from lfsr_core.base.arrays import Array
from lfsr_core.base.errors import LfsrError
from lfsr_core.base.files import system_errors
from lfsr_core.frames.foreground import foreground_mask, unseen_notes
from lfsr_core.frames.frame import (
    EIA_FILE,
    EIA_LINEAR_FILE,
    LOW_RES_FILE,
    MASK_FILE,
    PANEL_FILE,
    Frame,
    read_frame,
    read_rendered,
)
from lfsr_core.frames.low_res import LowResEIA, low_resolution, read_world
from lfsr_core.frames.report import Report, write_report
from lfsr_core.images.exposure import exposure_notes
from lfsr_core.images.exr import HALF_MAX, read_finite, read_layers, replaced_notes, write_layers
from lfsr_core.images.png import write_mask, write_png
from lfsr_core.images.view_transform import ViewTransform
from lfsr_core.optics.eia import flip_order, to_elemental_images
from lfsr_core.optics.panel.gather_cache import cached_gather_map
from lfsr_core.optics.panel.weave import weave
from lfsr_core.pipeline.staging import replace_files, staging_folder
from lfsr_core.reconstruct import registry
from lfsr_core.reconstruct.assembly import Assembly, filled, place, upscale_all
from lfsr_core.reconstruct.clock import StageClock, peak_bytes
from lfsr_core.reconstruct.contract import Upscaler
from lfsr_core.reconstruct.method_name import PLAIN_METHOD, MethodName
from lfsr_core.reconstruct.methods.temporal_averaging import average_frames
from lfsr_core.reconstruct.neighbours import Neighbour, averaging_notes, neighbours_of, read_low
from lfsr_core.reconstruct.options import DEFAULT, UpscaleOptions
from lfsr_core.reconstruct.panel_stage import check_panel_finish, finish_panel
from lfsr_core.reconstruct.registry import Method
from lfsr_core.reconstruct.world import finish_lenses, prepared

FILL_METHOD = PLAIN_METHOD
FINISHED_FILES = (EIA_FILE, EIA_LINEAR_FILE, MASK_FILE, PANEL_FILE)
MOST_JUDGED = 200  # elemental images that decide whether the image is nearly black or white


def upscale_frame(folder: str | Path, method: str | MethodName, options: UpscaleOptions = DEFAULT) -> Report:
    """Finish a rendered frame folder: write eia.png, mask.png and report.json.

    Also writes eia.exr where the options ask for it, and panel.png for a display with a lens sheet. After direct
    subpixel rendering it writes panel.png and report.json alone. LfsrError for bad input, or where another process
    writes into the folder; all files are replaced together or none.
    """
    folder, rendered, name = Path(folder), read_rendered(folder), MethodName.parse(method)
    if rendered.panel_rays:
        check_panel_finish(name, options)
    with staging_folder(folder) as staging, system_errors(folder):
        staged = staging / "finished"
        staged.mkdir()
        report = (finish_panel(folder, staged, rendered, name, options.progress) if rendered.panel_rays
                  else _finish(_begin(folder, registry.method(name, options.weights), options), staged))
        write_report(staged, report)
        replace_files(staged, folder, () if rendered.panel_rays else FINISHED_FILES)
    options.progress("write", 1.0, PANEL_FILE if rendered.panel_rays else EIA_FILE)
    return report


def _finish(run: _Run, staged: Path) -> Report:
    """Write the images of a finished light field into the folder ``staged``."""
    show = _view_transform(run)
    assembly, replaced, averaged, unseen = _prepare(run)
    pixels, linear = _panel_images(run, show, assembly)
    _write_panel(run, staged, pixels)
    run.options.progress("write", 0.0, EIA_FILE)
    with run.clock("write"):
        _write(staged, pixels, linear, assembly.mask)
    notes = unseen or _exposure_notes(run, show, assembly, pixels)
    return dataclasses.replace(_report(run, assembly, replaced, notes), averaged=averaged)


def panel_image(folder: str | Path, method: Method, options: UpscaleOptions = DEFAULT) -> Array:
    """Pixels of eia.png, (H, W, 3) uint8 in panel order; writes nothing."""
    run = _begin(folder, method, options)
    show = _view_transform(run)
    return _panel_images(run, show, _prepare(run)[0])[0]


def finished_linear(folder: str | Path, method: str | MethodName, options: UpscaleOptions = DEFAULT) -> Array:
    """Finished EIA, (H, W, 3) float32, scene-linear, in view order; writes nothing."""
    return linear_and_mask(folder, registry.method(method, options.weights), options)[0]


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
                        "finish the frame again with --linear-exr")
    return flip_order(pixels, tiles) if frame.display.ei_order == "flipped" else pixels


def linear_and_mask(folder: str | Path, method: Method, options: UpscaleOptions = DEFAULT) -> tuple[Array, Array]:
    """EIA like that of ``finished_linear``, and its foreground mask (sy, sx); writes nothing."""
    run = _begin(folder, method, options)
    assembly, *_ = _prepare(run)
    result = filled(assembly.size, run.background)
    finish = functools.partial(place, result, run.frame.rays.tiles, flipped=False)
    upscale_all(assembly, options.step, finish, run.clock, options.progress)
    return result, assembly.mask


def finished_lenses(low: LowResEIA, mask: Array, method: Method, lenses: Array) -> Array:
    """Finished EIs (n, py, px, 3) float32, scene-linear, of a few ``lenses`` (n, 2), as in a whole frame.

    ``low``: as rendered, before any prefilter. ``mask`` (n,) bool: lenses in the foreground; the others are filled in.
    """
    ready = prepared(low, method)
    images = np.empty((len(lenses), *low.finished_views, low.color.shape[-1]), np.float32)
    for wanted, upscaler in ((mask, method.upscaler), (~mask, _filler(method, low.scale))):
        if wanted.any():
            images[wanted] = finish_lenses(upscaler, ready, lenses[wanted])
    return images


@dataclasses.dataclass(frozen=True)
class _Run:
    """One frame on its way through the second stage."""

    folder: Path
    frame: Frame
    method: Method
    options: UpscaleOptions
    clock: StageClock
    neighbours: list[Neighbour]  # for temporal averaging

    @property
    def background(self) -> Array:
        """Colour (3,) float32 of the display's background, scene-linear."""
        return np.asarray(self.frame.display.background, np.float32)


def _begin(folder: str | Path, method: Method, options: UpscaleOptions) -> _Run:
    folder, frame = Path(folder), read_frame(folder)
    method.name.check_scale(frame.scale)
    beside = neighbours_of(folder, frame, options.temporal_averaging) if options.temporal_averaging else []
    return _Run(folder, frame, method, options, StageClock(frame.seconds), beside)


def _view_transform(run: _Run) -> ViewTransform:
    with run.clock("color"):
        return ViewTransform(run.frame.color, math.prod((*run.frame.rays.tiles, *run.frame.display.views)))


def _filler(method: Method, scale: int) -> Upscaler:
    """Upscaler of the lenses beside the foreground."""
    return method.upscaler if scale == 1 else registry.CLASSICAL[FILL_METHOD]


def _prepare(run: _Run) -> tuple[Assembly, int, float | None, list[str]]:
    """Everything before the first lens is finished.

    Then the number of pixels that were not finite, the fraction of the image that was averaged, and ``unseen_notes``.
    """
    averaged = None
    frame, clock, progress = run.frame, run.clock, run.options.progress
    progress("load", 0.0, LOW_RES_FILE)
    with clock("load"):
        layers, replaced = read_finite(run.folder / LOW_RES_FILE)
        low = low_resolution(layers, frame, read_world(run.folder, frame))
    if run.options.temporal_averaging:
        progress("average", 0.0, "neighbouring frames")
        with clock("share"):
            low, averaged = average_frames(low, (read_low(each.folder) for each in run.neighbours if each.usable))
    with clock("mask"):
        unseen, mask = unseen_notes(layers), foreground_mask(layers, frame.rays.tiles, run.options.dilate)
        mask = np.zeros_like(mask) if unseen else mask
        mask = mask if run.options.selection else np.ones_like(mask)
        fill = ~mask & (low.alpha.any(axis=(2, 3, 4)) | frame.world_visible)
    progress("upscale", 0.0, "+".join(run.method.name.prefilters))
    with clock("upscale"):
        low = prepared(low, run.method)
    return Assembly(low, mask, fill, run.method.upscaler, _filler(run.method, frame.scale)), replaced, averaged, unseen


def _panel_images(run: _Run, show: ViewTransform, assembly: Assembly) -> tuple[Array, Array | None]:
    """Finished EIA in panel order: uint8 as Blender shows it and, where asked for, scene-linear float16."""
    clock = run.clock
    with clock("assemble"):
        pixels = filled(assembly.size, show.to_uint8(run.background[None])[0])
        linear = filled(assembly.size, run.background.astype(np.float16)) if run.options.linear_exr else None
    grid, flipped = run.frame.rays.tiles, run.frame.display.ei_order == "flipped"

    def finish(lenses: Array, images: Array) -> None:
        with clock("color"):
            shown = show.to_uint8(images)
        with clock("assemble"):
            place(pixels, grid, lenses, shown, flipped)
            if linear is not None:
                place(linear, grid, lenses, np.minimum(images, HALF_MAX), flipped)

    upscale_all(assembly, run.options.step, finish, clock, run.options.progress)
    return pixels, linear


def _write_panel(run: _Run, staged: Path, pixels: Array) -> None:
    """Weave the EIA for a panel with a lens sheet; without one the EIA is the image of the panel."""
    if not run.frame.display.is_woven:
        return
    run.options.progress("weave", 0.0, PANEL_FILE)
    with run.clock("map"):
        mapped = cached_gather_map(run.frame.display)
    with run.clock("weave"):
        panel = weave(pixels, mapped)
    with run.clock("write"):
        write_png(staged / PANEL_FILE, panel)


def _write(staged: Path, pixels: Array, linear: Array | None, mask: Array) -> None:
    write_png(staged / EIA_FILE, pixels)
    write_mask(staged / MASK_FILE, mask)
    if linear is not None:
        write_layers(staged / EIA_LINEAR_FILE, {"color": linear}, half=True)


def _exposure_notes(run: _Run, show: ViewTransform, assembly: Assembly, pixels: Array) -> list[str]:
    """A sentence if the finished ``pixels`` are almost black or almost white."""
    images = to_elemental_images(pixels, run.frame.rays.tiles)
    lenses = np.argwhere(assembly.mask | assembly.fill)
    rows, columns = lenses[::len(lenses) // MOST_JUDGED + 1].T
    return exposure_notes(images[rows, columns], show.to_uint8(run.background[None])[0])


def _report(run: _Run, assembly: Assembly, replaced: int, notes: list[str]) -> Report:
    frame, name, options = run.frame, run.method.name, run.options
    return Report(
        method=name.text, display=frame.display.name, scale=frame.scale, samples=frame.samples,
        seconds=run.clock.rounded, peak_bytes=peak_bytes(), foreground_fraction=float(assembly.mask.mean()),
        notes=_notes(run, assembly, replaced, notes),
        replaced_pixels=replaced, dilate=options.dilate, layout=frame.layout, device=frame.device,
        weights=str(options.weights) if options.weights else None, temporal_averaging=options.temporal_averaging,
        neighbours=tuple(each.number for each in run.neighbours))


def _notes(run: _Run, assembly: Assembly, replaced: int, notes: list[str]) -> tuple[str, ...]:
    frame, low = run.frame, assembly.low
    return (*filter(None, [frame.scale_reason]), *frame.notes, *replaced_notes(replaced, low.alpha.size), *notes,
            *low.notes, *assembly.upscaler.notes, *averaging_notes(run.neighbours))
