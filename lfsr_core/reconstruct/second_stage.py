"""From a low-resolution frame to the finished EIA: the second stage, step by step."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from lfsr_core.files import write_json
from lfsr_core.frames.foreground import foreground_mask
from lfsr_core.frames.frame import EIA_FILE, EIA_LINEAR_FILE, LOW_RES_FILE, MASK_FILE, REPORT_FILE, Frame, read_frame
from lfsr_core.frames.low_res import low_resolution
from lfsr_core.images.exr import HALF_MAX, clean, read_layers, write_layers
from lfsr_core.images.png import write_mask, write_png
from lfsr_core.images.view_transform import ViewTransform
from lfsr_core.progress import Progress, silent
from lfsr_core.reconstruct.assembly import Plan, filled, place, upscale_all
from lfsr_core.reconstruct.clock import StageClock, peak_bytes
from lfsr_core.reconstruct.method_name import PLAIN_METHOD, MethodName
from lfsr_core.reconstruct.registry import Method, method

FILL_METHOD = PLAIN_METHOD


def upscale_frame(folder: str | Path, method_name: str, *, step: int | None = None, dilate: int = 0,
                  linear_exr: bool = False, weights: str | Path | None = None,
                  progress: Progress | None = None) -> dict[str, Any]:
    """Write eia.png, mask.png and report.json (and eia.exr) of a rendered frame folder; return the report.

    ``method_name`` as in ``upscale.METHODS``; ``step``: elemental images per
    call of the method (default: one row of lenses); ``dilate``: lenses by which
    the foreground mask grows; ``weights``: file for the method's network instead of
    the shipped one; ``progress(stage, fraction, message)``. LfsrError for bad input;
    then nothing in the folder is half-written.
    """
    folder, clock, progress = Path(folder), StageClock(), progress or silent
    chosen, frame = method(method_name, weights), read_frame(folder)
    show = ViewTransform(frame.color)
    plan, replaced = _prepare(folder, frame, chosen, dilate, clock, progress)
    background = np.asarray(frame.display.background, np.float32)
    with clock("assemble"):
        pixels = filled(plan.size, show.to_uint8(background[None])[0])
        linear = filled(plan.size, background.astype(np.float16)) if linear_exr else None
    grid, flipped = frame.rays.tiles, frame.display.ei_order == "flipped"

    def finish(lenses: np.ndarray, images: np.ndarray) -> None:
        with clock("color"):
            shown = show.to_uint8(images)
        with clock("assemble"):
            place(pixels, grid, lenses, shown, flipped)
            if linear is not None:
                place(linear, grid, lenses, np.minimum(images, HALF_MAX), flipped)

    upscale_all(plan, step, finish, clock, progress)
    with clock("write"):
        _write(folder, pixels, linear, plan.mask, progress)
    report = _report(chosen.name, plan, frame, clock) | {
        "replaced_pixels": replaced, "dilate": dilate, "weights": str(weights) if weights else None}
    write_json(folder / REPORT_FILE, report)
    return report


def finished_linear(folder: str | Path, method_name: str, *, step: int | None = None, dilate: int = 0,
                    weights: str | Path | None = None, progress: Progress | None = None) -> np.ndarray:
    """The finished EIA, (H, W, 3) float32, scene-linear, in view order: what metrics compare. Writes nothing."""
    folder, clock, progress = Path(folder), StageClock(), progress or silent
    frame = read_frame(folder)
    plan, _ = _prepare(folder, frame, method(method_name, weights), dilate, clock, progress)
    result = filled(plan.size, np.asarray(frame.display.background, np.float32))

    def finish(lenses: np.ndarray, images: np.ndarray) -> None:
        place(result, frame.rays.tiles, lenses, images, flipped=False)

    upscale_all(plan, step, finish, clock, progress)
    return result


def _prepare(folder: Path, frame: Frame, chosen: Method, dilate: int, clock: StageClock,
             progress: Progress) -> tuple[Plan, int]:
    """Everything before the first strip, and how many pixels were not finite."""
    clock.seconds["render"] = float(sum(frame.seconds.values()))
    progress("load", 0.0, LOW_RES_FILE)
    with clock("load"):
        layers, replaced = clean(read_layers(folder / LOW_RES_FILE))
        low = low_resolution(layers, frame)
    with clock("mask"):
        mask = foreground_mask(layers, frame.rays.tiles, dilate)
        fill = ~mask & (low.alpha.any(axis=(2, 3, 4)) | frame.world_visible)
    progress("upscale", 0.0, "+".join(chosen.name.prefilters))
    with clock("upscale"):
        low = chosen.prepare(low)
    filler = chosen.upscaler if frame.scale == 1 else method(FILL_METHOD).upscaler
    return Plan(low, mask, fill, chosen.upscaler, filler), replaced


def _write(folder: Path, pixels: np.ndarray, linear: np.ndarray | None, mask: np.ndarray, progress: Progress) -> None:
    progress("write", 0.0, EIA_FILE)
    write_png(folder / EIA_FILE, pixels)
    write_mask(folder / MASK_FILE, mask)
    if linear is None:
        # One of an earlier run would show another method than eia.png.
        (folder / EIA_LINEAR_FILE).unlink(missing_ok=True)
    else:
        write_layers(folder / EIA_LINEAR_FILE, {"color": linear}, half=True)
    progress("write", 1.0, EIA_FILE)


def _report(method_name: MethodName, plan: Plan, frame: Frame, clock: StageClock) -> dict[str, Any]:
    """Entries of report.json, see docs/reference/frame-folder.md."""
    return {
        "method": method_name.text,
        "display": frame.display.name,
        "scale": frame.scale,
        "samples": frame.samples,
        "seconds": {stage: round(seconds, 4) for stage, seconds in clock.seconds.items()},
        "peak_bytes": peak_bytes(),
        "foreground_share": float(plan.mask.mean()),
        "notes": [*method_name.guide_notes(plan.low.layers), *plan.upscaler.notes],
        "metrics": {},
    }
