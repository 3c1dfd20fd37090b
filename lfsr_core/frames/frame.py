"""The records of a frame: ``Request``, what is rendered, which Blender reads as JSON; ``Finish``, how it is finished;
``Frame`` and ``Report``, the frame.json and the report.json of its folder, which hold enough to make it again.
"""

from __future__ import annotations

import dataclasses
import itertools
import math
import os
import re
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from lfsr_core.base.messages import LfsrError, Notice, did_you_mean
from lfsr_core.base.records import check_choice, from_data, is_whole, read_record, to_data, write_record
from lfsr_core.base.system import read_json, write_json
from lfsr_core.images.color import ColorSettings
from lfsr_core.optics.depth_scale import ScaleChoice
from lfsr_core.optics.display import DisplayProfile
from lfsr_core.optics.panel.subpixel_rays import PanelLayout, check_sheet
from lfsr_core.optics.rays import CONVENTIONS, CameraArray, RayLayout, check_rows, rows_text

FORMAT = 1
SUBPIXELS, VIEW_BY_VIEW = "subpixels", "view-by-view"
DEVICES_JOINED = "+"  # between the devices of a frame that several machines rendered
# The OSL camera, or the lens card on devices that cannot run it; the lens card; one ordinary camera per view; a card
# with the rays of a panel's subpixels (direct subpixel rendering) instead of those of a light field.
LAYOUTS = ("one-pass", "lens-card", VIEW_BY_VIEW, SUBPIXELS)
# The only values that direct subpixel rendering has: there are neither views nor lenses to choose from.
DIRECT_ONLY = {"scale": 1, "convention": "centred", "view_aperture": 1, "lens_list": None, "rows": None}
LEAST_LENGTH = 1e-30  # scene units; its inverse is the most
ROTATION_TOLERANCE = 1e-3  # for products of columns; Blender's matrices are single precision
FRAME_FILE, REPORT_FILE = "frame.json", "report.json"
VIEWER_FILE, LOG_FILE = "view.html", "blender.log"
LOW_RES_FILE, MASK_FILE, EIA_FILE, EIA_LINEAR_FILE = "lr_eia.exr", "mask.png", "eia.png", "eia.exr"
PANEL_FILE = "panel.png"
WORLD_FILE = "world.exr"
REFERENCE_FILES = ("reference_a.exr", "reference_b.exr")
KINDS = ("render", "reference")
FIT = "fit"  # instead of a camera's name: the array is fitted to the subject
AUTO = "auto"  # the best device of the machine that renders
DEVICES = ("CPU", "OPTIX", "CUDA", "HIP", "ONEAPI", "METAL")
# Light of a scene besides AUTO: its own; lamps from all sides without shadows; one of Blender's world images.
OWN, EVEN = "own", "even"
WORLD_IMAGES = ("city", "courtyard", "forest", "interior", "night", "studio", "sunrise", "sunset")
LIGHTS = (AUTO, OWN, EVEN, *WORLD_IMAGES)
LIGHT_SUFFIXES = (".hdr", ".exr")  # of a world image of the user's
GUIDES = ("albedo", "normal")  # layers that the denoiser sees beside the colour
POSITION = "position"  # layer along which the missing views are pooled
LAYERS = (*GUIDES, POSITION, "index")
# Blender's own limits: it would silently clip larger numbers.
MOST_SAMPLES, MOST_SEED, MOST_FRAME, MOST_CLAMP = 2**24, 2**31 - 1, 1_048_574, 10**8
MOST_SCALE = 5  # that is chosen
MIN_VIEWS = 5  # along each axis that a scale above 2 must leave (docs/results/displays.md)
USUAL_SCALE, USUAL_SAMPLES = 4, 16  # the rays of a render for which nothing was asked
# Noise of a first view up to which the usual rays are enough, and from which more would take too long; a scene between
# takes one of these multiples of them, see ``more_rays``.
CALM, NOISIEST, TIMES_RAYS = 0.04, 0.08, (1, 2, 4, 8, 16)
CLAMP_INDIRECT = 10.0  # Cycles' default: fewer fireflies at low sample counts
SCENE_SUFFIXES = (".blend", ".glb", ".gltf", ".obj")
RANGE = re.compile(r"(-?\d{1,8})(?:-(-?\d{1,8})(?:[x:](\d{1,8}))?)?$")
MOST_FRAMES = 100_000
MOST_DILATE = 65536  # lenses
MOST_AVERAGED = 8  # frames to each side


