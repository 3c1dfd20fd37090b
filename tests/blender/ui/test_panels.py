"""Every panel draws against real RNA, in every state it can be in, with texts that follow Blender's rules."""

import importlib
import itertools
import re
from pathlib import Path
from types import SimpleNamespace

import bpy
import numpy as np
import pytest

import blender_addon
from blender_addon import compat
from blender_addon.check import last
from blender_addon.jobs import folders, session
from blender_addon.live import session as live_session
from blender_addon.live.scene import EYE, PANEL
from blender_addon.scene import settings as scene_settings
from blender_addon.scene import words
from blender_addon.scene.array import rig
from blender_addon.ui import array_view, panels
from blender_addon.ui.drawing import METRICS, metric_facts
from blender_addon.ui.panels import LFSR_MT_scale
from lfsr_core.base.messages import Progress
from lfsr_core.frames.frame import LIGHTS, Finish, Report, light_parts, write_report
from tests.support import panel
from tests.support.panel import problem_of
from tests.support.recording_layout import RecordingLayout
from tests.support.scenes import MINI
from tests.support.synthetic import write_render
from tests.support.told import refuses

# The menu of presets is Blender's.
PANELS = [cls for cls in panels.CLASSES if issubclass(cls, bpy.types.Panel) and cls != panels.LFSR_PT_presets]


def draw(cls) -> list:
    """Draw one panel as Blender does; what it drew."""
    layout, own = RecordingLayout(), {name: value for name, value in vars(cls).items() if callable(value)}
    drawing = type("Drawing", (), own | {"layout": layout})()
    if hasattr(drawing, "draw_header_preset"):
        drawing.draw_header_preset(bpy.context)
    drawing.draw(bpy.context)
    return layout.drawn


def draw_all() -> dict[str, list]:
    """Every panel but those of Live, which have tests of their own."""
    live = (panels.LFSR_PT_live, panels.LFSR_PT_live_advanced)
    return {cls.bl_label: draw(cls) for cls in PANELS if cls not in live}


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


CONTROLS = {"prop", "operator", "menu", "prop_enum", "operator_menu_enum", "popover"}
MOST_CONTROLS = 12  # that are open at first


def test_with_an_array(scene):
    drawn = draw_all()
    assert set(drawn) == {"Light Field", "Camera Array", "Quality", "Find Cheapest Settings", "Advanced", "Animation",
                          "View and Export", "Reference"}
    assert "16 × 12 points" in labels(drawn["Light Field"]) and operators(drawn["Light Field"]) >= {"lfsr.render_eia"}
    assert {"lfsr.array_fit", "lfsr.array_remove"} <= operators(drawn["Camera Array"])
    assert {"distance", "spacing", "show_frustum"} <= properties(drawn["Camera Array"])
    assert {"quality", "rays", "method", "output"} <= properties(drawn["Quality"])
    assert operators(drawn["Animation"]) == {"lfsr.render_animation"}
    assert ("menu", {"menu": "LFSR_MT_submit"}) in drawn["Animation"]
    assert properties(drawn["Animation"]) == {"temporal_averaging", "use_overwrite"}
    assert operators(drawn["View and Export"]) == {"lfsr.preview_view", "lfsr.open_viewer", "lfsr.show"}
    assert operators(drawn["Reference"]) == {"lfsr.render_reference"}


def test_few_controls_are_open_at_first_and_words_of_the_laboratory_are_advanced(scene):
    closed = [cls for cls in panels.CLASSES if "DEFAULT_CLOSED" in getattr(cls, "bl_options", ())]
    assert [cls for cls in PANELS if cls not in closed] == [panels.LFSR_PT_image]
    headers = [cls for cls in PANELS if not hasattr(cls, "bl_parent_id")]
    assert [cls.bl_label for cls in headers] == [  # Blender draws them in the order in which they are registered
        "Light Field", "Camera Array", "Quality", "Animation", "View and Export", "Live", "Reference"]
    assert len([name for name, _ in draw(panels.LFSR_PT_image) if name in CONTROLS]) + len(headers) <= MOST_CONTROLS
    plain = [draw(cls) for cls in PANELS if cls.bl_label != "Advanced"]
    assert not {"samples", "seed", "scale", "live_samples", "device"} & set().union(*map(properties, plain))
    assert "Renders On" not in " ".join(map(labels, plain))
    assert {"samples", "seed"} <= properties(draw(panels.LFSR_PT_advanced))
    assert "Renders On CPU, OSL camera" in labels(draw(panels.LFSR_PT_advanced))


