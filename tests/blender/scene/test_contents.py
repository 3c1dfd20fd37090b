"""The user is told of everything that changes the image."""

import shutil
from types import SimpleNamespace

import bpy
import pytest

from blender_addon import compat
from blender_addon.scene import settings
from blender_addon.scene.contents import left_out
from blender_addon.scene.words import PANEL, sentence
from lfsr_core.base.messages import LfsrError, Notice
from lfsr_core.commands.sentences import SENTENCES
from lfsr_core.optics import display
from tests.commands.test_sentences import EXAMPLES
from tests.support.scenes import add_box, add_camera, compositing


@pytest.fixture
def plain(scene):
    add_box(scene, (0, 0, 0), (1, 1, 1))
    add_camera(scene)
    return scene


def test_compositor_nodes_that_change_the_image_are_said_and_no_others(plain):
    compositing(plain, "NodeReroute").pop().id_data.nodes.new("CompositorNodeExposure")
    assert left_out(plain) == []
    tree_nodes = compositing(plain, "CompositorNodeExposure", "NodeReroute", "CompositorNodeBrightContrast")
    assert left_out(plain) == [Notice("compositor-ignored", {"names": ["Brightness/Contrast", "Exposure"]})]
    tree_nodes[0].mute = True
    assert left_out(plain)[0].values["names"] == ["Brightness/Contrast"]
    plain.render.use_compositing = False
    assert left_out(plain) == [], "F12 leaves it out too"


def test_strips_of_the_sequencer_and_python_that_was_not_run_are_said(plain, tmp_path):
    strip = plain.sequence_editor_create().strips.new_effect("x", "COLOR", 1, frame_start=1, length=10)
    assert left_out(plain) == [Notice("sequencer-ignored")]
    strip.mute = True
    assert left_out(plain) == []
    strip.mute, plain.render.use_sequencer = False, False
    assert left_out(plain) == []
    plain.camera.driver_add("location", 0).driver.expression = "__import__('os').getpid() * 0"
    path = tmp_path / "driven.blend"
    bpy.ops.wm.save_as_mainfile(filepath=str(path))
    bpy.ops.wm.open_mainfile(filepath=str(path), use_scripts=False)
    bpy.context.scene.frame_set(2)
    assert "scripts-off" in [notice.code for notice in left_out(bpy.context.scene)]


IMPORTS = {"angle-assumed", "aspect-assumed", "geometry-assumed"}  # of light fields, which the panel does not have


def test_the_panel_words_what_there_is_and_names_no_options():
    assert set(PANEL) <= set(SENTENCES)
    assert not [code for code in set(EXAMPLES) - IMPORTS if "--" in sentence(Notice(code, EXAMPLES[code][0]))]


def test_a_profile_added_to_the_folder_is_in_the_menu(tmp_path, monkeypatch):
    folder = shutil.copytree(display.PROFILE_FOLDER, tmp_path / "displays")
    for name, title in (("desk", 'title = "9″ Desk"\n'), ("untitled", "")):
        text = (folder / "mini.toml").read_text(encoding="utf-8").replace('name = "mini"', f'name = "{name}"')
        text = "".join(line for line in text.splitlines(keepends=True) if not line.startswith("title"))
        (folder / f"{name}.toml").write_text(title + text, encoding="utf-8")
    monkeypatch.setattr(display, "PROFILE_FOLDER", folder)
    items = settings.profile_items()
    titles, order = {item[0]: item[1] for item in items}, [item[0] for item in items]
    assert (titles["desk"], titles["untitled"]) == ("9″ Desk", "untitled")
    assert order.index("mini") < order.index("desk") < order.index("small") and order[-1] == settings.PROFILE_FILE
    assert len({item[4] for item in items}) == len(items), "each has a number of its own, whatever else is in the menu"


@pytest.mark.parametrize(("ids", "addresses"), [
    (["CUDA_NVIDIA H100_0000:65:00"], ("0000:65:00",)),
    (["CUDA_NVIDIA RTX_0000:01:00_OptiX", "CUDA_NVIDIA RTX_0000:02:00_OptiX"], ("0000:01:00", "0000:02:00")),
    (["HIP_AMD Radeon RX 7900 XTX_0000:0c:00"], ("0000:0c:00",)),
    (["ONEAPI_Intel Arc A770_0000:03:00.0"], ("0000:03:00",)), (["METAL_Apple M4"], ()), ([], ())])
def test_addresses_are_in_the_ids_of_cycles_devices(monkeypatch, ids, addresses):
    preferences = SimpleNamespace(get_device_types=lambda context: [("OPTIX", "OptiX", "", 3)],
                                  get_devices_for_type=lambda kind: [SimpleNamespace(id=device) for device in ids])
    monkeypatch.setattr(compat, "cycles_preferences", lambda: preferences)
    assert compat.gpu_addresses("OPTIX") == addresses
    assert compat.gpu_addresses("CPU") == compat.gpu_addresses("VULKAN") == ()


def test_what_blender_does_not_know_and_this_machine_does_not_have_is_refused():
    with pytest.raises(LfsrError, match="device is 'VULKAN', but this Blender knows"), compat.device_enabled("VULKAN"):
        pass
    absent = [kind for kind in ("CUDA", "HIP") if compat.best_device("auto") != kind]
    with pytest.raises(LfsrError, match="device is '.*', but this machine has none"), compat.device_enabled(absent[0]):
        pass