@dataclasses.dataclass(frozen=True)
class Sampling:
    """How many views and rays are rendered; either may follow from the depth of the scene."""

    scale: int = 4  # by which the views are divided
    samples: int = 16  # per rendered pixel, which a reference splits evenly over its halves
    scales: tuple[int, ...] = ()  # to choose from by the depth of the scene, instead of ``scale``; or none
    rays: float | None = None  # per finished pixel: they decide the samples at the chosen scale; None for ``samples``
    frames: tuple[int, ...] = ()  # frames whose depth decides the scale, none for the rendered frame alone
    reason: Notice | None = None  # why the scale was chosen, for frame.json; None where it was asked for

    @classmethod
    def of(cls, display: DisplayProfile, scales: tuple[int, ...], rays: float | None, samples: int | None,
           frames: tuple[int, ...] = (), direct: bool = False) -> Sampling:
        """Return the sampling at one of ``scales``, with ``samples`` per pixel or else ``rays`` per finished pixel.

        Of several scales the depth of the scene decides, in ``frames``. ``direct``: of a panel's own subpixels, which
        nothing is made of later. LfsrError for impossible rays.
        """
        if samples is not None:
            rays = None
        else:
            rays = (USUAL_SAMPLES if direct else usual_rays(display)) if rays is None else rays
            samples = samples_at(display, scales[0], rays)
        return cls(scales[0], samples) if len(scales) == 1 else cls(scales[0], samples, scales, rays, frames)