def test_what_follows_from_rays_and_from_fixed_samples(scene):
    scene.lfsr.display, scene.lfsr.scale, scene.lfsr.samples, scene.lfsr.rays = "small", "AUTO", 0, 1
    drawn = draw_all()
    assert "4 to 25 samples" in labels(drawn["Advanced"]) and "rays" not in greyed(drawn["Quality"])
    assert "8 × 8 or more" in labels(drawn["Advanced"])
    scene.lfsr.scale = "4"
    drawn = draw_all()
    assert "16 samples" in labels(drawn["Advanced"]) and "or more" not in labels(drawn["Advanced"])
    scene.lfsr.samples = 4
    assert "0.25 rays per pixel" in labels(draw(panels.LFSR_PT_advanced))
    assert greyed(draw(panels.LFSR_PT_quality)) == {"rays"}


def test_the_light_of_the_menu_is_the_jobs(scene, tmp_path):
    assert {"light"} == properties(draw_all()["Quality"]) & {"light", "light_file"}
    assert scene_settings.resolve(scene).request.light == "auto"
    assert {item.identifier.lower() for item in scene.lfsr.bl_rna.properties["light"].enum_items} == {*LIGHTS, "file"}
    for light, scene.lfsr.light_strength in (*((name, 1) for name in LIGHTS), ("city:0.3", 0.3), ("even", 4)):
        scene.lfsr.light = light_parts(light)[0].upper()
        assert scene_settings.resolve_for_render(scene).request.light == light
    scene.lfsr.light = "FILE"
    assert {"light", "light_file"} <= properties(draw_all()["Quality"])
    for path, sentence in (("", "no light file is chosen"), ("//gone.hdr", "does not exist"), ("//x.jpg", "light is")):
        scene.lfsr.light_file = path
        refuses(sentence, scene_settings.resolve_for_render, scene)
        assert sentence in problem_of(scene, "display").reason.lower()
    (tmp_path / "sky.hdr").touch()
    scene.lfsr.light_file = "//sky.hdr"
    assert scene_settings.resolve_for_render(scene).request.light == str(tmp_path / "sky.hdr")


def test_with_a_broken_array_and_without_one(scene):
    assert "lfsr.array_add" not in entries()
    bpy.data.objects.remove(bpy.data.objects["Display Plane"])
    assert "no display plane" in labels(draw_all()["Camera Array"])
    bpy.ops.lfsr.array_remove()
    assert operators(draw(panels.LFSR_PT_array)) == {"lfsr.array_add", "lfsr.array_fit"}
    assert entries()["lfsr.array_add"] == "Light Field Camera Array"


def test_the_menu_of_scales_has_those_of_the_display_and_a_missing_profile_is_said(scene):
    def offered() -> list[str]:
        return [named["value"] for name, named in draw(LFSR_MT_scale) if name == "prop_enum"]

    assert offered() == ["AUTO", "1", "2", "4", "8"]
    scene.lfsr.display = "bupt-32in-8k"
    assert offered() == ["AUTO", "1", "2", "4", "5", "8"]
    assert ("menu", {"menu": "LFSR_MT_scale", "text": "2×"}) in draw(panels.LFSR_PT_advanced)
    scene.lfsr.display = "FILE"
    assert offered() == ["AUTO"]
    scene.lfsr.display, scene.lfsr.profile_file = "FILE", "//gone.toml"
    drawn = draw_all()["Light Field"]
    assert "profile_file" in properties(drawn)
    # A long path is broken over lines.
    assert "gone.tomldoesnotexist" in labels(drawn).replace(" ", "")


