"""What verbs share: arguments, the records made of them, and the progress bar."""

import argparse
import contextlib
import os
import sys
import time
from pathlib import Path
from typing import Any, TextIO

from lfsr_core.base.messages import Notice, Progress, cleaned, duration
from lfsr_core.commands.sentences import sentence
from lfsr_core.frames import frame as files
from lfsr_core.frames.frame import Finish, Request, check_light, check_scene
from lfsr_core.optics.display import load_display
from lfsr_core.optics.rays import parse_rows
from lfsr_core.reconstruct.methods import DEFAULT_METHOD, METHODS, PLAIN_METHOD, SUBPIXEL_METHODS, MethodName
from lfsr_core.reconstruct.methods.denoise import why_missing

FARTHEST_MM = 1e6
BAR_WIDTH = 30
SECONDS_BETWEEN_LINES = 4.0  # a render writes a record each second, so that a line comes every five at the latest
PROGRESS_VARIABLE, OPENJD = "LFSR_PROGRESS", "openjd"  # environment variable, set by our OpenJD template


def add_scene_arguments(parser: argparse.ArgumentParser, when: str = "") -> None:
    """Add the arguments of scene, output, geometry, part and cluster; ``when`` begins the help of ``--cluster``."""
    parser.add_argument("scene", type=Path, metavar="SCENE", help=".blend, .glb, .gltf or .obj")
    parser.add_argument("-o", "--output", type=Path, required=True, metavar="DIR", help="frame folder to write")
    add_geometry_arguments(parser)
    parser.add_argument("--rows", metavar="A-B|K/N", help="render only these rows of lenses, counted from 1, or the "
                                                          "Kth of N equal parts, for `lfsr merge`; default: all")
    parser.add_argument("--cluster", metavar="ADDRESS",
                        help=f"{when}on the workers of this Dask scheduler, such as tcp://host:8786")