@dataclasses.dataclass(frozen=True)
class Request:
    """What to render and where to; LfsrError on values that cannot be rendered."""

    output: str  # frame folder to write
    display: DisplayProfile  # to render for
    scene: str = ""  # file to open, empty when Blender has it open already
    kind: str = "render"  # "render" or "reference", which has two halves
    sampling: Sampling = Sampling()
    layers: tuple[str, ...] = ()  # auxiliary layers to write too
    # layout, convention, view_aperture: how rays are laid out, see optics.rays
    layout: str = "one-pass"
    convention: str = "centred"
    view_aperture: float = 1.0
    seed: int = 0  # of Cycles' noise
    frame: int | None = None  # number of the frame, None for the scene's current one
    subject: str | None = None  # collection that is the foreground, None for all but one called Background
    lens_list: tuple[tuple[int, int], ...] | None = None  # (row, column) of the lenses to render, None for all
    rows: tuple[int, int] | None = None  # first and last row of lenses, from 1, of a part of the frame, None for all
    device: str = "CPU"  # Cycles' device, or AUTO
    clamp_indirect: float | None = None  # None for Cycles' default, 0 for none
    world_visible: bool | None = None  # None for the scene's own film setting
    camera: str | None = None  # name of the camera to use, FIT to stand before the subject, None for the scene's own
    scene_name: str | None = None  # full name of the scene in the file, None for the one that is open in it
    source: str = ""  # the file of which ``scene`` is a copy, as of ``Frame.source``; empty where it is not known
    world: str | None = None  # world.exr of another render from the same place, None to render the world where needed
    light: str = AUTO  # of LIGHTS, or the file of a world image; AUTO: the scene's own unless it is too dark
    allow_missing: bool = False  # whether files of the scene may be missing or damaged
    parts: str | None = None  # folder for the finished parts of a long render, None to store none
    first_view: str | None = None  # .npy of what an eye in the middle sees, to write before the render; None for none
    calm: float = CALM  # noise of that view up to which the usual rays are enough: half of it without a denoiser

    def __post_init__(self) -> None:
        for field, choices in (("kind", KINDS), ("layout", LAYOUTS), ("convention", CONVENTIONS)):
            check_choice(field, getattr(self, field), choices)
        for layer in self.layers:
            check_choice("layer", layer, LAYERS)
        if not is_light_file(self.light):
            check_light(self.light)
        if os.sep != "\\" and "\\" in self.output:
            raise LfsrError(f"output {self.output} has a backslash, which Blender takes for a slash: choose another "
                            "folder")
        least, samples = 2 if self.kind == "reference" else 1, self.sampling.samples
        if not is_whole(samples) or not least <= samples <= MOST_SAMPLES:
            raise LfsrError(f"samples per pixel is {samples!r:.30}, but a {self.kind} needs a whole number of at "
                            f"least {least} and at most {MOST_SAMPLES}")
        scales = (self.sampling.scale, *self.sampling.scales)
        for scale in scales:
            if not is_whole(scale):
                raise LfsrError(f"scale is {scale!r}, but it must be a whole number")
        for name, most in (("view_aperture", max(scales)), ("seed", MOST_SEED), ("clamp_indirect", MOST_CLAMP)):
            value = getattr(self, name)
            if value is not None and not 0 <= value <= most:
                raise LfsrError(f"{name.replace('_', ' ')} is {value!r:.30}, but it must be between 0 and {most}")
        for frame in (self.frame, *self.sampling.frames):
            if frame is not None and abs(frame) > MOST_FRAME:
                raise LfsrError(f"frame is {frame!r:.30}, but it must be between -{MOST_FRAME} and {MOST_FRAME}")
        for scale in scales:
            self.display.low_views(scale)
            self.samples_at(scale)
        if self.rows is not None:
            check_rows(self.rows, self.display.lenses[1])
            whole = {"a list of lenses": self.lens_list is not None,
                     "the layout view-by-view": self.layout == "view-by-view"}
            for name in (name for name, asked in whole.items() if asked):
                raise LfsrError(f"rows {rows_text(self.rows)} were asked for, but {name} is not rendered by rows: "
                                "leave out one of the two")
        if self.layout == SUBPIXELS:
            check_direct(self.display, vars(self) | vars(self.sampling))

    @property
    def judged_rays(self) -> float:
        """Rays per finished pixel by which a scale is chosen; without ``rays``, what the samples are at USUAL_SCALE."""
        rays = self.sampling.rays
        return usual_rays(self.display, self.sampling.samples) if rays is None else rays

    def samples_at(self, scale: int) -> int:
        """Samples per pixel of a render at ``scale``; LfsrError for impossible rays."""
        rays = self.sampling.rays
        return self.sampling.samples if rays is None else samples_at(self.display, scale, rays)

    def sampled(self, **changes: Any) -> Request:
        """Return the request with these fields of its sampling changed."""
        return dataclasses.replace(self, sampling=dataclasses.replace(self.sampling, **changes))

    def with_scale(self, choice: ScaleChoice) -> Request:
        """Return the request at the scale that was chosen."""
        return dataclasses.replace(self, sampling=Sampling(choice.scale, self.samples_at(choice.scale),
                                                           reason=choice.reason))


