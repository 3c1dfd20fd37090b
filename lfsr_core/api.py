"""Functions for notebooks: render a scene to views, and finish a low-resolution EIA, in one line each.

    frame = lfsr_core.render("scene.blend", display="fhd", rays=1)
    frame.views[10, 10]                         # what one camera sees
"""

from __future__ import annotations

import builtins
import sys
from pathlib import Path
from typing import Any

import numpy as np

from lfsr_core.base.arrays import Array, Bytes
from lfsr_core.base.messages import LfsrError, Tell, silent
from lfsr_core.commands.common import ProgressBar, method_of
from lfsr_core.exports.formats import export
from lfsr_core.exports.light_field import read_views
from lfsr_core.exports.options import ExportOptions
from lfsr_core.frames import frame as files
from lfsr_core.frames.folder import FrameFolder
from lfsr_core.frames.frame import Finish, Report, Request, Sampling, check_light, check_scene, scales_up_to
from lfsr_core.images.image_files import encode_png, read_layers, read_png
from lfsr_core.metrics.eia_metrics import Metrics, compare_folders
from lfsr_core.optics.display import DisplayProfile, load_display
from lfsr_core.optics.eye import eye_view
from lfsr_core.optics.rays import from_elemental_images
from lfsr_core.pipeline.make import make
from lfsr_core.process.child import Starts
from lfsr_core.reconstruct.second_stage import finish_frame, finished_lenses, finished_linear, read_finished_linear
from lfsr_core.reconstruct.upscaler import LowResEIA


class RenderedFrame:
    """A frame folder that reads its images when they are used; a notebook shows it as an eye in front of it sees it."""

    def __init__(self, folder: str | Path, tell: Tell = silent) -> None:
        self.folder = FrameFolder(folder)
        self._tell = tell

    @property
    def display(self) -> DisplayProfile:
        """The display that it was rendered for."""
        return self.folder.rendered.display

    @property
    def report(self) -> Report:
        """How it was finished."""
        return self.folder.report

    @property
    def views(self) -> Bytes:
        """Views (py, px, sy, sx, 3) uint8, display values; row 0 is the topmost camera, column 0 the leftmost."""
        return read_views(self.folder.path)

    @property
    def linear(self) -> Array:
        """Finished EIA (H, W, 3) float32, scene-linear, in view order; computed again if there is no eia.exr."""
        stored = read_finished_linear(self.folder.path)
        return finished_linear(self.folder.path, self.report.finish) if stored is None else stored

    @property
    def depth(self) -> Array:
        """Depth (h, w) of the first hit behind each rendered pixel, in view order and scene units from the camera
        plane; NaN where nothing is covered. LfsrError where the frame has no position layer.
        """
        layers, frame = read_layers(self.folder.path / files.LOW_RES_FILE), self.folder.frame
        if "position" not in layers:
            raise LfsrError(f"{self.folder.path} has no position layer: render it with layers=('position',)")
        matrix = np.asarray(frame.matrix_world)
        depth = (layers["position"] - matrix[:3, 3]) @ matrix[:3, 2]
        return np.where(layers["color"][..., 3] > 0, depth, np.nan).astype(np.float32)

    def finish(self, method: str | None = None, **options: Any) -> RenderedFrame:
        """Run the second stage with ``method``, None for the best; ``options``: fields of ``Finish``. Return self."""
        wanted = Finish(method_of(method, bool(self.folder.rendered.subpixels)), **options)
        finish_frame(self.folder.path, wanted, self._tell)
        return self

    def eye(self, x: float = 0.0, y: float = 0.0, z: float | None = None) -> Bytes:
        """Return what an eye sees through the lenses, (rows, columns, 3) uint8.

        ``x``, ``y``, ``z``: millimetres to the right, up and towards the viewer from the display's centre; ``z`` None
        for the viewing distance. LfsrError where there is no finished image.
        """
        display = self.display
        image = read_png(self.folder.path / files.PANEL_FILE if display.is_woven else self.folder.image)
        return np.asarray(eye_view(image, display, (x, y, display.viewing_distance_mm if z is None else z)), np.uint8)

    def compare(self, reference: str | Path | RenderedFrame) -> Metrics:
        """Return the metrics of the frame against a reference folder, and write them into its report."""
        other = reference.folder.path if isinstance(reference, RenderedFrame) else Path(reference)
        return compare_folders(self.folder.path, other)

    def export(self, format: str, target: str | Path | None = None, **options: Any) -> list[Path]:
        """Export it as ``format``, such as "quilt"; ``options``: fields of ``ExportOptions``. Return the files."""
        return export(self.folder.path, format, target, ExportOptions(**options, tell=self._tell))

    def _repr_png_(self) -> bytes:
        return b"".join(encode_png(self.eye()))

    def __repr__(self) -> str:
        frame = self.folder.rendered
        return f"<frame {self.folder.path}: {frame.display.name}, scale {frame.scale}, {frame.samples} samples>"


