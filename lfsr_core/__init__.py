"""LFSR: path-traced light-field images for integral-imaging displays.

``__all__`` lists the public names; docs/reference/python.md shows how to use them. Importing this package is quick:
each name is loaded from its module when it is first used, and neither Blender nor torch nor NumPy is loaded before.

    from lfsr_core import Request, find_blender, load_display, run_job, finish_frame

    run_job(Request("frame", load_display("fhd"), scene="scene.blend"), find_blender())
    report = finish_frame("frame", "denoise+bicubic")
"""

from __future__ import annotations

import importlib
from typing import TYPE_CHECKING

from lfsr_core.version import __version__ as __version__

if TYPE_CHECKING:  # the same names once more, for type checkers
    from lfsr_core.base.errors import LfsrError
    from lfsr_core.exports.formats import export
    from lfsr_core.exports.importing import ImportGeometry, import_views
    from lfsr_core.exports.options import ExportOptions
    from lfsr_core.exports.page import Page, write_page
    from lfsr_core.frames.contact_sheet import write_views
    from lfsr_core.frames.finish import Finish
    from lfsr_core.frames.frame import Frame, read_frame
    from lfsr_core.frames.reference import Reference
    from lfsr_core.frames.report import Report, read_report
    from lfsr_core.frames.request import Request
    from lfsr_core.frames.views import eia_to_views, read_views, views_to_eia
    from lfsr_core.images.png import read_png, write_png
    from lfsr_core.metrics.compare import Metrics, compare_folders
    from lfsr_core.optics.display import DisplayProfile, load_display
    from lfsr_core.optics.eye import eye_view
    from lfsr_core.optics.rays import CameraArray, RayLayout
    from lfsr_core.pipeline.finishing import finish_frame
    from lfsr_core.pipeline.store import run_job
    from lfsr_core.plan.options import PlanOptions
    from lfsr_core.plan.planner import Planned, make_plan
    from lfsr_core.process.blender import Blender, find_blender
    from lfsr_core.reconstruct.methods import MethodName

__all__ = [
    "Blender",
    "CameraArray",
    "DisplayProfile",
    "ExportOptions",
    "Finish",
    "Frame",
    "ImportGeometry",
    "LfsrError",
    "MethodName",
    "Metrics",
    "Page",
    "PlanOptions",
    "Planned",
    "RayLayout",
    "Reference",
    "Report",
    "Request",
    "__version__",
    "compare_folders",
    "eia_to_views",
    "export",
    "eye_view",
    "find_blender",
    "finish_frame",
    "import_views",
    "load_display",
    "make_plan",
    "read_frame",
    "read_png",
    "read_report",
    "read_views",
    "run_job",
    "views_to_eia",
    "write_page",
    "write_png",
    "write_views",
]

_MODULES = {
    "base.errors": "LfsrError",
    "exports.formats": "export",
    "exports.importing": "ImportGeometry import_views",
    "exports.options": "ExportOptions",
    "exports.page": "Page write_page",
    "frames.contact_sheet": "write_views",
    "frames.finish": "Finish",
    "frames.frame": "Frame read_frame",
    "frames.request": "Request",
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
    "reconstruct.methods": "MethodName",
    "pipeline.finishing": "finish_frame",
    "process.blender": "Blender find_blender",
    "pipeline.store": "run_job",
}
_HOMES = {name: module for module, names in _MODULES.items() for name in names.split()}


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
