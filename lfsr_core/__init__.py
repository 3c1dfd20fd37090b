"""LFSR: path-traced light-field images for integral-imaging displays.

``__all__`` lists the public names; docs/reference/python.md shows how to use them. Importing this package is quick:
each name is loaded from its module when it is first used, and neither Blender nor torch nor NumPy is loaded before.

    from lfsr_core import Job, find_blender, load_display, run_job, upscale_frame

    run_job(Job("frame", load_display("fhd"), scene="scene.blend"), find_blender())
    report = upscale_frame("frame", "oidn+bicubic")
"""

from __future__ import annotations

import importlib
from typing import TYPE_CHECKING

if TYPE_CHECKING:  # the same names once more, for type checkers
    from lfsr_core.errors import LfsrError as LfsrError
    from lfsr_core.exports.formats import Exported as Exported
    from lfsr_core.exports.formats import export as export
    from lfsr_core.exports.importing import Imported as Imported
    from lfsr_core.exports.importing import ImportGeometry as ImportGeometry
    from lfsr_core.exports.importing import import_views as import_views
    from lfsr_core.exports.options import ExportOptions as ExportOptions
    from lfsr_core.exports.page import Page as Page
    from lfsr_core.exports.page import write_page as write_page
    from lfsr_core.frames.contact_sheet import write_views as write_views
    from lfsr_core.frames.frame import Frame as Frame
    from lfsr_core.frames.frame import read_frame as read_frame
    from lfsr_core.frames.job import Job as Job
    from lfsr_core.frames.reference import Reference as Reference
    from lfsr_core.frames.report import Report as Report
    from lfsr_core.frames.report import read_report as read_report
    from lfsr_core.frames.views import eia_to_views as eia_to_views
    from lfsr_core.frames.views import read_views as read_views
    from lfsr_core.frames.views import views_to_eia as views_to_eia
    from lfsr_core.images.png import read_png as read_png
    from lfsr_core.images.png import write_png as write_png
    from lfsr_core.metrics.compare import Metrics as Metrics
    from lfsr_core.metrics.compare import compare_folders as compare_folders
    from lfsr_core.optics.display import DisplayProfile as DisplayProfile
    from lfsr_core.optics.display import load_display as load_display
    from lfsr_core.optics.eye import eye_view as eye_view
    from lfsr_core.optics.rays import CameraArray as CameraArray
    from lfsr_core.optics.rays import RayLayout as RayLayout
    from lfsr_core.plan.options import PlanOptions as PlanOptions
    from lfsr_core.plan.planner import Planned as Planned
    from lfsr_core.plan.planner import make_plan as make_plan
    from lfsr_core.reconstruct.method_name import MethodName as MethodName
    from lfsr_core.reconstruct.options import UpscaleOptions as UpscaleOptions
    from lfsr_core.reconstruct.second_stage import upscale_frame as upscale_frame
    from lfsr_core.render.blender import Blender as Blender
    from lfsr_core.render.blender import find_blender as find_blender
    from lfsr_core.render.process import run_job as run_job

__version__ = "0.1.0"

_MODULES = {
    "errors": "LfsrError",
    "exports.formats": "Exported export",
    "exports.importing": "Imported ImportGeometry import_views",
    "exports.options": "ExportOptions",
    "exports.page": "Page write_page",
    "frames.contact_sheet": "write_views",
    "frames.frame": "Frame read_frame",
    "frames.job": "Job",
    "frames.reference": "Reference",
    "frames.report": "Report read_report",
    "frames.views": "eia_to_views read_views views_to_eia",
    "images.png": "read_png write_png",
    "metrics.compare": "Metrics compare_folders",
    "optics.display": "DisplayProfile load_display",
    "optics.eye": "eye_view",
    "optics.rays": "CameraArray RayLayout",
    "plan.options": "PlanOptions",
    "plan.planner": "Planned make_plan",
    "reconstruct.method_name": "MethodName",
    "reconstruct.options": "UpscaleOptions",
    "reconstruct.second_stage": "upscale_frame",
    "render.blender": "Blender find_blender",
    "render.process": "run_job",
}
_HOMES = {name: module for module, names in _MODULES.items() for name in names.split()}
__all__ = ["__version__", *_HOMES]  # noqa: PLE0604  (all are texts)


if not TYPE_CHECKING:  # so that checkers find a misspelt name
    def __getattr__(name: str) -> object:
        """Load a public name from its module."""
        if name not in _HOMES:
            raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
        value = getattr(importlib.import_module(f"{__name__}.{_HOMES[name]}"), name)
        globals()[name] = value
        return value


def __dir__() -> list[str]:
    return sorted({*globals(), *_HOMES})
