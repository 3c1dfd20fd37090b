"""Import the views of other programs or cameras: a folder of views, by their names, a quilt or a film of quilts."""

import configparser
import dataclasses
import itertools
import math
import re
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np

from lfsr_core.base.arrays import Array
from lfsr_core.base.messages import LfsrError, Notice, Progress, Tell, silent
from lfsr_core.base.records import check_within
from lfsr_core.base.system import file_digest, read_bytes, reading, staging_folder, system_errors
from lfsr_core.exports.images import PARAMETERS_FILE
from lfsr_core.exports.light_field import resized, view_between
from lfsr_core.exports.options import PRESETS, SUFFIX, Pair, read_quilt_name, without_suffix
from lfsr_core.frames.folder import FrameFolder
from lfsr_core.frames.frame import EIA_FILE, FRAME_FILE, LOW_RES_FILE, PANEL_FILE, Frame, read_frame, write_frame
from lfsr_core.images.color import srgb_decode
from lfsr_core.images.image_files import SIDEWAYS, opened, upright, write_layers
from lfsr_core.optics.display import MAX_PIXELS, DisplayProfile
from lfsr_core.optics.rays import CameraArray, from_views
from lfsr_core.reconstruct.second_stage import finish_frame

NAME = "imported"
MOST_SCALE = 10
SAMPLES = 1024  # per pixel, like a render almost without noise
IDENTITY = tuple(tuple(float(row == column) for column in range(4)) for row in range(4))
MOST_CAMERAS = 65536
MOST_BYTES = 2**35  # of all views together
SEPARATOR, ENDING = "[-_. x]", r"\.(?:png|jpe?g|ppm|tiff?)"
Place = tuple[int, int]  # row from the top, column from the left
# FFmpeg's readers by the ending of a film's name; without one it would also follow playlists to other files.
FILMS = {".mp4": "mov", ".mov": "mov", ".m4v": "mov", ".mkv": "matroska", ".webm": "matroska", ".avi": "avi"}
MOST_SIDE, LEAST_TILE = 16384, 2  # pixels; no program takes more
MOST_PIXELS = 2**27  # of a quilt all of whose pixels are kept: about a minute's work
BT709, UNKNOWN = "ITU709", 2  # a film's colour matrix, and FFmpeg's number for one that it does not say
HIGH_DEFINITION = 720  # rows from which a film that states no matrix has BT.709


def find_views(folder: Path, columns: int | None = None) -> list[list[Path]]:
    """Files of the views in a folder, by row from the topmost cameras and from the left, all of one size.

    ``columns``: cameras across, for names that are mere numbers; None: as many as down. LfsrError where a view is
    missing or differs in size.
    """
    if not folder.is_dir():
        raise LfsrError(f"{folder} is no folder, expected one of views: check the path")
    names = sorted(path.name for path in folder.iterdir() if not path.name.startswith("."))
    if not (places := _places(names, columns)):
        raise LfsrError(f"{folder} has no views with known names, such as input_Cam000.png (HCI), "
                        "out_00_00_-1.5_2.5_.png (Stanford), 000_000.ppm (JPEG Pleno) or view_000_000.png (a title, "
                        "row and column): rename them")
    down, across = (range(min(numbers), max(numbers) + 1) for numbers in zip(*places, strict=True))
    if len(down) * len(across) > MOST_CAMERAS:
        raise LfsrError(f"{folder} names {len(across)}×{len(down)} cameras, more than {MOST_CAMERAS}: check the names")
    for row, column in itertools.product(down, across):
        if (row, column) not in places:
            raise LfsrError(f"{folder} has {len(places)} views, but the one in row {row}, column {column} of "
                            f"{len(down)} rows of {len(across)} is missing (another is {min(places.values())}): add "
                            "it, or remove its whole row or column")
    paths = [[folder / places[row, column] for column in across] for row in down]
    first = image_size(paths[0][0])  # from the header
    for path in itertools.chain(*paths):
        if (size := image_size(path)) != first:
            raise LfsrError(f"{path.name} has {size[0]}×{size[1]} pixels, but {paths[0][0].name} has "
                            f"{first[0]}×{first[1]}: all views must have one size")
    if max(first) > MAX_PIXELS or first[0] * first[1] * len(paths) * len(paths[0]) * 3 > MOST_BYTES:
        raise LfsrError(f"{len(paths[0])}×{len(paths)} views of {first[0]}×{first[1]} pixels are too many to import: "
                        "make them smaller")
    return paths