@dataclasses.dataclass(frozen=True)
class Finish:
    """The only record of a method and its options; LfsrError on values that no frame can be finished with."""

    method: str  # its name, such as "denoise+pool", see ``reconstruct.methods``
    dilate: int = 0  # lenses by which the foreground mask grows
    weights: str | None = None  # file for the method's network, None for the shipped one
    linear_exr: bool = False  # also write the scene-linear eia.exr
    temporal_averaging: int = 0  # neighbouring frames to each side that are averaged where nothing has changed

    def __post_init__(self) -> None:
        if not 0 <= self.dilate <= MOST_DILATE:
            raise LfsrError(f"dilation of the foreground mask is {str(self.dilate)[:20]}, but it must be 0 to "
                            f"{MOST_DILATE} lenses")
        if not 0 <= self.temporal_averaging <= MOST_AVERAGED:
            raise LfsrError(f"temporal averaging is {str(self.temporal_averaging)[:20]} frames to each side, but it "
                            f"must be 0 to {MOST_AVERAGED}")

    @classmethod
    def of(cls, finish: Finish | str) -> Finish:
        """Return a finish, or that of a method's name with the usual options."""
        return finish if isinstance(finish, Finish) else cls(finish)

    def seeds_of(self, seed: int, frames: Iterable[int]) -> dict[int, int]:
        """Return the seed of each of the ``frames`` of an animation whose first seed is ``seed``, by their numbers.

        With temporal averaging any 2 · n + 1 frames in a row have different seeds, of a small set that repeats, so that
        their mean does not flicker where nothing moves. Without it all have one seed, so that the noise does not move.
        """
        ordered, across = sorted({*frames}), 2 * self.temporal_averaging + 1
        apart = {b - a for reach in range(1, across) for a, b in zip(ordered, ordered[reach:], strict=False)}
        count = next(count for count in itertools.count(across) if all(step % count for step in apart))
        return {frame: (seed + (frame - 1) % count) % (MOST_SEED + 1) for frame in ordered}


@dataclasses.dataclass(frozen=True)
class Report:
    """How a frame was finished, see docs/reference/frame-folder.md."""

    finish: Finish  # as it was asked for
    method: str  # what ran of its method at this scale
    display: str  # name of the display
    # scale, samples: of the render
    scale: int
    samples: int
    seconds: dict[str, float]  # of each stage
    peak_bytes: int | None  # most memory that the process held, None where the system does not say
    # of the lenses, or of a panel's subpixels, in [0, 1]
    foreground_fraction: float
    notes: tuple[Notice, ...] = ()  # what the user should know
    # against a reference, empty until they are measured
    metrics: dict[str, Any] = dataclasses.field(default_factory=dict)
    replaced_pixels: int = 0  # pixels of the render that were not finite
    # layout, device: what sent the rays, and what Cycles rendered on
    layout: str = ""
    device: str = ""
    neighbours: tuple[int, ...] = ()  # numbers of the frames beside it, averaged or not, with temporal averaging
    averaged: float | None = None  # mean weight of the neighbouring frames where this one shows something, in [0, 1]


