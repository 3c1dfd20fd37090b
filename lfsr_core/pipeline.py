"""From a low-resolution frame to the finished EIA: the second stage, step by step."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from lfsr_core.assembly import Plan, filled, place, upscale_all
from lfsr_core.color import ViewTransform
from lfsr_core.eia import to_elemental_images
from lfsr_core.errors import LfsrError
from lfsr_core.files import write_json
from lfsr_core.foreground import foreground_mask
from lfsr_core.frame import EIA_FILE, EIA_LINEAR_FILE, LOW_RES_FILE, MASK_FILE, REPORT_FILE, Frame, read_frame
from lfsr_core.image_io import HALF_MAX, clean, read_layers, write_layers, write_mask, write_png
from lfsr_core.stages import Progress, StageClock, peak_bytes, silent
from lfsr_core.upscale import PLAIN_METHOD, LowResEIA, Method, guide_notes, method

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
    report = _report(method_name, plan, frame, clock) | {
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


def over_background(layers: Mapping[str, np.ndarray], frame: Frame) -> np.ndarray:
    """Opaque scene-linear colour (H, W, 3) >= 0 of a render: over the world where visible, else the display's colour.

    Cycles has already weighted the environment layer by what shows of it, so it
    is added as it is. LfsrError where that layer should be there and is not.
    """
    color = layers["color"]
    if frame.world_visible:
        if "environment" not in layers:
            raise LfsrError("frame.json says that the world is visible, but the EXR has no environment layer: "
                            "render the frame again")
        return np.maximum(color[..., :3] + layers["environment"], 0)
    if not any(frame.display.background):
        return np.maximum(color[..., :3], 0)
    background = np.asarray(frame.display.background, np.float32)
    return np.maximum(color[..., :3] + (1 - np.clip(color[..., 3:], 0, 1)) * background, 0)


def low_resolution(layers: Mapping[str, np.ndarray], frame: Frame) -> LowResEIA:
    """What a method sees, from the layers of lr_eia.exr; LfsrError where their size is not the frame's."""
    width, height = frame.rays.size
    shape = layers["color"].shape
    if shape[:2] != (height, width):
        raise LfsrError(f"{LOW_RES_FILE} has {shape[1]}×{shape[0]} pixels, but frame.json says {width}×{height}: "
                        "render the frame again")

    images = {name: layers[name] for name in ("albedo", "normal", "position") if name in layers}
    images |= {"color": over_background(layers, frame), "alpha": np.clip(layers["color"][..., 3:], 0, 1)}
    aux = {name: to_elemental_images(layer, frame.rays.tiles) for name, layer in images.items()}
    return LowResEIA(aux.pop("color"), aux.pop("alpha"), aux, frame.samples, frame.scale)


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
    progress("upscale", 0.0, "+".join(chosen.name.split("+")[:len(chosen.prefilters)]))
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


def _report(method_name: str, plan: Plan, frame: Frame, clock: StageClock) -> dict[str, Any]:
    """Entries of report.json, see docs/frame-folder.md."""
    return {
        "method": method_name,
        "display": frame.display.name,
        "scale": frame.scale,
        "samples": frame.samples,
        "seconds": {stage: round(seconds, 4) for stage, seconds in clock.seconds.items()},
        "peak_bytes": peak_bytes(),
        "foreground_share": float(plan.mask.mean()),
        "notes": [*guide_notes(method_name, plan.low.aux), *plan.upscaler.notes],
        "metrics": {},
    }