def read_views(files: list[list[Path]], tell: Tell = silent) -> Array:
    """Views (rows, columns, height, width, 3) uint8 display values of the ``files`` of ``find_views``."""
    views = np.empty((len(files), len(files[0]), *image_size(files[0][0])[::-1], 3), np.uint8)
    for row, paths in enumerate(files):
        tell(Progress("import", row / len(files), paths[0].name))
        for column, path in enumerate(paths):
            views[row, column] = read_image(path)
    return views


def _places(names: list[str], columns: int | None) -> dict[Place, str]:
    """Names of views by their places, by the first convention that any name follows.

    LfsrError where two have the same place.
    """
    def matching(pattern: str) -> list[tuple[re.Match[str], str]]:
        whole = re.compile(pattern + ENDING, re.IGNORECASE)
        return [(match, name) for name in names if (match := whole.fullmatch(name))]

    pair = rf"(\d+){SEPARATOR}(\d+)"
    if hci := matching(r"input_cam(\d+)"):
        numbers = [int(match[1]) for match, _ in hci]
        columns = columns or math.ceil(math.sqrt(max(numbers) + 1))
        placed = [(divmod(number, columns), name) for number, (_, name) in zip(numbers, hci, strict=True)]
    elif (stanford := matching(r".*?_?(\d+)_(\d+)_(-?\d+(?:\.\d+)?)_(-?\d+(?:\.\d+)?)_?")) and len(
            {match.group(1, 2) for match, _ in stanford}) == len(stanford):  # else the title ends in numbers
        axes = np.array([[float(match[group]) for group in (1, 2, 3, 4)] for match, _ in stanford]).T
        for counted, coordinates in ((axes[0], axes[2]), (axes[1], axes[3])):
            # Numbers count from 0, and are reversed where the coordinates fall while they rise.
            falls = np.dot(counted - counted.mean(), coordinates - coordinates.mean()) < 0
            counted[:] = counted.max() - counted if falls else counted - counted.min()
        placed = [((int(row), int(column)), name) for row, column, (_, name) in zip(*axes[:2], stanford, strict=True)]
    elif pleno := matching(pair):  # by column and row
        placed = [((int(match[2]), int(match[1])), name) for match, name in pleno]
    else:  # by a title, row and column, as our exports are
        placed = [((int(match[1]), int(match[2])), name) for match, name in matching(rf".*\D{pair}")]
    places: dict[Place, str] = {}
    for place, name in placed:
        if place in places:
            raise LfsrError(f"{places[place]} and {name} belong to the same camera: remove one")
        places[place] = name
    return places


def image_size(path: Path) -> tuple[int, int]:
    """(width, height) in pixels of an upright image, from the header; LfsrError where it cannot be read."""
    with opened(path) as source:
        if source is None:
            raise LfsrError(f"{path} is no readable image: replace it")
        size = source.spec().width, source.spec().height
        return size[::-1] if source.spec().get_int_attribute("Orientation", 1) in SIDEWAYS else size


def read_image(path: Path) -> Array:
    """(height, width, 3) uint8, grey in three channels; LfsrError where it cannot be read to its end."""
    with opened(path) as source:
        pixels, spec = (source.read_image("uint8"), source.spec()) if source else (None, None)
        # A JPEG that was cut short is read, its rest grey. Extraneous bytes, which some cameras write, change nothing.
        if source and source.has_error and "extraneous" not in source.geterror():
            pixels = None
    if pixels is None or spec is None:
        raise LfsrError(f"{path} is damaged: replace it")
    pixels = upright(np.asarray(pixels).reshape(*pixels.shape[:2], -1), spec)
    return pixels[..., :3] if pixels.shape[2] >= 3 else pixels[..., :1].repeat(3, axis=2)


@dataclasses.dataclass(frozen=True)
class Quilt:
    """How to read a quilt."""

    grid: tuple[int, int]  # tiles across and down
    aspect: float  # of the picture, width / height
    top_first: bool = False  # whether tile 0 is at the top left, as in quilts for CubeVi's display
    assumed: Notice | None = None  # says that the aspect ratio is assumed