@dataclasses.dataclass(frozen=True)
class Frame:
    """Everything that decides the pixels of one render."""

    display: DisplayProfile  # that it was rendered for
    scale: int  # by which the views are divided, 1 for a full-resolution render
    array: CameraArray  # placement of the dense camera array
    # from camera-array space (+X right, +Y up, +Z towards the display) to the world, row by row
    matrix_world: tuple[tuple[float, ...], ...]
    samples: int  # per pixel
    seed: int = 0  # of Cycles' noise
    seeds: tuple[int, ...] = ()  # of the references whose mean it is, none for a single one
    frame: int = 1  # number of the scene's frame
    # convention, view_aperture, layout: how rays are laid out, see optics.rays
    convention: str = "centred"
    view_aperture: float = 1.0
    lens_list: tuple[tuple[int, int], ...] | None = None  # (row, column) of the lenses that were rendered, None for all
    rows: tuple[int, int] | None = None  # first and last row of lenses, from 1, of a part of the frame; None for all
    layout: str = "one-pass"
    layers: tuple[str, ...] = ()  # auxiliary layers in the EXR
    world_visible: bool = False  # whether the world shows behind the subject
    scale_reason: Notice | None = None  # why the scale was chosen, None where it was asked for
    world_apart: bool = False  # whether the visible world is in a file of its own, see optics.world_view
    color: ColorSettings = dataclasses.field(default_factory=ColorSettings)  # how Blender would show the scene
    # scene, subject: names of the file and of the foreground's collection
    scene: str = ""
    subject: str = ""
    scene_name: str = ""  # of the scene in that file, with its library; empty where it is not known
    # path from the frame's folder to the artist's file, or a name for one that was never saved; empty where not known
    source: str = ""
    content: str = ""  # size and time of change of the scene's file; empty where it is not known
    camera: str = ""  # name of the camera that was asked for, empty for the scene's own
    light: str = ""  # its own, the name or file of a world image, or even, see LIGHTS; empty where not known
    # blender, device, gpus: version and device that rendered it, with the PCI addresses of the GPUs where known
    blender: str = ""
    device: str = "CPU"
    gpus: tuple[str, ...] = ()
    notes: tuple[Notice, ...] = ()  # what the user was told of this render
    # of the render stage: "open" and "render", which includes that of the "world"
    seconds: dict[str, float] = dataclasses.field(default_factory=dict)

    def __post_init__(self) -> None:
        if len(self.matrix_world) != 4 or any(len(row) != 4 for row in self.matrix_world):
            raise LfsrError("matrix_world must have four rows of four numbers")
        # Products of the rotation's columns, which are orthonormal; then the last row.
        columns = [[row[index] for row in self.matrix_world[:3]] for index in range(3)]
        products = [sum(a * b for a, b in zip(one, other, strict=True)) for one in columns for other in columns]
        if not (all(abs(value - right) <= ROTATION_TOLERANCE for value, right in zip(
                [*products, *self.matrix_world[3]], (1, 0, 0, 0, 1, 0, 0, 0, 1, 0, 0, 0, 1), strict=True))
                and all(abs(row[3]) <= 1 / LEAST_LENGTH for row in self.matrix_world)):
            raise LfsrError(f"matrix_world is {str(self.matrix_world)[:60]}…, expected a rotation and a place: three "
                            "columns of length 1 at right angles, and the last row 0, 0, 0, 1")
        if self.samples < 1 or self.layout not in LAYOUTS:
            raise LfsrError(f"samples are {self.samples} and layout is {self.layout[:20]!r}, but it must be 1 or more "
                            f"samples and one of {', '.join(LAYOUTS)}")
        for name, value in vars(self.array).items():
            if name != "clip" and not LEAST_LENGTH <= value <= 1 / LEAST_LENGTH:
                raise LfsrError(f"array.{name} is {value!r}, but it must be a length above 0")
        if (clip := self.array.clip) is not None and not 0 <= clip[0] < clip[1] <= 1 / LEAST_LENGTH:
            raise LfsrError(f"array.clip is {clip}, but it must be two depths, the nearer one first")
        if self.layout == SUBPIXELS:
            check_direct(self.display, vars(self))
        count, lenses = len(self.rays.lens_list or ()), self.display.lenses[0] * self.display.lenses[1]
        if count > lenses:
            raise LfsrError(f"lens_list names {count} lenses, but the display has {lenses}")
        if self.rows is not None:
            check_rows(self.rows, self.display.lenses[1])

    @property
    def subpixels(self) -> PanelLayout | None:
        """Rays of the panel's subpixels in direct subpixel rendering, else None."""
        return PanelLayout(self.display, self.array) if self.layout == SUBPIXELS else None

    @property
    def rays(self) -> RayLayout:
        """Ray layout of this render; in direct subpixel rendering, of the light field that is not rendered."""
        return RayLayout.for_display(self.display, self.array, self.scale, convention=self.convention,
                                     view_aperture=self.view_aperture, lens_list=self.lens_list)


