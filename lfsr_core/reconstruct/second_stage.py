"""From a low-resolution frame to the finished EIA: the second stage, step by step."""

from __future__ import annotations

import dataclasses
import math
from pathlib import Path

import numpy as np

from lfsr_core.arrays import Array
from lfsr_core.errors import LfsrError
from lfsr_core.frames.foreground import foreground_mask
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
from lfsr_core.frames.low_res import LowResEIA, low_resolution
from lfsr_core.frames.report import Report, write_report
from lfsr_core.frames.world import read_world
from lfsr_core.images.exposure import exposure_notes
from lfsr_core.images.exr import HALF_MAX, clean, read_layers, write_layers
from lfsr_core.images.png import write_mask, write_png
from lfsr_core.images.view_transform import ViewTransform
from lfsr_core.optics.eia import to_elemental_images
from lfsr_core.optics.panel.gather_cache import cached_gather_map
from lfsr_core.optics.panel.weave import weave
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
from lfsr_core.reconstruct.world import BeforeWorld, prepared

FILL_METHOD = PLAIN_METHOD
MOST_JUDGED = 200  # elemental images that say whether the picture is black


def upscale_frame(folder: str | Path, method: str | MethodName, options: UpscaleOptions = DEFAULT) -> Report:
    """Write eia.png, mask.png and report.json of a rendered frame folder; return the report.

    And eia.exr where asked for, panel.png where the display has a lens sheet to weave for. Of a render of the panel's
    subpixels panel.png and report.json alone.

    LfsrError for bad input; then nothing in the folder is half-written.
    """
    rendered, name = read_rendered(folder), MethodName.parse(method)
    if rendered.panel_rays:
        check_panel_finish(name, options)
        return finish_panel(Path(folder), rendered, name, options.progress)
    run = _begin(folder, registry.method(name, options.weights), options)
    show = _shown_by(run)
    assembly, replaced = _prepare(run)
    pixels, linear = _panel_images(run, show, assembly)
    panel = _woven(run, pixels)
    with run.clock("write"):
        _write_panel(run, panel)
        _write(run, pixels, linear, assembly.mask)
    report = _report(run, assembly, replaced, _exposure_notes(run, show, assembly, pixels))
    write_report(run.folder, report)
    return report


def panel_image(folder: str | Path, method: Method, options: UpscaleOptions = DEFAULT) -> Array:
    """The pixels of eia.png, (H, W, 3) uint8 in panel order. Writes nothing."""
    run = _begin(folder, method, options)
    show = _shown_by(run)
    return _panel_images(run, show, _prepare(run)[0])[0]


def finished_linear(folder: str | Path, method: str | MethodName, options: UpscaleOptions = DEFAULT) -> Array:
    """The finished EIA, (H, W, 3) float32, scene-linear, in view order: what metrics compare. Writes nothing."""
    return linear_and_mask(folder, registry.method(method, options.weights), options)[0]


def read_finished_linear(folder: str | Path) -> Array | None:
    """The finished EIA as ``finished_linear`` makes it, from the folder's eia.exr; None where there is none.

    To half precision. A second stage that writes no eia.exr removes that of an earlier one.
    LfsrError where it is damaged or of another size than the folder's eia.png has to be.
    """
    path, frame = Path(folder) / EIA_LINEAR_FILE, read_frame(folder)
    if not path.exists():
        return None
    pixels, tiles = read_layers(path)["color"][..., :3].astype(np.float32), frame.rays.tiles
    size = tuple(count * views for count, views in zip(tiles[::-1], frame.display.views[::-1], strict=True))
    if pixels.shape[:2] != size:
        raise LfsrError(f"{path} has {pixels.shape[1]}×{pixels.shape[0]} pixels, but its frame {size[1]}×{size[0]}: "
                        "finish the frame again with --linear-exr")
    if frame.display.ei_order != "flipped":
        return pixels
    result, images = np.empty_like(pixels), to_elemental_images(pixels, tiles)
    lenses = np.argwhere(np.ones(tiles[::-1], bool))
    place(result, tiles, lenses, images[lenses[:, 0], lenses[:, 1]], flipped=True)
    return result


def linear_and_mask(folder: str | Path, method: Method, options: UpscaleOptions = DEFAULT) -> tuple[Array, Array]:
    """``finished_linear`` and the foreground mask (sy, sx) that it was made with. Writes nothing."""
    run = _begin(folder, method, options)
    assembly, _ = _prepare(run)
    result = filled(assembly.size, np.asarray(run.frame.display.background, np.float32))

    def finish(lenses: Array, images: Array) -> None:
        place(result, run.frame.rays.tiles, lenses, images, flipped=False)

    upscale_all(assembly, options.step, finish, run.clock, options.progress)
    return result, assembly.mask


def finished_lenses(low: LowResEIA, mask: Array, method: Method, lenses: Array) -> Array:
    """Elemental images of a few lenses, made as those of a whole frame are.

    Parameters
    ----------
    low : what was rendered, before any prefilter
    mask : (n,) bool, which of ``lenses`` are foreground; the others are filled in
    method : what finishes them
    lenses : (n, 2) rows and columns

    Returns
    -------
    (n, py, px, 3) float32, scene-linear
    """
    ready = prepared(low, method)
    images = np.empty((len(lenses), *low.finished_views, low.color.shape[-1]), np.float32)
    for wanted, upscaler in ((mask, method.upscaler), (~mask, _filler(method, low.scale))):
        if wanted.any():
            images[wanted] = BeforeWorld(upscaler)(ready, lenses[wanted])
    return images