def is_film(path: Path) -> bool:
    """Whether a file's name is that of a film."""
    return path.suffix.lower() in FILMS


def quilt_of(path: Path, shape: str | None = None, top_first: bool = False) -> Quilt:
    """How to read the quilt in ``path``, by ``shape``, as 8x6 or 8x6a0.75, else by its name; LfsrError for neither."""
    if shape is not None and not SUFFIX.fullmatch(f"_qs{shape}"):
        raise LfsrError(f"quilt is {shape[:30]!r}, but it must be tiles across and down, and perhaps the aspect ratio, "
                        "as 8x6 or 8x6a0.75")
    if (said := read_quilt_name(f"_qs{shape}" if shape is not None else path.stem)) is None:
        raise LfsrError(f"the name {path.name} does not say how many tiles the quilt has, as name_qs8x6a0.75.png does: "
                        "give --quilt, as 8x6 or 8x6a0.75")
    if said.grid[0] * said.grid[1] < 2:
        raise LfsrError(f"a quilt of {said.grid[0]}x{said.grid[1]} tiles has no two views: give --quilt, as 8x6")
    named = read_quilt_name(path.stem)
    aspect = said.aspect or (named.aspect if named else None)
    if aspect is not None:
        return Quilt(said.grid, aspect, top_first)
    # That of the panels whose quilts have this grid.
    aspect, (across, down) = {preset.grid: preset.aspect for preset in PRESETS.values()}.get(said.grid), said.grid
    if aspect is None:
        raise LfsrError(f"the aspect ratio of a quilt of {across}x{down} tiles is not known: give --quilt with it, as "
                        f"{across}x{down}a0.75")
    return Quilt(said.grid, aspect, top_first,
                 Notice("aspect-assumed", {"across": across, "down": down, "aspect": aspect}))


def read_quilt(path: Path, quilt: Quilt) -> Array:
    """Views (1, n, height, width, 3) uint8 of an image; LfsrError where it cannot be read, is too large or small."""
    _check_quilt(path, image_size(path), quilt)
    return _tiles(read_image(path), quilt)


def read_film(path: Path, quilt: Quilt) -> Iterator[tuple[Array, int]]:
    """Yield the views of each frame of a quilt film, and its number of frames, 0 if not known; errors as above."""
    try:
        import av
    except ImportError:
        raise LfsrError("films need the package av: pip install 'lfsr[video]', or import single images") from None
    # PyAV 19 and later accept any bytes as metadata.
    damaged: dict[str, Any] = {} if int(av.__version__.split(".")[0]) >= 19 else {"metadata_errors": "replace"}
    try:
        with reading(path, "a film"), av.open(str(path), format=FILMS[path.suffix.lower()], **damaged) as film:
            stream = next((stream for stream in film.streams.video if stream.codec_context), None)
            if stream is None:
                raise LfsrError(f"{path} has no images that can be read: give a film of quilts")
            _check_quilt(path, (stream.width, stream.height), quilt)
            # FFmpeg reports no error at the end of a truncated Matroska file, so its duration is counted down.
            said = re.fullmatch(r"(\d+):(\d+):(\d+\.?\d*)", stream.metadata.get("DURATION", ""))
            left = float(said[1]) * 3600 + float(said[2]) * 60 + float(said[3]) if said else 0.0
            for frame in film.decode(stream):
                _check_quilt(path, (frame.width, frame.height), quilt)
                matrix = BT709 if frame.colorspace == UNKNOWN and frame.height >= HIGH_DEFINITION else None
                yield _tiles(frame.reformat(format="rgb24", src_colorspace=matrix).to_ndarray(), quilt), stream.frames
                left -= float((frame.duration or 0) * (frame.time_base or 0))
            if left > 0.5 / float(stream.average_rate or 1):
                raise LfsrError(f"{path} ends {left:.1f} s earlier than it says: replace it")
    except av.FFmpegError as error:
        raise LfsrError(f"{path} is no readable film ({error.strerror}): replace it") from None