def check_direct(display: DisplayProfile, fields: Mapping[str, object]) -> None:
    """LfsrError unless ``display`` and the ``fields`` of a frame or request allow direct subpixel rendering."""
    check_sheet(display)
    for name, only in DIRECT_ONLY.items():
        if fields[name] != only:
            raise LfsrError(f"{name.replace('_', ' ')} is {str(fields[name])[:40]}, but the layout {SUBPIXELS} traces "
                            "the panel's subpixels, whole and at scale 1: leave it out, or choose another layout")


def write_frame(folder: str | Path, frame: Frame) -> None:
    """Write ``frame.json`` into ``folder``."""
    write_json(Path(folder) / FRAME_FILE, to_data(frame) | {"format": FORMAT})


def read_frame(folder: str | Path) -> Frame:
    """Read the ``frame.json`` of a light field.

    LfsrError where it is missing, incomplete, of another format, of a part of a frame, or of direct subpixel rendering.
    """
    if (frame := read_rendered(folder)).subpixels:
        raise LfsrError(f"{folder} holds the panel image alone, rendered with the layout {SUBPIXELS}: elemental "
                        "images, views and what is made of them need a render with another layout")
    return frame


def read_rendered(folder: str | Path) -> Frame:
    """Read the ``frame.json`` of a light field or of direct subpixel rendering; errors as of ``read_frame``."""
    if (frame := read_part(folder)).rows is not None:
        raise LfsrError(f"{folder} holds rows {rows_text(frame.rows)} of {frame.display.lenses[1]} alone: join it with "
                        "the other parts by `lfsr merge`")
    return frame


def read_part(folder: str | Path) -> Frame:
    """Read the ``frame.json`` of a frame or of a part of one; errors as of ``read_frame``."""
    path = Path(folder) / FRAME_FILE
    data = read_json(path, "the frame.json of a rendered frame folder")
    if not isinstance(data, dict) or data.pop("format", None) != FORMAT:
        raise LfsrError(f"{path} is not of format {FORMAT}, the one this version reads: render the frame again")
    try:
        return from_data(Frame, data, FRAME_FILE)
    except LfsrError as error:
        raise LfsrError(f"{path} is incomplete or has wrong entries ({error}): render the frame again") from None


def write_report(folder: str | Path, report: Report) -> None:
    """Write ``report.json`` into ``folder``."""
    write_record(Path(folder) / REPORT_FILE, report)


def read_report(folder: str | Path) -> Report:
    """Read ``report.json``; LfsrError if it is absent or damaged."""
    return read_record(Path(folder) / REPORT_FILE, Report, "the report of `lfsr render` or `lfsr upscale`")


def scales_up_to(display: DisplayProfile) -> tuple[int, ...]:
    """Scales to choose from, the largest first: those that divide the display's views and leave enough, and 1.

    If there are none, the smallest that divides the views, and 1.
    """
    fewest = min((count for count in display.views if count > 1), default=1)
    usual = [scale for scale in display.scales() if scale <= MOST_SCALE and (scale <= 2 or fewest >= MIN_VIEWS * scale)]
    return (*sorted(usual or display.scales()[:1], reverse=True), 1)


def usual_rays(display: DisplayProfile, samples: int = USUAL_SAMPLES) -> float:
    """Rays per finished pixel of ``samples`` per pixel at USUAL_SCALE."""
    return samples / display.finished_pixels(USUAL_SCALE)


def samples_at(display: DisplayProfile, scale: int, rays: float) -> int:
    """Samples per rendered pixel that make ``rays`` per finished pixel: at least 1, rounded.

    LfsrError for rays that are not above 0, or more than Blender can render.
    """
    samples = rays * display.finished_pixels(scale)
    if not 0 < samples <= MOST_SAMPLES:
        raise LfsrError(f"rays per finished pixel are {rays:g}, but they must be above 0, and at most "
                        f"{MOST_SAMPLES // display.finished_pixels(scale)} at scale {scale}")
    return max(1, round(samples))


