"""Images of a light field (quilts, stereo pairs of two eyes, anaglyphs, RGB-D), films, and folders of views.

Films are of quilts, and of an eye that moves: sway goes round an ellipse, wiggle between two eyes.
Quilts are for Looking Glass displays and their programs. Tile 0 is at the bottom left and holds the leftmost camera's
view; tiles go rightwards, then upwards. The name holds columns, rows and the panel's proportions.
"""

import itertools
import math
from collections.abc import Callable, Iterator
from fractions import Fraction
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import OpenImageIO as oiio

from lfsr_core.base.arrays import Array
from lfsr_core.base.messages import LfsrError, Notice, Progress, did_you_mean
from lfsr_core.exports.light_field import LightField, camera_places, on_screen, resized, screen_size, usual_width
from lfsr_core.exports.options import H264_SIDE, PRESETS, QUILT_FILM, ExportOptions, Preset, chosen_type, quilt_name
from lfsr_core.frames.frame import EIA_LINEAR_FILE, LOW_RES_FILE, Frame
from lfsr_core.images.color import srgb_decode, srgb_encode
from lfsr_core.images.image_files import HALF_MAX, read_finite, write_png
from lfsr_core.optics.display import Pair
from lfsr_core.optics.rays import to_views
from lfsr_core.reconstruct.second_stage import read_finished_linear
from lfsr_core.reconstruct.upscaler import low_resolution

MOST_SIDE = 16384  # pixels; no program takes more
EXR_FILE = "views.exr"
MOST_PARTS = 1024  # that readers here and elsewhere accept
PLENO_MAX = 1023
SENSOR_MM = 35.0  # arbitrary: the focal length follows from it
DISPARITY_FILE, PARAMETERS_FILE = "gt_disp_lowres.pfm", "parameters.cfg"
QUALITY = 90  # of WebP
ENCODERS = {"libx264": {"crf": "18", "preset": "medium"},  # without visible loss
            "libx265": {"crf": "20", "preset": "fast", "x265-params": "log-level=error"}}
MOST_DELAY = 16  # frames from decoding to showing; libx265 leaves that of a film of one frame undefined
RATES = {"mp4": 30, "gif": 20, "webp": 20, "png": 30}  # frames per second
LOOPING = ("gif", "webp")  # start again by themselves
ANIMATION_RATE = 24  # Blender's default
REACH, RISE = 0.85, 0.35  # fraction of the half viewing zone, across and up
LEAST_SPAN = 1e-6  # of disparities, in pixels per view
# Left and right eye's linear red, green and blue to those of red-cyan glasses on a liquid crystal display: E. Dubois,
# "Conversion of a stereo pair to anaglyph with the least-squares projection method", March 2009.
DUBOIS = np.array([[[0.437, 0.449, 0.164], [-0.062, -0.062, -0.024], [-0.048, -0.050, -0.017]],
                   [[-0.011, -0.032, -0.007], [0.377, 0.761, 0.009], [-0.026, -0.093, 1.234]]], np.float32)


def write_quilt(field: LightField, folder: Path, options: ExportOptions) -> None:
    """Write one quilt."""
    grid, tile = quilt_layout(field, options)
    write_png(folder / f"{quilt_name(field.name, grid, panel_aspect(field))}.png", quilt_of_views(field, grid, tile))


def panel_aspect(field: LightField) -> float:
    """Width / height of the display's panel."""
    return field.display.panel_mm[0] / field.display.panel_mm[1]


