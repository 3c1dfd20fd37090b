"""Open Viewer and Export without a window: the files they write, and what they say without an image."""

import dataclasses

import av
import bpy
import numpy as np
import pytest

from blender_addon.jobs import folders
from blender_addon.ui.operators import show
from lfsr_core.calibration.patterns import pattern
from lfsr_core.exports import loopback
from lfsr_core.exports.images import eye_place
from lfsr_core.exports.light_field import on_screen, read_light_field
from lfsr_core.exports.options import FORMATS
from lfsr_core.frames.frame import read_frame
from lfsr_core.images.image_files import read_png, write_png
from lfsr_core.optics.display import load_display, write_profile
from tests.calibration.test_fit import CYLINDERS, GOOD, PLACE
from tests.calibration.test_makers import OLD
from tests.support import panel
from tests.support.bridge import device
from tests.support.finished import finished
from tests.support.panels import lenticular, small
from tests.support.telephone import jpeg


@pytest.fixture
def frame(add_on, tmp_path):
    """The frame folder of a new scene, finished."""
    scene = panel.artist_scene(tmp_path)
    return finished(folders.frame_folder(scene), source=folders.source_of(scene))


def test_the_viewer_is_written_beside_the_image_and_every_format_is_in_the_menu(frame, add_on):
    assert bpy.ops.lfsr.open_viewer() == {"FINISHED"}
    assert "two depths" not in (frame / "view.html").read_text(encoding="utf-8")
    assert "5\\u2033 for Trials" in (frame / "view.html").read_text(encoding="utf-8")
    assert set(bpy.ops.lfsr.export.get_rna_type().properties["format"].enum_items.keys()) == set(FORMATS)


@pytest.mark.parametrize(("name", "file"), [("quilt", "two_depths_qs*.png"), ("hci", "parameters.cfg"),
                                            ("pleno", "007_007.ppm")])
def test_exports_go_into_the_frame_folder(frame, name, file):
    assert bpy.ops.lfsr.export(format=name) == {"FINISHED"} and list((frame / "export" / name).glob(file))


