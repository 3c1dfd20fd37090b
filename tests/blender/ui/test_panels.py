"""Every panel draws against real RNA, in every state it can be in."""

from __future__ import annotations

import itertools
from types import SimpleNamespace

import bpy
import pytest

from blender_addon.check import last
from blender_addon.jobs import session
from blender_addon.scene import folders
from blender_addon.scene import settings as scene_settings
from blender_addon.ui import panels
from blender_addon.ui.panels import LFSR_MT_scale, LFSR_PT_display
from lfsr_core.base.errors import LfsrError
from lfsr_core.base.notices import Progress
from lfsr_core.frames.request import LIGHTS
from tests.support.problems import found
from tests.support.recording_layout import RecordingLayout


def draw(cls) -> list:
    """Draw one panel as Blender does; what it drew."""
    layout = RecordingLayout()
    own = {name: value for name, value in vars(cls).items() if callable(value)}
    drawing = type("Drawing", (), own | {"layout": layout})()
    if hasattr(drawing, "draw_header_preset"):
        drawing.draw_header_preset(bpy.context)
    drawing.draw(bpy.context)
    return layout.drawn


def draw_all() -> dict[str, list]:
    """Every panel but Live, which ``test_live_panel`` draws."""
    return {cls.bl_label: draw(cls) for cls in panels.CLASSES
            if issubclass(cls, bpy.types.Panel) and cls is not panels.LFSR_PT_live}


def labels(drawn: list) -> str:
    return " ".join(named.get("text", "") for name, named in drawn if name == "label")


def operators(drawn: list) -> set[str]:
    return {named["operator"] for name, named in drawn if name == "operator"}


def properties(drawn: list) -> set[str]:
    return {named["property"] for name, named in drawn if name == "prop"}


def greyed(drawn: list) -> set[str]:
    """Properties, and menus with their labels, that begin a row or column that is switched off."""
    drawn = [call for call in drawn if call[0] in ("prop", "menu", "operator") or call[1] == {"enabled": False}]
    return {named.get("property") or named["menu"] for (_, before), (name, named) in itertools.pairwise(drawn)
            if name in ("prop", "menu") and before == {"enabled": False}}


def all_greyed(drawn: dict[str, list]) -> set[str]:
    return set().union(*map(greyed, drawn.values()))


def test_with_an_array(scene):
    drawn = draw_all()
    assert list(drawn) == ["Display", "Camera Array", "Scene Check", "Quality", "Find Cheapest Settings", "Render",
                           "Preview", "View and Export", "Reference"]
    assert "16 × 12" in labels(drawn["Display"]) and "64 × 48 px" in labels(drawn["Display"])
    assert {"lfsr.array_fit", "lfsr.array_remove"} <= operators(drawn["Camera Array"])
    assert {"distance", "spacing", "show_frustum"} <= properties(drawn["Camera Array"])
    assert {"quality", "rays", "samples", "method", "output"} <= properties(drawn["Quality"])
    assert {"lfsr.render_eia", "lfsr.render_animation"} <= operators(drawn["Render"])
    assert ("menu", {"menu": "LFSR_MT_submit"}) in drawn["Render"]
    assert properties(drawn["Render"]) == {"temporal_averaging", "use_overwrite"}
    assert {"eye_right", "eye_up"} <= properties(drawn["Preview"])
    assert operators(drawn["View and Export"]) == {"lfsr.open_viewer", "lfsr.show"}
    assert operators(drawn["Reference"]) == {"lfsr.render_reference"}


def test_what_follows_from_rays_and_from_fixed_samples(scene):
    scene.lfsr.display, scene.lfsr.scale, scene.lfsr.samples, scene.lfsr.rays = "small", "AUTO", 0, 1
    drawn = draw_all()
    assert "1 to 25 samples" in labels(drawn["Quality"]) and "rays" not in greyed(drawn["Quality"])
    assert "8 × 8 or more" in labels(drawn["Display"])
    scene.lfsr.scale = "4"
    drawn = draw_all()
    assert "16 samples" in labels(drawn["Quality"]) and "or more" not in labels(drawn["Display"])
    scene.lfsr.samples = 4
    drawn = draw(panels.LFSR_PT_quality)
    assert "0.25 rays per pixel" in labels(drawn) and greyed(drawn) == {"rays"}


def test_the_light_of_the_menu_is_the_jobs(scene, tmp_path):
    assert {"light"} == properties(draw_all()["Quality"]) & {"light", "light_file"}
    assert scene_settings.resolve(scene).request.light == "auto"
    items = scene.lfsr.bl_rna.properties["light"].enum_items
    assert {item.identifier.lower() for item in items} == {*LIGHTS, "file"}
    for name in LIGHTS:
        scene.lfsr.light = name.upper()
        assert scene_settings.resolve_for_render(scene).request.light == name
    scene.lfsr.light = "FILE"
    assert {"light", "light_file"} <= properties(draw_all()["Quality"])
    for path, sentence in (("", "no light file is chosen"), ("//gone.hdr", "does not exist"), ("//x.jpg", "light is")):
        scene.lfsr.light_file = path
        with pytest.raises(LfsrError, match=sentence):
            scene_settings.resolve_for_render(scene)
        assert sentence in found(scene, "display").reason.lower()
    (tmp_path / "sky.hdr").touch()
    scene.lfsr.light_file = "//sky.hdr"
    assert scene_settings.resolve_for_render(scene).request.light == str(tmp_path / "sky.hdr")


def test_without_an_array(scene):
    bpy.ops.lfsr.array_remove()
    assert operators(draw(panels.LFSR_PT_array)) == {"lfsr.array_add", "lfsr.array_fit"}


