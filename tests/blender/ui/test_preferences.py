"""The Test button of the preferences."""

from __future__ import annotations

import os
import subprocess
import sys

import bpy
import pytest

import blender_addon
from blender_addon.background import runtime


@pytest.fixture
def addon(monkeypatch):
    """The add-on, enabled as Blender does it, with its preferences; disabled afterwards."""
    monkeypatch.delenv(runtime.PYTHON_VARIABLE, raising=False)
    bpy.ops.preferences.addon_enable(module=blender_addon.__name__)
    yield bpy.context.preferences.addons[blender_addon.__name__].preferences
    bpy.ops.preferences.addon_disable(module=blender_addon.__name__)


@pytest.fixture
def bare_python(tmp_path):
    """A Python without packages."""
    subprocess.run([sys.executable, "-m", "venv", "--without-pip", tmp_path / "bare"], check=True)
    return str(tmp_path / "bare" / "bin" / "python")


def test_python_that_lacks_packages_is_reported_by_the_button(addon, bare_python):
    addon.python_path = bare_python
    with pytest.raises(RuntimeError, match="cannot run the second stage.*No module named 'numpy'.*choose another"):
        bpy.ops.lfsr.test_python()


@pytest.mark.parametrize("name", ["missing", "text"])
def test_path_that_is_no_python_is_reported_by_the_button(addon, tmp_path, name):
    (tmp_path / "text").write_text("not a program")
    addon.python_path = os.fspath(tmp_path / name)
    with pytest.raises(RuntimeError, match=f"{name}' (does not exist|cannot be started).*choose another"):
        bpy.ops.lfsr.test_python()
