"""Labels and tooltips of every operator, panel, menu and property follow Blender's rules."""

import re

import bpy
import pytest

import blender_addon
from blender_addon.check import last
from blender_addon.scene import words
from blender_addon.ui import panels, summary
from tests.blender.ui.test_panels import draw, draw_all
from tests.support import panel

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


def texts_of(cls) -> list[str]:
    """What is wrong with the texts of a registered class and its properties."""
    rna, found = cls.bl_rna, []
    if issubclass(cls, bpy.types.Operator):
        rna = getattr(bpy.ops.lfsr, cls.bl_idname.removeprefix("lfsr.")).get_rna_type()
        found.append(wrong_tooltip(rna.description))
    if hasattr(cls, "bl_label"):
        found.append(wrong_label(cls.bl_label))
    for item in rna.properties:
        if item.identifier in cls.__annotations__:
            found += [wrong_label(item.name), wrong_tooltip(item.description), *enum_texts(item)]
    return [f"{cls.__name__}: {text}" for text in found if text]


def enum_texts(item) -> list[str]:
    """The same of an enumeration's items; a display is called by its profile's own name."""
    items = getattr(item, "enum_items", ())
    return [text for each in items if each.name != each.identifier
            for text in (wrong_label(each.name), wrong_tooltip(each.description))]


@pytest.mark.parametrize("cls", CLASSES, ids=lambda cls: cls.__name__)
def test_texts_follow_blenders_rules(cls):
    with panel.registered():
        assert texts_of(cls) == []
        assert not issubclass(cls, bpy.types.Operator) or cls.bl_idname.startswith("lfsr.")


def test_texts_of_buttons_follow_them_too(tmp_path):
    with panel.registered():
        scene = panel.artist_scene(tmp_path)
        scene.lfsr.display, scene.cycles.pixel_filter_type = "looking-glass-16", "GAUSSIAN"
        scene.collection.objects.unlink(bpy.data.objects["Sun"])
        assert len(last.check(scene)) > 1
        bpy.context.window_manager.lfsr.show_problems = True
        drawn = [call for calls in draw_all().values() for call in calls]
        texts = {named["text"] for name, named in drawn if name in ("operator", "prop", "menu") and named.get("text")}
    assert {"Use Box", "Selection", "View", "Camera"} <= texts
    assert [wrong_label(text) for text in texts if wrong_label(text)] == []


def test_buttons_of_one_operator_have_tooltips_of_their_own(scene):
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


def test_no_two_check_boxes_have_one_title():
    with panel.registered():
        owners = [bpy.types.Scene.bl_rna.properties["lfsr"].fixed_type,
                  *(getattr(bpy.ops.lfsr, cls.bl_idname.removeprefix("lfsr.")).get_rna_type()
                    for cls in CLASSES if issubclass(cls, bpy.types.Operator))]
        titles = [[item.name for item in owner.properties if item.type == "BOOLEAN"
                   and not {item.is_hidden, item.is_readonly} & {True}] for owner in owners]
    assert all(len(names) == len(set(names)) for names in titles) and len(titles[0]) > 5


PLAIN = re.compile(r"--[a-z]|\[.*\]|(?<![\w/:.])/(?!lightfield)\w+/|\b1 [a-z]+s\b")


def wrong_message(text: str) -> str:
    """What is wrong with a text of a panel: an option, a list of Python, a path, or one of many things."""
    found = PLAIN.search(text.removesuffix("."))
    return f"{text!r} has {found[0]!r}" if found else ""


def texts_in(drawn: list) -> list[str]:
    """Texts that are drawn, with the lines of one sentence in one piece."""
    return [named["text"] for name, named in drawn if name in ("label", "operator", "prop", "menu", "progress")
            and named.get("text")]


def spoiled(scene, name: str) -> None:
    """Bring the scene into a state in which the panel has something to say."""
    lfsr, state = scene.lfsr, bpy.context.window_manager.lfsr
    if name == "profile":
        lfsr.display, lfsr.profile_file = "FILE", "/no/such/profile.toml"
    elif name == "scale":
        lfsr.scale = "5"
    elif name == "texture":
        image = bpy.data.images.new("wood", 1, 1)
        image.source, image.filepath, image.use_fake_user = "FILE", "/no/such/folder/wood.png", True
    elif name == "lens sheet":
        lfsr.display, lfsr.subpixels = "looking-glass-16-gen3", True
    elif name == "one sample":
        lfsr.samples = 1
    elif name == "one ray":
        lfsr.display, lfsr.scale, lfsr.samples = "bupt-32in-8k", "1", 1
    elif name == "warning":
        state.message = "the scene is dark: choose another light, or see /tmp/lfsr-1/log.txt"
    last.check(scene)
    state.show_problems = True


STATES = ("as it is", "profile", "scale", "texture", "lens sheet", "one sample", "one ray", "warning")


@pytest.mark.parametrize("state", STATES)
def test_the_panels_texts_are_plain(tmp_path, state):
    with panel.registered():
        spoiled(panel.artist_scene(tmp_path), state)
        everything = [*draw_all().values(), draw(panels.LFSR_PT_live)]
        wrong = [wrong_message(text) for drawn in everything for text in texts_in(drawn)]
        starts = [texts_in(drawn)[0] for drawn in everything if texts_in(drawn)]
    assert [text for text in wrong if text] == []
    assert [text for text in starts if text[:1].islower()] == []


@pytest.mark.parametrize(("message", "shown"), [
    ("no image in /tmp/a/b.c/0001 to preview", "No image in 0001 to preview"),
    (r"file C:\Users\me\wood.png is missing", "File wood.png is missing"),
    ("see https://www.openimagedenoise.org/downloads.html", "See https://www.openimagedenoise.org/downloads.html"),
    ("the output folder is '//lightfield/', 1/2 of it", "The output folder is '//lightfield/', 1/2 of it")])
def test_the_panel_shows_the_names_of_paths_alone(message, shown):
    assert words.for_panel(message) == shown


def test_names_of_numbers_are_labels():
    names = [*summary.METRICS.values()]
    assert [wrong_label(name) for name in names] == [""] * len(names)


@pytest.mark.parametrize(("wrong", "texts"), [
    (wrong_message, ["give --overwrite", "choose one of [2, 4]", "see /tmp/log.txt", "1 samples"]),
    (wrong_label, ["", "Least that Will Do", "fit", "Denoise + Half of the Resolution + Recover"]),
    (wrong_tooltip, ["", "Ends with a full stop.", "begins without a capital"])])
def test_what_is_wrong_is_noticed(wrong, texts):
    assert all(map(wrong, texts))


def test_messages_are_sentences():
    assert words.capitalized("no image") == "No image"
    assert words.capitalized("own.toml: no name") == "own.toml: no name", "a file's name stays"
    assert [words.counted(count, "problem") for count in (0, 1, 2)] == ["0 problems", "1 problem", "2 problems"]
