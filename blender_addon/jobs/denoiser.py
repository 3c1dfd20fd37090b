"""Whether the second stage has Open Image Denoise, what can be done without it, and where to get it."""

from __future__ import annotations

import contextlib
import functools
import platform
import sys
from pathlib import Path

import bpy

from lfsr_core.base.errors import LfsrError
from lfsr_core.process.child import output_of
from lfsr_core.tasks.probe import DENOISER

from ..scene.settings import Resolved, title
from . import runtime

SECONDS_TO_ANSWER = 60
RAYS_UNDENOISED = 2.0  # times as many where nothing is denoised
LIBRARIES = {"win32": "OpenImageDenoise.dll", "darwin": "libOpenImageDenoise.dylib"}
# Packages of the library, by the ID in /etc/os-release. Debian and those made of it have none.
PACKAGES = {"fedora": "oidn-libs", "arch": "openimagedenoise", "alpine": "openimagedenoise",
            "void": "openimagedenoise", "gentoo": "media-libs/oidn"}


def why_missing() -> str:
    """Why the second stage finds no library that loads, "" where it does; LfsrError where its Python does not start."""
    command = (*runtime.second_stage_command("lfsr_core.tasks.probe"), DENOISER)
    return _reason(command, runtime.chosen_library())


def forget() -> None:
    """Ask again next time: something may have been installed."""
    _reason.cache_clear()


@functools.lru_cache(maxsize=8)
def _reason(command: tuple[str, ...], _library: str) -> str:
    """Why there is none, "" where there is; the process is asked once in a session."""
    try:
        code, output = output_of(command, runtime.environment(), SECONDS_TO_ANSWER)
    except OSError as error:
        raise LfsrError(f"Python {command[0]!r} cannot be started ({error}): choose another") from None
    return output.strip() if code == 0 else ""  # what else it lacks is said by the render


def lacking(settings: Resolved) -> str:
    """Return a sentence if the method of ``settings`` needs the library and it is missing, else ""."""
    reason = why_missing() if settings.method.needs_denoiser else ""
    if not reason:
        return ""
    name = "Direct subpixel rendering" if settings.subpixels else f"The method {title(settings.method.text)}"
    if chosen := runtime.chosen_library():
        detail = reason.replace(chosen, Path(chosen).name)
        return f"{name} needs Open Image Denoise, but {detail}"
    owner = "the Python of the second stage" if runtime.chosen_python() else "this Blender"
    return f"{name} needs Open Image Denoise, which {owner} does not have"


def is_replaced(scene: bpy.types.Scene) -> bool:
    """True if ``scene``, where no method was chosen, gets one without denoising unasked: that was answered before."""
    return (not scene.lfsr.is_property_set("method")
            and getattr(runtime.preferences_of_addon(), "without_denoiser", False))


def use_replacement(scene: bpy.types.Scene, settings: Resolved) -> None:
    """Set the method of ``settings`` without denoising in ``scene``, with more rays: nothing removes their noise.

    Where none was chosen, new scenes get one unasked from now on.
    """
    if (preferences := runtime.preferences_of_addon()) is not None and not scene.lfsr.is_property_set("method"):
        preferences.without_denoiser = True
    scene.lfsr.method = settings.method.undenoised.text
    if not scene.lfsr.samples:
        scene.lfsr.rays *= RAYS_UNDENOISED


def where_to_get() -> str:
    """Return a sentence on where to get the library on this system."""
    if runtime.chosen_python():
        return "Install the package pyoidn for that Python"
    library, names = LIBRARIES.get(sys.platform, "libOpenImageDenoise.so.2"), list[str]()
    with contextlib.suppress(OSError):  # names of this Linux and of those that it is made of
        system = platform.freedesktop_os_release()
        names = [system.get("ID", ""), *system.get("ID_LIKE", "").split()]
    package = next((PACKAGES[name] for name in names if name in PACKAGES), "")
    install = (f"Install the package {package}, or use" if package else
               f"{names[0].capitalize()} has no package of it: use" if {"debian", "ubuntu"} & {*names} else "Use")
    return (f"{install} the Blender of blender.org, which has it, or choose {library} of a download from "
            "openimagedenoise.org in the add-on's preferences")
