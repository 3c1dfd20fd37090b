"""Tests that need Blender, apart from the user's settings, a fresh scene each; without bpy they fail on CI alone."""

import importlib.util
import os
import tempfile

import pytest

MISSING = importlib.util.find_spec("bpy") is None and os.environ.get("CI") != "true"

if MISSING:
    collect_ignore_glob = ["test_*.py"]
else:
    # Before bpy is imported: start-up files and preferences of the user would change the renders.
    for _name in ("BLENDER_USER_RESOURCES", "BLENDER_USER_CONFIG", "BLENDER_USER_SCRIPTS"):
        os.environ[_name] = tempfile.mkdtemp(prefix="lfsr-blender-")
    import bpy

    import blender_addon
    from blender_addon.scene import light
    from tests.support import panel
    from tests.support.scenes import fresh_scene


def pytest_report_header() -> str:
    return "Blender tests: left out, the bpy module is not installed" if MISSING else f"bpy {bpy.app.version_string}"


@pytest.fixture
def scene(request):
    """An artist's scene with the add-on on where jobs, panels and the live view are tested, else an empty one."""
    if {"jobs", "live", "ui"} & {*request.path.parts}:
        return request.getfixturevalue("artist")
    return fresh_scene()


@pytest.fixture(autouse=True, scope="module")
def quick_sky():
    """World images are sampled by a map of 512 columns: Cycles takes two seconds for its own of 4096."""
    def add_light(*arguments):
        world = real(*arguments)
        world.cycles.sampling_method, world.cycles.sample_map_resolution = "MANUAL", 512
        return world
    real, light.add_light = light.add_light, add_light
    yield
    light.add_light = real


@pytest.fixture
def artist(tmp_path):
    """An artist's scene, saved in a file, with the add-on on."""
    with panel.registered():
        yield panel.artist_scene(tmp_path)


@pytest.fixture(scope="module")
def add_on():
    """The add-on is on for a module's tests."""
    with panel.registered():
        yield


@pytest.fixture
def addon():
    """The add-on, enabled as Blender does it, with its preferences; disabled afterwards."""
    bpy.ops.preferences.addon_enable(module=blender_addon.__name__)
    yield bpy.context.preferences.addons[blender_addon.__name__].preferences
    bpy.ops.preferences.addon_disable(module=blender_addon.__name__)
