"""Direct subpixel rendering: the panel image, an animation, and what the buttons refuse."""

from pathlib import Path

import bpy
import numpy as np
import pytest

from blender_addon.jobs import folders, images
from lfsr_core.frames.frame import EIA_FILE, PANEL_FILE, read_rendered, read_report
from lfsr_core.images.image_files import read_png
from lfsr_core.optics.display import write_profile
from tests.support import panel
from tests.support.panels import cells, small
from tests.support.scenes import snapshot


@pytest.fixture(scope="module")
def rendered(add_on, tmp_path_factory) -> Path:
    """A file whose frame 1 was rendered by the button, for a small lenticular display, while views were previewed."""
    folder = tmp_path_factory.mktemp("direct")
    write_profile(folder / "own.toml", small(cells()))
    scene = panel.artist_scene(folder)
    lfsr = scene.lfsr
    lfsr.display, lfsr.profile_file, lfsr.subpixels = "FILE", "//own.toml", True
    lfsr.linear_exr, lfsr.temporal_averaging, lfsr.samples = True, 2, 4  # the first two do not count
    bpy.ops.wm.save_mainfile()
    views = folders.views_file(folder / "lightfield" / "scene" / "Scene" / "0001")
    np.save(views, np.zeros((8, 8, 12, 16, 3), np.uint8))
    images.load(scene, views)
    before = snapshot()
    assert bpy.ops.lfsr.render_eia() == {"FINISHED"}
    assert snapshot() == before and not images.show(scene, (0, 0))
    assert [image.name for image in bpy.data.images if image.filepath.endswith(PANEL_FILE)] == ["Scene 0001 panel"]
    return folder / "scene.blend"


def test_the_panel_image_is_the_only_result_and_an_animation_keeps_it(opened, rendered, capfd):
    folder = panel.frame_one(rendered)
    assert {path.name for path in folder.iterdir()} == {"frame.json", "lr_eia.exr", "panel.png", "report.json"}
    image, frame, report = read_png(folder / PANEL_FILE), read_rendered(folder), read_report(folder)
    assert image.shape == (80, 120, 3) and image.std() > 10
    assert (frame.layout, frame.scale, frame.layers, frame.samples) == ("subpixels", 1, (), 4)
    assert (report.method, report.finish.temporal_averaging) == ("oidn", 0)
    opened.frame_start, opened.frame_end = 1, 2
    assert bpy.ops.lfsr.render_animation() == {"FINISHED"}
    assert "2 frames: 1 made, 1 kept, 0 failed" in capfd.readouterr().out
    second = panel.frame_one(rendered).with_name("0002")
    assert read_rendered(second).frame == 2 and read_png(second / PANEL_FILE).std() > 10
    assert not (second / EIA_FILE).exists() and not folders.views_file(second).exists()


def test_it_is_complete_for_these_settings_alone_and_an_image_without_views_has_no_reference(opened, rendered):
    assert folders.is_made(*folders.requested(opened))
    opened.lfsr.subpixels, opened.lfsr.scale, opened.lfsr.method = False, "1", "oidn"
    assert not folders.is_made(*folders.requested(opened))
    (panel.frame_one(rendered) / EIA_FILE).touch()
    assert not folders.is_made(*folders.requested(opened))
    (panel.frame_one(rendered) / EIA_FILE).unlink()
    opened.lfsr.subpixels, opened.lfsr.samples = True, 5
    assert not folders.is_made(*folders.requested(opened))
    opened.lfsr.subpixels = False
    panel.refused("no views to compare", bpy.ops.lfsr.render_reference)


@pytest.mark.parametrize(("button", "arguments", "sentence"), [
    ("preview_view", {}, "no views to preview"), ("open_viewer", {}, "no views to show or export"),
    ("export", {"format": "quilt"}, "no views to show or export"),
    ("render_reference", {}, "A reference needs a light field"), ("plan", {}, "A plan needs a light field"),
    ("submit", {"farm": "openjd", "directory": "//job"}, "A farm's job needs a light field")])
def test_what_needs_a_light_field_says_so(opened, rendered, button, arguments, sentence):
    panel.refused(f"{sentence}.* switch .*off under Quality, Advanced", getattr(bpy.ops.lfsr, button), **arguments)
    assert not (rendered.parent / "job").exists()
