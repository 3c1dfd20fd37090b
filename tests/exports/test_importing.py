"""Folders of views of others: what goes in comes out of the second stage, and what is wrong is one sentence."""

import os
import re

import numpy as np
import pytest
from PIL import Image

from lfsr_core.base.notices import Notice
from lfsr_core.exports.formats import export
from lfsr_core.exports.importing import ImportGeometry, import_views
from lfsr_core.exports.light_field import read_light_field
from lfsr_core.exports.options import ExportOptions
from lfsr_core.frames.frame import read_frame
from lfsr_core.images.exr import read_layers
from lfsr_core.pipeline.make import finish_frame
from tests.support.finished import MINI
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


def test_hci_tells_its_geometry(folder, tmp_path):
    export(folder, "hci", tmp_path / "views")
    told = Told()
    imported = import_views(tmp_path / "views", tmp_path / "back", tell=told)
    display = read_frame(tmp_path / "back").display
    assert told.notices == [] and imported == display
    assert (display.lenses, display.views, display.name) == (MINI.lenses, MINI.views, "imported")
    assert display.panel_mm == pytest.approx(MINI.panel_mm) and display.camera_spacing_mm == pytest.approx(
        MINI.camera_spacing_mm)
    assert display.viewing_distance_mm == pytest.approx(MINI.viewing_distance_mm)


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
    for row in range(2):
        for column in range(2):
            Image.fromarray(field.views[row * 4, 4 - column * 4]).save(
                source / f"out_{row:02d}_{column:02d}_{row * 10.5:.3f}_{-60.25 * column:.3f}.png")
    import_views(source, tmp_path / "frame")
    finish_frame(tmp_path / "frame", "none")
    np.testing.assert_array_equal(read_light_field(tmp_path / "frame").views, field.views[::4, ::4][:, :2])


def test_mirrored_cameras_are_turned_round(images, field, tmp_path):
    import_views(images, tmp_path / "frame", geometry=ImportGeometry(mirror="x"))
    finish_frame(tmp_path / "frame", "none")
    np.testing.assert_array_equal(read_light_field(tmp_path / "frame").views, field.resampled((3, 3))[:, ::-1])


def test_a_wide_grid_keeps_its_middle(folder, field, tmp_path):
    export(folder, "views", tmp_path / "views", ExportOptions(views=(8, 4)))
    told = Told()
    imported = import_views(tmp_path / "views", tmp_path / "frame", tell=told)
    assert imported.views == (4, 4) and Notice("cameras-cut", {"side": 4, "across": 8, "down": 4}) in told.notices


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
    "t_rex_{row:02d}_{column:02d}.png", "2 SAI-{row} {column}.png"])
def test_any_digits_separators_and_endings(images, field, tmp_path, pattern):
    source = tmp_path / "others"
    source.mkdir()
    for number in range(9):
        row, column = divmod(number, 3)
        name = pattern.format(row=row, column=column, number=number)
        Image.open(images / f"input_Cam{number:03d}.png").save(source / name, quality=100, subsampling=0)
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


def test_a_page_in_a_folder_that_held_no_render_is_kept(images, tmp_path):
    (tmp_path / "frame").mkdir()
    (tmp_path / "frame" / "view.html").write_text("my own")
    import_views(images, tmp_path / "frame")
    assert (tmp_path / "frame" / "view.html").read_text() == "my own"
    import_views(images, tmp_path / "frame")
    assert not (tmp_path / "frame" / "view.html").exists(), "it would show another image than the frame"


def camera(source, number):
    return source / f"input_Cam{number:03d}.png"


def jpeg_cut_short(source):
    path = source / "input_Cam002.png"
    Image.open(path).save(path.with_suffix(".jpg"))
    data = path.with_suffix(".jpg").read_bytes()
    path.with_suffix(".jpg").write_bytes(data[:-60])
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


def test_an_empty_or_missing_folder_and_geometry_that_cannot_be(tmp_path, images):
    refuses("no views with known names", import_views, tmp_path, tmp_path / "frame")
    refuses(re.escape("nowhere is no folder"), import_views, tmp_path / "nowhere", tmp_path / "frame")
    for options, message in [
        ({"scale": 0}, "scale is 0"), ({"scale": 99}, "scale is 99"),
        ({"geometry": ImportGeometry(angle_deg=200.0)}, "between 1 and 120"),
        ({"geometry": ImportGeometry(width_mm=-1.0)}, "lengths above 0")]:
        refuses(message, import_views, images, tmp_path / "frame", **options)
        assert not (tmp_path / "frame").exists()
