"""The second stage: from a rendered frame folder to the finished EIA.

Two arguments are for the laboratory: ``selection``, False to count every lens as foreground; ``upscaler``, a network
in place of the method's upscaler. Only a few elemental images at a time exist in linear light: an 8K image of floats
would take 400 MB, and longer to move than to make.
"""

import contextlib
import functools
import math
import threading
import time
from collections.abc import Callable, Iterator, Mapping
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np

from lfsr_core.base import system
from lfsr_core.base.arrays import Array
from lfsr_core.base.messages import LfsrError, Notice, Progress, Tell, silent
from lfsr_core.frames import frame as files
from lfsr_core.frames.frame import SUBPIXELS, Finish, Frame, Report, read_frame, read_rendered, write_report
from lfsr_core.images import image_files
from lfsr_core.images.color import ViewTransform, exposure_notices
from lfsr_core.optics.panel.subpixel_rays import panel_image
from lfsr_core.optics.panel.weave import cached_gather_map, weave
from lfsr_core.optics.rays import flip_order, to_elemental_images
from lfsr_core.reconstruct.averaging import average_frames, averaging_notices, neighbours_of, read_low
from lfsr_core.reconstruct.methods import METHODS, PLAIN_METHOD, SUBPIXEL_METHODS, Method, MethodName, load_method
from lfsr_core.reconstruct.methods.denoise import Note, Wanted, denoise_eia, span
from lfsr_core.reconstruct.upscaler import (
    LowResEIA,
    Upscaler,
    foreground_mask,
    foreground_pixels,
    low_resolution,
    over_background,
    read_world,
    unseen_notices,
)

MOST_JUDGED = 200  # elemental images that decide whether the image is nearly black or white
NEED_LENSES = ("dilate", "weights", "linear_exr", "temporal_averaging")
FINISHED_FILES = (files.EIA_FILE, files.EIA_LINEAR_FILE, files.MASK_FILE, files.PANEL_FILE)
STAGES = ("render", "load", "mask", "upscale", "assemble", "color", "write")
view_transform = functools.lru_cache(maxsize=2)(ViewTransform)  # the same for every image of an animation


def finish_frame(folder: str | Path, finish: Finish | str, tell: Tell = silent,
                 upscaler: Upscaler | None = None) -> Report:
    """Finish a rendered frame folder: write its images and report.json, and return the report.

    Images are eia.png, mask.png, eia.exr where it is asked for, and panel.png for a display with a lens sheet; after
    direct subpixel rendering panel.png alone. LfsrError for bad input, or where another process writes into the folder;
    all files are replaced together or none. ``upscaler``: for the laboratory, see above.
    """
    folder, finish = Path(folder), Finish.of(finish)
    rendered = read_rendered(folder)
    direct = rendered.subpixels is not None
    with system.staging_folder(folder) as staging, system.system_errors(folder):
        staged = staging / "finished"
        staged.mkdir()
        report = (_finish_subpixels(folder, staged, rendered, finish, tell) if direct
                  else _finish_eia(folder, staged, finish, tell, upscaler))
        write_report(staged, report)
        system.replace_files(staged, folder, () if direct else FINISHED_FILES)
    tell(Progress("write", 1.0, files.PANEL_FILE if direct else files.EIA_FILE))
    return report