def test_films_are_encoded_by_blender_also_of_the_quilts_of_an_animation(frame):
    assert bpy.ops.lfsr.export(format="sway") == {"FINISHED"}
    (path,) = (frame / "export" / "sway").iterdir()
    assert path.suffix == ".mp4"
    with av.open(str(path)) as film:
        frames = [frame.to_ndarray(format="rgb24") for frame in film.decode(video=0)]
    field = read_light_field(frame)
    expected = on_screen(field.seen_from(*eye_place(field, 0.25)), field.display, 320)
    assert len(frames) == 120 and frames[30].shape == expected.shape
    assert abs(frames[30].astype(float) - expected).mean() < 4
    panel.refused("one image only", bpy.ops.lfsr.export, format="quilt-film")
    second = finished(frame.with_name("0002"), source=read_frame(frame).source, frame=2)
    write_png(second / "eia.png", read_png(second / "eia.png") // 2)
    bpy.context.scene.render.fps = 12
    assert bpy.ops.lfsr.export(format="quilt-film") == {"FINISHED"}
    (path,) = (frame.parent / "export" / "quilt-film").iterdir()
    assert path.name == "two_depths_qs2x4a1.333.mp4"
    with av.open(str(path)) as film:
        assert film.streams.video[0].average_rate == 12
        frames = [frame.to_ndarray(format="rgb24").astype(float) for frame in film.decode(video=0)]
    assert len(frames) == 2 and frames[0].mean() > 1.5 * frames[1].mean()


@pytest.mark.parametrize("press", [lambda: bpy.ops.lfsr.open_viewer(), lambda: bpy.ops.lfsr.export(format="quilt"),
                                   lambda: bpy.ops.lfsr.show()])
def test_without_an_image_it_says_what_to_do(add_on, tmp_path, press):
    panel.artist_scene(tmp_path)
    panel.refused("render the EIA first", press)


@pytest.fixture
def lenticular_frame(add_on, tmp_path, monkeypatch):
    """A finished frame for a lenticular display of 240×160 pixels."""
    display = small(lenticular())
    write_profile(tmp_path / "own.toml", display)
    scene = panel.artist_scene(tmp_path)
    scene.lfsr.display, scene.lfsr.profile_file = "FILE", str(tmp_path / "own.toml")
    folder = finished(folders.frame_folder(scene), display, source=folders.source_of(scene))
    write_png(folder / "panel.png", np.zeros((*display.panel_pixels[::-1], 3), np.uint8))
    monkeypatch.setenv(loopback.PORT_VARIABLE, "1")  # nobody listens there
    return folder


def said():
    return bpy.context.window_manager.lfsr.message


def test_a_quilt_is_shown_through_bridge_and_without_it_the_panel_full_screen(lenticular_frame, bridge):
    panel.refused("Looking Glass Bridge is not running", bpy.ops.lfsr.show)
    assert bpy.ops.lfsr.show(full_screen=True) == {"FINISHED"}
    assert "panel.png" in (lenticular_frame / "show.html").read_text(encoding="utf-8")
    assert said() == "The browser shows it full screen: move its window to the display and click into it"
    stand_in = bridge(devices=[device(1, "LKG-S3", "small", OLD | {"screenW": 240, "screenH": 160})])
    assert bpy.ops.lfsr.show() == {"FINISHED"}
    assert stand_in.shown == [str(next((lenticular_frame / "export" / "quilt").glob("*.png")))]
    assert said().endswith("a1.5.png is shown on LKG-S3 (small)")


@pytest.mark.parametrize("command", ["missing", "/bin/false %s", "'no end %s"])
def test_where_no_browser_opens_a_page_it_says_where_that_is(add_on, tmp_path, monkeypatch, command):
    monkeypatch.setenv("BROWSER", command)
    (opener := tmp_path / "xdg-open").write_text("#!/bin/sh\nexit 3\n")  # where there is none
    opener.chmod(0o755)
    monkeypatch.setenv("PATH", str(tmp_path))
    monkeypatch.setenv("DISPLAY", ":0")
    process = show._browser(page := tmp_path / "view.html")
    assert process.wait() and show._look(process, page) is None
    assert said().startswith("No browser has opened view.html, which lies in the folder ")


def test_a_lens_array_is_shown_full_screen_and_an_image_for_another_display_is_not(frame):
    assert bpy.ops.lfsr.show() == {"FINISHED"} and "eia.png" in (frame / "show.html").read_text(encoding="utf-8")
    finished(frame.with_name("0002"), frame=2)
    assert bpy.ops.lfsr.show(animation=True) == {"FINISHED"}
    assert (frame.parent / "show.html").read_text(encoding="utf-8").count("eia.png") == 2
    bpy.context.scene.lfsr.display = "small"
    with pytest.raises(RuntimeError, match="is for the display 5″ for Trials, but the scene's is 14″ for Trials"):
        bpy.ops.lfsr.show()


def test_a_lenticular_animation_is_shown_as_a_film_of_quilts(lenticular_frame, bridge):
    finished(lenticular_frame.with_name("0002"), small(lenticular()), frame=2)
    panel.refused("is not running", bpy.ops.lfsr.show, animation=True)
    assert not (lenticular_frame.parent / "export").exists(), "Bridge is asked first"
    stand_in = bridge(devices=[device(1, "LKG-S3", "small", OLD | {"screenW": 240, "screenH": 160})])
    bpy.context.scene.render.fps = 12
    assert bpy.ops.lfsr.show(animation=True) == {"FINISHED"}
    with av.open(stand_in.shown[0]) as film:
        assert film.streams.video[0].average_rate == 12 and len(list(film.decode(video=0))) == 2


@pytest.fixture(scope="module")
def own_display(add_on, tmp_path_factory):
    folder = tmp_path_factory.mktemp("calibration")
    write_profile(folder / "own.toml", CYLINDERS)
    made = panel.artist_scene(folder)
    made.lfsr.display, made.lfsr.profile_file = "FILE", str(folder / "own.toml")
    return made, folder


def test_the_test_picture_is_photographed_and_the_display_calibrated(own_display):
    made, folder = own_display
    assert bpy.ops.lfsr.test_picture(filepath=str(folder / "phase.png")) == {"FINISHED"}
    np.testing.assert_array_equal(read_png(folder / "phase.png"), pattern(CYLINDERS, "phase"))
    shot = dataclasses.replace(GOOD, rays=1)
    (folder / "photo.jpg").write_bytes(jpeg(read_png(folder / "phase.png"), CYLINDERS, shot))
    with pytest.raises(RuntimeError, match="by its perspective"):
        bpy.ops.lfsr.calibrate(files=[{"name": "photo.jpg"}], directory=str(folder), place=(-200.0, 0.0, 500.0))
    assert made.lfsr.profile_file.endswith("own.toml")
    assert bpy.ops.lfsr.calibrate(files=[{"name": "photo.jpg"}], directory=str(folder), place=PLACE) == {"FINISHED"}
    assert made.lfsr.profile_file.endswith("large-calibrated.toml")
    assert load_display(made.lfsr.profile_file).lenticular.pitch_mm == pytest.approx(1.6, rel=2e-5)
    assert (folder / "large-calibrated.png").exists()
    panel.refused("No photograph was chosen", bpy.ops.lfsr.calibrate, directory=str(folder))
