"""Set the OSL shader of a ray layout on a camera."""

from __future__ import annotations

import hashlib
import re
import tempfile
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import bpy

from lfsr_core.base.errors import LfsrError
from lfsr_core.base.files import system_errors
from lfsr_core.optics.rays import RayLayout

from ..scene import devices

ROOM = 10  # times the size of the source that its bytecode has at most
SOURCE = Path(__file__).with_name("ray_layout.osl")


def layout_source(layout: RayLayout) -> str:
    """Return the OSL source with the lens list of ``layout`` as constants: parameters of a shader cannot be arrays."""
    source = SOURCE.read_text(encoding="utf-8")
    if layout.lens_list is None:
        return source
    source = re.sub(r"#define LISTED .*", f"#define LISTED {len(layout.lens_list)}", source)
    for name, axis in (("LENS_ROWS", 0), ("LENS_COLUMNS", 1)):
        values = ", ".join(str(lens[axis]) for lens in layout.lens_list)
        source = re.sub(rf"#define {name} .*", f"#define {name} {{ {values} }}", source)
    return source


def layout_parameters(layout: RayLayout, clip_start: float = 0.0) -> dict[str, int | float]:
    """Return the values of the shader's parameters; rays start at the depth ``clip_start``."""
    array = layout.array
    pairs = {"lenses": layout.lenses, "views": layout.views, "tiles": layout.tiles}
    numbers = {f"{name}_{axis}": pair[i] for name, pair in pairs.items() for i, axis in enumerate("xy")}
    return numbers | {"listed": int(layout.lens_list is not None), "paper": int(layout.convention == "paper"),
                      "half_width": float(array.half_width), "half_height": float(array.half_height),
                      "plane_distance": float(array.distance), "spacing": float(layout.spacing),
                      "cell_x": float(layout.cell[0]), "cell_y": float(layout.cell[1]),
                      "clip_start": float(clip_start)}


def set_shader(camera: bpy.types.Camera, source: str, parameters: Mapping[str, Any]) -> None:
    """Compile OSL ``source`` for ``camera`` and set its parameters; LfsrError if it does not compile."""
    bytecode = compile_osl(source)
    camera.type = "CUSTOM"
    camera.custom_mode = "INTERNAL"
    # After an error above the camera is as before, with its own bytecode and parameters.
    camera.custom_bytecode = bytecode
    camera.custom_bytecode_hash = hashlib.md5(bytecode.encode(), usedforsecurity=False).hexdigest()
    for name in list(camera.cycles_custom.keys()):
        del camera.cycles_custom[name]
    for name, value in parameters.items():
        camera.cycles_custom[name] = value
    camera.update_tag()


def compile_osl(source: str) -> str:
    """Return the bytecode of OSL ``source``; LfsrError if this Blender has no OSL or rejects it."""
    advice = "the OSL camera is not available ({}): render with the layout lens-card"
    if not devices.has_osl():
        raise LfsrError(advice.format("this Blender was built without OSL"))
    import _cycles

    # In Blender's own temporary folder, which is removed even if Blender crashes.
    with tempfile.TemporaryDirectory(prefix="lfsr-osl-", dir=bpy.app.tempdir or None) as folder:
        text, code = Path(folder, "camera.osl"), Path(folder, "camera.oso")
        with system_errors(text.parent):
            text.write_text(source, encoding="utf-8")
            if not _cycles.osl_compile(str(text), str(code)) or not code.is_file() or not code.stat().st_size:
                code.write_bytes(bytes(ROOM * text.stat().st_size))  # fails where there was no room for the bytecode
                raise LfsrError(advice.format("Cycles rejected the ray-layout shader, see its message above"))
        return code.read_text(encoding="utf-8")