def test_direct_rendering_is_offered_for_a_lens_sheet_only(scene):
    scene.lfsr.subpixels, scene.lfsr.samples = True, 0
    drawn = draw_all()
    assert "subpixels" not in properties(drawn["Advanced"]) and "Panel 64 × 48 px" not in labels(drawn["Advanced"])
    assert all_greyed(drawn) == set()
    scene.lfsr.display, scene.lfsr.subpixels = "looking-glass-portrait", False
    drawn = draw_all()
    assert "subpixels" in properties(drawn["Advanced"]) and "Lenses" in labels(drawn["Advanced"])
    assert "Panel 1536 × 2048 px" in labels(drawn["Advanced"])
    assert {"lfsr.test_picture", "lfsr.calibrate"} <= operators(drawn["View and Export"]) and all_greyed(drawn) == set()
    scene.lfsr.subpixels = True
    drawn = draw_all()
    assert "Rendered 4608 × 2048 px" in labels(drawn["Advanced"]) and "Lenses" not in labels(drawn["Advanced"])
    assert all_greyed(drawn) == {"LFSR_MT_scale", "method", "linear_exr", "temporal_averaging"}


def test_checks_are_one_line_that_opens(scene):
    state = bpy.context.window_manager.lfsr
    state.show_problems = False
    assert "lfsr.check_scene" in operators(draw(panels.LFSR_PT_image))
    last.check(scene)
    assert "No problems found" in labels(draw(panels.LFSR_PT_image))
    scene.cycles.pixel_filter_type = "GAUSSIAN"
    last.check(scene)
    drawn = draw(panels.LFSR_PT_image)
    assert "1 Note" in texts(drawn) and "lfsr.check_fix" not in operators(drawn)
    scene.collection.objects.unlink(bpy.data.objects["Sun"])
    scene.lfsr.light = "OWN"
    last.check(scene)
    assert "1 Problem" in texts(draw(panels.LFSR_PT_image))
    state.show_problems = True
    drawn = draw(panels.LFSR_PT_image)
    assert {"lfsr.check_scene", "lfsr.check_fix"} <= operators(drawn)
    assert "Pixel Filter" in labels(drawn) and "The scene has no light" in labels(drawn)


def texts(drawn: list) -> set[str]:
    return {named["text"] for name, named in drawn if name == "prop" and "text" in named}


def test_while_a_task_runs(scene, monkeypatch):
    task = SimpleNamespace(progress=Progress("frames", 0.42, "frame 3, 2 of 5"), fraction=0.42, seconds_left=31.4)
    monkeypatch.setattr(session, "_current", task)
    drawn = draw_all()["Light Field"]
    assert "lfsr.cancel" in operators(drawn) and "lfsr.render_eia" not in operators(drawn)
    texts = [named.get("text") for name, named in drawn if name in {"progress", "label"}]
    assert {"Rendering 42%, 0:31 left", "Frame 3, 2 of 5"} <= set(texts)
    header = SimpleNamespace(layout=RecordingLayout())
    session.draw_status(header, bpy.context)
    assert "lfsr.cancel" in operators(header.layout.drawn)
    monkeypatch.setattr(session, "_current", None)


def icons(drawn: list, text: str) -> set[str]:
    """Icons of the labels that begin with ``text``."""
    return {named["icon"] for name, named in drawn if name == "label" and named["text"].startswith(text)}


def test_what_informs_is_no_error_and_what_was_done_is_one_line_with_its_buttons(scene):
    for say, icon in ((session.say, "INFO"), (lambda text: session.say(text, is_error=True), "ERROR")):
        say("a kept frame is older")
        assert icons(draw_all()["Light Field"], "A kept frame") == {icon}
    state = bpy.context.window_manager.lfsr
    state.message, state.outcome, state.outcome_folder = "", "Done in 0:42", str(folders.frame_folder(scene))
    drawn = draw(panels.LFSR_PT_image)
    assert icons(drawn, "Done in 0:42") == {"CHECKMARK"} and "wm.path_open" in operators(drawn)
    scene.lfsr.display = "small"  # which that image is not for
    assert "wm.path_open" not in operators(draw(panels.LFSR_PT_image))
    state.outcome = state.outcome_folder = ""


def drawn(draw) -> list[tuple[str, dict]]:
    layout = RecordingLayout()
    draw(SimpleNamespace(layout=layout), bpy.context)
    return layout.drawn


