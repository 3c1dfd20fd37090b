"""What an artist does with the extension, in a Blender of its own: extension_steps.py STEP FOLDER [ZIP]

tests/blender/test_extension.py runs it with a Python that has Blender and nothing
else. What it finds goes to FOLDER/found.json.
"""

from __future__ import annotations

import importlib
import importlib.util
import json
import subprocess
import sys
from pathlib import Path

import bpy

REPOSITORY, NAME = "user_default", "lfsr"
MODULE = f"bl_ext.{REPOSITORY}.{NAME}"
FORMATS = ("quilt", "views", "sway")  # one image, one per view, a film that Blender encodes
FOREIGN = ("cv2", "torch", "pyoidn", "onnxruntime", "av", "PIL", "lfsr_core", "flip_evaluator", "threadpoolctl")


def install(folder: Path, archive: str) -> dict[str, object]:
    """Install and enable the zip, test the second stage's Python, switch off and on again."""
    found: dict[str, object] = {"foreign": [name for name in FOREIGN if importlib.util.find_spec(name)]}
    done = bpy.ops.extensions.package_install_files(filepath=archive, repo=REPOSITORY, enable_on_install=True)
    found |= {"install": sorted(done), "enabled": state()}
    found["core"] = importlib.import_module("lfsr_core").__file__
    found["second_stage"] = importlib.import_module(f"{MODULE}.ui.preferences").probe()
    found["test_button"] = sorted(bpy.ops.lfsr.test_python())
    bpy.ops.preferences.addon_disable(module=MODULE)
    found["disabled"] = state()
    bpy.ops.preferences.addon_enable(module=MODULE)
    found["enabled_again"] = state()
    bpy.ops.wm.save_userpref()
    return found


def render(folder: Path) -> dict[str, object]:
    """In a new session: render the default cube with the extension's two commands."""
    runtime = importlib.import_module(f"{MODULE}.background.runtime")
    display = importlib.import_module("lfsr_core.optics.display").load_display("mini")
    job = importlib.import_module("lfsr_core.frames.job").Job(
        str(folder / "frame"), display, scene=str(folder / "cube.blend"), spp=2, layers=("albedo", "normal"))
    bpy.ops.wm.save_as_mainfile(filepath=job.scene, copy=True)
    importlib.import_module("lfsr_core.records").write_record(folder / "job.json", job)
    commands = (runtime.render_command(folder / "job.json"),
                [*runtime.second_stage_command(), "upscale", job.output, "--method", "denoise+bilinear"])
    for command in commands:
        done = subprocess.run(command, env=runtime.environment(), stdout=subprocess.PIPE, stderr=subprocess.STDOUT,
                              text=True, check=False)
        if done.returncode:
            return {"enabled": state(), "failed": done.stdout}
    return {"enabled": state()}


def press(folder: Path) -> dict[str, object]:
    """In a new session: render the default cube and its reference from the panel's operators."""
    settings = bpy.context.scene.lfsr
    settings.display, settings.samples, settings.method = "mini", 2, "denoise+bilinear"
    settings.output = str(folder / "images")
    bpy.ops.lfsr.array_add()
    settings.reference_samples = 2
    return {"enabled": state(), "render": sorted(bpy.ops.lfsr.render_eia()),
            "reference": sorted(bpy.ops.lfsr.render_reference()), "viewer": sorted(bpy.ops.lfsr.open_viewer()),
            "exports": {name: sorted(bpy.ops.lfsr.export(format=name)) for name in FORMATS}}


def uninstall(folder: Path) -> dict[str, object]:
    """Uninstall; the state before and after."""
    repositories = [repository.module for repository in bpy.context.preferences.extensions.repos]
    before = state()
    done = bpy.ops.extensions.package_uninstall(repo_index=repositories.index(REPOSITORY), pkg_id=NAME)
    return {"enabled": before, "uninstall": sorted(done), "after": state()}


def state() -> dict[str, bool]:
    """Whether Blender lists the add-on, its operators and its settings."""
    return {"listed": MODULE in bpy.context.preferences.addons,
            "operators": hasattr(bpy.types, "LFSR_OT_render_eia"), "settings": hasattr(bpy.types.Scene, "lfsr")}


if __name__ == "__main__":
    step = {"install": install, "render": render, "press": press, "uninstall": uninstall}[sys.argv[1]]
    if step is not install:
        # A Blender application does so on its own when it starts.
        bpy.ops.wm.read_userpref()
    result = step(Path(sys.argv[2]), *sys.argv[3:])
    Path(sys.argv[2], "found.json").write_text(json.dumps(result), encoding="utf-8")
