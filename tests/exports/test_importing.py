"""Folders of views of others: what goes in comes out of the second stage, and what is wrong is one sentence."""

import dataclasses
import os
import re
import shutil

import av
import numpy as np
import pytest
from PIL import Image

from lfsr_core.base.messages import LfsrError, Notice, Progress
from lfsr_core.cli import main
from lfsr_core.exports import importing as quilts
from lfsr_core.exports.formats import export
from lfsr_core.exports.importing import ImportGeometry, Quilt, import_views, quilt_of
from lfsr_core.exports.light_field import read_light_field
from lfsr_core.exports.options import ExportOptions
from lfsr_core.frames.frame import read_frame
from lfsr_core.images.image_files import read_layers, read_png, write_png
from lfsr_core.optics.display import load_display, write_profile
from lfsr_core.optics.rays import CameraArray
from lfsr_core.reconstruct.second_stage import finish_frame
from tests.exports.conftest import NAMES
from tests.support.finished import MINI, finished, picture
from tests.support.panels import lenticular, small
from tests.support.synthetic import fails
from tests.support.told import Told, refuses


@pytest.fixture
def images(tmp_path, field):
    """Folder of 3×3 HCI views without parameters."""
    source = tmp_path / "views"
    source.mkdir()
    for number, view in enumerate(field.resampled((3, 3)).reshape(9, 12, 16, 3)):
        Image.fromarray(view).save(source / f"input_Cam{number:03d}.png")
    return source


@pytest.mark.parametrize("name", ["hci", "stanford", "views", "pleno"])
def test_what_was_exported_comes_back_equal(folder, field, tmp_path, name):
    export(folder, name, tmp_path / "views")
    import_views(tmp_path / "views", tmp_path / "back")
    finish_frame(tmp_path / "back", "none")
    np.testing.assert_array_equal(read_light_field(tmp_path / "back").views, field.views)


@pytest.mark.parametrize("own", [MINI, dataclasses.replace(MINI, lenses=(8, 12), views=(8, 1), panel_pixels=(64, 12))])
def test_hci_tells_its_geometry_and_a_wide_grid_keeps_its_middle(folder, tmp_path, own):
    export(finished(tmp_path / "own", own), "hci", tmp_path / "views")
    told = Told()
    imported = import_views(tmp_path / "views", tmp_path / "back", tell=told)
    display = read_frame(tmp_path / "back").display
    assert told.notices == [] and imported == display
    assert (display.lenses, display.views, display.name) == (own.lenses, own.views, "imported")
    assert (*display.panel_mm, display.camera_spacing_mm, display.viewing_distance_mm) == pytest.approx(
        (*own.panel_mm, own.camera_spacing_mm, own.viewing_distance_mm))
    export(folder, "views", tmp_path / "wide", ExportOptions(views=(8, 4)))
    imported = import_views(tmp_path / "wide", tmp_path / "frame", tell=told)
    assert imported.views == (4, 4) and Notice("cameras-cut", {"side": 4, "across": 8, "down": 4}) in told.notices


def test_the_second_stage_makes_the_views_between(images, field, tmp_path):
    told = Told()
    import_views(images, tmp_path / "frame", 2, ImportGeometry(angle_deg=30.0), told)
    assert told.notices == [Notice("geometry-assumed", {"width_mm": 600.0, "distance_mm": 1000.0})]
    finish_frame(tmp_path / "frame", "bilinear")
    made = read_light_field(tmp_path / "frame")
    assert made.count == (6, 6) and made.display.viewing_angle_deg == 30
    # Low view k covers high views 2k and 2k + 1, a quarter of a step to its sides.
    mixed = 0.75 * field.resampled((3, 3))[1, 1] + 0.25 * field.resampled((3, 3))[1, 2]
    assert np.abs(made.view_at(3, 2.5).astype(float) - mixed).mean() < 6


def test_a_jpeg_with_bytes_that_change_nothing_is_read(images, tmp_path):
    for path in images.glob("*.png"):
        Image.open(path).save(path.with_suffix(".jpg"), progressive=True)
        path.unlink()
    import_views(images, tmp_path / "plain")
    data = (images / "input_Cam004.jpg").read_bytes()
    at = data.rindex(b"\xff\xc4")  # the tables of the last scan
    (images / "input_Cam004.jpg").write_bytes(data[:at] + b"abc" + data[at:])
    import_views(images, tmp_path / "more")
    plain, more = (read_layers(tmp_path / name / "lr_eia.exr")["color"] for name in ("plain", "more"))
    np.testing.assert_array_equal(more, plain)