def quilt_layout(field: LightField, options: ExportOptions) -> tuple[Pair, Pair]:
    """Return the tiles and the pixels of a tile: as asked for, else of the display's quilt, else of all views."""
    asked = options.views or options.grid or options.width
    if options.preset and asked:
        raise LfsrError(f"preset {options.preset!r} decides views, grid and width of a quilt: leave these out")
    if options.preset and options.preset not in PRESETS:
        raise LfsrError(f"preset is {options.preset!r}: {did_you_mean(options.preset, PRESETS)}Choose from "
                        f"{', '.join(PRESETS)}")
    shape = options.shape or field.display.quilt
    preset = PRESETS[options.preset] if options.preset else shape and Preset(shape[:2], shape[2:])
    if preset and not asked:
        grid, tile = preset.grid, preset.tile
    else:
        if options.views and options.views[1] != 1:
            raise LfsrError(f"views are {options.views[0]}x{options.views[1]}, but a quilt has one row of cameras: "
                            "give one number")
        count = options.views[0] if options.views else math.prod(options.grid or (field.count[0],))
        pairs = [(columns, count // columns) for columns in range(1, count + 1) if count % columns == 0]
        # By default the quilt is as nearly square as the tiles' aspect ratio allows.
        grid = options.grid or min(pairs, key=lambda pair: abs(math.log(pair[0] * panel_aspect(field) / pair[1])))
        if math.prod(grid) != count:
            raise LfsrError(f"a grid of {grid[0]}x{grid[1]} tiles does not hold just {count} views: choose one that "
                            "does")
        tile = field.display.lenses if options.width is None else screen_size(field.display, options.width)
    if max(tile[0] * grid[0], tile[1] * grid[1]) > MOST_SIDE:
        raise LfsrError(f"a quilt of {grid[0]}x{grid[1]} tiles of {tile[0]}×{tile[1]} pixels is over {MOST_SIDE} "
                        "pixels a side: give fewer views or a smaller width")
    return grid, tile


def quilt_of_views(field: LightField, grid: Pair, tile: Pair) -> Array:
    """Quilt (H, W, 3) uint8 of the views at eye level.

    For as many tiles as the display has views across: the finished views of the middle row, or of the row above the
    middle. For another number: interpolated views at equal angles of the viewing cone.
    """
    (columns, rows), (across, down) = grid, field.count
    if columns * rows == across:
        views = list(field.views[(down - 1) // 2])
    else:
        cone, distance = math.radians(field.display.viewing_angle_deg), field.display.viewing_distance_mm
        angles = ((np.arange(columns * rows) + 0.5) / (columns * rows) - 0.5) * cone
        views = [field.seen_from(distance * math.tan(angle)) for angle in angles]
    tiles = [resized(view, tile) for view in views]
    lines = [np.concatenate(tiles[row * columns:(row + 1) * columns], axis=1) for row in range(rows)]
    return np.concatenate(lines[::-1], axis=0)


class Layout(NamedTuple):
    """How the two eyes' images, (H, W, 3) uint8, become one."""

    suffix: str  # in the file's name, by which players know the layout
    size: tuple[float, float]  # of each image, as fractions of the width and height of a whole one
    axis: int | None  # along which they are joined; None: as an anaglyph


LAYOUTS = {
    "stereo": Layout("stereo", (1, 1), 1), "half-side-by-side": Layout("hsbs", (0.5, 1), 1),
    "top-bottom": Layout("tab", (1, 1), 0), "half-top-bottom": Layout("htab", (1, 0.5), 0),
    "anaglyph": Layout("anaglyph", (1, 1), None)}


def anaglyph(left: Array, right: Array) -> Array:
    """Image (H, W, 3) uint8 for red-cyan glasses, of two images of that shape."""
    eyes = np.stack([srgb_decode(image.astype(np.float32) / 255) for image in (left, right)])
    return np.asarray(np.rint(srgb_encode(np.clip(np.einsum("eoc,ehwc->hwo", DUBOIS, eyes), 0, 1)) * 255), np.uint8)


def write_stereo(layout: Layout, field: LightField, folder: Path, options: ExportOptions) -> None:
    """Write one image, the left eye's half on the left or on top."""
    between, width = eye_distance(field, options), options.width or usual_width(field.display)
    pair = [on_screen(field.seen_from(x), field.display, width, layout.size) for x in (-between / 2, between / 2)]
    joined = anaglyph(*pair) if layout.axis is None else np.concatenate(pair, layout.axis)
    write_png(folder / f"{field.name}_{layout.suffix}_{between:g}mm.png", joined)


def eye_distance(field: LightField, options: ExportOptions) -> float:
    """Millimetres between the eyes; LfsrError where they do not both see the display's views."""
    between, zone = options.eyes_mm or 63.0, field.display.camera_spacing_mm * field.count[0]
    if between > zone:
        raise LfsrError(f"eyes {between:g} mm apart are outside the viewing zone of display {field.display.name!r}, "
                        f"which is {zone:.0f} mm wide at the viewing distance: choose a smaller distance")
    return between


def write_rgbd(field: LightField, folder: Path, options: ExportOptions) -> None:
    """Write colour left and depth right, near is white, as Looking Glass' programs take them.

    Depth is linear in disparity; a notice tells the depth of the display plane.
    """
    if (rendered := rendered_disparity(field)) is None:
        raise LfsrError(f"{field.folder} has no position layer, from which depth comes: render it at scale "
                        "2 or more, or with the layer position")
    (disparity, camera), infinite = rendered, infinite_disparity(field.frame)
    color = on_screen(field.view_at(*camera), field.display, options.width or usual_width(field.display))
    hit = disparity[disparity > infinite]
    far, near = (float(hit.min()), float(hit.max())) if hit.size else (infinite, 0.0)
    if near - far < LEAST_SPAN:  # all at one depth: emptiness is behind it
        far = min(infinite, near - LEAST_SPAN)
    nearness = np.clip((disparity - far) / (near - far), 0, 1)  # emptiness is as far as the farthest that is hit
    rows, columns = (np.arange(size) * count // size
                     for size, count in zip(color.shape[:2], nearness.shape, strict=True))
    grey = np.rint(nearness[rows][:, columns] * 255).astype(np.uint8)  # not interpolated: no depth between objects
    write_png(folder / f"{field.name}_rgbd.png", np.concatenate([color, np.repeat(grey[..., None], 3, 2)], axis=1))
    options.tell(Notice("display-plane", {"depth": float(np.clip(-far / (near - far), 0, 1))}))


def write_stanford(field: LightField, folder: Path, options: ExportOptions) -> None:
    """Write ``out_ROW_COLUMN_Y_X_.png``, y downwards and x rightwards in millimetres on the display."""
    spacing, count = field.frame.array.spacing * field.mm_per_unit, options.views or field.count
    x, y = ((camera_places(n, wanted) - (n - 1) / 2) * spacing for n, wanted in zip(field.count, count, strict=True))
    for row, column, view in each_view(field, options):
        write_png(folder / f"out_{row:02d}_{column:02d}_{y[row]:.6f}_{x[column]:.6f}_.png", view)


def write_pleno(field: LightField, folder: Path, options: ExportOptions) -> None:
    """Write ``COLUMN_ROW.ppm``, 16 bit with values to 1023, as in the JPEG Pleno test sets."""
    for row, column, view in each_view(field, options):
        values = np.rint(view * np.float32(PLENO_MAX / 255)).astype(">u2")
        header = f"P6\n{view.shape[1]} {view.shape[0]}\n{PLENO_MAX}\n".encode()
        (folder / f"{column:03d}_{row:03d}.ppm").write_bytes(header + values.tobytes())


def write_views(field: LightField, folder: Path, options: ExportOptions) -> None:
    """Write ``view_ROW_COLUMN.png`` of display values, or an EXR of scene-linear half-float parts ``vROW_COLUMN``."""
    if chosen_type(options, "views") == "png":
        for row, column, view in each_view(field, options):
            write_png(folder / f"view_{row:03d}_{column:03d}.png", view)
        return
    path, image = str(folder / EXR_FILE), read_finished_linear(field.folder)
    if image is None:
        raise LfsrError(f"{field.folder} has no {EIA_LINEAR_FILE}, which scene-linear views need: finish the "
                        "frame with a linear EXR, or export PNG")
    linear = np.clip(to_views(image, field.display.lenses), 0, HALF_MAX)
    columns, rows = (sorted({min(max(round(place), 0), n - 1) for place in camera_places(n, wanted)})
                     for n, wanted in zip(field.count, options.views or field.count, strict=True))
    if len(columns) * len(rows) > MOST_PARTS:
        raise LfsrError(f"{len(columns)}x{len(rows)} views are more parts than the {MOST_PARTS} that programs read: "
                        "choose fewer, such as 9 or 9x9")
    parts, specs = [(row, column) for row in rows for column in columns], []
    for row, column in parts:
        specs.append(spec := oiio.ImageSpec(linear.shape[3], linear.shape[2], 3, "half"))
        name = f"v{row:03d}_{column:03d}"
        for key, value in {"oiio:subimagename": name, "view": name, "compression": "zip"}.items():
            spec.attribute(key, value)
    output = oiio.ImageOutput.create(path)
    done = output.open(path, specs)
    for number, (row, column) in enumerate(parts):
        done = done and (not number or output.open(path, specs[number], "AppendSubimage"))
        done = done and output.write_image(np.ascontiguousarray(linear[row, column], np.float32))
    if not (output.close() and done):
        raise LfsrError(f"{EXR_FILE} cannot be written ({output.geterror().strip()}): choose another folder")
    if options.views not in (None, field.count):
        options.tell(Notice("views-nearest"))


def each_view(field: LightField, options: ExportOptions) -> Iterator[tuple[int, int, Array]]:
    """Row, column and (sy, sx, 3) of every view to export; reports progress after each row."""
    views = field.resampled(options.views)
    for row, line in enumerate(views):
        options.tell(Progress("export", row / len(views), f"row {row + 1} of {len(views)}"))
        yield from ((row, column, view) for column, view in enumerate(line))


def write_hci(field: LightField, folder: Path, options: ExportOptions) -> None:
    """Write ``input_Cam%03i.png`` row by row from the top left, the parameters and the disparity."""
    (across, down), (x, y) = options.views or field.count, field.count
    if across * y != down * x and not down == y == 1:
        raise LfsrError(f"views are {across}x{down} of {x}x{y}, but HCI folders have one distance between cameras "
                        "across and down: choose numbers in the same proportion")
    for row, column, view in each_view(field, options):
        write_png(folder / f"input_Cam{row * across + column:03d}.png", view)
    if (disparity := central_disparity(field)) is not None:
        disparity = disparity * np.float32(x / across)  # between the exported views
        # PFM starts with the bottom row; -1 says little-endian.
        header = f"Pf\n{disparity.shape[1]} {disparity.shape[0]}\n-1\n".encode()
        (folder / DISPARITY_FILE).write_bytes(header + disparity[::-1].astype("<f4").tobytes())
    (width, height), array, mm = field.display.lenses, field.frame.array, field.mm_per_unit
    focus, baseline = array.distance * mm, array.spacing * mm * field.count[0] / across
    # The sensor is as wide as the longer side of an image, as the benchmark's programs expect.
    side = 2 * mm * max(array.half_width, array.half_height)
    focal, matrix = focus * SENSOR_MM / side, np.asarray(field.frame.matrix_world, float)
    axes = matrix[:3, :3] / np.linalg.norm(matrix[:3, :3], axis=0)
    place = (*matrix[:3, 3] * mm / 1000,  # of the central camera in the world: metres, and angles (XYZ)
             math.atan2(axes[2, 1], axes[2, 2]), math.asin(float(np.clip(-axes[2, 0], -1, 1))),
             math.atan2(axes[1, 0], axes[0, 0]))
    names = [f"center_cam_{name}" for name in ("x_m", "y_m", "z_m", "rx_rad", "ry_rad", "rz_rad")]
    nearest, farthest = (0.0, 0.0) if disparity is None else (float(disparity.max()), float(disparity.min()))
    sections: dict[str, dict[str, str | float]] = {
        "intrinsics": {"focal_length_mm": focal, "image_resolution_x_px": width, "image_resolution_y_px": height,
                       "sensor_size_mm": SENSOR_MM, "fstop": 100.0, "panel_aspect": panel_aspect(field)},
        "extrinsics": {"num_cams_x": across, "num_cams_y": down, "baseline_mm": baseline,
                       "focus_distance_m": focus / 1000, **dict(zip(names, map(float, place), strict=True)),
                       "offset": baseline * focal / (focus / 1000) / 1000 / SENSOR_MM * max(width, height)},
        "meta": {"scene": field.name, "category": "lfsr", "date": "", "version": "v0", "authors": "", "contact": "",
                 "cycles_seed": field.frame.seed, "disp_min": farthest, "disp_max": nearest,
                 "frustum_disp_min": farthest, "frustum_disp_max": nearest, "depth_map_scale": 1.0}}
    parameters = "\n".join(f"[{title}]\n" + "".join(
        f"{key} = {value:.9g}\n" if isinstance(value, float) else f"{key} = {value}\n"
        for key, value in entries.items()) for title, entries in sections.items())
    (folder / PARAMETERS_FILE).write_text(parameters, encoding="ascii", errors="replace")
    if disparity is None:
        options.tell(Notice("disparity-missing"))


class Motion(NamedTuple):
    """How the eye moves."""

    name: str
    seconds: float  # of one round
    rounds: int  # of a film that does not start again by itself
    # place (x, y) of the eye in millimetres, at a phase of the round in [0, 1)
    place: Callable[[LightField, ExportOptions, float], tuple[float, float]]


def eye_place(field: LightField, phase: float) -> tuple[float, float]:
    """Place (x, y) of the swaying eye in millimetres, at ``phase`` in [0, 1)."""
    spacing, (across, down) = field.display.camera_spacing_mm, field.count
    angle = 2 * math.pi * phase
    return (REACH * across / 2 * spacing * math.sin(angle), RISE * down / 2 * spacing * math.cos(angle))


SWAY = Motion("sway", 4.0, 1, lambda field, _, phase: eye_place(field, phase))
WIGGLE = Motion("wiggle", 0.8, 5, lambda field, options, phase:
                (eye_distance(field, options) / 2 * math.sin(2 * math.pi * phase), 0.0))


def write_motion(motion: Motion, fields: Iterator[LightField], count: int | None, folder: Path,
                 options: ExportOptions) -> None:
    """Write the film of ``count`` frames, while the eye moves one or more whole rounds; of one frame for count None."""
    first, chosen = next(fields), chosen_type(options, motion.name)
    rate = kept_rate(options.fps or (RATES[chosen] if count is None else ANIMATION_RATE), chosen)
    if count is None:
        rounds = 1 if chosen in LOOPING else motion.rounds
        total = max(2, round((options.seconds or motion.seconds) * rate)) * rounds
        fields = itertools.repeat(first, total)
    else:
        total = count
        rounds = max(1, round(count / rate / (options.seconds or motion.seconds)))
        fields = itertools.chain([first], fields)

    def frames() -> Iterator[Array]:
        for number, field in enumerate(fields):
            options.tell(Progress("export", number / total, f"frame {number + 1} of {total}"))
            view = field.seen_from(*motion.place(field, options, rounds * number / total % 1))
            yield on_screen(view, field.display, options.width or usual_width(field.display))

    write_film(folder / f"{first.name}_{motion.name}.{chosen}", frames(), rate)


def write_quilt_film(fields: Iterator[LightField], count: int | None, folder: Path, options: ExportOptions) -> None:
    """Write a film of ``count`` quilts, None for one; the sides are even, because encoders need that."""
    first = next(fields)
    grid, (width, height) = quilt_layout(first, options)
    tile = width - width * grid[0] % 2, height - height * grid[1] % 2
    name = f"{quilt_name(first.name, grid, panel_aspect(first))}.{chosen_type(options, QUILT_FILM)}"

    def quilts() -> Iterator[Array]:
        for number, field in enumerate(itertools.chain([first], fields)):
            options.tell(Progress("export", number / (count or 1), f"frame {number + 1} of {count or 1}"))
            yield quilt_of_views(field, grid, tile)

    write_film(folder / name, quilts(), options.fps or ANIMATION_RATE)


def kept_rate(rate: float, kind: str) -> float:
    """Return the rate nearest to ``rate`` that a film has: GIF counts in 1/100 s, at least 2, and WebP in 1/1000 s."""
    ticks = {"gif": 100, "webp": 1000}.get(kind)
    return ticks / max(2, round(ticks / rate)) if ticks else rate


def write_film(path: Path, frames: Iterator[Array], rate: float) -> None:
    """Write frames (H, W, 3) uint8 of one size, with even sides, by the ending of ``path``.

    PNG becomes numbered images, ``stem_0001.png``. LfsrError where the encoder is missing.
    """
    if path.suffix == ".png":
        for number, frame in enumerate(frames, start=1):
            write_png(path.with_name(f"{path.stem}_{number:04d}.png"), frame)
        return
    if path.suffix != ".mp4":
        try:
            from PIL import Image
        except ImportError:
            raise LfsrError(f"{path.suffix[1:].upper()} needs the package pillow, which this Python lacks: pip install "
                            "'lfsr[video]', or choose another type") from None
        picture, *others = plain = [Image.fromarray(frame) for frame in frames]
        options: dict[str, Any] = {"quality": QUALITY, "method": 4}
        if path.suffix == ".gif":  # one palette, of samples of all, so that colours do not flicker, and no bands
            palette = Image.fromarray(np.concatenate([np.asarray(image)[::4, ::4] for image in plain])).quantize()
            picture, *others = [image.quantize(palette=palette) for image in plain]
            options = {"optimize": True}
        duration = round(1000 / kept_rate(rate, path.suffix[1:]))
        picture.save(path, save_all=True, append_images=others, loop=0, duration=duration, **options)
        return
    try:
        import av
    except ImportError:
        raise LfsrError("MP4 needs the package av, which this Python lacks: pip install 'lfsr[video]', or choose "
                        "type png and encode the frames elsewhere") from None
    first, speed = next(frames), Fraction(rate).limit_denominator(1001)
    encoder = "libx264" if max(first.shape[:2]) <= H264_SIDE else "libx265"
    with av.open(str(path), "w", options={"movflags": "faststart"}) as film:
        try:
            stream: Any = film.add_stream(encoder, rate=speed, options=ENCODERS[encoder])
        except ValueError:
            raise LfsrError(f"films of {first.shape[1]}×{first.shape[0]} pixels need {encoder}, which this Python's "
                            "package av lacks: choose type png and encode the frames elsewhere") from None
        stream.height, stream.width = first.shape[:2]
        stream.pix_fmt = "yuv420p"
        # The file says BT.709 of limited range, which players otherwise guess from the size.
        codec = stream.codec_context
        codec.color_primaries = codec.color_trc = codec.colorspace = codec.color_range = 1
        if encoder == "libx265":
            codec.codec_tag = "hvc1"  # without which Apple's programs do not play HEVC
        pictures = (av.VideoFrame.from_ndarray(pixels, format="rgb24").reformat(
            format="yuv420p", dst_colorspace="ITU709", dst_color_range="MPEG")
            for pixels in itertools.chain([first], frames))
        for packet in itertools.chain.from_iterable(map(stream.encode, itertools.chain(pictures, [None]))):
            if not 0 <= packet.pts - packet.dts <= MOST_DELAY:
                packet.dts = packet.pts
            film.mux(packet)


def central_disparity(field: LightField) -> Array | None:
    """Disparity (sy, sx) float32 at the centre of the cameras; None where the frame has no position layer.

    In pixels (lenses) per finished view, positive in front of the display plane: a camera one step to the right sees
    a point that many pixels further left, one step up that many further down. Empty pixels have that of infinity.
    """
    if (rendered := rendered_disparity(field)) is None:
        return None
    (seen, camera), array, (sx, sy) = rendered, field.frame.array, field.display.lenses
    right, down = (place - (count - 1) / 2 for place, count in zip(camera, field.count, strict=True))
    down = down * array.half_width / sx / (array.half_height / sy)  # in lenses across, which may not be square
    # One step of a fixed-point iteration, enough for the fractions of a pixel between the centre and the nearest view.
    rows, columns = np.indices(seen.shape)
    column = np.clip(np.rint(columns - right * seen), 0, seen.shape[1] - 1).astype(int)
    return np.asarray(seen[np.clip(np.rint(rows - down * seen), 0, seen.shape[0] - 1).astype(int), column])


def rendered_disparity(field: LightField) -> tuple[Array, tuple[float, float]] | None:
    """Disparity (sy, sx), as of ``central_disparity``, of the rendered view nearest to the centre; its camera's place.

    The place counts finished views (column, row). None where the frame has no position layer.
    """
    path = field.folder / LOW_RES_FILE
    if "position" not in field.frame.layers or not path.is_file() or field.frame.lens_list is not None:
        return None
    layers, _ = read_finite(path)
    if "position" not in layers:
        return None
    low = low_resolution(layers, field.frame)
    row, column = low.color.shape[2] // 2, low.color.shape[3] // 2
    steps = (field.count[0] / low.color.shape[3], field.count[1] / low.color.shape[2])  # in finished views
    assert low.position is not None, "the layers have it"
    hit = low.alpha[:, :, row, column, 0] > 0
    to_array = np.linalg.inv(np.asarray(field.frame.matrix_world, float))
    distance = low.position[:, :, row, column] @ to_array[2, :3] + to_array[2, 3]  # from the camera plane
    depth, array = np.where(hit, distance, np.inf), field.frame.array
    nearness = array.distance / np.maximum(depth, 1e-6 * array.distance)
    return (np.asarray((1 - nearness) * infinite_disparity(field.frame), np.float32),
            ((column + 0.5) * steps[0] - 0.5, (row + 0.5) * steps[1] - 0.5))


def infinite_disparity(frame: Frame) -> float:
    """Disparity at infinity, in pixels (lenses) per finished view."""
    return float(np.float32(-frame.array.spacing / (2 * frame.array.half_width / frame.display.lenses[0])))
