"""Labels and tooltips of every operator, panel, menu and property follow Blender's rules."""

from __future__ import annotations

import bpy
import pytest

import blender_addon
from blender_addon.settings import words
from blender_addon.ui import summary
from blender_addon.ui.operators import check
from tests.blender.ui.test_panels import draw_all
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
        assert len(check.refresh(scene)) > 1
        drawn = [call for calls in draw_all().values() for call in calls]
        texts = {named["text"] for name, named in drawn if name in ("operator", "prop", "menu") and named.get("text")}
    assert {"Use Box", "Selection", "View", "Camera"} <= texts
    assert [wrong_label(text) for text in texts if wrong_label(text)] == []


def test_names_of_numbers_are_labels():
    names = [*summary.METRICS.values(), "Renders On"]
    assert [wrong_label(name) for name in names] == [""] * len(names)


@pytest.mark.parametrize("label", ["", "Least that Will Do", "fit", "Denoise + Half of the Resolution + Recover"])
def test_a_wrong_label_is_noticed(label):
    assert wrong_label(label)


@pytest.mark.parametrize("tooltip", ["", "Ends with a full stop.", "begins without a capital"])
def test_a_wrong_tooltip_is_noticed(tooltip):
    assert wrong_tooltip(tooltip)


def test_messages_are_sentences():
    assert words.capitalized("no image") == "No image"
    assert words.capitalized("own.toml: no name") == "own.toml: no name", "a file's name stays"
    assert [words.counted(count, "problem") for count in (0, 1, 2)] == ["0 problems", "1 problem", "2 problems"]
