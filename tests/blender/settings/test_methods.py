"""Methods of the panel's menu."""

from __future__ import annotations

import zlib

from blender_addon.settings import methods
from lfsr_core.reconstruct.method_name import MethodName


def test_methods_name_their_layers_and_have_lasting_numbers():
    items = methods.method_items()
    assert len({item[4] for item in items}) == len(items)
    # The number stored in artists' files: a new method must not shift it.
    assert {item[0]: item[4] for item in items}["oidn+bicubic"] == zlib.crc32(b"oidn+bicubic") & 0x7FFFFFFF
    assert MethodName.parse("oidn-guided+bicubic").layers == MethodName.parse("light").layers == ("albedo", "normal")
    assert MethodName.parse("oidn+bicubic").layers == MethodName.parse("bicubic").layers == ()


def test_every_method_of_the_menu_is_one_of_the_second_stage():
    for name, *_ in methods.method_items():
        assert MethodName.parse(name).text == name