def test_stanford_cameras_are_ordered_by_place(field, tmp_path):
    """As in the archive's older sets, whose columns run from right to left."""
    source = tmp_path / "views"
    source.mkdir()
    for row, column in np.ndindex(2, 2):
        Image.fromarray(field.views[row * 4, 4 - column * 4]).save(
            source / f"out_{row:02d}_{column:02d}_{row * 10.5:.3f}_{-60.25 * column:.3f}.png")
    import_views(source, tmp_path / "frame")
    finish_frame(tmp_path / "frame", "none")
    np.testing.assert_array_equal(read_light_field(tmp_path / "frame").views, field.views[::4, ::4][:, :2])


def test_a_row_of_cameras_has_views_along_it_alone(images, field, tmp_path):
    for number in range(3, 9):
        (images / f"input_Cam{number:03d}.png").unlink()
    for number in range(3):
        (images / f"input_Cam{number:03d}.png").rename(images / f"row_00_{number:02d}.png")
    imported = import_views(images, tmp_path / "frame", scale=3)
    assert imported.views == (9, 1) and imported.lenses == (16, 12)
    finish_frame(tmp_path / "frame", "bilinear")
    made, given = read_light_field(tmp_path / "frame").views, field.resampled((3, 3))[:1]
    np.testing.assert_array_equal(made[:, 1::3], given)
    between = (2 * given[:, 0].astype(float) + given[:, 1]) / 3
    assert np.abs(made[:, 2] - between).mean() < np.abs(made[:, 3] - between).mean()


@pytest.mark.parametrize("pattern", [
    "view_{row:03d}_{column:03d}.JPG", "View-{row}-{column}.jpeg", "{column}_{row}.PNG", "{column:05d}-{row:02d}.jpg",
    "{column} {row}.Tif", "INPUT_CAM{number}.PNG", "OUT_{row}_{column}_{row}.5_{column}.5_.JPG",
    "t_rex_{row:02d}_{column:02d}.png", "2 SAI-{row} {column}.png", "Take_2024_06_{row:03d}_{column:03d}.png"])
def test_any_digits_separators_and_endings(images, field, tmp_path, pattern):
    source = tmp_path / "others"
    source.mkdir()
    for number in range(9):
        row, column = divmod(number, 3)
        name = pattern.format(row=row, column=column, number=number)
        Image.open(images / f"input_Cam{number:03d}.png").save(source / name, quality=100, subsampling=0)
        (source / f"._{name}").touch()  # as macOS writes on other file systems
    import_views(source, tmp_path / "frame")
    finish_frame(tmp_path / "frame", "none")
    off = np.abs(read_light_field(tmp_path / "frame").views.astype(int) - field.resampled((3, 3)))
    assert off.mean() < (1.5 if "j" in pattern.lower().split(".")[-1] else 1e-9)


@pytest.mark.parametrize("kept", ["view.html", "mask.png", "eia.png"])
def test_files_beside_views_are_kept(images, tmp_path, kept):
    (images / kept).write_text("my own")
    refuses("views holds the views themselves, expected another folder for the frame", import_views, images, images)
    import_views(images, tmp_path / "frame")
    assert (images / kept).read_text() == "my own"


def camera(source, number):
    return source / f"input_Cam{number:03d}.png"


def jpeg_cut_short(source):
    path = source / "input_Cam002.png"
    Image.open(path).save(path.with_suffix(".jpg"))
    path.with_suffix(".jpg").write_bytes(path.with_suffix(".jpg").read_bytes()[:-60])
    path.unlink()


