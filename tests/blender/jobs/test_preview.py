"""The preview's speed at full size."""

import time
from pathlib import Path

import bpy
import numpy as np

from blender_addon.jobs import asked, preview, show_image
from blender_addon.scene.files import unreadable
from lfsr_core.images.png import write_png


def test_preview_is_fast_for_an_8k_image(scene):
    views = np.random.default_rng(0).integers(0, 255, (80, 80, 54, 96, 3), np.uint8)
    path = asked.views_file(Path("/8k"))
    np.save(path, views)
    preview.load(scene, path)
    seconds = []
    for eye in np.linspace(-1, 1, 9):
        started = time.perf_counter()
        scene.lfsr.eye_right = eye
        seconds.append(time.perf_counter() - started)
    maps = Path("/proc/self/maps")
    assert not maps.is_file() or str(path) not in maps.read_text(), "Windows replaces no mapped file"
    path.unlink()
    print(f"preview of an 8K image: {np.median(seconds) * 1000:.1f} ms")
    image = bpy.data.images[preview.IMAGE_NAME]
    assert not any(item.is_dirty for item in bpy.data.images), "Blender asks about it when it quits"
    shown = np.empty(len(image.pixels), np.float32)
    image.pixels.foreach_get(shown)
    expected = preview.to_pixels(views[preview.view_index((80, 80), (1, scene.lfsr.eye_up))])
    assert np.abs(shown - expected.ravel()).max() < 1e-3 and len(bpy.data.images) == 1
    assert np.median(seconds) < 0.1


def test_our_images_stay_out_of_the_file(scene, tmp_path):
    np.save(tmp_path / "views.npy", np.full((2, 2, 3, 4, 3), 255, np.uint8))
    write_png(tmp_path / "panel.png", np.zeros((4, 4, 3), np.uint8))
    preview.load(scene, tmp_path / "views.npy")
    own = [preview.show(scene, (0, 0)), show_image.open_file(tmp_path / "panel.png")]
    for image in own:
        image.use_fake_user = True  # as if an editor showed it
    (tmp_path / "panel.png").unlink()
    assert not unreadable(bpy.context.scene)
    bpy.ops.wm.save_as_mainfile(filepath=str(tmp_path / "scene.blend"))
    assert len(bpy.data.images) == 2, "they stay in this session"
    bpy.ops.wm.open_mainfile(filepath=str(tmp_path / "scene.blend"))
    assert not bpy.data.images


def test_an_image_of_the_same_name_is_the_artists(scene, tmp_path):
    own = bpy.data.images.new(preview.IMAGE_NAME, 4, 4)
    own.filepath_raw, own.file_format = str(tmp_path / "own.png"), "PNG"
    own.save()
    np.save(tmp_path / "views.npy", np.full((2, 2, 3, 4, 3), 255, np.uint8))
    preview.load(scene, tmp_path / "views.npy")
    assert preview.show(scene, (0, 0)) != own and tuple(own.size) == (4, 4)
