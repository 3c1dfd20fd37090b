"""A render borrows the scene: every setting is as before, after success, an error, and a cancel."""

import os

import bpy
import OpenImageIO as oiio
import pytest

from blender_addon.compat import overridden
from blender_addon.render import frame_folder
from blender_addon.render.cycles import RenderSettings, cycles_settings
from lfsr_core.base.messages import Progress
from lfsr_core.base.system import CORES
from lfsr_core.images import image_files
from tests.support.requests import make_request
from tests.support.scenes import MINI, add_box, emission, snapshot
from tests.support.told import Told, refuses

KINDS = {"low": {}, "card": {"layout": "lens-card"}, "views": {"layout": "view-by-view"},
         "reference": {"kind": "reference", "samples": 2}}


def state():
    images = sorted(image.name for image in bpy.data.images if image.name != "Render Result")  # Blender's own
    return snapshot() | {"images": images}


def changes(before):
    """Settings that are not as in ``before``: what they were and are."""
    after = state()
    return {key: (before.get(key), after.get(key)) for key in before | after if before.get(key) != after.get(key)}


@pytest.fixture
def worn(scene):
    """A scene whose settings are all unlike those of a render and unlike the defaults."""
    add_box(scene, (0, 0, 0), (0.5, 0.5, 0.5)).pass_index = 7
    add_box(scene, (0, 3, 0), (2, 0.1, 2), emission((0.1, 0.2, 0.3))).pass_index = 9
    background = bpy.data.collections.new("Background")
    background.objects.link(scene.objects[1])
    scene.collection.children.link(background)
    scene.render.engine = "BLENDER_WORKBENCH"
    scene.render.resolution_x, scene.render.resolution_y, scene.render.resolution_percentage = 320, 200, 37
    scene.render.filepath, scene.render.use_border, scene.render.use_motion_blur = "//mine_####", True, True
    scene.render.image_settings.file_format = "PNG"
    scene.render.image_settings.color_mode, scene.render.image_settings.color_depth = "BW", "16"
    scene.render.image_settings.compression = 33
    scene.render.use_multiview, scene.render.pixel_aspect_x, scene.render.use_stamp = True, 1.5, True
    scene.cycles.samples, scene.cycles.seed, scene.cycles.use_adaptive_sampling = 999, 5, True
    scene.cycles.pixel_filter_type, scene.cycles.filter_width = "GAUSSIAN", 2.5
    scene.cycles.sample_clamp_direct, scene.cycles.use_denoising, scene.cycles.time_limit = 3.0, True, 0.5
    layer = scene.view_layers[0]
    layer.use_pass_mist, layer.use_pass_emit, layer.use_pass_cryptomatte_object = True, True, True
    layer.cycles.use_denoising = False
    scene.view_layers.new("second").use_pass_uv = True
    scene.frame_set(12)
    return scene


def job(folder, **options):
    return make_request(str(folder), MINI, **{"scale": 4, "samples": 1, "frame": 3, "layers": ("albedo",
            "index")} | options)


@pytest.mark.parametrize("options", KINDS.values(), ids=KINDS)
def test_after_a_render(worn, tmp_path, options):
    before = state()
    frame_folder.render_job(worn, job(tmp_path, **options))
    assert not changes(before)
    layers = image_files.read_layers(next(tmp_path.glob("*.exr")))
    assert layers["color"].shape[:2] == ((96, 128) if options.get("kind") == "reference" else (24, 32))
    position = set() if options.get("kind") == "reference" else {"position"}
    assert set(layers) == {"color", "albedo", "normal", "index", "path"} | position
    file, part, passes = oiio.ImageInput.open(str(next(tmp_path.glob("*.exr")))), 0, set()
    while file.seek_subimage(part, 0):
        passes, part = passes | {name.lower() for name in file.spec().channelnames}, part + 1
    assert not any(own in name for own in ("mist", "emi", "crypto") for name in passes), "the user's own stay out"


@pytest.mark.parametrize("options", KINDS.values(), ids=KINDS)
def test_after_an_error(worn, tmp_path, options):
    before = state()
    (tmp_path / "file").touch()
    refuses("cannot be written", frame_folder.render_job, worn, job(tmp_path / "file" / "folder", **options))
    assert not changes(before)


@pytest.mark.parametrize("options", KINDS.values(), ids=KINDS)
def test_after_a_cancel(worn, tmp_path, options):
    before, reported = state(), []

    def cancel(told):
        if isinstance(told, Progress) and told.fraction:  # in the middle
            reported.append(told)
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        frame_folder.render_job(worn, job(tmp_path, **options), tell=cancel)
    assert len(reported) == 1 and not changes(before)
    assert list(tmp_path.iterdir()) == [], "a cancelled render leaves no file"
    assert not bpy.app.handlers.render_stats


def test_progress_grows_to_one_and_a_setting_that_cannot_be_set_restores_those_before(worn, tmp_path):
    told = Told()
    frame_folder.render_job(worn, job(tmp_path, layout="view-by-view"), tell=told)
    fractions = [progress.fraction for progress in told.progress]
    assert fractions == sorted(fractions) and fractions[-1] == 1 and len(set(fractions)) >= 4
    said = [progress.detail for progress in told.progress]
    assert any(message.startswith("4/4: Sample") for message in said)
    assert any("Updating Scene BVH: Building" in message for message in said), "also while Cycles gets ready"
    assert not any("Mem:" in message for message in said)
    with pytest.raises(TypeError), overridden(worn.cycles, {"samples": 77, "pixel_filter_type": "NONE SUCH"}):
        pass
    assert worn.cycles.samples != 77


def test_a_value_that_blender_does_not_have_any_more_stops_nothing(worn):
    image = worn.render.image_settings
    image.file_format, image.color_mode = "PNG", "RGBA"
    with overridden(image, {"color_mode": "RGB"}):
        image.file_format = "JPEG"
    assert image.color_mode == "RGB"


@pytest.mark.parametrize(("own", "allowed", "used"), [(None, None, os.cpu_count()), (None, 1, 1), (1, 9, 1)])
def test_renders_use_the_cores_that_they_may(scene, monkeypatch, own, allowed, used):
    monkeypatch.delenv(CORES, raising=False)
    if allowed:
        monkeypatch.setenv(CORES, str(allowed))
    if own:
        scene.render.threads_mode, scene.render.threads = "FIXED", own
    before = scene.render.threads_mode, scene.render.threads
    with cycles_settings(scene, RenderSettings(), (32, 24)):
        assert scene.render.threads == used
    assert (scene.render.threads_mode, scene.render.threads) == before
