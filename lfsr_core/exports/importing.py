"""Import the views of other programs or cameras: a folder of views, a quilt or a film of quilts."""

from __future__ import annotations

import configparser
import dataclasses
import math
from pathlib import Path

import numpy as np

from lfsr_core.base.arrays import Array
from lfsr_core.base.errors import LfsrError
from lfsr_core.base.files import file_digest, read_bytes, replace_files, staging_folder, system_errors
from lfsr_core.base.notices import Notice, Progress, Tell, silent
from lfsr_core.base.records import check_within
from lfsr_core.exports.folders import PARAMETERS_FILE
from lfsr_core.exports.light_field import resized, view_between
from lfsr_core.exports.options import Pair, without_suffix
from lfsr_core.exports.sources import Quilt, Source, find_views, read_film, read_quilt, read_views
from lfsr_core.frames.folder import DERIVED_FILES, FrameFolder
from lfsr_core.frames.frame import (
    EIA_FILE,
    FRAME_FILE,
    LOW_RES_FILE,
    PANEL_FILE,
    Frame,
    read_frame,
    write_frame,
)
from lfsr_core.images.exr import write_layers
from lfsr_core.images.srgb import srgb_decode
from lfsr_core.optics.display import DisplayProfile
from lfsr_core.optics.eia import from_views
from lfsr_core.optics.rays import CameraArray
from lfsr_core.pipeline.make import finish_frame

NAME = "imported"
MOST_SCALE = 10
SAMPLES = 1024  # per pixel, like a render almost without noise
IDENTITY = tuple(tuple(float(row == column) for column in range(4)) for row in range(4))
MOST_PARAMETER_BYTES = 100_000


@dataclasses.dataclass(frozen=True)
class ImportGeometry:
    """Camera geometry of views, and their display; None: from the folder's parameters, else the default."""

    width_mm: float | None = None  # of the plane without parallax, which becomes the display
    distance_mm: float | None = None  # from the cameras to that plane
    angle_deg: float | None = None  # of all cameras, seen from the centre of that plane
    mirror: str = ""  # "x", "y" or "xy" where the cameras are in the reverse order of their names
    display: DisplayProfile | None = None  # that the views are made for; None: one whose lenses are their pixels
    fill: bool = False  # whether the picture fills that display and is cut; else it is seen whole, between black bars


# For folders without parameters: a desk display seen from a metre; for quilts the usual viewing cone.
DEFAULTS = {"width_mm": 600.0, "distance_mm": 1000.0, "angle_deg": 20.0}
QUILT_ANGLE = 40.0


def import_views(source: str | Path, output: str | Path, scale: int = 1, geometry: ImportGeometry | None = None,
                 tell: Tell = silent) -> DisplayProfile:
    """Make a frame folder of a folder of views, as if they had been rendered; return its display.

    Parameters
    ----------
    source : folder of views named as in the HCI benchmark, the Stanford archive, JPEG Pleno, or our own exports
    output : frame folder to write
    scale : views that the second stage is to make of each, along each axis; 1 for a display of one's choice
    geometry : replaces what the folder's parameters say
    tell : called with ``Progress`` and ``Notice``

    Raises
    ------
    LfsrError : for views that are missing, unreadable or of several sizes, or a scale or geometry out of range
    """
    source, output, geometry = Path(source), Path(output), geometry or ImportGeometry()
    FrameFolder(output).check_free("render")
    if output.resolve() == source.resolve():
        raise LfsrError(f"{output} holds the views themselves, expected another folder for the frame: choose one")
    columns, lengths = _hci_parameters(source / PARAMETERS_FILE)
    files, known = find_views(source, columns), dict[str, float]()
    files = files.square(tell) if geometry.display is None else files
    if lengths:
        focal, sensor, baseline, focus = lengths
        known = {"width_mm": focus * sensor / focal * files.size[0] / max(files.size), "distance_mm": focus,
                 "angle_deg": 2 * math.degrees(math.atan(baseline * files.count[0] / 2 / focus))}
    display = _display(files.size, files.count, scale, geometry, known, tell)
    taken = Source(read_views(files, tell), files.size[0] / files.size[1], equal_angles=False)
    frame = _frame(display, scale, source.resolve().name)
    _write(output, frame, _views(taken, geometry, geometry.angle_deg or known.get("angle_deg")))
    tell(Progress("import", 1.0, str(output)))
    return display