def _check_quilt(path: Path, size: tuple[int, int], quilt: Quilt) -> None:
    if max(size) > MOST_SIDE:
        raise LfsrError(f"{path} has {size[0]}×{size[1]} pixels, but a quilt has at most {MOST_SIDE} a side: make it "
                        "smaller")
    if any(pixels < LEAST_TILE * tiles for pixels, tiles in zip(size, quilt.grid, strict=True)):
        raise LfsrError(f"{path} has {size[0]}×{size[1]} pixels, too few for {quilt.grid[0]}x{quilt.grid[1]} tiles: "
                        "give the right --quilt")


def _tiles(pixels: Array, quilt: Quilt) -> Array:
    """Views (1, n, height, width, 3), the leftmost first, of a quilt (H, W, 3) uint8.

    Where the grid does not divide the size, tiles begin at the nearest pixel.
    """
    (columns, rows), (high, wide) = quilt.grid, pixels.shape[:2]
    width, height = wide // columns, high // rows
    left = [min(round(column * wide / columns), wide - width) for column in range(columns)]
    top = [min(round(row * high / rows), high - height) for row in range(rows)]
    lines = top if quilt.top_first else top[::-1]
    return np.asarray(np.stack([pixels[y:y + height, x:x + width] for y in lines for x in left])[None])


@dataclasses.dataclass(frozen=True)
class ImportGeometry:
    """Camera geometry of views, and their display; None: from the folder's parameters, else the default."""

    width_mm: float | None = None  # of the plane without parallax, which becomes the display
    distance_mm: float | None = None  # from the cameras to that plane
    angle_deg: float | None = None  # of all cameras, seen from the centre of that plane
    mirror: str = ""  # "x", "y" or "xy" where the cameras are in the reverse order of their names
    display: DisplayProfile | None = None  # the views are resampled for it; None: one with a lens per pixel of a view
    fill: bool = False  # True: the picture fills that display and is cut; False: it is whole, between black bars


# For folders without parameters: a desk display seen from a metre.
DEFAULTS = {"width_mm": 600.0, "distance_mm": 1000.0, "angle_deg": 20.0}


def import_views(source: str | Path, output: str | Path, scale: int = 1, geometry: ImportGeometry | None = None,
                 tell: Tell = silent, quilt: Quilt | None = None) -> DisplayProfile:
    """Make a frame folder of a folder of views or of a quilt, as if they had been rendered; return its display.

    ``source``: folder of views named as in the HCI benchmark, the Stanford archive, JPEG Pleno, or our own exports; or
    the image or film of a quilt. Each frame of a film becomes a finished folder ``0001`` … in ``output``; folders that
    are there already stay. ``output``: frame folder to write; ``scale``: factor by which the second stage multiplies
    the views along each axis, 1 if ``geometry`` has a display; ``geometry``: replaces what the folder's parameters say;
    ``quilt``: how to read a quilt, as of ``quilt_of``, None for a folder of views. LfsrError for views that are
    missing, unreadable or of several sizes, a scale or geometry out of range, or where a folder holds another film or
    another import of this one.
    """
    source, output, geometry, facts = Path(source), Path(output), geometry or ImportGeometry(), dict[str, float]()
    if quilt is not None and is_film(source):
        return _import_film(source, output, quilt, geometry, tell)
    if output.resolve() == source.resolve():
        raise LfsrError(f"{output} holds the views themselves, expected another folder for the frame: choose one")
    FrameFolder(output).check_free("render")
    if quilt is not None:
        tell(Progress("import", 0.0, source.name))
        _check_quilt(source, size := image_size(source), quilt)
        if geometry.display is None and math.prod(size) > MOST_PIXELS:
            raise LfsrError(f"{source} has {size[0]}×{size[1]} pixels, but without a display at most "
                            f"{MOST_PIXELS // 10**6} million are imported: choose one with --display, or make it "
                            "smaller")
        tile = size[0] // quilt.grid[0], size[1] // quilt.grid[1]
        name = without_suffix(source.stem)
        display = _display(tile, (math.prod(quilt.grid), 1), scale, geometry, facts, tell, quilt)
        views = _views(read_quilt(source, quilt), geometry, quilt.aspect, geometry.angle_deg, equal_angles=True)
    else:
        columns, lengths = _hci_parameters(source / PARAMETERS_FILE)
        files = find_views(source, columns)
        down, across = len(files), len(files[0])
        if geometry.display is None and across == 1:
            raise LfsrError(f"the folder has {across}×{down} cameras, but a display needs at least two beside each "
                            "other: check the names")
        if geometry.display is None and down not in (across, 1):  # the cameras in the middle, as many down as across
            side = min(across, down)
            top, left = (down - side) // 2, (across - side) // 2
            tell(Notice("cameras-cut", {"side": side, "across": across, "down": down}))
            files, across, down = [row[left:left + side] for row in files[top:top + side]], side, side
        size = image_size(files[0][0])
        if lengths:
            focal, sensor, baseline, focus, aspect = lengths
            aspect = aspect or size[0] / size[1]
            facts = {"width_mm": focus * sensor / focal * min(1, aspect), "distance_mm": focus, "aspect": aspect,
                     "angle_deg": 2 * math.degrees(math.atan(baseline * across / 2 / focus))}
        display, name = _display(size, (across, down), scale, geometry, facts, tell), source.resolve().name
        views = _views(read_views(files, tell), geometry, facts.get("aspect", size[0] / size[1]),
                       geometry.angle_deg or facts.get("angle_deg"), equal_angles=False)
    _write(output, _frame(display, scale, name), views)
    tell(Progress("import", 1.0, str(output)))
    return display