@pytest.mark.parametrize(("spoil", "told"), [
    (lambda source: camera(source, 4).unlink(), "8 views, but the one in row 1, column 1 of 3 rows of 3"),
    (lambda source: Image.new("RGB", (20, 12)).save(camera(source, 5)), "Cam005.png has 20×12.*Cam000.png has 16×12"),
    (lambda source: [path.rename(source / f"camera-{path.name}") for path in [*source.iterdir()]], "input_Cam000.png"),
    (lambda source: camera(source, 2).write_bytes(camera(source, 2).read_bytes()[:60]),
     "input_Cam002.png is (damaged|no readable image)"),
    (jpeg_cut_short, "input_Cam002.jpg is damaged"),
    (lambda source: (camera(source, 0).unlink(), os.mkfifo(camera(source, 0))), "Cam000.png is no readable image"),
    (lambda source: camera(source, 0).write_text("no image"), "input_Cam000.png is no readable image"),
    (lambda source: (source / "parameters.cfg").write_text("[intrinsics]\nfocal_length_mm = long\n"), "parameters of"),
    (lambda source: [camera(source, n).rename(source / f"view_{n:03d}_000.png") for n in range(9)], "1×9 cameras"),
    (lambda source: [camera(source, n).unlink() for n in range(1, 9)], "1×1 cameras"),
    (lambda source: Image.new("RGB", (16, 12)).save(source / "input_Cam4.png"), "input_Cam004.png and input_Cam4.png"),
    (lambda source: camera(source, 0).rename(source / "input_Cam99999999.png"), "more than 65536")])
def test_refused_in_one_sentence(images, tmp_path, spoil, told):
    spoil(images)
    refuses(told, import_views, images, tmp_path / "frame")
    assert [path.name for path in tmp_path.iterdir()] == ["views"]


def test_a_page_in_a_folder_that_held_no_render_is_kept_and_what_cannot_be_imported_said(tmp_path, images):
    refuses("no views with known names", import_views, tmp_path, tmp_path / "frame")
    refuses(re.escape("nowhere is no folder"), import_views, tmp_path / "nowhere", tmp_path / "frame")
    for options, message in [
        ({"scale": 0}, "scale is 0"), ({"scale": 99}, "scale is 99"),
        ({"geometry": ImportGeometry(angle_deg=200.0)}, "between 1 and 120"),
        ({"geometry": ImportGeometry(width_mm=-1.0)}, "lengths above 0"),
        ({"geometry": ImportGeometry(display=MINI, width_mm=5.0)}, "have no use with --display"),
        ({"geometry": ImportGeometry(display=MINI, distance_mm=5.0)}, "have no use with --display"),
        ({"geometry": ImportGeometry(display=MINI, angle_deg=500.0)}, "between 1 and 120")]:
        refuses(message, import_views, images, tmp_path / "frame", **options)
        assert not (tmp_path / "frame").exists()
    (tmp_path / "view.html").touch()
    refuses("holds view.html but no render", import_views, images, tmp_path)
    import_views(images, tmp_path / "frame")
    (tmp_path / "view.html").rename(tmp_path / "frame" / "view.html")
    import_views(images, tmp_path / "frame")
    assert not (tmp_path / "frame" / "view.html").exists(), "it would show another image than the frame"


PORTRAIT = dataclasses.replace(load_display("looking-glass-portrait"), lenses=(105, 140))


def landscape(angle_deg: float = 50.0):
    """A 16-inch display of the third generation with a quarter of its pixels and lenses; a picture of its height is
    seen from as many of its own widths as ``PORTRAIT``."""
    wide = load_display("looking-glass-16-gen3")
    sheet = dataclasses.replace(wide.lenticular, pitch_mm=4 * wide.lenticular.pitch_mm)
    return dataclasses.replace(wide, lenses=(214, 120), panel_pixels=(960, 540), lenticular=sheet,
                               viewing_distance_mm=400 / 120.415 * 0.75 * 193.866, viewing_angle_deg=angle_deg)


def coordinates(folder):
    """A quilt whose tiles have red for their number, green rightwards and blue downwards."""
    columns, rows, width, height = 2, 4, 6, 9
    quilt = np.zeros((rows, height, columns, width, 3), np.uint8)
    number = np.arange(rows * columns).reshape(rows, columns)[::-1]  # from the bottom left
    quilt[..., 0] = 20 * number[:, None, :, None]
    quilt[..., 1] = 40 * np.arange(width)
    quilt[..., 2] = 25 * np.arange(height)[:, None, None]
    path = folder / "holo_qs2x4a0.75.png"
    write_png(path, quilt.reshape(rows * height, columns * width, 3))
    return path