def entries() -> dict[str, str]:
    """Operator and text of each entry of the menu *Light Field*."""
    return {named["operator"]: named.get("text", "") for name, named in drawn(panels.LFSR_MT_render.draw)
            if name == "operator"}


def test_blenders_menus_have_the_entries_and_renders_do_not_block_it(scene):
    for menu, draw in ((bpy.types.TOPBAR_MT_render, panels.draw_render),
                       (bpy.types.VIEW3D_MT_camera_add, panels.draw_camera)):
        assert draw in menu._dyn_ui_initialize()
    assert ("menu", {"menu": "LFSR_MT_render", "icon": "CAMERA_STEREO"}) in drawn(panels.draw_render)
    assert [(named["operator"], named["text"]) for _, named in drawn(panels.draw_camera)] == [
        ("lfsr.array_add", "Light Field Camera Array")]
    assert ("set", {"operator_context": "INVOKE_DEFAULT"}) in drawn(panels.LFSR_MT_render.draw)
    assert {"lfsr.render_eia", "lfsr.render_animation", "lfsr.check_scene"} <= set(entries())


def buttons(drawn) -> list[str]:
    return [named.get("text", "") for name, named in drawn if name == "operator"]


def test_off_and_a_lens_sheet_that_has_no_pixel_size(scene):
    drawn = draw(panels.LFSR_PT_live)
    assert not bpy.ops.lfsr.live_full_screen.poll() and buttons(drawn) == ["Start Live", "Show One Eye"]
    assert {"live_eye_right", "live_eye_up", "live_eye_near"} == properties(drawn)
    advanced = {"live_scale", "live_rays", "live_samples", "live_smooth", "live_denoise"}
    assert properties(draw(panels.LFSR_PT_live_advanced)) == advanced
    scene.lfsr.display = "looking-glass-go"
    assert {"live_scale", "live_smooth"} <= greyed(draw(panels.LFSR_PT_live_advanced))


def test_on(scene, monkeypatch):
    monkeypatch.setattr(live_session, "_on", {PANEL: live_session._Shown(bpy.context.scene.session_uid)})
    assert "exact" in labels(draw(panels.LFSR_PT_live))
    live_session._on[PANEL].message = "the live window shows 5×5 pixels"
    drawn = draw(panels.LFSR_PT_live)
    assert buttons(drawn) == ["Stop Live", "", "Show One Eye"]
    assert "5×5" in labels(drawn) and "full screen" in labels(drawn) and "exact" not in labels(drawn)
    live_session._on[EYE] = live_session._Shown(bpy.context.scene.session_uid, message="make the window larger")
    drawn = draw(panels.LFSR_PT_live)
    assert "Make the window larger" in labels(drawn) and buttons(drawn) == ["Stop Live", "", "Hide Eye"]


def test_what_this_blender_cannot_do_and_a_scene_without_an_array_that_gets_one(scene, monkeypatch):
    monkeypatch.setattr(panels, "can_interpolate", lambda: False)
    monkeypatch.setattr(compat, "has_denoiser", lambda: False)
    text = labels(draw(panels.LFSR_PT_live))
    assert "cannot interpolate" in text and "without a denoiser" in text
    bpy.ops.lfsr.array_remove()
    panel.refused("without a window", bpy.ops.lfsr.live)
    assert rig.find(scene) is not None and not live_session.is_on() and len(bpy.data.scenes) == 1


def test_the_drawn_frustum_is_the_array(scene):
    array, _ = rig.placement(scene, MINI)
    near, far = rig.usable_depth(array, MINI)
    drawn = [points for *_, points in array_view.lines(array, MINI, scale=2)]
    depths = {round(float(z), 4) for points in drawn for z in points[:, 2]}
    assert {round(z, 4) for z in (0.0, near, array.distance, far, *rig.usable_depth(array, MINI, 2))} == depths
    rectangle = array_view.rectangle(array, array.distance)
    assert np.allclose(np.abs(rectangle), [(array.half_width, array.half_height, array.distance)] * 4)
    zone = next(points for points in drawn if not points[:, 2].any())
    assert zone[:, 0].max() == pytest.approx(MINI.views[0] * array.spacing / 2)