def more_rays(request: Request, noise: float) -> int:
    """Return how many times its rays a request needs, of TIMES_RAYS; 1 for samples, or for fewer rays than usual.

    ``noise``: by how much two halves of its first view differ, root of the mean square in display values from 0 to 1.
    """
    share, noise = (request.sampling.rays or 0) / usual_rays(request.display), min(noise, NOISIEST)
    return next((times for times in TIMES_RAYS if share < 1 or noise <= request.calm * math.sqrt(times * share)),
                TIMES_RAYS[-1])


def read_request(path: str | Path) -> Request:
    """Read a request from a JSON file; LfsrError if it is unreadable or wrong."""
    return read_record(path, Request, "a render request")


def parse_frames(text: str) -> tuple[int, ...]:
    """Return the frames of ``1-48``, ``1-48x2`` (every second one), ``7``, or several of these with commas; each once.

    OpenJD writes ``1-48:2`` for ``1-48x2``.

    LfsrError for any other ``text``.
    """
    frames: dict[int, None] = {}
    for word in text.split(","):
        word = word.strip()
        if (match := RANGE.match(word)) is None:
            raise LfsrError(f"frames are {text[:50]!r}, but they must be like 1-48, 1-48x2 or 1,5,9")
        first, last, step = int(match[1]), int(match[2] or match[1]), int(match[3] or 1)
        if first > last or not step:
            raise LfsrError(f"frames are {word}, but the first number must be the smaller one and the step at least 1")
        if max(abs(first), abs(last)) > MOST_FRAME:
            raise LfsrError(f"frames are {word}, but they must be between -{MOST_FRAME} and {MOST_FRAME}")
        frames |= dict.fromkeys(range(first, last + 1, step))
        if len(frames) > MOST_FRAMES:
            raise LfsrError(f"frames {text[:30]} are more than {MOST_FRAMES}: render them in several runs")
    return tuple(frames)


def spread(frames: Sequence[int], most: int = 5) -> tuple[int, ...]:
    """Return at most ``most`` of ``frames``, evenly spread over them, with the first and the last."""
    return tuple(frames[round(place)] for place in np.linspace(0, len(frames) - 1, min(len(frames), most)))


def check_scene(scene: str | Path) -> str:
    """Return the absolute path of a scene file; LfsrError if it is missing or of a kind that cannot be opened."""
    scene = Path(scene)
    if not scene.is_file():
        raise LfsrError(f"scene {scene} {'is no file' if scene.exists() else 'does not exist'}: check the path")
    if scene.suffix.lower() not in SCENE_SUFFIXES:
        raise LfsrError(f"{scene} is not a scene file that can be opened: give one of {', '.join(SCENE_SUFFIXES)}")
    return str(scene.parent.resolve() / scene.name)  # a link stays: the files that a scene names lie beside the link


def check_light(light: str) -> str:
    """Return a light by its name, or the absolute path of its file; LfsrError if there is neither."""
    if not is_light_file(light):
        if light_parts(light)[0] not in LIGHTS:
            raise LfsrError(f"light is {light!r}: {did_you_mean(light, LIGHTS)}It must be one of {', '.join(LIGHTS)}, "
                            f"or a {' or '.join(LIGHT_SUFFIXES)} file")
        return light
    if not Path(light).is_file():
        raise LfsrError(f"light {light} {'is no file' if Path(light).exists() else 'does not exist'}: check the path, "
                        f"or choose one of {', '.join(LIGHTS)}")
    return str(Path(light).parent.resolve() / Path(light).name)


def light_parts(light: str) -> tuple[str, float]:
    """Return a light's name, and the factor of a world image's strength that may follow it, as in ``city:4``."""
    known = re.fullmatch(rf"({'|'.join(WORLD_IMAGES)}):(\d*\.?\d+)", light)
    return (known[1], float(known[2])) if known and float(known[2]) else (light, 1.0)


def is_light_file(light: str) -> bool:
    """Return True if a light is the file of a world image."""
    return Path(light).suffix.lower() in LIGHT_SUFFIXES
