"""The processes that work for the panel: another Blender that renders, and Blender's Python for the second stage.

Where they find modules is said in their environment. Also: whether the second stage finds Open Image Denoise, and what
can be done without it.
"""

from __future__ import annotations

import contextlib
import fnmatch
import functools
import hashlib
import os
import platform
import sys
from pathlib import Path

import bpy

from lfsr_core.base.messages import LfsrError
from lfsr_core.base.system import CORES
from lfsr_core.process.child import BLENDER_FOLDER, PACKAGES, output_of
from lfsr_core.reconstruct.methods.oidn import LIBRARY_VARIABLE
from lfsr_core.tasks.probe import DENOISER

from ..scene.settings import Resolved, title

PACKAGE = __package__.rpartition(".")[0]  # the add-on, under the name that Blender gave it
RUNNER = "lfsr_core.tasks.runner"
HEADLESS = Path(__file__).resolve().parents[1] / "headless"
# A clone has the first, the zip only the second.
ENTRY = next(path for name in ("from_sources.py", "entry.py") if (path := HEADLESS / name).is_file())
SECONDS_TO_ANSWER = 60
RAYS_UNDENOISED = 2.0  # times as many where nothing is denoised
LIBRARIES = {"win32": "OpenImageDenoise.dll", "darwin": "libOpenImageDenoise.dylib"}
# Packages of the library, by the ID in /etc/os-release. Debian and those made of it have none.
OF_SYSTEMS = {"fedora": "oidn-libs", "arch": "openimagedenoise", "alpine": "openimagedenoise",
              "void": "openimagedenoise", "gentoo": "media-libs/oidn"}
