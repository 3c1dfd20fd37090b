"""The frame folder, which the render stage hands to the second stage, and its ``frame.json``.

``frame.json`` holds enough to render the same frame again; see docs/reference/frame-folder.md.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping
from pathlib import Path

from lfsr_core.base.messages import LfsrError, Notice
from lfsr_core.base.records import from_data, to_data
from lfsr_core.base.system import read_json, write_json
from lfsr_core.images.color import ColorSettings
from lfsr_core.optics.display import DisplayProfile
from lfsr_core.optics.lenses import check_rows, rows_text
from lfsr_core.optics.panel.subpixel_rays import PanelLayout, check_sheet
from lfsr_core.optics.rays import CameraArray, RayLayout

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
Clip = tuple[float, float]


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
    frame: int = 1  # number of the scene's frame
    # convention, view_aperture, layout: how rays are laid out, see optics.rays
    convention: str = "centred"
    view_aperture: float = 1.0
    lens_list: tuple[tuple[int, int], ...] | None = None  # (row, column) of the lenses that were rendered, None for all
    rows: tuple[int, int] | None = None  # first and last row of lenses, from 1, of a part of the frame; None for all
    layout: str = "one-pass"
    clip: Clip | None = None  # nearest and farthest visible depth from the camera plane, None for no limit
    layers: tuple[str, ...] = ()  # auxiliary layers in the EXR
    world_visible: bool = False  # whether the world shows behind the subject
    scale_reason: Notice | None = None  # why the scale was chosen, None where it was asked for
    world_apart: bool = False  # whether the visible world is in a file of its own, see optics.world_view
    color: ColorSettings = dataclasses.field(default_factory=ColorSettings)  # how Blender would show the scene
    # scene, subject: names of the file and of the foreground's collection
    scene: str = ""
    subject: str = ""
    scene_name: str = ""  # of the scene in that file, with its library; empty where it is not known
    # way from the frame's folder to the artist's file, or a name for a file that was never saved; empty where not known
    source: str = ""
    content: str = ""  # size and time of change of the scene's file; empty where it is not known
    camera: str = ""  # name of the camera that was asked for, empty for the scene's own
    light: str = ""  # its own, the name or file of a world image, or even, see ``job.LIGHTS``; empty where not known
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
        # Products of the rotation's columns, each of length 1 and square to the others; then the last row.
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
            if not LEAST_LENGTH <= value <= 1 / LEAST_LENGTH:
                raise LfsrError(f"array.{name} is {value!r}, but it must be a length above 0")
        if self.clip is not None and not 0 <= self.clip[0] < self.clip[1] <= 1 / LEAST_LENGTH:
            raise LfsrError(f"clip is {self.clip}, but it must be two depths, the nearer one first")
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
    def rendered_size(self) -> tuple[int, int]:
        """Size in pixels, (width, height), of the rendered image."""
        return (self.subpixels or self.rays).size

    @property
    def rays(self) -> RayLayout:
        """Ray layout of this render; in direct subpixel rendering, of the light field that is not rendered."""
        return RayLayout.for_display(self.display, self.array, self.scale, convention=self.convention,
                                     view_aperture=self.view_aperture, lens_list=self.lens_list)


def check_direct(display: DisplayProfile, fields: Mapping[str, object]) -> None:
    """LfsrError unless ``display`` and the ``fields`` of a frame or job allow direct subpixel rendering."""
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
    frame = read_rendered(folder)
    if frame.subpixels:
        raise LfsrError(f"{folder} holds the panel image alone, rendered with the layout {SUBPIXELS}: elemental "
                        "images, views and what is made of them need a render with another layout")
    return frame


def read_rendered(folder: str | Path) -> Frame:
    """Read the ``frame.json`` of a light field or of direct subpixel rendering; errors as of ``read_frame``."""
    frame = read_part(folder)
    if frame.rows is not None:
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