def import_quilt(source: str | Path, output: str | Path, quilt: Quilt, scale: int = 1,
                 geometry: ImportGeometry | None = None, tell: Tell = silent) -> DisplayProfile:
    """Make a frame folder of a quilt; parameters and errors as of ``import_views``."""
    source, output, geometry = Path(source), Path(output), geometry or ImportGeometry()
    FrameFolder(output).check_free("render")
    tell(Progress("import", 0.0, source.name))
    taken = read_quilt(source, quilt)
    display = _quilt_display(taken, scale, geometry, quilt, tell)
    _write(output, _frame(display, scale, without_suffix(source.stem)), _views(taken, geometry, geometry.angle_deg))
    tell(Progress("import", 1.0, str(output)))
    return display


def import_film(source: str | Path, output: str | Path, quilt: Quilt, geometry: ImportGeometry | None = None,
                tell: Tell = silent) -> DisplayProfile:
    """Make finished frame folders ``0001`` … in ``output`` of a film of quilts; those that are there already stay.

    LfsrError as of ``import_views``, or where a folder holds another film or another import of this one.
    """
    source, output, geometry = Path(source), Path(output), geometry or ImportGeometry()
    with system_errors():
        content = file_digest(source)
    display: DisplayProfile | None = None
    for number, (taken, count) in enumerate(read_film(source, quilt), start=1):
        of_all = f" of {count}" if count else ""
        tell(Progress("import", (number - 1) / max(count, number), f"frame {number}{of_all}"))
        display = _quilt_display(taken, 1, geometry, quilt, tell if number == 1 else silent)
        frame = dataclasses.replace(_frame(display, 1, without_suffix(source.stem)), frame=number, content=content)
        folder = FrameFolder.of_frame(output, number).path
        if is_there := (folder / FRAME_FILE).exists():
            FrameFolder(folder).check_free("render")
            if read_frame(folder) != frame:
                raise LfsrError(f"{folder} holds a frame of another film, or for another display: choose another "
                                "folder")
        if not (is_there and (folder / LOW_RES_FILE).is_file()):
            _write(folder, frame, _views(taken, geometry, geometry.angle_deg))
        if not all((folder / name).is_file() for name in (EIA_FILE, *((PANEL_FILE,) if display.is_woven else ()))):
            finish_frame(folder, "none")
    if display is None:
        raise LfsrError(f"{source} has no images that can be read: give a film of quilts")
    tell(Progress("import", 1.0, str(output)))
    return display


def _frame(display: DisplayProfile, scale: int, name: str) -> Frame:
    return Frame(display, scale, CameraArray.for_display(display, display.panel_mm[0]), IDENTITY, SAMPLES, scene=name)


def _views(taken: Source, geometry: ImportGeometry, angle_deg: float | None) -> Array:
    """Views (rows, columns, height, width, 3) uint8 in their order, made for the display if one was chosen.

    ``angle_deg``: over which the cameras are spread horizontally; beyond it the outermost view repeats. None: the
    display's own angle.
    """
    views = taken.views[::-1 if "y" in geometry.mirror else 1, ::-1 if "x" in geometry.mirror else 1]
    display = geometry.display
    if display is None:
        return views
    wider = taken.aspect / (display.panel_mm[0] / display.panel_mm[1])
    across = max(1.0, wider) if geometry.fill else min(1.0, wider)
    covers = (across, across / wider)
    shown = np.stack([[resized(view, display.lenses, covers) for view in row] for row in views])
    angle, (down, count) = math.radians(angle_deg or display.viewing_angle_deg), taken.views.shape[:2]
    right, up = ((np.arange(n) + 0.5 - n / 2) * display.camera_spacing_mm / display.viewing_distance_mm
                 for n in display.views)  # tangents of the display's cameras
    span = 2 * math.tan(angle / 2)
    columns = ((np.arctan(right) / angle if taken.equal_angles else right / span) + 0.5) * count - 0.5
    rows = up / span * count + (down - 1) / 2  # as far apart as columns
    return np.stack([np.stack([view_between(shown, column, row) for column in columns]) for row in rows])


