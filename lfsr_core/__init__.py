"""LFSR: path-traced light-field images for integral-imaging displays.

``__all__`` lists the public names; docs/reference/python.md shows how to use them. Importing this package is quick:
each name is loaded from its module when it is first used, and neither Blender nor torch nor NumPy is loaded before.
"""

TYPE_CHECKING = False  # here, because the module typing takes long to load
if TYPE_CHECKING:  # the same names once more, for type checkers
    from lfsr_core.api import RenderedFrame, render
    from lfsr_core.base.messages import LfsrError, Notice, Progress
    from lfsr_core.exports.formats import export
    from lfsr_core.exports.importing import ImportGeometry, import_views
    from lfsr_core.exports.light_field import eia_to_views, views_to_eia, write_views
    from lfsr_core.exports.options import ExportOptions
    from lfsr_core.exports.page import Page, write_page
    from lfsr_core.frames.folder import FrameFolder
    from lfsr_core.frames.frame import Finish, Frame, Report, Request, Sampling
    from lfsr_core.images.image_files import read_png, write_png
    from lfsr_core.metrics.eia_metrics import Metrics, Reference, compare_folders
    from lfsr_core.optics.display import DisplayProfile, load_display
    from lfsr_core.optics.eye import eye_view
    from lfsr_core.optics.rays import CameraArray, RayLayout
    from lfsr_core.pipeline.make import Made, make
    from lfsr_core.plan.options import PlanOptions
    from lfsr_core.plan.planner import Planned, make_plan
    from lfsr_core.process.child import Blender, find_blender
    from lfsr_core.reconstruct.methods import MethodName
    from lfsr_core.reconstruct.second_stage import finish_frame
    from lfsr_core.version import __version__

__all__ = [
    "Blender", "CameraArray", "DisplayProfile", "ExportOptions", "Finish", "Frame", "FrameFolder", "ImportGeometry",
    "LfsrError", "Made", "MethodName", "Metrics", "Notice", "Page", "PlanOptions", "Planned", "Progress", "RayLayout",
    "Reference", "RenderedFrame", "Report", "Request", "Sampling", "__version__", "compare_folders", "eia_to_views",
    "export", "eye_view", "find_blender", "finish_frame", "import_views", "load_display", "make", "make_plan",
    "read_png", "render", "views_to_eia", "write_page", "write_png", "write_views"]

_MODULES = {
    "exports.light_field": "eia_to_views views_to_eia write_views",
    "metrics.eia_metrics": "Reference Metrics compare_folders", "api": "RenderedFrame render",
    "base.messages": "LfsrError Notice Progress", "exports.formats": "export",
    "exports.importing": "ImportGeometry import_views", "exports.options": "ExportOptions",
    "exports.page": "Page write_page", "frames.folder": "FrameFolder",
    "frames.frame": "Finish Frame Report Request Sampling", "images.image_files": "read_png write_png",
    "optics.display": "DisplayProfile load_display", "optics.eye": "eye_view", "optics.rays": "CameraArray RayLayout",
    "pipeline.make": "Made make", "plan.options": "PlanOptions", "plan.planner": "Planned make_plan",
    "process.child": "Blender find_blender", "reconstruct.methods": "MethodName",
    "reconstruct.second_stage": "finish_frame", "version": "__version__"}


if not TYPE_CHECKING:  # so that checkers find a misspelt name
    def __getattr__(name: str) -> object:
        """Load a public name from its module."""
        import importlib

        home = next((module for module, names in _MODULES.items() if name in names.split()), None)
        if home is None:
            raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
        value = getattr(importlib.import_module(f"{__name__}.{home}"), name)
        globals()[name] = value
        return value


def __dir__() -> list[str]:
    return sorted({*globals(), *__all__})