def write_metrics(folder, metrics: dict) -> None:
    write_report(folder, Report(Finish("bicubic"), "bicubic", "mini", 4, 16, {"render": 1.0}, None, 0.5,
                                metrics=metrics))


def test_metrics_of_this_files_frame_are_shown(scene):
    folder = folders.frame_folder(scene)
    assert metric_facts(scene) == []
    folder.mkdir(parents=True)
    for flip, shown in ((0.01234, [("FLIP", "0.0123")]), (None, [])):
        write_metrics(folder, {"ssim_eia_fg": 0.91234, "psnr_fg": 31.26, "flip": flip})
        assert metric_facts(scene) == [("SSIM Foreground", "0.9123"), ("PSNR", "31.3 dB"), *shown]
    write_render(folder, source="../other.blend")
    write_metrics(folder, {"psnr_fg": 31.26})
    assert metric_facts(scene) == [], "it is another file's"


CLASSES = [cls for module in blender_addon._modules() for cls in getattr(module, "CLASSES", ())]
LONGEST_LABEL = 30  # letters; a narrow sidebar shows no more
SMALL_WORDS = {"a", "an", "and", "at", "by", "for", "from", "in", "of", "on", "or", "per", "the", "to", "with"}


def wrong_label(text: str) -> str:
    """What is wrong with a label; empty if nothing is."""
    first, *rest = text.split() or [""]
    small = [word for word in (first, *(word for word in rest if word not in SMALL_WORDS)) if word[:1].islower()]
    if not text or len(text) > LONGEST_LABEL:
        return f"{text!r} has {len(text)} letters"
    return f"{text!r} is not in Title Case: {', '.join(small)}" if small else ""


def wrong_tooltip(text: str) -> str:
    """What is wrong with a tooltip; empty if nothing is."""
    if not text or text.endswith(".") or text[:1].islower():
        return f"{text!r} is empty, ends with a full stop or begins without a capital"
    return ""


@pytest.mark.parametrize("cls", CLASSES, ids=lambda cls: cls.__name__)
def test_texts_follow_blenders_rules(artist, cls):
    rna, faults = cls.bl_rna, [wrong_label(cls.bl_label)] if hasattr(cls, "bl_label") else []
    if issubclass(cls, bpy.types.Operator):
        assert cls.bl_idname.startswith("lfsr.")
        rna = getattr(bpy.ops.lfsr, cls.bl_idname.removeprefix("lfsr.")).get_rna_type()
        faults.append(wrong_tooltip(rna.description))
    for item in rna.properties:
        if item.identifier in cls.__annotations__:
            for entry in (item, *getattr(item, "enum_items", ())):
                if entry is item or entry.name != entry.identifier:  # a display is called by its profile's own name
                    faults += [wrong_label(entry.name), wrong_tooltip(entry.description)]
    assert [text for text in faults if text] == []


def test_texts_of_buttons_and_numbers_follow_them_too(scene):
    scene.lfsr.display, scene.cycles.pixel_filter_type = "looking-glass-16", "GAUSSIAN"
    scene.collection.objects.unlink(bpy.data.objects["Sun"])
    assert len(last.check(scene)) > 1
    bpy.context.window_manager.lfsr.show_problems = True
    drawn = [call for calls in draw_all().values() for call in calls]
    texts = {named["text"] for name, named in drawn if name in ("operator", "prop", "menu") and named.get("text")}
    assert {"Use Box", "Selection", "View", "Camera"} <= texts
    assert [wrong_label(text) for text in texts if wrong_label(text)] == []
    assert not any(map(wrong_label, METRICS.values()))