def render(scene: str | Path, output: str | Path | None = None, *, display: str | Path | DisplayProfile = "fhd",
           rays: float | None = None, samples: int | None = None, scale: int | None = None, method: str | None = None,
           blender: str | Starts | None = None, overwrite: bool = True, progress: Tell | bool | None = None,
           finish: dict[str, Any] | None = None, **request: Any) -> RenderedFrame:
    """Render a scene and finish it; return the frame.

    Parameters
    ----------
    scene : .blend, .glb, .gltf or .obj
    output : frame folder, by default one with the scene's name in the current folder
    display : name or file of a display profile, or a profile
    rays : paths per finished pixel; None for the default
    samples : samples per rendered pixel, instead of ``rays``
    scale : factor by which the number of views in each direction is divided; None to choose it by the scene's depth
    method : method of the second stage, None for the best that this machine can run
    blender : executable, None for the best one found
    overwrite : False to keep a finished image of the same request
    progress : True or False to show it or not, or a function; None for True in a terminal or a notebook
    finish, request : further fields of ``Finish`` and of ``Request``, such as ``frame`` or ``camera``

    LfsrError for bad input, or with the error that Blender reports.
    """
    profile = display if isinstance(display, DisplayProfile) else load_display(str(display))
    subpixels = request.get("layout") == files.SUBPIXELS
    scales = (scale,) if scale is not None else (1,) if subpixels else scales_up_to(profile)
    given = {"device": files.AUTO, "layers": ("position",), "light": files.AUTO} | request
    given["light"] = check_light(given["light"])
    asked = Request(str(output or Path(scene).stem), profile, check_scene(scene),
                    sampling=Sampling.of(profile, scales, rays, samples, direct=subpixels), **given)
    if progress is None:
        progress = sys.stderr.isatty() or hasattr(builtins, "__IPYTHON__")  # a notebook
    bar = ProgressBar() if progress and not callable(progress) else None
    tell = bar or (progress if callable(progress) else silent)
    try:
        make(asked, Finish(method_of(method, subpixels), **finish or {}), blender=blender, tell=tell,
             overwrite=overwrite)
    finally:
        if bar:
            bar.close()
    return RenderedFrame(asked.output, tell)


def reconstruct(low: LowResEIA, method: str = "bilinear") -> Array:
    """Return the finished EIA (H, W, 3) of a low-resolution one in memory, scene-linear float32 in view order.

    ``low``: as of ``reconstruct.upscaler``, with colour and coverage at least; every lens is foreground. LfsrError
    for an unknown method.
    """
    rows, columns = low.color.shape[:2]
    lenses = np.argwhere(np.ones((rows, columns), bool))
    images = finished_lenses(low, np.ones(len(lenses), bool), method, lenses)
    return from_elemental_images(images.reshape(rows, columns, *images.shape[1:]))