# Workers that each started BLAS threads of their own would wait for one another.
ONE_BLAS_THREAD = dict.fromkeys(("OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "VECLIB_MAXIMUM_THREADS"), "1")


def second_stage_command(module: str) -> list[str]:
    """Command line that runs ``module`` of lfsr_core; append its arguments, and start it with ``environment()``."""
    return [sys.executable, "-s", "-m", module]


def render_command() -> list[str]:
    """Start of a command line that renders in another Blender of this version; request files follow it."""
    if not bpy.app.binary_path:  # the bpy wheel
        return [sys.executable, "-P", str(ENTRY), "--"]
    scripts = ["--enable-autoexec"] if may_run_scripts(bpy.data.filepath) else []
    return [bpy.app.binary_path, *scripts, "--background", "--factory-startup", "--python-exit-code", "1",
            "--python", str(ENTRY), "--"]


def may_run_scripts(file: str) -> bool:
    """True if this session runs the Python in ``file`` when it opens it: only then may a background Blender.

    A file that has run no Python so far is not trusted: scripts may have been added to it since.
    """
    preferences = bpy.context.preferences
    # Where the preferences say that no Python is run.
    excluded = any(fnmatch.fnmatch(file, entry.path) if entry.use_glob else
                   entry.path and Path(file).is_relative_to(bpy.path.abspath(entry.path))
                   for entry in preferences.autoexec_paths)
    return preferences.filepaths.use_scripts_auto_execute and not bpy.app.autoexec_fail and not excluded


def environment() -> dict[str, str]:
    """Environment for those processes: this one's, with Python's variables replaced by ours.

    lfsr_core is the add-on's own. LfsrError where the library that was chosen does not exist.
    """
    kept = {name: value for name, value in os.environ.items() if not name.startswith("PYTHON")}
    # Blender's OpenImageIO and OpenColorIO, where its Python may not look outside Blender.
    blender = Path(bpy.utils.resource_path("LOCAL"))
    library = blender / "python" / "lib"
    places = (library / f"python{sys.version_info[0]}.{sys.version_info[1]}", library)
    folders = [PACKAGES, *(place / "site-packages" for place in places if (place / "site-packages").is_dir())]
    denoiser = chosen_library()
    # The preferred number of cores is left to this Blender and other programs.
    cores = str(max(1, (os.cpu_count() or 1) - getattr(preferences_of_addon(), "free_cores", 1)))
    return {CORES: cores, "OIDN_NUM_THREADS": cores} | kept | (
        {LIBRARY_VARIABLE: denoiser} if denoiser else {}) | ONE_BLAS_THREAD | {
        "PYTHONPATH": os.pathsep.join(map(str, folders)), "PYTHONSAFEPATH": "1", "PYTHONUNBUFFERED": "1",
        "PYTHONUTF8": "1", BLENDER_FOLDER: str(blender.parent)}


def temporary(kind: str, folder: Path) -> Path:
    """Path for what is made of a frame folder, among this session's temporary files."""
    name = hashlib.md5(str(folder).encode(), usedforsecurity=False).hexdigest()[:16]
    return Path(bpy.app.tempdir, f"lfsr-{kind}-{name}")


def chosen_library() -> str:
    """The user's own library of Open Image Denoise: the preference, else $LFSR_OIDN; "" means one that is found."""
    preferred = getattr(preferences_of_addon(), "oidn_path", "").strip()
    chosen: str = bpy.path.abspath(preferred) if preferred else os.environ.get(LIBRARY_VARIABLE, "")
    if chosen and not Path(chosen).is_file():
        raise LfsrError(f"the library {chosen!r} of Open Image Denoise does not exist: choose another in the add-on's "
                        "preferences, or clear it")
    return chosen


def preferences_of_addon() -> bpy.types.AddonPreferences | None:
    """The add-on's preferences; None where it was not enabled in them."""
    addon = bpy.context.preferences.addons.get(PACKAGE)
    return addon.preferences if addon else None


def why_missing() -> str:
    """Why the second stage finds no library that loads, "" where it does; its process is asked once in a session."""
    return _why_missing(chosen_library())


@functools.lru_cache(maxsize=8)
def _why_missing(_library: str) -> str:
    code, output = output_of([*second_stage_command("lfsr_core.tasks.probe"), DENOISER], environment(),
                             SECONDS_TO_ANSWER)
    return output.strip() if code == 0 else ""  # what else it lacks is said by the render


def lacking(settings: Resolved) -> str:
    """Return a sentence if the method of ``settings`` needs the library and it is missing, else ""."""
    reason = why_missing() if settings.method.needs_denoiser else ""
    if not reason:
        return ""
    name = "Direct subpixel rendering" if settings.subpixels else f"The method {title(settings.method.text)}"
    if chosen := chosen_library():
        detail = reason.replace(chosen, Path(chosen).name)
        return f"{name} needs Open Image Denoise, but {detail}"
    return f"{name} needs Open Image Denoise, which this Blender does not have"


def use_replacement(scene: bpy.types.Scene, settings: Resolved) -> None:
    """Set the method of ``settings`` without denoising in ``scene``, with more rays: nothing removes their noise.

    Where none was chosen, new scenes get one unasked from now on.
    """
    if (preferences := preferences_of_addon()) is not None and not scene.lfsr.is_property_set("method"):
        preferences.without_denoiser = True
    scene.lfsr.method = settings.method.undenoised.text
    if not scene.lfsr.samples:
        scene.lfsr.rays *= RAYS_UNDENOISED


def where_to_get() -> str:
    """Return a sentence on where to get the library on this system."""
    library, names = LIBRARIES.get(sys.platform, "libOpenImageDenoise.so.2"), list[str]()
    with contextlib.suppress(OSError):  # names of this Linux and of those that it is made of
        system = platform.freedesktop_os_release()
        names = [system.get("ID", ""), *system.get("ID_LIKE", "").split()]
    package = next((OF_SYSTEMS[name] for name in names if name in OF_SYSTEMS), "")
    install = (f"Install the package {package}, or use" if package else
               f"{names[0].capitalize()} has no package of it: use" if {"debian", "ubuntu"} & {*names} else "Use")
    return (f"{install} the Blender of blender.org, which has it, or choose {library} of a download from "
            "openimagedenoise.org in the add-on's preferences")
