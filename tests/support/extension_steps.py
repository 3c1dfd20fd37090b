"""What an artist does with the extension, in a Blender of its own: extension_steps.py STEP FOLDER [ZIP]

tests/blender/test_extension.py runs it with Blender's Python alone. What it finds goes to FOLDER/result.json.
"""

import importlib
import importlib.util
import json
import subprocess
import sys
from pathlib import Path

import bpy

REPOSITORY, NAME, OTHER = "user_default", "lfsr", "other"
MODULE = f"bl_ext.{REPOSITORY}.{NAME}"
CORE = f"{MODULE}.packages.lfsr_core"
FORMATS = ("quilt", "views", "sway")  # one image, one per view, a film that Blender encodes
FOREIGN = ("cv2", "torch", "pyoidn", "onnxruntime", "av", "PIL", "lfsr_core", "flip_evaluator", "threadpoolctl")


def install(folder: Path, archive: str) -> dict[str, object]:
    """Install and enable the zip, ask what the second stage finds, switch off and on again."""
    import addon_utils  # bpy brings it
    states: dict[str, object] = {"foreign": [name for name in FOREIGN if importlib.util.find_spec(name)]}
    before, modules = list(sys.path), set(sys.modules)
    done = bpy.ops.extensions.package_install_files(filepath=archive, repo=REPOSITORY, enable_on_install=True)
    states |= {"install": sorted(done), "enabled": state(),
               "warnings": addon_utils._extensions_warnings_get().get(MODULE, [])}
    states["added_paths"] = [path for path in sys.path if path not in before]
    states["added_modules"] = sorted({name.split(".")[0] for name in set(sys.modules) - modules if NAME in name})
    states["core"] = importlib.import_module(CORE).__file__
    states["second_stage"] = second_stage()
    bpy.ops.preferences.addon_disable(module=MODULE)
    states["disabled"] = state()
    bpy.ops.preferences.addon_enable(module=MODULE)
    states["enabled_again"] = state()
    bpy.ops.wm.save_userpref()
    return states


def press(folder: Path) -> dict[str, object]:
    """In a new session: render the default cube and its reference from the panel's operators; the state before."""
    settings = bpy.context.scene.lfsr
    settings.display, settings.samples, settings.method = "mini", 2, "denoise+bilinear"
    settings.output = str(folder / "images")
    bpy.ops.lfsr.array_add()
    settings.reference_samples = 2
    return {"enabled": state(), "render": sorted(bpy.ops.lfsr.render_eia()),
            "reference": sorted(bpy.ops.lfsr.render_reference()), "viewer": sorted(bpy.ops.lfsr.open_viewer()),
            "exports": {name: sorted(bpy.ops.lfsr.export(format=name)) for name in FORMATS}}


def install_other(folder: Path, archive: str) -> dict[str, object]:
    """Install and enable another extension, which brings a package in a version of its own."""
    done = bpy.ops.extensions.package_install_files(filepath=archive, repo=REPOSITORY, enable_on_install=True)
    bpy.ops.wm.save_userpref()
    return {"install": sorted(done), **both(folder)}


def both(folder: Path) -> dict[str, object]:
    """The version of the package that the other extension sees, and whether ours works beside it."""
    other = importlib.import_module(f"bl_ext.{REPOSITORY}.{OTHER}")
    return {"other": other.VERSION, "ours": second_stage() if state()["operators"] else ""}


def second_stage() -> str:
    """Version that the second stage's process finds, and what keeps it from denoising."""
    runtime = importlib.import_module(f"{MODULE}.jobs.runtime")
    program = f"import lfsr_core.tasks.runner; print('LFSR', lfsr_core.__version__); {runtime.SAY_WHY}"
    done = subprocess.run(runtime.second_stage_command("-c", program), env=runtime.environment(),
                          capture_output=True, text=True, check=False)
    return done.stdout.strip()


def uninstall(folder: Path) -> dict[str, object]:
    """Uninstall beside the other extension; the state before and after."""
    before_all = both(folder)
    repositories = [repository.module for repository in bpy.context.preferences.extensions.repos]
    before = state()
    done = bpy.ops.extensions.package_uninstall(repo_index=repositories.index(REPOSITORY), pkg_id=NAME)
    return {**before_all, "enabled": before, "uninstall": sorted(done), "after": state()}


def state() -> dict[str, bool]:
    """Whether Blender lists the add-on, its operators and its settings."""
    return {"listed": MODULE in bpy.context.preferences.addons,
            "operators": hasattr(bpy.types, "LFSR_OT_render_eia"), "settings": hasattr(bpy.types.Scene, "lfsr")}


if __name__ == "__main__":
    step = {step.__name__: step for step in (install, press, install_other, both, uninstall)}[sys.argv[1]]
    if step is not install:
        # A Blender application does so on its own when it starts.
        bpy.ops.wm.read_userpref()
    result = step(Path(sys.argv[2]), *sys.argv[3:])
    Path(sys.argv[2], "result.json").write_text(json.dumps(result), encoding="utf-8")