def test_buttons_of_one_operator_have_tooltips_and_check_boxes_titles_of_their_own(scene):
    for name, item, values in (("live", "kind", ("panel", "eye")), ("export", "format", ("quilt", "views")),
                               ("submit", "farm", ("openjd", "flamenco")), ("array_fit", "to", ("VIEW", "CAMERA")),
                               ("show", "full_screen", (False, True)), ("show", "animation", (False, True))):
        properties = bpy.context.window_manager.operator_properties_last(f"lfsr.{name}")
        cls, texts = getattr(bpy.types, f"LFSR_OT_{name}"), set()
        for value in values:
            setattr(properties, item, value)
            texts.add(cls.description(bpy.context, properties))
        properties.property_unset(item)
        assert len(texts) == 2 and not any(map(wrong_tooltip, texts - {""}))
    owners = [bpy.types.Scene.bl_rna.properties["lfsr"].fixed_type,
              *(getattr(bpy.ops.lfsr, cls.bl_idname.removeprefix("lfsr.")).get_rna_type()
                for cls in CLASSES if issubclass(cls, bpy.types.Operator))]
    titles = [[item.name for item in owner.properties if item.type == "BOOLEAN"
               and not {item.is_hidden, item.is_readonly} & {True}] for owner in owners]
    assert all(len(names) == len(set(names)) for names in titles) and len(titles[0]) > 5


# An option, a list of Python, a path, or one of many things.
NOT_PLAIN = re.compile(r"--[a-z]|\[.*\]|(?<![\w/:.])/(?!lightfield)\w+/|\b1 [a-z]+s\b")


def texts_in(drawn: list) -> list[str]:
    """Texts that are drawn, with the lines of one sentence in one piece."""
    return [named["text"] for name, named in drawn if name in ("label", "operator", "prop", "menu", "progress")
            and named.get("text")]


# Settings with which the panel has something to say.
STATES = {
    "as it is": {}, "profile": {"display": "FILE", "profile_file": "/no/such/profile.toml"}, "scale": {"scale": "5"},
    "lens sheet": {"display": "looking-glass-16-gen3", "subpixels": True}, "one sample": {"samples": 1},
    "one ray": {"display": "bupt-32in-8k", "scale": "1", "samples": 1}, "texture": {}}


@pytest.mark.parametrize("state", STATES)
def test_the_panels_texts_are_plain(scene, state):
    compat.assign(scene.lfsr, STATES[state])
    if state == "texture":
        image = bpy.data.images.new("wood", 1, 1)
        image.source, image.filepath, image.use_fake_user = "FILE", "/no/such/folder/wood.png", True
        bpy.context.window_manager.lfsr.message = "the scene is dark: choose another, or see /tmp/lfsr-1/log.txt"
    last.check(scene)
    bpy.context.window_manager.lfsr.show_problems = True
    everything = [*draw_all().values(), draw(panels.LFSR_PT_live)]
    wrong = [text for drawn in everything for text in texts_in(drawn) if NOT_PLAIN.search(text.removesuffix("."))]
    starts = [texts_in(drawn)[0] for drawn in everything if texts_in(drawn)]
    assert wrong == [] and [text for text in starts if text[:1].islower()] == []


@pytest.mark.parametrize(("message", "shown"), [
    ("no image in /tmp/a/b.c/0001 to preview", "No image in 0001 to preview"),
    (r"file C:\Users\me\wood.png is missing", "File wood.png is missing"),
    ("see https://www.openimagedenoise.org/downloads.html", "See https://www.openimagedenoise.org/downloads.html"),
    ("the output folder is '//lightfield/', 1/2 of it", "The output folder is '//lightfield/', 1/2 of it")])
def test_the_panel_shows_the_names_of_paths_alone(message, shown):
    assert words.for_panel(message) == shown


def test_messages_are_sentences():
    assert words.capitalized("no image") == "No image"
    assert words.capitalized("own.toml: no name") == "own.toml: no name", "a file's name stays"
    assert [words.counted(count, "problem") for count in (0, 1, 2)] == ["0 problems", "1 problem", "2 problems"]


def test_names_that_window_tests_send_to_blender_exist():
    """A window is no part of CI: a module that moves would show there only when somebody opens one."""
    tests = Path(__file__).resolve().parents[2]
    for path in [*tests.rglob("*_window.py"), *tests.rglob("support/window/*.py")]:
        for name in re.findall(r"\baddon((?:\.[a-z_]\w*)+)", path.read_text(encoding="utf-8")):
            place = blender_addon
            for part in name[1:].split("."):
                if not hasattr(place, part):
                    assert hasattr(place, "__path__"), f"{path.name}: addon{name}"
                    importlib.import_module(f"{place.__name__}.{part}")
                place = getattr(place, part)
