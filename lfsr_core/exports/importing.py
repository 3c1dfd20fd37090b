"""Import the views of other programs or cameras: a folder of views becomes a frame folder."""

from __future__ import annotations

import configparser
import dataclasses
import math
from pathlib import Path

import numpy as np

from lfsr_core.errors import LfsrError
from lfsr_core.exports.hci import PARAMETERS_FILE
from lfsr_core.exports.view_files import ViewFiles, find_views, read_views
from lfsr_core.files import read_bytes
from lfsr_core.frames.frame import FRAME_FILE, LOW_RES_FILE, Frame, write_frame
from lfsr_core.images.exr import write_layers
from lfsr_core.images.srgb import srgb_decode
from lfsr_core.optics.display import DisplayProfile
from lfsr_core.optics.eia import from_views
from lfsr_core.optics.rays import CameraArray
from lfsr_core.progress import Progress, silent
from lfsr_core.render.process import DERIVED_FILES, check_folder
from lfsr_core.render.staging import publish, staging_folder

NAME = "imported"
MOST_SCALE = 10
SAMPLES = 1024  # per pixel, like a render almost without noise
IDENTITY = tuple(tuple(float(row == column) for column in range(4)) for row in range(4))
MOST_PARAMETER_BYTES = 100_000


@dataclasses.dataclass(frozen=True)
class ImportGeometry:
    """Camera geometry of a folder of views; None: from the folder's parameters, else the default."""

    width_mm: float | None = None  # of the plane without parallax, which becomes the display
    distance_mm: float | None = None  # from the cameras to that plane
    angle_deg: float | None = None  # of all cameras, seen from the centre of that plane
    mirror: str = ""  # "x", "y" or "xy" where the cameras are in the reverse order of their names


# For folders without parameters: a desk display seen from a metre.
DEFAULTS = {"width_mm": 600.0, "distance_mm": 1000.0, "angle_deg": 20.0}


@dataclasses.dataclass(frozen=True)
class Imported:
    """An imported light field."""

    display: DisplayProfile
    notes: tuple[str, ...]  # on what was left out or assumed


def import_views(source: str | Path, output: str | Path, scale: int = 1, geometry: ImportGeometry | None = None,
                 progress: Progress = silent) -> Imported:
    """Make a frame folder of a folder of views, as if they had been rendered.

    Parameters
    ----------
    source : folder of views named as in the HCI benchmark, the Stanford archive, JPEG Pleno, or our own exports
    output : frame folder to write
    scale : views that the second stage is to make of each, along each axis
    geometry : replaces what the folder's parameters say
    progress : called with (stage, fraction, message)

    Raises
    ------
    LfsrError : for views that are missing, unreadable or of several sizes, or a scale or geometry out of range
    """
    source, output, geometry = Path(source), Path(output), geometry or ImportGeometry()
    check_folder(output, "render")
    if output.resolve() == source.resolve():
        raise LfsrError(f"{output} holds the views themselves, expected another folder for the frame: choose one")
    known = _hci_parameters(source / PARAMETERS_FILE)
    files = find_views(source, known.columns if known else None).square()
    display, notes = _display(files, scale, geometry, known)
    views = read_views(files, geometry.mirror, progress)
    frame = Frame(display, scale, CameraArray.for_display(display, display.panel_mm[0]), IDENTITY, SAMPLES,
                  scene=source.resolve().name)
    with staging_folder(output) as work:
        staged = work / "frame"
        staged.mkdir()
        # A table of the 256 display values, which are exactly restored when they are encoded again.
        linear = srgb_decode(np.arange(256, dtype=np.float32) / 255)[from_views(views)]
        write_layers(staged / LOW_RES_FILE, {"color": linear})
        write_frame(staged, frame)
        # In a folder that holds no frame, files of these names are the user's own.
        publish(staged, output, DERIVED_FILES if (output / FRAME_FILE).exists() else ())
    progress("import", 1.0, str(output))
    return Imported(display, (*files.notes, *notes))


def _display(files: ViewFiles, scale: int, given: ImportGeometry, hci: _Hci | None) -> tuple[DisplayProfile, list[str]]:
    """Display whose lenses are the pixels of the views, and notes on assumptions."""
    if not 1 <= scale <= MOST_SCALE:
        raise LfsrError(f"scale is {scale}, but it must be a whole number from 1 to {MOST_SCALE}")
    known = {name: value for name in DEFAULTS if (value := getattr(given, name)) is not None}
    known = (hci.geometry(files) if hci else {}) | known
    assumed = [f"--{name.replace('_', '-')} {value:g}" for name, value in DEFAULTS.items() if name not in known]
    notes = [f"the folder has no camera geometry, assumed: {', '.join(assumed)}"] if assumed else []
    (width, height), (across, down), chosen = files.size, files.count, DEFAULTS | known
    views = (across * scale, down * scale if down > 1 else 1)
    display = DisplayProfile(
        NAME, (width * views[0], height * views[1]), (chosen["width_mm"], chosen["width_mm"] * height / width),
        (width, height), views, chosen["distance_mm"], chosen["angle_deg"],
        description=f"{across}×{down} views of another program or camera")
    return display, notes


@dataclasses.dataclass(frozen=True)
class _Hci:
    """The parameters in parameters.cfg; lengths in millimetres."""

    columns: int | None  # cameras across
    focal: float
    sensor: float
    baseline: float
    focus: float

    def geometry(self, files: ViewFiles) -> dict[str, float]:
        """Values of an ``ImportGeometry``, by name."""
        width = self.focus * self.sensor / self.focal * files.size[0] / max(files.size)
        angle = 2 * math.degrees(math.atan(self.baseline * files.count[0] / 2 / self.focus))
        return {"width_mm": width, "distance_mm": self.focus, "angle_deg": angle}


def _hci_parameters(path: Path) -> _Hci | None:
    """Parameters of an HCI light field; None where there is no file. LfsrError where it cannot be read."""
    if not path.is_file():
        return None
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
    return _Hci(columns, *lengths)
