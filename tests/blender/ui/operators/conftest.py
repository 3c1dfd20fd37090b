"""A file whose frame was rendered by the button, opened again."""

from pathlib import Path

import bpy
import pytest


@pytest.fixture
def opened(rendered: Path) -> bpy.types.Scene:
    """The scene of ``rendered``, a fixture of each module."""
    bpy.ops.wm.open_mainfile(filepath=str(rendered))
    return bpy.context.scene
