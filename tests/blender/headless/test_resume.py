"""Long work that is killed: the same command again takes up what was whole, and ends with the same bytes."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
import time
from contextlib import suppress
from pathlib import Path

import bpy
import numpy as np
import pytest

from blender_addon.jobs import session
from blender_addon.scene import folders
from blender_addon.ui.operators import render
from lfsr_core.base.notices import Notice
from lfsr_core.images.exr import read_layers
from lfsr_core.pipeline.make import RENDER_FRACTION
from tests.support import panel
from tests.support.scenes import ROOT, add_box

WAYS = {
    "one pass": ("render", "--method", "bicubic", "--scale", "2", "--spp", "500"),
    "reference": ("reference", "--spp", "200", "--lenses", "24"),
}
SECONDS_PER_PART = "0.05"


@pytest.fixture
def blend(scene, tmp_path):
    """A box with light and shadow: noise, so that equal pixels are no accident."""
    add_box(scene, (0, 0, 0), (0.5, 0.5, 0.5))
    add_box(scene, (0, 1, 0), (2, 0.1, 2))
    lamp = bpy.data.objects.new("lamp", bpy.data.lights.new("lamp", "AREA"))
    lamp.data.energy, lamp.data.size, lamp.location, lamp.rotation_euler = 200, 2.0, (1, -4, 2), (1.1, 0, 0.2)
    scene.collection.objects.link(lamp)
    bpy.ops.wm.save_as_mainfile(filepath=str(tmp_path / "scene.blend"))
    return tmp_path / "scene.blend"


def start(blend, folder, verb, *options, seconds_per_part=SECONDS_PER_PART):
    command = [sys.executable, "-m", "lfsr_core.cli", verb, blend, "-o", folder, "--display", "mini", *options]
    return subprocess.Popen(command, cwd=ROOT, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True,
                            start_new_session=True, env=os.environ | {"LFSR_SECONDS_PER_PART": seconds_per_part})


def parts(folder):
    return sorted(folder.with_name(f".{folder.name}-parts").glob("*-*-*-*.exr"))


def written(folder):
    """When each part was written; none of those that the render removes at this moment."""
    times = {}
    for path in parts(folder):
        with suppress(FileNotFoundError):
            times[path.name] = path.stat().st_mtime_ns
    return times


def wait_for_parts(folder, count, program):
    while len(parts(folder)) < count:
        assert program.poll() is None, program.communicate()
        time.sleep(0.02)


def end_group(program, number):
    """Send to the command and to its Blender, which has a group of its own."""
    blenders = Path(f"/proc/{program.pid}/task/{program.pid}/children").read_text().split()
    for pid in (program.pid, *map(int, blenders)):
        os.killpg(pid, number)
    program.communicate()


def layers(folder):
    return {path.name: read_layers(path) for path in folder.glob("*.exr")}


@pytest.mark.skipif(sys.platform != "linux", reason="looks into /proc")
@pytest.mark.parametrize("way", WAYS)
def test_a_killed_render_goes_on_where_it_was(blend, tmp_path, way):
    folder = tmp_path / "frame"
    program = start(blend, folder, *WAYS[way])
    wait_for_parts(folder, 2, program)
    end_group(program, signal.SIGKILL)
    assert not folder.exists()
    done = written(folder)
    program = start(blend, folder, *WAYS[way])
    again = {}
    while program.poll() is None:
        again |= written(folder)
        time.sleep(0.05)
    assert program.returncode == 0, program.stdout.read()
    assert {name: again.get(name) for name in done} == done, "what was whole is not rendered again"
    assert start(blend, tmp_path / "whole", *WAYS[way], seconds_per_part="60").wait(120) == 0
    found, wanted = layers(folder), layers(tmp_path / "whole")
    assert set(found) == set(wanted) and len(wanted) == (2 if way == "reference" else 1)
    for name, images in wanted.items():
        assert set(found[name]) == set(images)
        for layer, pixels in images.items():
            np.testing.assert_array_equal(found[name][layer], pixels, f"{name} {layer}", strict=True)
    assert sorted(path.name for path in tmp_path.iterdir()) == ["frame", "scene.blend", "whole"]


@pytest.mark.skipif(sys.platform != "linux", reason="looks into /proc")
def test_an_interrupted_render_says_what_is_kept_and_a_changed_scene_starts_anew(blend, tmp_path):
    folder = tmp_path / "frame"
    program = start(blend, folder, *WAYS["one pass"])
    wait_for_parts(folder, 1, program)
    program.send_signal(signal.SIGINT)
    said, _ = program.communicate(timeout=30)
    assert program.returncode == 130
    assert f"delete {tmp_path / '.frame-parts'} to start over" in said
    assert not list(tmp_path.glob(".frame-????????")), "staging is gone"
    bpy.data.lights["lamp"].energy *= 2
    bpy.ops.wm.save_as_mainfile(filepath=str(blend))
    said, _ = start(blend, folder, *WAYS["one pass"], seconds_per_part="60").communicate(timeout=120)
    assert "other scene file: they are removed, and the render starts from the beginning" in said
    assert sorted(path.name for path in tmp_path.iterdir() if path.suffix != ".blend1") == ["frame", "scene.blend"]


def test_a_render_cancelled_in_the_panel_goes_on_with_the_next_press(tmp_path, monkeypatch):
    """Saved or not; with an edit it starts over."""
    monkeypatch.setenv("LFSR_SECONDS_PER_PART", SECONDS_PER_PART)
    with panel.registered():
        scene = panel.artist_scene(tmp_path)
        scene.lfsr.samples = 800
        bpy.data.lights["Sun"].energy += 1  # not saved
        folder = folders.frame_folder(scene)

        def press():
            return session.start("Render EIA", render.image_job(scene))

        def cancel():
            assert bpy.ops.lfsr.cancel() == {"FINISHED"}
            assert bpy.context.window_manager.lfsr.message == "Cancelled. Render again to continue"
            return written(folder)

        def same(before):
            return {name: written(folder).get(name) for name in before} == before

        press()
        panel.wait_for(lambda: len(parts(folder)) >= 2)
        for save in (False, True):
            done = cancel()
            if save:
                bpy.ops.wm.save_mainfile()
            task = press()
            count = len(done)
            panel.wait_for(lambda count=count: len(parts(folder)) > count)
            assert same(done) and not task.notices
        rows = sum(int(last) - int(first) for first, last in (name.split("-")[-3:-1] for name in cancel()))
        task, fractions = press(), []

        def ended():
            fractions.append(task.fraction)
            return session.current() is None
        panel.wait_for(ended)
        fraction = RENDER_FRACTION * rows / read_layers(folder / "lr_eia.exr")["color"].shape[0]
        assert min(filter(None, fractions)) >= 0.99 * fraction > 0, "progress begins at what was kept"
        assert json.loads((folder / "report.json").read_text())["method"] == "bicubic"
        assert [path.name for path in folder.parent.iterdir()] == [folder.name]
        press()
        panel.wait_for(lambda: len(parts(folder)) >= 1)
        done = cancel()
        bpy.data.objects["Box"].location.z += 0.1
        task = press()
        panel.wait_for(lambda: task.notices)
        assert task.notices[0] == Notice("parts-removed", {"input": "scene file"})
        assert not set(done) & set(written(folder))