def _import_film(source: Path, output: Path, quilt: Quilt, geometry: ImportGeometry, tell: Tell) -> DisplayProfile:
    with system_errors():
        content = file_digest(source)
    display: DisplayProfile | None = None
    for number, (views, count) in enumerate(read_film(source, quilt), start=1):
        of_all = f" of {count}" if count else ""
        tell(Progress("import", (number - 1) / max(count, number), f"frame {number}{of_all}"))
        _, tiles, height, width, _ = views.shape
        display = _display((width, height), (tiles, 1), 1, geometry, {}, tell if number == 1 else silent, quilt)
        frame = dataclasses.replace(_frame(display, 1, without_suffix(source.stem)), frame=number, content=content)
        folder = FrameFolder.of_frame(output, number).path
        FrameFolder(folder).check_free("render")
        if (is_there := (folder / FRAME_FILE).exists()) and read_frame(folder) != frame:
            raise LfsrError(f"{folder} holds a frame of another film, or for another display: choose another folder")
        if not (is_there and (folder / LOW_RES_FILE).is_file()):
            _write(folder, frame, _views(views, geometry, quilt.aspect, geometry.angle_deg, equal_angles=True))
        if not all((folder / name).is_file() for name in (EIA_FILE, *((PANEL_FILE,) if display.is_woven else ()))):
            finish_frame(folder, "none")
    if display is None:
        raise LfsrError(f"{source} has no images that can be read: give a film of quilts")
    tell(Progress("import", 1.0, str(output)))
    return display


def _frame(display: DisplayProfile, scale: int, name: str) -> Frame:
    return Frame(display, scale, CameraArray.for_display(display, display.panel_mm[0]), IDENTITY, SAMPLES, scene=name)


def _views(taken: Array, geometry: ImportGeometry, aspect: float, angle_deg: float | None, *,
           equal_angles: bool) -> Array:
    """Views (rows, columns, height, width, 3) uint8 in their order, made for the display if one was chosen.

    ``taken``: the same, row 0 the topmost cameras; ``aspect``: width / height of the picture, whose pixels need not be
    square; ``angle_deg``: over which the cameras are spread horizontally, None for the display's own angle, beyond
    which the outermost view repeats; ``equal_angles``: neighbouring cameras differ by one angle, else by one distance.
    """
    views = taken[::-1 if "y" in geometry.mirror else 1, ::-1 if "x" in geometry.mirror else 1]
    if (display := geometry.display) is None:
        return views
    wider = aspect / (display.panel_mm[0] / display.panel_mm[1])
    across = max(1.0, wider) if geometry.fill else min(1.0, wider)
    shown = np.stack([[resized(view, display.lenses, (across, across / wider)) for view in row] for row in views])
    angle, (down, count) = math.radians(angle_deg or display.viewing_angle_deg), taken.shape[:2]
    right, up = ((np.arange(n) + 0.5 - n / 2) * display.camera_spacing_mm / display.viewing_distance_mm
                 for n in display.views)  # tangents of the display's cameras
    span = 2 * math.tan(angle / 2)
    columns = ((np.arctan(right) / angle if equal_angles else right / span) + 0.5) * count - 0.5
    rows = up / span * count + (down - 1) / 2  # as far apart as columns
    return np.stack([np.stack([view_between(shown, column, row) for column in columns]) for row in rows])