def add_geometry_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the arguments of display, views, subject, light, and the Blender that renders them."""
    parser.add_argument("--display", default="bupt-32in-8k", metavar="NAME|FILE.toml", help="default: %(default)s")
    offered = [layout for layout in files.LAYOUTS if layout != files.VIEW_BY_VIEW]
    parser.add_argument("--layout", choices=offered, default=files.LAYOUTS[0],
                        help="how rays are sent, default: %(default)s; subpixels: direct subpixel rendering with "
                             "`lfsr render`, for displays with a lens sheet: the panel's image, no light field")
    parser.add_argument("--view-aperture", type=float, default=1.0, metavar="N",
                        help="side of what the rays of a view cover, in finished views, at most the scale; default: "
                             "%(default)s")
    parser.add_argument("--seed", type=int, default=0, metavar="N", help="seed of the noise, default: %(default)s")
    parser.add_argument("--frame", type=int, metavar="N", help="default: the scene's current frame")
    parser.add_argument("--camera", metavar="NAME",
                        help="camera to render from; `fit`: in front of the subject; default: the scene's active "
                             "camera, the first one of a glTF file")
    parser.add_argument("--subject", metavar="COLLECTION",
                        help="the foreground; default: everything but the world and a collection called Background")
    parser.add_argument("--world-visible", action=argparse.BooleanOptionalAction,
                        help="show the world behind the subject; default: as set in the scene")
    parser.add_argument("--light", default=files.AUTO, metavar="auto|own|NAME|FILE.hdr|FILE.exr",
                        help="auto, the default: the scene's own light, or another for an almost dark file that is "
                             f"not a .blend; own; {files.EVEN}: from all sides, without shadows; one of Blender's "
                             f"world images ({', '.join(files.WORLD_IMAGES)}), city:4 with four times its "
                             "strength; or one of yours")
    parser.add_argument("--device", type=lambda text: text if text == files.AUTO else text.upper(), default=files.AUTO,
                        metavar="auto|NAME",
                        help=f"Cycles device, {', '.join(files.DEVICES)}; default: the best of this machine")
    parser.add_argument("--allow-missing", action="store_true",
                        help="render although files of the scene, such as images, are missing or damaged")
    parser.add_argument("--blender", metavar="PATH", help="Blender 4.5 or newer; default: the bpy package, then PATH")


def make_request(arguments: argparse.Namespace, **values: Any) -> Request:
    """Return the checked request of the parsed arguments; ``values``: fields that add to them or replace them."""
    same = ("output", "layout", "view_aperture", "seed", "frame", "subject", "device",
            "world_visible", "camera", "allow_missing")
    given = {name: getattr(arguments, name) for name in same if name not in values}
    display = load_display(arguments.display)
    if getattr(arguments, "rows", None) is not None:
        given["rows"] = parse_rows(arguments.rows, display.lenses[1])
    given["light"] = check_light(arguments.light)
    given |= {"scene": check_scene(arguments.scene), "display": display} | values
    return Request(**given | {"output": str(given["output"])})


def add_method_arguments(parser: argparse.ArgumentParser) -> None:
    """Method and options of the second stage."""
    parser.add_argument("--method", metavar="NAME",
                        help=f"steps of {', '.join(METHODS)}, joined by + as in denoise+bicubic; default: the most "
                             "accurate")
    parser.add_argument("--dilate", type=int, default=0, metavar="N",
                        help="grow the foreground mask by N lenses, for details too thin for sparse views")
    parser.add_argument("--weights", type=Path, metavar="FILE", help="weights for the method's denoiser")
    parser.add_argument("--linear-exr", action=argparse.BooleanOptionalAction, default=False,
                        help="also write the scene-linear eia.exr")


def method_of(name: str | None, subpixels: bool) -> str:
    """Return the ``name`` of the method asked for, else that of the best that this machine can do.

    ``subpixels``: whether the panel's subpixels are rendered.
    """
    best, plain = SUBPIXEL_METHODS if subpixels else (DEFAULT_METHOD, PLAIN_METHOD)
    return name or (plain if why_missing() else best)


def finish_of(arguments: argparse.Namespace, subpixels: bool, scale: int) -> Finish:
    """Return the finish that the arguments ask for; LfsrError for a method that cannot finish a render at ``scale``."""
    finish = Finish(method_of(arguments.method, subpixels), arguments.dilate,
                    os.path.abspath(arguments.weights) if arguments.weights else None, arguments.linear_exr,
                    arguments.temporal_averaging or 0)
    if subpixels:
        from lfsr_core.reconstruct.second_stage import check_subpixels_finish

        check_subpixels_finish(finish)
    else:
        MethodName.parse(finish.method).check_scale(scale)
    return finish


def position(text: str) -> tuple[float, float, float]:
    """Three numbers X,Y,Z in millimetres, for argparse."""
    try:
        x, y, z = (float(part) for part in text.split(","))
        if not all(abs(value) <= FARTHEST_MM for value in (x, y, z)):
            raise ValueError
    except ValueError:
        raise argparse.ArgumentTypeError(f"{text!r} is not three numbers X,Y,Z in millimetres, "
                                         f"each below {FARTHEST_MM:g}") from None
    return x, y, z


def numbers(text: str, kind: type = int) -> tuple[Any, ...]:
    """Return the numbers in a text such as 1,4,16, each once, for argparse; ``kind``: int or float."""
    try:
        return tuple(dict.fromkeys(kind(part) for part in text.split(",")))
    except ValueError:
        what = "whole numbers such as 1,4,16" if kind is int else "numbers such as 0.25,1,4"
        raise argparse.ArgumentTypeError(f"{text!r} is not a list of {what}") from None


def names(text: str) -> tuple[str, ...]:
    """Names such as oidn,bilinear, for argparse: each once, empty ones left out."""
    return tuple(dict.fromkeys(part.strip() for part in text.split(",") if part.strip()))


class ProgressBar:
    """A ``Tell``: shows progress, and prints the sentence of each notice once."""

    def __init__(self, stream: TextIO | None = None) -> None:
        self._stream = stream or sys.stderr
        self._moving = self._stream.isatty()
        self._stage, self._shown_at, self._most = "", 0.0, 0.0
        self._told: list[Notice] = []

    def __call__(self, told: Progress | Notice) -> None:
        """Show progress or a notice; without a terminal only at a new stage, at its end, and every few seconds."""
        if sys.stdout is None:  # --quiet
            return
        if isinstance(told, Notice):
            if told not in self._told:
                self._told.append(told)
                self.note(sentence(told))
            return
        left = "" if told.left is None else f"{duration(told.left)} left"
        fraction, detail = min(max(told.fraction, 0.0), 1.0), ", ".join(filter(None, (cleaned(told.detail), left)))
        if self._moving:
            filled = round(BAR_WIDTH * fraction)
            start = "\n" if self._stage not in ("", told.stage) else "\r"
            bar = "█" * filled + "░" * (BAR_WIDTH - filled)
            self._stream.write(f"{start}{told.stage:10} {bar} {fraction:4.0%}  {detail[:60]}\x1b[K")
            self._stream.flush()
        elif told.stage != self._stage or fraction >= 1 or time.monotonic() - self._shown_at >= SECONDS_BETWEEN_LINES:
            if is_openjd():
                # A farm shows one number for the whole task: it must not fall where a new stage begins.
                self._most = max(self._most, fraction)
                tell_openjd(progress=f"{100 * self._most:.1f}", status=f"{told.stage} {detail}")
            else:
                print(f"{told.stage:10} {fraction:4.0%}  {detail}".rstrip(), file=self._stream, flush=True)
            self._shown_at = time.monotonic()
        self._stage = told.stage

    def note(self, message: str) -> None:
        """Print a line that stays."""
        self.close()
        print(f"note: {message}", file=self._stream, flush=True)

    def close(self) -> None:
        """End the moving line, so that the next print starts on its own line."""
        if self._moving and self._stage:
            print(file=self._stream)
        self._stage = ""


def progress() -> contextlib.closing[ProgressBar]:
    """Return a progress bar for a block, which ends its line after it."""
    return contextlib.closing(ProgressBar())


def is_openjd() -> bool:
    """True inside a task of our OpenJD template."""
    return os.environ.get(PROGRESS_VARIABLE) == OPENJD


def tell_openjd(**messages: str) -> None:
    """Print messages of Open Job Description by their kind: ``progress`` (0 to 100), ``status``, ``fail``."""
    for kind, message in messages.items():
        print(f"openjd_{kind}: {' '.join(message.split())}", flush=True)