def test_with_a_broken_array(scene):
    bpy.data.objects.remove(bpy.data.objects["Display Plane"])
    assert "no display plane" in labels(draw_all()["Camera Array"])


def test_the_menu_of_scales_has_those_of_the_display(scene):
    def offered() -> list[str]:
        return [named["value"] for name, named in draw(LFSR_MT_scale) if name == "prop_enum"]

    assert offered() == ["AUTO", "1", "2", "4", "8"]
    scene.lfsr.display = "bupt-32in-8k"
    assert offered() == ["AUTO", "1", "2", "4", "5", "8"]
    assert ("menu", {"menu": "LFSR_MT_scale", "text": "2×"}) in draw(LFSR_PT_display)
    scene.lfsr.display = "FILE"
    assert offered() == ["AUTO"]


def test_with_a_missing_profile(scene):
    scene.lfsr.display, scene.lfsr.profile_file = "FILE", "//gone.toml"
    drawn = draw_all()
    assert "profile_file" in properties(drawn["Display"])
    # A long path is broken over lines.
    assert "gone.tomlcannotberead" in labels(drawn["Display"]).replace(" ", "")


def test_direct_rendering_is_offered_for_a_lens_sheet_only(scene):
    scene.lfsr.subpixels, scene.lfsr.samples = True, 0
    drawn = draw_all()
    assert "subpixels" not in properties(drawn["Display"]) and "64 × 48 px" in labels(drawn["Display"])
    assert all_greyed(drawn) == {"eye_right"}, "there are no views yet"
    scene.lfsr.display, scene.lfsr.subpixels = "looking-glass-16", False
    drawn = draw_all()
    assert "subpixels" in properties(drawn["Display"]) and "Lenses" in labels(drawn["Display"])
    assert all_greyed(drawn) == {"eye_right"}, "there are no views yet"
    scene.lfsr.subpixels = True
    drawn = draw_all()
    assert "Rendered 11520 × 2160 px Image 3840 × 2160 px" in labels(drawn["Display"])
    assert "Lenses" not in labels(drawn["Display"])
    assert all_greyed(drawn) == {"eye_right", "LFSR_MT_scale", "method", "linear_exr", "temporal_averaging"}


def test_with_problems_of_every_kind(scene):
    scene.cycles.pixel_filter_type = "GAUSSIAN"
    scene.collection.objects.unlink(bpy.data.objects["Sun"])
    last.check(scene)
    drawn = draw_all()["Scene Check"]
    assert {"lfsr.check_scene", "lfsr.check_fix"} <= operators(drawn)
    assert "Pixel Filter" in labels(drawn) and "The scene has no light" in labels(drawn)


def test_while_a_task_runs(scene, monkeypatch):
    task = SimpleNamespace(progress=Progress("frames", 0.42, "frame 3, 2 of 5"), fraction=0.42, seconds_left=31.4)
    monkeypatch.setattr(session, "_current", task)
    drawn = draw_all()["Render"]
    assert "lfsr.cancel" in operators(drawn)
    texts = [named.get("text") for name, named in drawn if name in {"progress", "label"}]
    assert {"Rendering 42%, 0:31 left", "Frame 3, 2 of 5"} <= set(texts)
    header = SimpleNamespace(layout=RecordingLayout())
    session.draw_status(header, bpy.context)
    assert "lfsr.cancel" in operators(header.layout.drawn)
    monkeypatch.setattr(session, "_current", None)


def test_with_a_message(scene):
    bpy.context.window_manager.lfsr.message = "The render stopped with signal 9"
    assert "signal 9" in labels(draw_all()["Render"])


def icons(drawn: list, text: str) -> set[str]:
    """Icons of the labels that begin with ``text``."""
    return {named["icon"] for name, named in drawn if name == "label" and named["text"].startswith(text)}


def test_what_informs_is_not_drawn_as_an_error(scene):
    for say, icon in ((session.say, "INFO"), (lambda text: session.notify(text, "ERROR"), "ERROR")):
        say("a kept frame is older")
        assert icons(draw_all()["Render"], "A kept frame") == {icon}
    bpy.context.window_manager.lfsr.message = ""


def test_what_was_done_is_one_line_with_its_buttons(scene):
    state = bpy.context.window_manager.lfsr
    state.outcome, state.outcome_folder = "Done in 0:42", str(folders.frame_folder(scene))
    drawn = draw(panels.LFSR_PT_render)
    assert icons(drawn, "Done in 0:42") == {"CHECKMARK"}
    assert {"wm.path_open", "lfsr.preview_view", "lfsr.render_reference"} <= operators(drawn)
    scene.frame_set(2)  # another frame than the one that was rendered
    drawn = draw(panels.LFSR_PT_render)
    assert "wm.path_open" in operators(drawn) and "lfsr.preview_view" not in operators(drawn)
    state.outcome = state.outcome_folder = ""


def test_with_cycles_disabled(scene):
    bpy.ops.preferences.addon_disable(module="cycles")
    try:
        last.check(scene)
        assert "Cycles" in labels(draw_all()["Scene Check"])
    finally:
        bpy.ops.preferences.addon_enable(module="cycles")


def test_the_layout_refuses_misspellings(scene):
    layout = RecordingLayout()
    for call in (lambda: layout.prop(scene.lfsr, "sampels"), lambda: layout.label(text="x", icon="NO_SUCH_ICON"),
                 lambda: layout.operator("lfsr.rendre"), lambda: layout.labl(text="x"),
                 lambda: layout.label(txt="x")):
        with pytest.raises((AssertionError, KeyError)):
            call()
    with pytest.raises(AssertionError):
        layout.scale_yy = 2
    with pytest.raises(AssertionError):
        layout.operator("lfsr.check_fix").codee = "x"
