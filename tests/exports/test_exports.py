"""Every export read back by a program that is not ours, or by the rules of its readers."""

import configparser
import dataclasses
import math
import re
import shutil
import subprocess

import av
import cv2
import numpy as np
import OpenEXR
import pytest
from PIL import Image, ImageSequence

from lfsr_core.base.messages import Notice
from lfsr_core.cli import main
from lfsr_core.exports import images
from lfsr_core.exports.formats import WRITERS, export
from lfsr_core.exports.images import anaglyph, central_disparity
from lfsr_core.exports.light_field import on_screen, read_light_field, resized
from lfsr_core.exports.options import FORMATS, PRESETS, ExportOptions, quilt_name, read_quilt_name
from lfsr_core.frames.folder import frame_folders
from lfsr_core.frames.frame import read_frame, write_frame
from lfsr_core.images.image_files import read_layers, write_layers, write_png
from lfsr_core.optics.display import builtin_names, load_display
from lfsr_core.optics.rays import flip_order, to_views
from tests.exports.conftest import NAMES
from tests.support.finished import DIRECT, MINI, TALL, finished, picture
from tests.support.synthetic import fails
from tests.support.told import Told, refuses


def column_of_square(view) -> float:
    """Mean column of the near square, the only blue."""
    return float(np.nonzero(view[..., 2] > 160)[1].mean())


# Quilts: what a player does with the name and the image.

