"""The Test button of the preferences."""

import os

import bpy
import pytest

from tests.support import panel


def test_python_that_lacks_packages_is_reported_by_the_button(addon, bare_python):
    addon.python_path = bare_python
    panel.refused("cannot run the second stage.*No module named 'numpy'.*choose another", bpy.ops.lfsr.test_python)


@pytest.mark.parametrize("name", ["missing", "text"])
def test_path_that_is_no_python_is_reported_by_the_button(addon, tmp_path, name):
    (tmp_path / "text").write_text("not a program")
    addon.python_path = os.fspath(tmp_path / name)
    panel.refused(f"{name}' (does not exist|cannot be started).*choose another", bpy.ops.lfsr.test_python)