@dataclasses.dataclass(frozen=True)
class _Run:
    """One frame on its way through the second stage."""

    folder: Path
    frame: Frame
    method: Method
    options: UpscaleOptions
    clock: StageClock
    neighbours: list[Neighbour]  # frames that it may share with


def _begin(folder: str | Path, method: Method, options: UpscaleOptions) -> _Run:
    frame = read_frame(folder)
    method.name.check_scale(frame.scale)
    beside = neighbours_of(Path(folder), frame, options.temporal_averaging) if options.temporal_averaging else []
    return _Run(Path(folder), frame, method, options, StageClock(), beside)


def _shown_by(run: _Run) -> ViewTransform:
    tiles, views = run.frame.rays.tiles, run.frame.display.views
    with run.clock("color"):
        return ViewTransform(run.frame.color, math.prod((*tiles, *views)))


def _filler(method: Method, scale: int) -> Upscaler:
    """What finishes the lenses beside the foreground."""
    return method.upscaler if scale == 1 else registry.CLASSICAL[FILL_METHOD]


def _prepare(run: _Run) -> tuple[Assembly, int]:
    """Everything before the first lens, and how many pixels were not finite."""
    frame, clock, progress = run.frame, run.clock, run.options.progress
    clock.seconds["render"] = float(sum(frame.seconds.get(step, 0.0) for step in ("open", "render")))
    progress("load", 0.0, LOW_RES_FILE)
    with clock("load"):
        layers, replaced = clean(read_layers(run.folder / LOW_RES_FILE))
        low = low_resolution(layers, frame, read_world(run.folder, frame))
    low = _with_neighbours(run, low)
    with clock("mask"):
        mask = foreground_mask(layers, frame.rays.tiles, run.options.dilate)
        mask = mask if run.options.selection else np.ones_like(mask)
        fill = ~mask & (low.alpha.any(axis=(2, 3, 4)) | frame.world_visible)
    progress("upscale", 0.0, "+".join(run.method.name.prefilters))
    with clock("upscale"):
        low = prepared(low, run.method)
    upscalers = (BeforeWorld(upscaler) for upscaler in (run.method.upscaler, _filler(run.method, frame.scale)))
    return Assembly(low, mask, fill, *upscalers), replaced


def _with_neighbours(run: _Run, low: LowResEIA) -> LowResEIA:
    if not run.options.temporal_averaging:
        return low
    run.options.progress("share", 0.0, "neighbouring frames")
    with run.clock("share"):
        return average_frames(low, (read_low(each.folder) for each in run.neighbours if each.usable))


def _panel_images(run: _Run, show: ViewTransform, assembly: Assembly) -> tuple[Array, Array | None]:
    """The finished EIA in panel order: uint8 as Blender shows it and, where asked for, scene-linear float16."""
    clock, background = run.clock, np.asarray(run.frame.display.background, np.float32)
    with clock("assemble"):
        pixels = filled(assembly.size, show.to_uint8(background[None])[0])
        linear = filled(assembly.size, background.astype(np.float16)) if run.options.linear_exr else None
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


def _woven(run: _Run, pixels: Array) -> Array | None:
    """The image of a panel with a lens sheet; None where the EIA is the panel's image."""
    display = run.frame.display
    if not display.is_woven:
        return None
    run.options.progress("weave", 0.0, PANEL_FILE)
    with run.clock("map"):
        mapped = cached_gather_map(display)
    with run.clock("weave"):
        return weave(pixels, mapped)


def _write_panel(run: _Run, panel: Array | None) -> None:
    if panel is None:
        (run.folder / PANEL_FILE).unlink(missing_ok=True)
    else:
        write_png(run.folder / PANEL_FILE, panel)


def _write(run: _Run, pixels: Array, linear: Array | None, mask: Array) -> None:
    run.options.progress("write", 0.0, EIA_FILE)
    write_png(run.folder / EIA_FILE, pixels)
    write_mask(run.folder / MASK_FILE, mask)
    if linear is None:
        # One of an earlier run would show another method than eia.png.
        (run.folder / EIA_LINEAR_FILE).unlink(missing_ok=True)
    else:
        write_layers(run.folder / EIA_LINEAR_FILE, {"color": linear}, half=True)
    run.options.progress("write", 1.0, EIA_FILE)


def _exposure_notes(run: _Run, show: ViewTransform, assembly: Assembly, pixels: Array) -> list[str]:
    """A sentence if what the finished ``pixels`` show is almost black or almost white."""
    images = to_elemental_images(pixels, run.frame.rays.tiles)
    lenses = np.argwhere(assembly.mask | assembly.fill)
    rows, columns = lenses[::len(lenses) // MOST_JUDGED + 1].T
    background = show.to_uint8(np.asarray(run.frame.display.background, np.float32)[None])[0]
    return exposure_notes(images[rows, columns], background)


def _report(run: _Run, assembly: Assembly, replaced: int, notes: list[str]) -> Report:
    frame, name, options = run.frame, run.method.name, run.options
    return Report(
        method=name.text, display=frame.display.name, scale=frame.scale, samples=frame.samples,
        seconds={stage: round(seconds, 4) for stage, seconds in run.clock.seconds.items()},
        peak_bytes=peak_bytes(), foreground_fraction=float(assembly.mask.mean()),
        notes=(*filter(None, [frame.scale_reason]), *notes, *name.guide_notes(assembly.low.layers),
               *assembly.upscaler.notes, *averaging_notes(run.neighbours)),
        replaced_pixels=replaced, dilate=options.dilate, layout=frame.layout, device=frame.device,
        weights=str(options.weights) if options.weights else None, temporal_averaging=options.temporal_averaging,
        neighbours=tuple(each.number for each in run.neighbours))