def test_tiles_become_views_from_the_left(tmp_path):
    path, told = coordinates(tmp_path), Told()
    display = import_views(path, tmp_path / "frame", quilt=quilt_of(path), tell=told)
    finish_frame(tmp_path / "frame", "none")
    views = read_light_field(tmp_path / "frame").views
    assert (views[..., 0] == 20 * np.arange(views.shape[1])[:, None, None]).all()
    assert (views[..., 1] == 40 * np.arange(views.shape[3])).all()
    assert (views[..., 2] == 25 * np.arange(views.shape[2])[:, None]).all()
    assert (display.views, display.lenses, display.viewing_angle_deg) == ((8, 1), (6, 9), 40)
    assert display.panel_mm[0] / display.panel_mm[1] == pytest.approx(0.75)
    assert told.notices == [Notice("geometry-assumed", {"width_mm": 600.0, "distance_mm": 1000.0, "angle_deg": 40.0})]
    (back,) = export(tmp_path / "frame", "quilt", tmp_path / "back")
    assert "holo_qs" in back.name and back.name.count("_qs") == 1, "the name says its own tiles alone"


@pytest.mark.parametrize(("top_first", "mirror"), [(True, ""), (False, "x")])
def test_tiles_in_other_orders(tmp_path, top_first, mirror):
    path = coordinates(tmp_path)
    import_views(path, tmp_path / "frame", geometry=ImportGeometry(mirror=mirror),
                 quilt=quilt_of(path, None, top_first))
    finish_frame(tmp_path / "frame", "none")
    numbers = (read_light_field(tmp_path / "frame").views[0, :, 0, 0, 0] // 20).tolist()
    assert numbers == ([6, 7, 4, 5, 2, 3, 0, 1] if top_first else [7, 6, 5, 4, 3, 2, 1, 0])


def test_grids_and_aspects_as_names_and_people_give_them(tmp_path):
    path = tmp_path / "q_qs5x9a1.6.png"
    write_png(path, np.zeros((4096 // 8, 4096 // 8, 3), np.uint8))
    assert quilts.read_quilt(path, quilt_of(path)).shape == (1, 45, 56, 102, 3)
    for name, shape, expected, noted in [
        ("q_qs8x6a0.75", None, Quilt((8, 6), 0.75), False), ("plain", "8x6a0.5", Quilt((8, 6), 0.5), False),
        ("q_qs8x6a0.75", "4x12", Quilt((4, 12), 0.75), False), ("plain", "5x9", Quilt((5, 9), 16 / 9), True)]:
        grid = quilt_of(tmp_path / f"{name}.png", shape)
        assert dataclasses.replace(grid, assumed=None) == expected and bool(grid.assumed) == noted
    for name, shape, message in [
        ("plain", None, "does not say how many tiles"), ("plain", "8by6", "quilt is '8by6'"),
        ("plain", "3x3", "aspect ratio of a quilt of 3x3 tiles is not known"), ("q_qs1x1a1", None, "has no two views"),
        ("plain", "0x6a1", "has no two views"), ("plain", "_qs8x6", "must be tiles"), ("plain", "8x6.5", "must")]:
        refuses(message, quilt_of, tmp_path / f"{name}.png", shape)


@pytest.fixture(scope="module")
def quilt(tmp_path_factory):
    folder = tmp_path_factory.mktemp("portrait")
    made = finished(folder / "frame", PORTRAIT, scale=1)
    return export(made, "quilt", folder, ExportOptions(grid=(8, 6), width=105))[0]


@pytest.mark.parametrize(("angle", "seen", "most_of_panel"), [(40.0, slice(48), 4.0), (50.0, slice(6, 42), 8.0)])
def test_woven_for_another_display_as_if_made_for_it(tmp_path, quilt, angle, seen, most_of_panel):
    """Beyond the quilt's 40 degrees the outermost view repeats: there the panel of 50 degrees differs."""
    display = landscape(angle)
    import_views(quilt, tmp_path / "frame", geometry=ImportGeometry(display=display, angle_deg=40.0),
                 quilt=quilt_of(quilt))
    finish_frame(tmp_path / "frame", "none")
    covered = 0.75 * display.panel_mm[1] / display.panel_mm[0]  # of the panel's width, by a picture of its height
    # The same scene, for a display on which the picture is as wide.
    array = CameraArray.for_display(display, 1.6 / covered)
    finish_frame(finished(tmp_path / "direct", display, scale=1, array=array), "none")
    woven, wanted = (read_png(tmp_path / name / "panel.png").astype(float) for name in ("frame", "direct"))
    views, wanted_views = (read_light_field(tmp_path / name).views.astype(float) for name in ("frame", "direct"))
    inside = slice(round(960 * (1 - covered) / 2) + 12, round(960 * (1 + covered) / 2) - 12)
    lenses = slice(inside.start * 214 // 960 + 2, inside.stop * 214 // 960 - 2)
    off = np.abs(views - wanted_views)[:, seen, :, lenses]
    assert off.mean() < 3.0 and np.abs(woven - wanted)[:, inside].mean() < most_of_panel
    for turned in (views[:, ::-1], views[:, :, ::-1], views[:, :, :, ::-1]):  # inside out, upside down, mirrored
        assert np.abs(turned - wanted_views)[:, seen, :, lenses].mean() > 20
    assert (woven[:, :inside.start - 24] == 0).all(), "beside the picture the panel is black"


def test_a_folder_of_views_for_a_display_and_fill_that_cuts_the_picture(tmp_path, folder, field):
    export(folder, "hci", tmp_path / "views")
    smaller, told = dataclasses.replace(MINI, views=(4, 4), panel_pixels=(64, 48), name="smaller"), Told()
    imported = import_views(tmp_path / "views", tmp_path / "frame", 1, ImportGeometry(display=smaller), told)
    finish_frame(tmp_path / "frame", "none")
    assert imported == smaller and not told.notices
    assert np.abs(read_light_field(tmp_path / "frame").views.astype(int) - field.resampled((4, 4))).max() <= 1
    path = coordinates(tmp_path)
    for fill in (False, True):
        import_views(path, tmp_path / str(fill), quilt=quilt_of(path),
                     geometry=ImportGeometry(display=landscape(), fill=fill))
        finish_frame(tmp_path / str(fill), "none")
    whole, cut = (read_light_field(tmp_path / str(fill)).views[0, 24] for fill in (False, True))
    assert (whole[:, 0] == 0).all() and cut[:, 0, 0].min() > 0
    assert cut[0, 107, 2] > whole[0, 107, 2] + 30, "the top of the picture is cut"


# Films.

@pytest.fixture(scope="module")
def quilt_film(film, tmp_path_factory):
    """A film of quilts."""
    return export(film, "quilt-film", tmp_path_factory.mktemp("quilts"), ExportOptions(grid=(4, 2), width=64))[0]


def test_frames_of_a_film_become_frames(film, quilt_film, tmp_path):
    path, told = quilt_film, Told()
    assert import_views(path, tmp_path / "film", 1, ImportGeometry(display=MINI, angle_deg=40.0), told,
                        quilt_of(path)) == MINI
    assert "frame 2 of 3" in [progress.detail for progress in told.progress]
    fractions = [progress.fraction for progress in told.progress]
    assert fractions == sorted(fractions)
    for number, name in enumerate(NAMES, 1):
        ours, made = (read_light_field(folder).views for folder in (tmp_path / "film" / f"{number:04d}", film / name))
        assert np.abs(ours[4].astype(float) - made[3]).mean() < 12
        assert read_frame(tmp_path / "film" / f"{number:04d}").frame == number


def test_an_interrupted_import_of_a_film_goes_on(quilt_film, tmp_path):
    path, output = quilt_film, tmp_path / "film"

    def stop(told):
        if isinstance(told, Progress) and told.fraction > 0.5:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        import_views(path, output, quilt=quilt_of(path), tell=stop)
    assert sorted(folder.name for folder in output.iterdir()) == ["0001", "0002"]
    (output / "0002" / "eia.png").unlink()  # stopped between the two stages
    before = (output / "0001" / "eia.png").stat().st_mtime_ns
    import_views(path, output, quilt=quilt_of(path))
    assert (output / "0001" / "eia.png").stat().st_mtime_ns == before, "what is there stays"
    assert all((output / f"000{number}" / "eia.png").is_file() for number in (1, 2, 3))
    with pytest.raises(LfsrError, match="0001 holds a frame of another film, or for another display"):
        import_views(path, output, quilt=quilt_of(path), geometry=ImportGeometry(display=MINI))


def test_the_command(quilt_film, tmp_path, capsys):
    assert main(["import", str(quilt_film), "-o", str(tmp_path / "film"), "--display", "mini"]) == 0
    said = capsys.readouterr()
    assert "8×8 views of 16×12 pixels" in said.out and "--angle-deg 40" in said.err
    plain = shutil.copy(coordinates(tmp_path), tmp_path / "plain.png")
    write_profile(tmp_path / "own.toml", small(lenticular()))
    assert main(["import", str(plain), "-o", str(tmp_path / "one"), "--quilt", "2x4a0.75", "--display",
                 str(tmp_path / "own.toml")]) == 0
    assert picture(tmp_path / "one" / "panel.png").shape == (80, 120, 3)
    capsys.readouterr()
    assert "for quilts" in fails(["import", str(tmp_path), "-o", str(tmp_path / "two"), "--quilt", "2x4"], capsys)
    assert "has all its views" in fails(["import", str(quilt_film), "-o", str(tmp_path / "x"), "--scale", "2"], capsys)
    assert not (tmp_path / "two").exists() and not (tmp_path / "x").exists()


def test_a_film_without_a_word_on_its_colours(tmp_path):
    """Players take such films of high definition for BT.709; FFmpeg alone would take it for another."""
    path, pixels = tmp_path / "q_qs2x2a1.mp4", np.full((1280, 1280, 3), (200, 60, 30), np.uint8)
    with av.open(str(path), "w") as made:
        stream = made.add_stream("libx264", rate=10, options={"crf": "1"})
        stream.width = stream.height = 1280
        stream.pix_fmt = "yuv420p"
        frame = av.VideoFrame.from_ndarray(pixels, format="rgb24")
        made.mux(stream.encode(frame.reformat(format="yuv420p", dst_colorspace="ITU709", dst_color_range="MPEG")))
        made.mux(stream.encode())
    ((taken, count),) = quilts.read_film(path, quilt_of(path))
    assert count == 1 and np.abs(taken.astype(int) - (200, 60, 30)).max() <= 3


def test_quilts_and_films_that_cannot_be_read(tmp_path, monkeypatch):
    for ending in (".png", ".mp4"):
        path = tmp_path / f"bad_qs2x2a1{ending}"
        path.write_bytes(b"no image")
        assert main(["import", str(path), "-o", str(tmp_path / "frame")]) == 2
    sound = tmp_path / "sound_qs2x2a1.mkv"
    with av.open(str(sound), "w") as made:
        stream = made.add_stream("pcm_s16le", rate=48000, layout="mono")
        frame = av.AudioFrame(format="s16", layout="mono", samples=1024)
        frame.sample_rate = 48000
        made.mux(stream.encode(frame))
        made.mux(stream.encode())
    refuses("has no images", import_views, sound, tmp_path / "frame", quilt=quilt_of(sound))
    cut = tmp_path / "cut_qs2x2a1.mkv"
    with av.open(str(cut), "w") as made:
        stream = made.add_stream("ffv1", rate=10)
        stream.width = stream.height = 32
        for number in range(4):
            made.mux(stream.encode(av.VideoFrame.from_ndarray(np.full((32, 32, 3), number, np.uint8))))
        made.mux(stream.encode())
    assert len(list(quilts.read_film(cut, quilt_of(cut)))) == 4
    cut.write_bytes(cut.read_bytes()[:-250])
    refuses(r"ends 0\.\d s earlier", import_views, cut, tmp_path / "part", quilt=quilt_of(cut))
    small = tmp_path / "small_qs8x6a1.png"
    write_png(small, np.zeros((8, 90, 3), np.uint8))
    refuses("90×8 pixels, too few for 8x6 tiles", import_views, small, tmp_path / "frame", quilt=quilt_of(small))
    monkeypatch.setattr(quilts, "MOST_SIDE", 80)
    refuses("at most 80 a side", import_views, small, tmp_path / "frame", quilt=quilt_of(small))
    monkeypatch.setattr(quilts, "MOST_SIDE", 90)
    monkeypatch.setattr(quilts, "MOST_PIXELS", 700)
    refuses("90×8 pixels, but without a display", import_views, small, tmp_path / "frame", quilt=quilt_of(small, "2x2"))
    monkeypatch.setitem(__import__("sys").modules, "av", None)
    refuses("pip install", import_views, sound, tmp_path / "frame", quilt=quilt_of(sound))
    assert not (tmp_path / "frame").exists()


def test_images_in_other_formats(tmp_path):
    path = tmp_path / "q_qs2x2a1.png"
    flat = np.array([[[40, 90, 200], [220, 120, 30]], [[10, 180, 60], [128, 128, 128]]], np.uint8)
    write_png(path, flat.repeat(64, 0).repeat(64, 1))
    wanted = quilts.read_quilt(path, quilt_of(path)).astype(int)
    for ending in (".jpg", ".webp"):
        other = path.with_suffix(ending)
        Image.open(path).save(other, quality=95)
        assert np.abs(quilts.read_quilt(other, quilt_of(other)) - wanted).mean() < 3