def _write(output: Path, frame: Frame, views: Array) -> None:
    """Write the frame folder of ``views``, as if they had been rendered."""
    with staging_folder(output) as work:
        staged = work / "frame"
        staged.mkdir()
        # A table of 256 values: encoding them again restores the display values exactly.
        linear = srgb_decode(np.arange(256, dtype=np.float32) / 255)[from_views(views)]
        write_layers(staged / LOW_RES_FILE, {"color": linear})
        write_frame(staged, frame)
        FrameFolder(output).publish(staged)


def _display(size: Pair, count: Pair, scale: int, given: ImportGeometry, facts: dict[str, float],
             tell: Tell, quilt: Quilt | None = None) -> DisplayProfile:
    """The chosen display, or one whose lenses are the pixels of the views; tells what is assumed.

    ``size`` of the views, ``count`` of cameras (across, down).
    """
    if quilt is not None and quilt.assumed is not None:
        tell(quilt.assumed)
    if not 1 <= scale <= MOST_SCALE:
        raise LfsrError(f"scale is {scale}, but it must be a whole number from 1 to {MOST_SCALE}")
    if given.display is not None:
        if scale != 1 or given.width_mm is not None or given.distance_mm is not None:
            raise LfsrError("a display decides width, distance and number of views, so --scale, --width-mm and "
                            "--distance-mm have no use with --display: leave them out")
        if given.angle_deg is not None:
            check_within("angle_deg", given.angle_deg, 1, 120)
        elif "angle_deg" not in facts:
            tell(Notice("angle-assumed", {"angle_deg": given.display.viewing_angle_deg}))
        return given.display
    facts = facts | {name: value for name in DEFAULTS if (value := getattr(given, name)) is not None}
    defaults = DEFAULTS | ({} if quilt is None else {"angle_deg": 40.0})  # the usual viewing cone of quilts
    if assumed := {name: value for name, value in defaults.items() if name not in facts}:
        tell(Notice("geometry-assumed", assumed))
    (width, height), (across, down), chosen = size, count, defaults | facts
    views = (across * scale, down * scale if down > 1 else 1)
    panel_mm = chosen["width_mm"], chosen["width_mm"] / (quilt.aspect if quilt else facts.get("aspect", width / height))
    return DisplayProfile(
        NAME, (width * views[0], height * views[1]), panel_mm, (width, height), views, chosen["distance_mm"],
        chosen["angle_deg"], description=f"{across}×{down} views of another program or camera")


def _hci_parameters(path: Path) -> tuple[int | None, tuple[float, ...]]:
    """Return the cameras across, and (focal length, sensor, baseline, focus, width / height), of HCI parameters.

    Lengths in millimetres; width / height is 0 if not stated. (None, ()) without a file; LfsrError if it is unreadable.
    """
    if not path.is_file():
        return None, ()
    parser = configparser.ConfigParser(interpolation=None)
    try:
        parser.read_string(read_bytes(path, "the parameters of an HCI light field", 100_000).decode())
        inside, outside = parser["intrinsics"], parser["extrinsics"]
        lengths = (float(inside["focal_length_mm"]), float(inside["sensor_size_mm"]), float(outside["baseline_mm"]),
                   float(outside["focus_distance_m"]) * 1000, inside.getfloat("panel_aspect", fallback=0.0))
        columns = outside.getint("num_cams_x")
        if not all(0 < value < math.inf for value in (*lengths[:4], lengths[4] or 1, columns or 1)):
            raise ValueError("a number is not above 0")
    except (configparser.Error, ValueError, KeyError) as error:
        raise LfsrError(f"{path} cannot be read as the parameters of an HCI light field "
                        f"({str(error).splitlines()[0][:80]}): correct it, or remove it") from None
    return columns, lengths
