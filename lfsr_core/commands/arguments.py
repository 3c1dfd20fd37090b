"""Arguments and steps that ``render`` and ``reference`` share."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import Any

from lfsr_core.frames.job import AUTO, DEVICES, LAYOUTS, Job, check_scene
from lfsr_core.optics.display import load_display
from lfsr_core.optics.lens_rows import parse_rows
from lfsr_core.optics.rays import CONVENTIONS
from lfsr_core.render.store import with_blender

FARTHEST_MM = 1e6


def add_scene_arguments(parser: argparse.ArgumentParser, samples: int) -> None:
    """The scene, where to write, how many samples, and everything that decides the geometry."""
    parser.add_argument("scene", type=Path, metavar="SCENE", help=".blend, .glb, .gltf or .obj")
    parser.add_argument("-o", "--output", type=Path, required=True, metavar="DIR", help="frame folder to write")
    parser.add_argument("--spp", type=int, default=samples, metavar="N", help="samples per pixel, default: %(default)s")
    add_geometry_arguments(parser)


def add_rows_argument(parser: argparse.ArgumentParser) -> None:
    """Which rows of lenses, where it is not all of them."""
    parser.add_argument("--rows", metavar="A-B|K/N", help="render only these rows of lenses, counted from 1, or the "
                                                          "Kth of N equal shares, for `lfsr merge`; default: all")


def add_geometry_arguments(parser: argparse.ArgumentParser) -> None:
    """Display, views, subject and the Blender that renders them."""
    parser.add_argument("--display", default="bupt-32in-8k", metavar="NAME|FILE.toml", help="default: %(default)s")
    parser.add_argument("--layout", choices=LAYOUTS, default=LAYOUTS[0],
                        help="what sends the rays, default: %(default)s; subpixels: of `lfsr render` for displays with "
                             "a lens sheet, no light field but the panel's own image, a pixel for each subpixel")
    parser.add_argument("--convention", choices=CONVENTIONS, default=CONVENTIONS[0],
                        help="where views lie; `paper` only to reproduce the paper")
    parser.add_argument("--view-aperture", type=float, default=1.0, metavar="0..1",
                        help="share of a view's cell its rays cover, default: %(default)s")
    parser.add_argument("--seed", type=int, default=0, metavar="N")
    parser.add_argument("--frame", type=int, metavar="N", help="default: the scene's current frame")
    parser.add_argument("--camera", metavar="NAME",
                        help="stand at this camera; `fit`: before the subject; default: the scene's active camera, "
                             "of a glTF file its first")
    parser.add_argument("--subject", metavar="COLLECTION",
                        help="the foreground; default: everything but the world and a collection called Background")
    parser.add_argument("--world-visible", action=argparse.BooleanOptionalAction,
                        help="show the world behind the subject; default: what the scene says")
    parser.add_argument("--device", type=_device, default=AUTO, metavar="auto|NAME",
                        help=f"what Cycles renders on, {', '.join(DEVICES)}; default: the best that this machine has")
    parser.add_argument("--blender", metavar="PATH", help="Blender 4.5 or newer; default: the bpy package, then PATH")


def _device(text: str) -> str:
    return text if text == AUTO else text.upper()


def make_job(arguments: argparse.Namespace, **values: Any) -> Job:
    """Validated job of the parsed arguments; ``values`` add to them or replace them."""
    shared = ("output", "spp", "layout", "convention", "view_aperture", "seed", "frame", "subject", "device",
              "world_visible", "camera")
    given = {name: getattr(arguments, name) for name in shared if name not in values}
    display = load_display(arguments.display)
    if getattr(arguments, "rows", None) is not None:
        given["rows"] = parse_rows(arguments.rows, display.lenses[1])
    given |= {"scene": check_scene(arguments.scene), "display": display} | values
    return Job(**given | {"output": str(given["output"])})


def render(arguments: argparse.Namespace, job: Job) -> None:
    """Run ``job`` in Blender with a progress bar."""
    with_blender(arguments.blender, announce=False)(job)


def position(text: str) -> tuple[float, float, float]:
    """Three numbers X,Y,Z in millimetres, for argparse."""
    parts = text.split(",")
    try:
        x, y, z = (float(part) for part in parts)
        if not all(abs(value) <= FARTHEST_MM for value in (x, y, z)):
            raise ValueError
    except ValueError:
        raise argparse.ArgumentTypeError(f"{text!r} is not three numbers X,Y,Z in millimetres, "
                                         f"each below {FARTHEST_MM:g}") from None
    return x, y, z