def _write(output: Path, frame: Frame, views: Array) -> None:
    """Write the frame folder of ``views``, as if they had been rendered."""
    with staging_folder(output) as work:
        staged = work / "frame"
        staged.mkdir()
        # A table of the 256 display values, which are exactly restored when they are encoded again.
        linear = srgb_decode(np.arange(256, dtype=np.float32) / 255)[from_views(views)]
        write_layers(staged / LOW_RES_FILE, {"color": linear})
        write_frame(staged, frame)
        # In a folder that holds no frame, files of these names are the user's own.
        output.mkdir(exist_ok=True)
        replace_files(staged, output, DERIVED_FILES if (output / FRAME_FILE).exists() else ())


def _quilt_display(taken: Source, scale: int, geometry: ImportGeometry, quilt: Quilt, tell: Tell) -> DisplayProfile:
    if quilt.assumed is not None:
        tell(quilt.assumed)
    _, across, height, width = taken.views.shape[:4]
    defaults = DEFAULTS | {"angle_deg": QUILT_ANGLE}
    return _display((width, height), (across, 1), scale, geometry, {}, tell, defaults, taken.aspect)


def _display(size: Pair, count: Pair, scale: int, given: ImportGeometry, known: dict[str, float],
             tell: Tell, defaults: dict[str, float] = DEFAULTS, aspect: float | None = None) -> DisplayProfile:
    """The chosen display, or one whose lenses are the pixels of the views; tells what is assumed.

    ``size`` of the views, ``count`` of cameras (across, down); ``aspect`` of the picture, None: pixels are square.
    """
    if not 1 <= scale <= MOST_SCALE:
        raise LfsrError(f"scale is {scale}, but it must be a whole number from 1 to {MOST_SCALE}")
    if given.display is not None:
        if scale != 1 or given.width_mm is not None or given.distance_mm is not None:
            raise LfsrError("a display decides width, distance and number of views, so --scale, --width-mm and "
                            "--distance-mm have no use with --display: leave them out")
        if given.angle_deg is not None:
            check_within("angle_deg", given.angle_deg, 1, 120)
        elif "angle_deg" not in known:
            tell(Notice("angle-assumed", {"angle_deg": given.display.viewing_angle_deg}))
        return given.display
    known = known | {name: value for name in DEFAULTS if (value := getattr(given, name)) is not None}
    if assumed := {name: value for name, value in defaults.items() if name not in known}:
        tell(Notice("geometry-assumed", assumed))
    (width, height), (across, down), chosen = size, count, defaults | known
    views = (across * scale, down * scale if down > 1 else 1)
    panel_mm = chosen["width_mm"], chosen["width_mm"] / (aspect or width / height)
    return DisplayProfile(
        NAME, (width * views[0], height * views[1]), panel_mm, (width, height), views, chosen["distance_mm"],
        chosen["angle_deg"], description=f"{across}×{down} views of another program or camera")


def _hci_parameters(path: Path) -> tuple[int | None, tuple[float, ...]]:
    """Cameras across, and focal length, sensor, baseline and focus in millimetres, of an HCI light field's parameters.

    Nothing where there is no file; LfsrError where it cannot be read.
    """
    if not path.is_file():
        return None, ()
    parser = configparser.ConfigParser(interpolation=None)
    try:
        parser.read_string(read_bytes(path, "the parameters of an HCI light field", MOST_PARAMETER_BYTES).decode())
        inside, outside = parser["intrinsics"], parser["extrinsics"]
        lengths = (float(inside["focal_length_mm"]), float(inside["sensor_size_mm"]),
                   float(outside["baseline_mm"]), float(outside["focus_distance_m"]) * 1000)
        columns = outside.getint("num_cams_x")
        if not all(0 < value < math.inf for value in (*lengths, columns or 1)):
            raise ValueError("a number is not above 0")
    except (configparser.Error, ValueError, KeyError) as error:
        raise LfsrError(f"{path} cannot be read as the parameters of an HCI light field "
                        f"({str(error).splitlines()[0][:80]}): correct it, or remove it") from None
    return columns, lengths
