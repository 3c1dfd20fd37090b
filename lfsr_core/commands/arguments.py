"""What a verb is, and arguments that several verbs have, with the values that they become."""

from __future__ import annotations

import argparse
import dataclasses
import os
from collections.abc import Callable
from contextlib import closing
from pathlib import Path
from typing import Any

from lfsr_core.base.notices import ProgressBar
from lfsr_core.commands.sentences import sentence
from lfsr_core.frames.frame import LAYOUTS, VIEW_BY_VIEW
from lfsr_core.frames.request import AUTO, DEVICES, EVEN, OWN, WORLD_IMAGES, Finish, Request, check_light, check_scene
from lfsr_core.optics.display import load_display
from lfsr_core.optics.lenses import parse_rows
from lfsr_core.reconstruct.methods import METHODS

FARTHEST_MM = 1e6
OFFERED_LAYOUTS = tuple(layout for layout in LAYOUTS if layout != VIEW_BY_VIEW)


@dataclasses.dataclass(frozen=True)
class Verb:
    """A verb of ``lfsr``; it imports slow packages in ``run``."""

    NAME: str
    HELP: str
    add_arguments: Callable[[argparse.ArgumentParser], None]
    # Runs the verb, prints what people want to know, and returns it as a record or JSON-ready data for ``--json``;
    # LfsrError for bad input.
    run: Callable[[argparse.Namespace], Any]


def progress() -> closing[ProgressBar]:
    """Return a progress bar for a block, which ends its line after it."""
    return closing(ProgressBar(words=sentence))


def add_scene_arguments(parser: argparse.ArgumentParser) -> None:
    """Scene, output, and everything that decides the geometry."""
    parser.add_argument("scene", type=Path, metavar="SCENE", help=".blend, .glb, .gltf or .obj")
    parser.add_argument("-o", "--output", type=Path, required=True, metavar="DIR", help="frame folder to write")
    add_geometry_arguments(parser)


def add_rows_argument(parser: argparse.ArgumentParser) -> None:
    """Rows of lenses to render."""
    parser.add_argument("--rows", metavar="A-B|K/N", help="render only these rows of lenses, counted from 1, or the "
                                                          "Kth of N equal parts, for `lfsr merge`; default: all")


def add_geometry_arguments(parser: argparse.ArgumentParser) -> None:
    """Display, views, subject, and the Blender that renders them."""
    parser.add_argument("--display", default="bupt-32in-8k", metavar="NAME|FILE.toml", help="default: %(default)s")
    parser.add_argument("--layout", choices=OFFERED_LAYOUTS, default=LAYOUTS[0],
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
    parser.add_argument("--light", default=AUTO, metavar="|".join((AUTO, OWN, "NAME", "FILE.hdr", "FILE.exr")),
                        help="auto, the default: the scene's own light, or another for an almost dark file that is "
                             f"not a .blend; own; {EVEN}: from all sides, without shadows; one of Blender's world "
                             f"images ({', '.join(WORLD_IMAGES)}), or one of yours")
    parser.add_argument("--device", type=lambda text: text if text == AUTO else text.upper(), default=AUTO,
                        metavar="auto|NAME",
                        help=f"Cycles device, {', '.join(DEVICES)}; default: the best of this machine")
    parser.add_argument("--allow-missing", action="store_true",
                        help="render although files of the scene, such as images, are missing or damaged")
    parser.add_argument("--blender", metavar="PATH", help="Blender 4.5 or newer; default: the bpy package, then PATH")


def make_request(arguments: argparse.Namespace, **values: Any) -> Request:
    """Validated job of the parsed arguments; ``values`` add to them or replace them."""
    same = ("output", "layout", "view_aperture", "seed", "frame", "subject", "device",
            "world_visible", "camera", "allow_missing")
    given = {name: getattr(arguments, name) for name in same if name not in values}
    display = load_display(arguments.display)
    if getattr(arguments, "rows", None) is not None:
        given["rows"] = parse_rows(arguments.rows, display.lenses[1])
    given["light"] = check_light(arguments.light)
    given |= {"scene": check_scene(arguments.scene), "display": display} | values
    return Request(**given | {"output": str(given["output"])})


def add_cluster_argument(parser: argparse.ArgumentParser, when: str = "") -> None:
    """The scheduler whose workers do the work; ``when``: words of help before it."""
    parser.add_argument("--cluster", type=_not_empty, metavar="ADDRESS",
                        help=f"{when}on the workers of this Dask scheduler, such as tcp://host:8786")


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
    from lfsr_core.reconstruct.methods import DEFAULT_METHOD, PLAIN_METHOD, SUBPIXEL_METHODS, oidn

    best, plain = SUBPIXEL_METHODS if subpixels else (DEFAULT_METHOD, PLAIN_METHOD)
    return name or (plain if oidn.why_missing() else best)


def finish_of(arguments: argparse.Namespace, subpixels: bool, scale: int) -> Finish:
    """Return the finish that the arguments ask for; LfsrError for a method that cannot finish a render at ``scale``."""
    from lfsr_core.reconstruct.methods import load_method
    from lfsr_core.reconstruct.second_stage import check_subpixels_finish

    name = method_of(arguments.method, subpixels)
    finish = Finish(name, arguments.dilate, os.path.abspath(arguments.weights) if arguments.weights else None,
                    arguments.linear_exr, arguments.temporal_averaging or 0)
    chosen = load_method(name).name
    if subpixels:
        check_subpixels_finish(finish)
    else:
        chosen.check_scale(scale)
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


def _not_empty(text: str) -> str:
    if not text.strip():
        raise argparse.ArgumentTypeError("it is empty")
    return text


def numbers(text: str) -> tuple[int, ...]:
    """Whole numbers such as 1,4,16, for argparse: each once."""
    try:
        return tuple(dict.fromkeys(int(part) for part in text.split(",")))
    except ValueError:
        raise argparse.ArgumentTypeError(f"{text!r} is not a list of whole numbers such as 1,4,16") from None


def reals(text: str) -> tuple[float, ...]:
    """Numbers such as 0.25,1,4, for argparse: each once."""
    try:
        return tuple(dict.fromkeys(float(part) for part in text.split(",")))
    except ValueError:
        raise argparse.ArgumentTypeError(f"{text!r} is not a list of numbers such as 0.25,1,4") from None


def names(text: str) -> tuple[str, ...]:
    """Names such as oidn,bilinear, for argparse: each once, empty ones left out."""
    return tuple(dict.fromkeys(part.strip() for part in text.split(",") if part.strip()))
