"""Methods of the panel's menu."""

from __future__ import annotations

import zlib

from blender_addon.scene import methods
from lfsr_core.plan.options import default_methods
from lfsr_core.reconstruct.methods import DEFAULT_METHOD, FAST_METHOD, MethodName


def test_the_default_is_first_and_numbers_last():
    items = methods.method_items()
    assert len({item[4] for item in items}) == len(items)
    # The number stored in artists' files: a new method must not shift it.
    assert {item[0]: item[4] for item in items}["oidn+bilinear"] == zlib.crc32(b"oidn+bilinear") & 0x7FFFFFFF
    assert [item[:2] for item in items[:3]] == [
        (DEFAULT_METHOD, "Default"), (FAST_METHOD, "Fast"), ("denoise", "Every View")]


def test_every_method_of_the_menu_is_one_of_the_second_stage():
    for name, *_ in methods.method_items():
        assert not name or MethodName.parse(name).text == name


def test_every_method_that_a_plan_finds_is_in_the_menu():
    listed = {name for name, *_ in methods.method_items()}
    assert {MethodName.parse(name).at_scale(scale).text for name in default_methods() for scale in (1, 4)} <= listed