def test_quilts_as_a_player_reads_them_of_any_number_of_views_across_the_cone(folder, field, tmp_path):
    (path,) = export(folder, "quilt", tmp_path)
    columns, rows, aspect = re.fullmatch(r"two_depths_qs(\d+)x(\d+)a([\d.]+)\.png", path.name).groups()
    columns, rows = int(columns), int(rows)
    quilt = picture(path)[::-1]  # players count from the bottom
    assert columns * rows == 8 and float(aspect) == pytest.approx(128 / 96, abs=1e-3)
    height, width = quilt.shape[0] // rows, quilt.shape[1] // columns
    tiles = [quilt[view // columns * height:, view % columns * width:][:height, :width][::-1] for view in range(8)]
    np.testing.assert_array_equal(tiles, field.views[3])
    # View 0 is the leftmost camera's, which sees what is near further to the right.
    assert column_of_square(tiles[0]) > column_of_square(tiles[7]) + 1
    (path,) = export(folder, "quilt", tmp_path, ExportOptions(views=(6, 1), grid=(3, 2), width=64))
    quilt = picture(path)
    assert path.name == "two_depths_qs3x2a1.333.png" and quilt.shape == (96, 192, 3)
    angle = math.radians(MINI.viewing_angle_deg) * (0.5 / 6 - 0.5)
    leftmost = field.seen_from(MINI.viewing_distance_mm * math.tan(angle))
    np.testing.assert_array_equal(quilt[48:, :64], on_screen(leftmost, MINI, 64))


def test_quilts_that_other_programs_know(field, tmp_path):
    """Built-in lenticular displays have the sizes in pylightio's table, which it finds by size or exchanged numbers."""
    sizes = {"portrait": (8, 6, 3360, 3360), "go": (11, 6, 4092, 4092), "8.9": (5, 9, 4095, 4095),
             "15.6": (5, 9, 4095, 4095), "16": (5, 9, 4095, 4095), "16-gen3": (7, 7, 5999, 5999),
             "32": (5, 9, 8190, 8190), "65": (8, 9, 8192, 8190)}
    for name in filter(lambda name: name.startswith("looking-glass"), builtin_names()):
        columns, rows, width, height = load_display(name).quilt
        assert sizes.pop(name.removeprefix("looking-glass-")) == (columns, rows, columns * width, rows * height)
        assert ((columns, rows), (width, height)) in [preset[:2] for preset in PRESETS.values()]
    assert not sizes
    (path,) = export(field.folder, "quilt", tmp_path, ExportOptions(preset="portrait"))
    quilt = picture(path)
    assert path.name == "two_depths_qs8x6a1.333.png" and quilt.shape == (3360, 3360, 3)
    middle = field.seen_from(MINI.viewing_distance_mm * math.tan(math.radians(20) / 48))  # tile 24
    np.testing.assert_array_equal(quilt[3360 - 4 * 560:][:560, :420], resized(middle, (420, 560)))


@pytest.mark.parametrize(("name", "expected"), [
    ("a_qs8x6a0.75", ((8, 6), 0.75)), ("x_qs5x9a1.6_0001", ((5, 9), 1.6)), ("b_QS11x6", ((11, 6), None)),
    ("c_qs8x6a", ((8, 6), None)), ("plain", None), (f"g_qs5x9a{16 / 9}_0", ((5, 9), 16 / 9)),
    ("d_qs8x6x2", None), ("e_qs99999x1a1", None), ("f_qs8x6a0", ((8, 6), None))])
def test_what_a_quilts_name_says(name, expected):
    assert read_quilt_name(name) == expected
    if expected and expected[1] and "_0" not in name:
        assert quilt_name(name.split("_")[0], *expected).lower() == name


@pytest.mark.parametrize(("side", "codec"), [(None, "h264"), (400, "hevc")])
def test_film_of_quilts(folder, tmp_path, monkeypatch, side, codec):
    if side:
        monkeypatch.setattr(images, "H264_SIDE", side)  # as for quilts of 8192 pixels
    options = ExportOptions(grid=(4, 2), width=112, fps=10)
    (path,) = export(folder, "quilt-film", tmp_path, options)
    assert path.name == "two_depths_qs4x2a1.333.mp4"
    with av.open(str(path)) as film:
        stream = film.streams.video[0]
        assert (stream.codec.name, stream.pix_fmt, stream.average_rate) == (codec, "yuv420p", 10)
        (image,) = [frame.to_ndarray(format="rgb24") for frame in film.decode(video=0)]
    (still,) = export(folder, "quilt", tmp_path, dataclasses.replace(options, fps=None))
    off = image.astype(float) - picture(still)
    assert np.abs(off).mean() < 6 and np.abs(off.mean((0, 1))).max() < 2
    if not side:  # a film has even sides
        (path,) = export(folder, "quilt-film", tmp_path, ExportOptions(preset="8.9", type="png"))
        assert path.name == "two_depths_qs5x9a1.333_0001.png" and picture(path).shape == (9 * 454, 5 * 818, 3)


# Folders of views.

def test_folders_of_views_have_the_names_places_and_bits_of_their_readers(folder, field, tmp_path):
    files = export(folder, "stanford", tmp_path)
    parts = [re.fullmatch(r"out_(\d\d)_(\d\d)_(-?[\d.]+)_(-?[\d.]+)_\.png", path.name) for path in files]
    assert len(files) == 64 and all(parts)
    spacing = MINI.camera_spacing_mm
    for part in parts[::9]:
        row, column, y, x = (float(text) for text in part.groups())
        assert (y, x) == pytest.approx(((row - 3.5) * spacing, (column - 3.5) * spacing), abs=1e-5)
    np.testing.assert_array_equal(picture(files[2 * 8 + 5]), field.views[2, 5])
    files = export(folder, "pleno", tmp_path)
    assert len(files) == 64 and files[-1].name == "007_007.ppm"
    path = tmp_path / "005_002.ppm"
    assert path.read_bytes().startswith(b"P6\n16 12\n1023\n")
    np.testing.assert_array_equal(picture(path), field.views[2, 5])  # pillow scales by the header's maximum
    raw = np.frombuffer(path.read_bytes()[-16 * 12 * 6:], ">u2").reshape(12, 16, 3)
    assert np.abs(raw / 1023 - field.views[2, 5] / 255).max() <= 0.5 / 1023 + 1e-9


def test_views_as_png_and_fewer_of_them(folder, field, tmp_path):
    files = export(folder, "views", tmp_path)
    assert len(files) == 64
    np.testing.assert_array_equal(picture(tmp_path / "view_002_005.png"), field.views[2, 5])
    files = export(folder, "views", tmp_path, ExportOptions(views=(4, 2)))
    assert sorted(path.name for path in tmp_path.iterdir()) == [path.name for path in files]
    assert len(files) == 8, "the earlier export's files are gone"
    middle = np.mean([field.views[row, 2:4] for row in (1, 2)], axis=(0, 1))
    assert np.abs(picture(tmp_path / "view_000_001.png") - middle).max() <= 0.5


def test_views_as_parts_of_an_exr(folder, tmp_path):
    (path,) = export(folder, "views", tmp_path, ExportOptions(type="exr"))
    linear = to_views(flip_order(read_layers(folder / "eia.exr")["color"][..., :3], MINI.lenses), MINI.lenses)
    with OpenEXR.File(str(path), separate_channels=True) as file:
        assert len(file.parts) == 64
        names = [part.header["name"] for part in file.parts]
        assert len(set(names)) == 64 and all(re.fullmatch(r"\w+", name) for name in names)
        assert [part.header["view"] for part in file.parts] == names
        part = file.parts[names.index("v002_005")]
        pixels = np.stack([part.channels[name].pixels for name in "RGB"], axis=-1)
        assert pixels.dtype == np.float16
        np.testing.assert_allclose(pixels.astype(np.float32), linear[2, 5], rtol=1e-3)


# Images and films.


@pytest.mark.parametrize(("name", "suffix", "shape"), [
    ("stereo", "stereo", (120, 320)), ("half-side-by-side", "hsbs", (120, 160)), ("top-bottom", "tab", (240, 160)),
    ("half-top-bottom", "htab", (120, 160))])
def test_stereo_pairs(folder, field, tmp_path, name, suffix, shape):
    (path,) = export(folder, name, tmp_path, ExportOptions(eyes_mm=40, width=160))
    pair = picture(path)
    assert path.name == f"two_depths_{suffix}_40mm.png" and pair.shape == (*shape, 3)
    left, right = np.split(pair, 2, axis="s" in suffix)
    for image, x in ((left, -20), (right, 20)):
        np.testing.assert_array_equal(image, resized(field.seen_from(x), image.shape[1::-1]))
    # What is near lies further to the right for the left eye.
    assert column_of_square(left) > column_of_square(right) + 2 * left.shape[1] / 160


def test_anaglyph(folder, field, tmp_path):
    (path,) = export(folder, "anaglyph", tmp_path, ExportOptions(eyes_mm=40, width=160))
    assert path.name == "two_depths_anaglyph_40mm.png" and picture(path).shape == (120, 160, 3)
    np.testing.assert_array_equal(
        picture(path), anaglyph(*(on_screen(field.seen_from(x), MINI, 160) for x in (-20, 20))))
    grey = np.full((2, 2, 3), 128, np.uint8)
    assert np.abs(anaglyph(grey, grey).astype(int) - 128).max() <= 4, "the same for both eyes keeps its grey"
    black, bright = np.zeros((2, 2, 3), np.uint8), np.full((2, 2, 3), 255, np.uint8)
    assert (anaglyph(bright, black) == [255, 0, 0]).all() and (anaglyph(black, bright) == [0, 255, 255]).all()


def test_depth_beside_colour(folder, field, tmp_path):
    told = Told()
    (path,) = export(folder, "rgbd", tmp_path, ExportOptions(width=160, tell=told))
    both = picture(path).astype(int)
    assert path.name == "two_depths_rgbd.png" and both.shape == (120, 320, 3)
    np.testing.assert_array_equal(both[:, :160], on_screen(field.view_at(4.5, 4.5), MINI, 160))
    depth = both[..., 0][:, 160:]
    blue = both[:, :160, 2]  # of the near square alone; its border is between two cameras
    assert set(np.unique(depth)) == {0, 255}
    assert (depth[blue > 220] == 255).mean() > 0.99 and (depth[blue < 100] == 0).mean() > 0.99
    # Disparity is linear in 1 / depth: with things at .8 and 1.25 of its distance the display's plane is in between.
    depth = pytest.approx((1 - 1 / 1.25) / (1 / 0.8 - 1 / 1.25), abs=1e-5)
    assert Notice("display-plane", {"depth": depth}) in told.notices


def test_depth_where_nothing_was_hit_of_one_row_of_views_and_without_the_position_layer(tmp_path):
    folder = finished(tmp_path / "frame")
    layers = read_layers(folder / "lr_eia.exr")
    layers["color"][layers["color"][..., 2] < 0.5] = 0
    write_layers(folder / "lr_eia.exr", layers)
    (path,) = export(folder, "rgbd", tmp_path, ExportOptions(width=160))
    assert set(np.unique(picture(path)[:, 160:])) == {0, 255}
    folder = finished(tmp_path / "without", layers=())
    refuses("position layer.*--layers|layer position", export, folder, "rgbd", tmp_path / "out")
    row = dataclasses.replace(MINI, name="row", views=(8, 1), lenses=(64, 48), panel_pixels=(512, 48))
    field = read_light_field(finished(tmp_path / "row", row, scale=4))
    near = field.view_at(3.5, 0)[..., 2] > 160  # the near square is the only blue
    wrong = ((central_disparity(field) > 0) != near).any(axis=1)
    assert set(np.nonzero(wrong)[0]) <= set(np.nonzero(near.any(axis=1))[0]), "above and below nothing is near"
    assert (central_disparity(field)[:, 28] > 0).tolist() == near[:, 28].tolist()


def test_enlarged_images_are_as_opencv_makes_them_and_views_between_cameras_mixed(field, tmp_path):
    view = field.views[3, 3]
    theirs = cv2.resize(view, (320, 240), interpolation=cv2.INTER_CUBIC)
    assert np.abs(on_screen(view, MINI, 320).astype(int) - theirs).max() <= 1
    small = on_screen(np.full((200, 400, 3), 77, np.uint8), MINI, 32)
    assert (small == 77).all() and small.shape == (24, 32, 3)
    np.testing.assert_array_equal(field.view_at(3, 5), field.views[5, 3])
    assert np.abs(field.view_at(3.5, 5) - ((field.views[5, 3].astype(float) + field.views[5, 4]) / 2)).max() <= 0.5
    np.testing.assert_array_equal(field.view_at(-4, 99), field.views[7, 0])
    half = 3.5 * MINI.camera_spacing_mm
    np.testing.assert_array_equal(field.seen_from(half, half), field.views[0, 7])
    np.testing.assert_array_equal(read_light_field(finished(tmp_path, DIRECT)).views, field.views)


def test_film(folder, field, tmp_path):
    (path,) = export(folder, "sway", tmp_path, ExportOptions(seconds=0.4))
    with av.open(str(path)) as film:
        stream = film.streams.video[0]
        assert (stream.codec.name, stream.pix_fmt, stream.average_rate) == ("h264", "yuv420p", 30)
        frames = [frame.to_ndarray(format="rgb24") for frame in film.decode(video=0)]
    reader = cv2.VideoCapture(str(path))
    assert reader.get(cv2.CAP_PROP_FRAME_COUNT) == 12 == len(frames) and reader.read()[1].shape == (240, 320, 3)
    right = on_screen(field.seen_from(0.85 * 4 * MINI.camera_spacing_mm), MINI, 320)
    assert np.abs(frames[3].astype(float) - right).mean() < 4
    assert column_of_square(frames[9]) > column_of_square(frames[3]) + 10, "the eye goes right first"
    if shutil.which("ffprobe"):
        said = subprocess.run(["ffprobe", "-v", "error", "-show_streams", path], capture_output=True, text=True,
                              check=True).stdout.splitlines()
        assert {"codec_name=h264", "pix_fmt=yuv420p", "color_space=bt709", "color_range=tv", "r_frame_rate=30/1",
                "nb_frames=12"} <= {*said}


@pytest.mark.parametrize(("kind", "count"), [("gif", 16), ("webp", 16), ("png", 120)])
def test_wiggle(folder, field, tmp_path, kind, count):
    files = export(folder, "wiggle", tmp_path, ExportOptions(type=kind, width=64, eyes_mm=40))
    if kind == "png":
        frames = [picture(path) for path in files]
    else:
        assert files[0].name == f"two_depths_wiggle.{kind}"
        animation = Image.open(files[0])
        assert (animation.format, animation.info["loop"]) == (kind.upper(), 0)
        frames = [np.asarray(frame.convert("RGB")) for frame in ImageSequence.Iterator(animation)]
        assert animation.info.get("duration", 50) == 50
        images.write_film(fade := tmp_path / f"fade.{kind}", iter([frames[0] * 0, frames[0]]), 60)
        last = ImageSequence.all_frames(Image.open(fade))[-1]
        (fast,) = export(folder, "sway", tmp_path, ExportOptions(type=kind, width=64, seconds=0.5, fps=240))
        assert sum(frame.load() and frame.info["duration"] for frame in ImageSequence.Iterator(Image.open(fast))) == 500
        assert last.info.get("duration", 20) in (17, 20) and np.ptp(np.asarray(last.convert("RGB"))) > 99
    assert len(frames) == count
    quarter = count // 4 if kind != "png" else 6  # of 24 frames, five times
    for number, x in ((quarter, 20), (3 * quarter, -20)):
        assert np.abs(frames[number].astype(float) - on_screen(field.seen_from(x), MINI, 64)).mean() < 12


# What is refused, and what is left behind then.

@pytest.mark.parametrize(("name", "options", "named"), [("quitl", {}, "'quilt'"),
    ("quilt", {"eyes_mm": 60}, "eyes_mm.*views, grid, width, preset"), ("quilt", {"views": (6, 2)}, "one row"),
    ("quilt", {"views": (6, 1), "grid": (4, 2)}, "4x2.*6 views"), ("quilt", {"grid": (500, 1), "width": 64}, "16384"),
    ("quilt", {"preset": "portait"}, "'portrait'"), ("quilt", {"preset": "go", "views": (6, 1)}, "'go' decides views"),
    ("quilt-film", {"type": "gif"}, "mp4 or png"), ("anaglyph", {"eyes_mm": 500}, "viewing zone"),
    ("wiggle", {"eyes_mm": 500}, "viewing zone"), ("stereo", {"eyes_mm": 500}, "viewing zone"),
    ("rgbd", {"width": 3}, "width is 3"), ("stereo", {"width": 100000}, "width is 100000"),
    ("views", {"type": "mp4"}, "png or exr"), ("sway", {"type": "avi"}, "mp4 or gif or webp or png")])
def test_refused(folder, tmp_path, name, options, named):
    refuses(named, export, folder, name, tmp_path / "out", ExportOptions(**options))
    assert list(tmp_path.iterdir()) == []


def test_what_the_folder_or_the_computer_lacks_is_named(folder, tmp_path, monkeypatch):
    for kind, package in (("mp4", "av"), ("gif", "PIL")):
        monkeypatch.setitem(__import__("sys").modules, package, None)
        refuses("pip install", export, folder, "sway", tmp_path / "out", ExportOptions(type=kind, seconds=0.1))
    assert list(tmp_path.iterdir()) == [] and set(FORMATS) == set(WRITERS)
    for options in [{"views": (0, 1)}, {"views": 8}, {"eyes_mm": -1.0}, {"eyes_mm": math.nan}, {"seconds": 1e9},
                    {"width": 0}, {"fps": 1e-4}]:
        refuses("must be", ExportOptions, **options)
    monkeypatch.undo()
    folder = finished(tmp_path / "frame")
    (folder / "eia.exr").unlink()
    refuses("has no eia.exr", export, folder, "views", options=ExportOptions(type="exr"))
    write_png(folder / "eia.png", np.zeros((96, 64, 3), np.uint8))
    refuses("has 64×96 pixels", export, folder, "quilt")
    (folder / "eia.png").unlink()
    refuses("does not exist", export, folder, "quilt")
    assert not (folder / "export").exists()
    (folder / "export").write_text("a file")
    refuses("choose another folder", export, finished(folder), "quilt")


def pfm(path) -> np.ndarray:
    """As the evaluation toolkit's read_pfm does."""
    with path.open("rb") as file:
        assert file.readline() == b"Pf\n"
        width, height = map(int, file.readline().split())
        scale = float(file.readline())
        return np.flipud(np.fromfile(file, "<f4" if scale < 0 else ">f4").reshape(height, width)) * abs(scale)


@pytest.fixture(scope="module")
def hci(folder, tmp_path_factory):
    target = tmp_path_factory.mktemp("hci")
    export(folder, "hci", target, ExportOptions(views=(7, 7)))
    parameters = configparser.ConfigParser()
    parameters.read(target / "parameters.cfg")
    views = [picture(target / f"input_Cam{number:03d}.png") for number in range(49)]
    return np.array(views).reshape(7, 7, 12, 16, 3), parameters, pfm(target / "gt_disp_lowres.pfm")


def test_hci_has_its_views_and_parameters_and_disparity_the_depth_that_is_there(hci, field):
    views, parameters, disparity = hci
    np.testing.assert_array_equal(views, field.resampled((7, 7)))
    inside, outside = parameters["intrinsics"], parameters["extrinsics"]
    assert (inside["image_resolution_x_px"], inside["image_resolution_y_px"]) == ("16", "12")
    assert (outside["num_cams_x"], outside["num_cams_y"]) == ("7", "7")
    focal, sensor, baseline, focus = (float(section[name]) for section, name in (
        (inside, "focal_length_mm"), (inside, "sensor_size_mm"), (outside, "baseline_mm"),
        (outside, "focus_distance_m")))
    assert (baseline, focus * 1000, focus * 1000 * sensor / focal) == pytest.approx(
        (MINI.camera_spacing_mm * 8 / 7, MINI.viewing_distance_mm, MINI.panel_mm[0]))
    assert float(outside["offset"]) == pytest.approx(baseline * focal / focus / 1000 / sensor * 16)
    assert float(outside["center_cam_ry_rad"]) == pytest.approx(math.asin(0.6))
    # By the toolkit's conversion: depth = b·f·res·focus / (disparity·focus·sensor + b·f·res).
    value = {name: float(text) for section in ("intrinsics", "extrinsics", "meta")
             for name, text in parameters[section].items() if re.fullmatch(r"-?[\d.e-]+", text)}
    b, focus = value["baseline_mm"] * value["focal_length_mm"] * 16, value["focus_distance_m"] * 1000
    depth = b * focus / (disparity * focus * value["sensor_size_mm"] + b) / MINI.viewing_distance_mm
    assert depth[4, 6] == pytest.approx(0.8, abs=1e-3) and depth[10, 14] == pytest.approx(1.25, abs=1e-3)
    assert disparity[4, 6] > 0 > disparity[10, 14], "positive in front of the display"
    assert [value["disp_max"], value["disp_min"]] == pytest.approx([disparity.max(), disparity.min()], rel=1e-6)


@pytest.fixture(scope="module")
def fine_hci(tmp_path_factory):
    """Views of 64×48 pixels, in which textures are many pixels wide, and their disparity."""
    target = tmp_path_factory.mktemp("fine")
    fine = dataclasses.replace(MINI, name="fine", lenses=(64, 48), panel_pixels=(512, 384))
    export(finished(target / "frame", fine), "hci", target / "hci", ExportOptions(views=(7, 7)))
    views = [picture(target / "hci" / f"input_Cam{number:03d}.png") for number in range(49)]
    return np.array(views).reshape(7, 7, 48, 64, 3), pfm(target / "hci" / "gt_disp_lowres.pfm")


@pytest.mark.parametrize(("row", "column"), [(3, 5), (3, 1), (5, 3), (1, 3), (2, 2)])
def test_hci_disparity_warps_views_onto_each_other(fine_hci, row, column):
    """A camera ``n`` steps to the right sees a point ``n`` disparities further left; likewise down and up."""
    views, disparity = fine_hci
    rows, columns = np.indices(disparity.shape, np.float32)
    inside = np.s_[6:-6, 6:-6]

    def error(sign):
        warped = cv2.remap(views[row, column], (columns - sign * (column - 3) * disparity).astype(np.float32),
                           (rows - sign * (row - 3) * disparity).astype(np.float32), cv2.INTER_LINEAR)
        return np.abs(warped[inside].astype(float) - views[3, 3][inside]).mean()

    assert error(1) < 0.6 * error(0) < 0.6 * error(-1)


def test_hci_without_a_position_layer_says_so_and_lenses_may_not_be_square(tmp_path):
    folder = finished(tmp_path / "frame")
    write_frame(folder, dataclasses.replace(read_frame(folder), layers=()))
    told = Told()
    files = export(folder, "hci", tmp_path / "out", ExportOptions(views=(2, 2), tell=told))
    assert [path.name for path in files] == [f"input_Cam00{i}.png" for i in range(4)] + ["parameters.cfg"]
    assert Notice("disparity-missing") in told.notices
    tall = finished(tmp_path / "tall", TALL)
    refuses("same proportion", export, tall, "hci", options=ExportOptions(views=(4, 4)))
    files = export(tall, "hci", options=ExportOptions(views=(2, 3)))
    disparity = pfm(tall / "export" / "hci" / "gt_disp_lowres.pfm")
    assert len(files) == 8 and disparity.shape == (12, 16)
    spacing, pitch = TALL.camera_spacing_mm * 4, TALL.lens_pitch_mm[0]
    assert disparity[4, 6] == pytest.approx((1 / 0.8 - 1) * spacing / pitch, rel=1e-3)


# Animations: every frame on its own or in one film, in the order of the frames.


@pytest.mark.parametrize("name", sorted(set(FORMATS) - {"sway", "wiggle", "quilt-film"}))
def test_each_frame_is_what_its_own_export_is(film, tmp_path, name):
    files = export(film, name, tmp_path / "all")
    expected = [path for frame in NAMES for path in export(film / frame, name, tmp_path / frame)]
    assert [path.read_bytes() for path in files] == [path.read_bytes() for path in expected]
    assert len(set(files)) == len(files)
    if len(files) == len(NAMES):
        assert [re.search(r"two_depths_(\d+)_", path.name)[1] for path in files] == list(NAMES)
    else:
        assert list(dict.fromkeys(path.parent.name for path in files)) == list(NAMES)


@pytest.mark.parametrize("kind", ["mp4", "png"])
def test_the_film_plays_the_animation_while_the_eye_sways(film, tmp_path, kind):
    files = export(film, "sway", tmp_path, ExportOptions(type=kind, width=320, fps=12))
    if kind == "png":
        frames = [np.asarray(Image.open(path)) for path in files]
    else:
        with av.open(str(files[0])) as video:
            assert video.streams.video[0].average_rate == 12
            frames = [frame.to_ndarray(format="rgb24") for frame in video.decode(video=0)]
    for number, name in enumerate(NAMES):
        field = read_light_field(film / name)
        expected = on_screen(field.seen_from(*images.eye_place(field, number / 3)), field.display, 320)
        assert np.abs(frames[number].astype(float) - expected).mean() < (4 if kind == "mp4" else 1e-9)
    assert len(frames) == 3


def test_commands_export_and_show_every_frame(film, tmp_path, capsys):
    assert main(["export", str(film), "--format", "quilt", "-o", str(tmp_path / "quilts")]) == 0
    assert capsys.readouterr().out == f"{tmp_path / 'quilts'}: 3 files\n"
    assert main(["export", str(film), "--format", "hci", "--views", "3", "-o", str(tmp_path / "hci")]) == 0
    assert sorted(path.name for path in (tmp_path / "hci").iterdir()) == sorted(NAMES)
    row = finished(tmp_path / "row", dataclasses.replace(MINI, views=(8, 1), panel_pixels=(128, 12)))
    assert main(["export", str(row), "--format", "hci", "--views", "5"]) == 0 and len([*row.rglob("*Cam*.png")]) == 5
    second = finished(tmp_path / "second", frame=7)
    assert main(["view", str(film), str(second), "-o", str(tmp_path / "view.html"), "--quality", "80"]) == 0
    assert '"labels": ["2", "10", "10000", "7"]' in (tmp_path / "view.html").read_text()
    assert [folder.name for folder in frame_folders(film)] == list(NAMES)


def test_what_cannot_be_is_said_and_leaves_nothing(film, tmp_path, capsys):
    (tmp_path / "empty").mkdir()
    assert "holds none with an eia.png" in fails(["export", str(tmp_path / "empty"), "--format", "sway"], capsys)
    refuses("does not exist", export, tmp_path / "typo", "views")
    assert not (tmp_path / "typo").exists()
    assert "has no option 'fps'" in fails(["export", str(film), "--format", "quilt", "--fps", "9"], capsys)
    assert "quality is 0" in fails(["view", str(film), "--quality", "0"], capsys)
    mixed = shutil.copytree(film / "0002", tmp_path / "mixed" / "0001").parent
    finished(mixed / "0002", DIRECT)
    refuses("0002 is for display 'direct' and .*0001 for 'mini'", export, mixed, "sway")
    finished(mixed / "0003")
    shutil.rmtree(mixed / "0002")
    (mixed / "0003" / "eia.png").write_bytes(b"x")
    refuses("eia.png", export, mixed, "sway")
    assert not (mixed / "export").exists()