def _finish_eia(folder: Path, staged: Path, finish: Finish, tell: Tell, upscaler: Upscaler | None) -> Report:
    """Write the images of a frame folder with a light field into the folder ``staged``."""
    work = _Work(folder, finish, tell, upscaler=upscaler)
    frame, clock = work.frame, work.clock
    pixels, linear = work.panel_images(tell)
    if frame.display.is_woven:
        tell(Progress("weave", 0.0, files.PANEL_FILE))
        with clock("map"):
            mapped = cached_gather_map(frame.display)
        with clock("weave"):
            panel = weave(pixels, mapped)
        with clock("write"):
            image_files.write_png(staged / files.PANEL_FILE, panel)
    tell(Progress("write", 0.0, files.EIA_FILE))
    with clock("write"):
        image_files.write_png(staged / files.EIA_FILE, pixels)
        image_files.write_mask(staged / files.MASK_FILE, work.mask)
        if linear is not None:
            image_files.write_layers(staged / files.EIA_LINEAR_FILE, {"color": linear}, half=True)
    lenses = np.argwhere(work.mask | work.fill)
    rows, columns = lenses[::len(lenses) // MOST_JUDGED + 1].T
    judged = to_elemental_images(pixels, frame.rays.tiles)[rows, columns, ::2, ::2]
    notes = (*filter(None, [frame.scale_reason]), *frame.notes,
             *image_files.replaced_notices(work.replaced, work.low.alpha.size),
             *(work.unseen or exposure_notices(judged, work.show.to_uint8(work.background[None])[0])),
             *work.low.notes, *(averaging_notices(work.neighbours) if work.neighbours else ()))
    return _report(frame, finish, clock, method=work.method.name.text, notes=notes, replaced_pixels=work.replaced,
                   foreground_fraction=float(work.mask.mean()),
                   neighbours=tuple(neighbour.number for neighbour in work.neighbours), averaged=work.averaged)


def finished_panel(folder: str | Path, finish: Finish | str, *, selection: bool = True,
                   upscaler: Upscaler | None = None) -> Array:
    """Pixels of eia.png, (H, W, 3) uint8 in panel order; writes nothing."""
    return _Work(folder, Finish.of(finish), silent, selection, upscaler).panel_images(silent)[0]


def finished_linear(folder: str | Path, finish: Finish | str, tell: Tell = silent, *, selection: bool = True,
                    upscaler: Upscaler | None = None) -> Array:
    """Finished EIA, (H, W, 3) float32, scene-linear, in view order; writes nothing."""
    work = _Work(folder, Finish.of(finish), tell, selection, upscaler, shows=False)
    result = filled(work.size, work.background)
    work.upscale_all(lambda lenses, images: place(result, work.frame.rays.tiles, lenses, images, flipped=False), tell)
    return result


def finished_lenses(low: LowResEIA, mask: Array, finish: Finish | str, lenses: Array, *,
                    upscaler: Upscaler | None = None) -> Array:
    """Finished EIs (n, py, px, 3) float32, scene-linear, of a few ``lenses`` (n, 2), as in a whole frame.

    ``low``: as rendered, before any prefilter. ``mask`` (n,) bool: lenses in the foreground; the others are filled in.
    """
    method, filler = _loaded(Finish.of(finish), low.scale, upscaler)
    ready = method.prepare(low)
    images = np.empty((len(lenses), *low.finished_views, low.color.shape[-1]), np.float32)
    for wanted, chosen in ((mask, method.upscaler), (~mask, filler)):
        if wanted.any():
            images[wanted] = finish_lenses(chosen, ready, lenses[wanted])
    return images


def read_finished_linear(folder: str | Path) -> Array | None:
    """Read the EIA of ``finished_linear`` from eia.exr, to half precision; None where there is no such file.

    LfsrError where the file is damaged or has another size than the frame.
    """
    path, frame = Path(folder) / files.EIA_LINEAR_FILE, read_frame(folder)
    if not path.exists():
        return None
    pixels, tiles = image_files.read_layers(path)["color"][..., :3].astype(np.float32), frame.rays.tiles
    size = tuple(count * views for count, views in zip(tiles[::-1], frame.display.views[::-1], strict=True))
    if pixels.shape[:2] != size:
        raise LfsrError(f"{path} has {pixels.shape[1]}×{pixels.shape[0]} pixels, but its frame {size[1]}×{size[0]}: "
                        "finish the frame again with a linear EXR")
    return flip_order(pixels, tiles) if frame.display.ei_order == "flipped" else pixels


class StageClock:
    """``with clock("load"): ...`` adds the wall time of the block to ``seconds["load"]``.

    While ``threads`` of them run at once each block counts for 1 / ``threads``, so that the stages add up to the time
    that passed. ``rendered``: seconds per step of the render, from its frame.
    """

    def __init__(self, rendered: Mapping[str, float] | None = None) -> None:
        self.seconds: dict[str, float] = dict.fromkeys(STAGES, 0.0)
        self.seconds["render"] = float(sum((rendered or {}).get(step, 0.0) for step in ("open", "render")))
        self.threads, self._lock = 1, threading.Lock()

    @contextmanager
    def __call__(self, stage: str) -> Iterator[None]:
        started = time.perf_counter()
        try:
            yield
        finally:
            passed = time.perf_counter() - started
            with self._lock:
                self.seconds[stage] = self.seconds.get(stage, 0.0) + passed / self.threads


class _Work:
    """A frame on its way through the second stage: read, averaged and prefiltered before its first lens is finished."""

    def __init__(self, folder: str | Path, finish: Finish, tell: Tell, selection: bool = True,
                 upscaler: Upscaler | None = None, shows: bool = True) -> None:
        """``shows``: whether display values are made too, for which the view transform is loaded."""
        folder, frame = Path(folder), read_frame(folder)
        self.frame, self.finish, self.clock = frame, finish, StageClock(frame.seconds)
        self.method, self.filler = _loaded(finish, frame.scale, upscaler)
        self.background = np.asarray(frame.display.background, np.float32)  # (3,), scene-linear
        self.averaged: float | None = None  # fraction of the image
        count = finish.temporal_averaging
        self.neighbours = neighbours_of(folder, frame, count) if count else []
        tell(Progress("load", 0.0, files.LOW_RES_FILE))
        with ThreadPoolExecutor(1) as beside:
            # A table of the view transform takes as long as reading, and neither keeps all cores busy.
            show = beside.submit(view_transform, frame.color,
                                 math.prod((*frame.rays.tiles, *frame.display.views))) if shows else None
            with self.clock("load"):
                without = () if self.method.upscaler.follows_depth else ("position",)
                # replaced: pixels that were not finite
                layers, self.replaced = image_files.read_finite(folder / files.LOW_RES_FILE, without)
                low = low_resolution(layers, frame, read_world(folder, frame))
            if show is not None:
                with self.clock("color"):
                    self.show = show.result()
        if count:
            tell(Progress("average", 0.0, "neighbouring frames"))
            with self.clock("average"):
                usable = (each.folder for each in self.neighbours if each.same_rays and not each.same_seed)
                low, self.averaged = average_frames(low, map(read_low, usable))
        with self.clock("mask"):
            self.unseen = unseen_notices(layers)
            mask = foreground_mask(layers, frame.rays.tiles, finish.dilate)
            # (sy, sx) bool, lenses for the method's upscaler, and for the filler
            self.mask = np.full_like(mask, not selection) if self.unseen or not selection else mask
            self.fill = ~self.mask & (low.alpha.any(axis=(2, 3, 4)) | frame.world_visible)
        tell(Progress("upscale", 0.0, "+".join(self.method.name.prefilters)))
        with self.clock("upscale"):
            self.low = self.method.prepare(low)

    @property
    def size(self) -> tuple[int, int]:
        """(height, width) of the finished EIA."""
        (sy, sx), (py, px) = self.mask.shape, self.low.finished_views
        return sy * py, sx * px

    def panel_images(self, tell: Tell) -> tuple[Array, Array | None]:
        """Finished EIA in panel order: uint8 as Blender shows it and, where asked for, scene-linear float16."""
        show = self.show
        with self.clock("assemble"):
            pixels = filled(self.size, show.to_uint8(self.background[None])[0])
            linear = filled(self.size, self.background.astype(np.float16)) if self.finish.linear_exr else None
        grid, flipped = self.frame.rays.tiles, self.frame.display.ei_order == "flipped"

        def put(lenses: Array, images: Array) -> None:
            with self.clock("color"):
                shown = show.to_uint8(images)
            with self.clock("assemble"):
                place(pixels, grid, lenses, shown, flipped)
                if linear is not None:
                    place(linear, grid, lenses, np.minimum(images, image_files.HALF_MAX), flipped)

        self.upscale_all(put, tell)
        return pixels, linear

    def upscale_all(self, put: Callable[[Array, Array], None], tell: Tell) -> None:
        """Finish every lens, in several threads and in any order.

        ``put`` is called with lenses (n, 2) and their elemental images (n, py, px, 3), scene-linear: as many as stay in
        a core's cache, or one row of the display for an upscaler that uses every core itself. Such upscalers run one
        call at a time.
        """
        parts: list[tuple[Upscaler, Array]] = []
        for wanted, upscaler in ((self.mask, self.method.upscaler), (self.fill, self.filler)):
            some = 4 * system.in_cache(math.prod(self.low.finished_views))  # pooled at a quarter of their pixels
            size, lenses = some if upscaler.thread_safe else wanted.shape[1], np.argwhere(wanted)
            parts += [(upscaler, lenses[start:start + size]) for start in range(0, len(lenses), size)]
        workers = max(1, min(system.usable_cores(), system.MOST_THREADS, len(parts)))
        one_at_a_time = threading.Lock()

        def work(part: tuple[Upscaler, Array]) -> None:
            upscaler, lenses = part
            with contextlib.nullcontext() if upscaler.thread_safe else one_at_a_time, self.clock("upscale"):
                images = finish_lenses(upscaler, self.low, lenses)
            put(lenses, images)

        most = 1 if self.method.upscaler.thread_safe else None
        self.clock.threads = workers
        with blas_threads(most), ThreadPoolExecutor(workers) as pool:
            for done, _ in enumerate(pool.map(work, parts), start=1):
                tell(Progress("upscale", done / len(parts), f"{done} of {len(parts)} steps"))
        self.clock.threads = 1


def _loaded(finish: Finish, scale: int, upscaler: Upscaler | None) -> tuple[Method, Upscaler]:
    """The method that finishes a render at ``scale``, and the upscaler of the lenses beside the foreground."""
    name = MethodName.parse(finish.method)
    if upscaler is None:
        name.check_scale(scale)
        name = name.at_scale(scale)
    method = load_method(name, finish.weights, upscaler=upscaler)
    return method, method.upscaler if scale == 1 else METHODS[PLAIN_METHOD].make()


def _report(frame: Frame, finish: Finish, clock: StageClock, **facts: Any) -> Report:
    """Report of a frame, with the ``facts`` of the second stage."""
    return Report(finish=finish, display=frame.display.name, scale=frame.scale, samples=frame.samples,
                  seconds={stage: round(seconds, 4) for stage, seconds in clock.seconds.items()},
                  peak_bytes=system.peak_bytes(), layout=frame.layout, device=frame.device, **facts)


def check_subpixels_finish(finish: Finish) -> None:
    """LfsrError where the method or one of its options needs elemental images."""
    if MethodName.parse(finish.method).text not in SUBPIXEL_METHODS:
        raise LfsrError(f"method {finish.method!r} needs elemental images, which the layout {SUBPIXELS} does not have: "
                        f"choose one of {', '.join(SUBPIXEL_METHODS)}")
    for name in (name for name in NEED_LENSES if getattr(finish, name)):
        raise LfsrError(f"--{name.replace('_', '-')} is for elemental images, which the layout {SUBPIXELS} does not "
                        "have: leave it out")


def _finish_subpixels(folder: Path, staged: Path, frame: Frame, finish: Finish, tell: Tell) -> Report:
    """Write the panel.png of a frame folder after direct subpixel rendering into the folder ``staged``."""
    check_subpixels_finish(finish)
    clock, said, method = StageClock(frame.seconds), list[Notice](), MethodName.parse(finish.method)
    tell(Progress("load", 0.0, files.LOW_RES_FILE))
    with clock("load"):
        layers, replaced = image_files.read_finite(folder / files.LOW_RES_FILE)
    tell(Progress("denoise", 0.0, method.text))
    with clock("upscale"):
        image = linear_panel_image(layers, frame, method, said.append)
    tell(Progress("color", 0.0, files.PANEL_FILE))
    with clock("color"):
        show = view_transform(frame.color, image.shape[0] * image.shape[1])
        pixels = np.empty(image.shape, np.uint8)

        def work(rows: slice) -> None:
            pixels[rows] = show.to_uint8(image[rows])

        system.in_threads(work, *image.shape[:2])
    with clock("write"):
        image_files.write_png(staged / files.PANEL_FILE, pixels)
    background = show.to_uint8(np.asarray(frame.display.background, np.float32)[None])[0]
    notes = (*frame.notes, *image_files.replaced_notices(replaced, layers["color"][..., 3].size), *said,
             *(unseen_notices(layers) or exposure_notices(pixels, background)))
    return _report(frame, finish, clock, method=method.text, notes=notes, replaced_pixels=replaced,
                   foreground_fraction=float(foreground_pixels(layers).mean()))


def linear_panel_image(layers: Mapping[str, Array], frame: Frame, method: MethodName, note: Note = silent) -> Array:
    """Panel image (H, W, 3), scene-linear, from the layers of a direct subpixel rendering; ``note`` hears notices."""
    assert frame.subpixels is not None, "a frame of direct subpixel rendering has them"
    shown = over_background(layers, frame)
    if method.prefilters:
        # Of the rectangle that shows more than the background.
        seen = (shown != np.asarray(frame.display.background, np.float32)).any(-1)
        part = span(seen.any(1), 1), span(seen.any(0), 1)
        if shown[part].size:
            shown = shown.copy()
            shown[part] = denoise_eia(shown[part], device=Wanted.of(frame.device, frame.gpus), note=note)
    return panel_image(frame.subpixels, shown)


def filled(size: tuple[int, int], color: Array) -> Array:
    """Buffer (H, W, C) filled with one ``color`` (C,), of its type."""
    buffer = np.empty((*size, len(color)), color.dtype)
    # Row by row, as broadcasting one pixel would copy byte by byte.
    buffer[:] = np.tile(color, (size[1], 1))
    return buffer


def place(buffer: Array, grid: tuple[int, int], lenses: Array, images: Array, flipped: bool) -> None:
    """Copy EIs ``images`` (n, py, px, C) of ``lenses`` (n, 2) into an EIA (H, W, C) with a ``grid`` (sx, sy) of lenses.

    ``flipped``: reverse the pixels of each EI in both axes, the order of a panel behind lenses.
    """
    if flipped:
        count, *_, channels = images.shape
        # One item per pixel, which NumPy moves three times as fast as three channels.
        pixels = np.ascontiguousarray(images).reshape(count, -1, channels).view(f"V{channels * images.itemsize}")
        images = np.ascontiguousarray(pixels[:, ::-1]).view(images.dtype).reshape(images.shape)
    slots = to_elemental_images(buffer, grid)
    for (row, column), image in zip(lenses, images, strict=True):
        slots[row, column] = image


def finish_lenses(upscaler: Upscaler, low: LowResEIA, lenses: Array) -> Array:
    """EIs (N, h·s, w·s, 3), scene-linear, of ``lenses`` (N, 2): upscaled, before the world where there is one.

    Before a world the low-resolution EIA holds the subject alone, over black, and its opacity. The opacity is denoised
    and upscaled as colour is, along the same depth and in the same domain, so that no dark or bright seam is left
    between subject and world; the world itself is known at full resolution and without noise.
    """
    if low.world is None:
        return upscaler(low, lenses)
    assert low.places is not None and low.opacity is not None and low.cover is not None, "Method.prepare has checked it"
    rows, columns = lenses.T
    # Light of the world that passes the subject.
    images = low.world.elemental_images(low.places[rows, columns])
    some = low.opacity[rows, columns].any((1, 2, 3)) | low.rendered[rows, columns].any((1, 2, 3))
    if some.any():
        passing = 1 - np.clip(upscaler(low.cover, lenses[some]), 0, 1)
        images[some] = images[some] * passing + upscaler(low, lenses[some])
    return images


def blas_threads(most: int | None) -> contextlib.AbstractContextManager[Any]:
    """At most ``most`` BLAS threads inside the block, None for as many as there are.

    Workers that each started threads of their own would wait for one another. No effect without threadpoolctl:
    the add-on, which brings no packages, starts our process with one thread.
    """
    try:
        from threadpoolctl import threadpool_limits
    except ImportError:
        return contextlib.nullcontext()
    limits: contextlib.AbstractContextManager[Any] = threadpool_limits(most, "blas")
    return limits
