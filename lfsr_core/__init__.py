"""LFSR: path-traced light-field images for integral-imaging displays.

The names in ``__all__`` are the public face; each is loaded from its module when it
is first used. Importing this package imports neither Blender nor torch nor NumPy.

    from lfsr_core import Job, compare_folders, find_blender, load_display, run_job, upscale_frame

    run_job(Job("frame", load_display("fhd"), scene="scene.blend"), find_blender())
    report = upscale_frame("frame", "oidn+bicubic")
"""

from __future__ import annotations

import importlib
from typing import Any

__version__ = "0.1.0"

_HOMES = {
    "CameraArray": "optics.rays",
    "DisplayProfile": "optics.display",
    "Frame": "frames.frame",
    "Job": "frames.job",
    "LfsrError": "errors",
    "RayLayout": "optics.rays",
    "Reference": "frames.reference",
    "MethodName": "reconstruct.method_name",
    "compare_folders": "metrics.compare",
    "export": "exports.formats",
    "find_blender": "render.blender",
    "import_views": "exports.importing",
    "load_display": "optics.display",
    "make_plan": "plan.planner",
    "read_frame": "frames.frame",
    "read_layers": "images.exr",
    "run_job": "render.process",
    "eye_view": "optics.eye",
    "upscale_frame": "reconstruct.second_stage",
    "write_page": "exports.page",
    "write_views": "frames.contact_sheet",
}
__all__ = ["__version__", *_HOMES]  # noqa: PLE0604  (all are texts)


def __getattr__(name: str) -> Any:
    """A public name, from its module."""
    if name not in _HOMES:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    value = getattr(importlib.import_module(f"{__name__}.{_HOMES[name]}"), name)
    globals()[name] = value
    return value


def __dir__() -> list[str]:
    return sorted({*globals(), *_HOMES})
