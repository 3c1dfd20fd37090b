"""The render buttons without a window: results, skipped frames, the comparison."""

from pathlib import Path

import bpy
import numpy as np
import pytest

from blender_addon.jobs import folders, images, session
from blender_addon.scene.array import rig
from blender_addon.ui.drawing import metric_facts
from blender_addon.ui.operators import render
from lfsr_core.base.system import read_json
from lfsr_core.frames.frame import read_frame
from lfsr_core.images.image_files import read_png
from tests.support import panel
from tests.support.scenes import snapshot


@pytest.fixture
def scene(add_on, tmp_path):
    """A fresh scene, for tests that render nothing or spoil it."""
    return panel.artist_scene(tmp_path)


@pytest.fixture(scope="module")
def rendered(add_on, tmp_path_factory) -> Path:
    """A file whose frame 1 was rendered by the button."""
    folder = tmp_path_factory.mktemp("rendered")
    panel.artist_scene(folder)
    before = snapshot()
    assert bpy.ops.lfsr.render_eia() == {"FINISHED"} and snapshot() == before
    return folder / "scene.blend"


def test_render_writes_the_frame_folder_beside_the_file(rendered):
    folder = panel.frame_one(rendered)
    names = {path.name for path in folder.iterdir()}
    assert names == {"frame.json", "lr_eia.exr", "mask.png", "eia.png", "report.json"}
    assert [path.name for path in folder.parent.iterdir()] == ["0001"]
    image = read_png(folder / "eia.png")
    assert image.shape == (96, 128, 3) and image.max() > 60
    frame, report = read_frame(folder), read_json(folder / "report.json", "report")
    assert (frame.display.name, frame.scale, frame.samples, frame.frame) == ("mini", 2, 1, 1)
    assert report["method"] == "bicubic" and 0 < report["foreground_fraction"] < 1


def test_preview_shows_the_view_of_the_eye_and_in_another_file_not_the_old_ones(opened, rendered):
    assert bpy.ops.lfsr.preview_view() == {"FINISHED"}
    image, views = bpy.data.images[images.IMAGE_NAME], np.load(folders.views_file(panel.frame_one(rendered)))
    assert views.shape == (8, 8, 12, 16, 3)
    for eye, index in {(-1, 1): (0, 0), (1, 1): (0, 7), (1, -1): (7, 7)}.items():
        opened.lfsr.eye_right, opened.lfsr.eye_up = eye
        pixels, times = np.array(image.pixels).reshape(image.size[1], image.size[0], 4), image.size[0] // 16
        shown = pixels[::-1, :, :3][times // 2::times, times // 2::times]
        assert np.allclose(shown, views[index] / 255, atol=0.01), eye
    assert images.show(opened, (0, 0))
    bpy.ops.wm.open_mainfile(filepath=str(rendered))
    assert not images.show(bpy.context.scene, (0, 0))


def stamps(folder: Path) -> dict[str, int]:
    return {path.parent.name: path.stat().st_mtime_ns for path in folder.glob("*/lr_eia.exr")}


def test_animation_makes_what_is_missing(opened, rendered, capfd):
    film = panel.frame_one(rendered).parent
    opened.frame_start, opened.frame_end = 1, 3
    assert bpy.ops.lfsr.render_animation() == {"FINISHED"}
    said = capfd.readouterr().out
    assert "3 frames: 2 made, 1 kept, 0 failed" in said and "frame 1: kept" in said
    # The button sets the range in the copy that it renders, which is not the file of frame 1.
    assert "frames-older" in said or "1 frame is older" in said
    assert [read_frame(film / name).frame for name in ("0001", "0002", "0003")] == [1, 2, 3]
    assert folders.is_decoded(film / "0003") and images.show(opened, (0, 0))

    before = stamps(film)
    (film / "0002" / "eia.png").unlink()
    (film / "0003" / "lr_eia.exr").write_bytes((film / "0003" / "lr_eia.exr").read_bytes()[:-9])
    assert bpy.ops.lfsr.render_animation() == {"FINISHED"}
    assert {name for name, stamp in stamps(film).items() if before[name] != stamp} == {"0003"}
    assert (film / "0002" / "eia.png").is_file() and "3 frames: 2 made, 1 kept" in capfd.readouterr().out


def test_reference_and_ssim_need_the_image_of_these_settings(opened, rendered):
    opened.lfsr.reference_samples, opened.lfsr.reference_lenses = 2, 16
    before = snapshot()
    assert bpy.ops.lfsr.render_reference() == {"FINISHED"} and snapshot() == before
    reference = panel.frame_one(rendered).with_name("0001_reference")
    assert {path.name for path in reference.iterdir()} == {"frame.json", "reference_a.exr", "reference_b.exr"}
    assert len(read_frame(reference).lens_list) == 16
    metrics = read_json(panel.frame_one(rendered) / "report.json", "report")["metrics"]
    assert metrics["ssim_lens_fg"] > 0.7 and metrics["psnr_fg"] > 17, "of their neighbours it is 9 dB"
    assert "ssim_eia_fg" not in metrics, "of sampled lenses"
    assert "SSIM per Lens" in dict(metric_facts(opened))
    opened.lfsr.samples = 5
    panel.refused("made with other settings", bpy.ops.lfsr.render_reference)
    opened.frame_set(44)
    panel.refused("render the EIA first", bpy.ops.lfsr.render_reference)
    panel.refused("to preview: render the EIA first", bpy.ops.lfsr.preview_view)


def test_an_array_that_is_deleted_meanwhile_leaves_nothing(scene):
    session.start("Render EIA", render.image_job(scene))
    panel.wait_for(lambda: session.current() is None or session.current().child is not None)
    bpy.data.objects.remove(rig.find(scene))
    panel.wait_for(lambda: session.current() is None)
    assert not [item for item in bpy.data.objects if rig.PLANE in item]


def test_edit_mode_is_left_while_rays_are_sent_and_entered_again(scene, monkeypatch):
    """Blender makes its tree of an edited mesh anew for each ray."""
    bpy.ops.mesh.primitive_ico_sphere_add(subdivisions=7)
    bpy.ops.object.mode_set(mode="EDIT")
    modes = []
    monkeypatch.setattr(rig, "find", lambda *_, real=rig.find: (modes.append(bpy.context.mode), real(*_))[1])
    assert bpy.ops.lfsr.check_scene() == {"FINISHED"}
    assert modes and set(modes) == {"OBJECT"} and bpy.context.mode == "EDIT_MESH"
