"""Long work that is killed: the same command again takes up what was whole, and ends with the same bytes."""

import json
import os
import signal
import sys
import time
from contextlib import suppress

import bpy
import numpy as np
import pytest

from blender_addon.jobs import folders, session
from blender_addon.ui.operators import render
from lfsr_core.base.messages import Notice
from lfsr_core.frames.frame import read_frame, read_report
from lfsr_core.images.image_files import read_layers, read_png
from lfsr_core.pipeline.make import RENDER_FRACTION
from tests.support import panel
from tests.support.processes import children, lives, start_lfsr, wait_for
from tests.support.scenes import add_box, add_lamp

pytestmark = pytest.mark.skipif(sys.platform != "linux", reason="looks into /proc")
ONE_PASS = ("render", "--method", "bicubic", "--scale", "2", "--spp", "240")
SECONDS_PER_PART = "0.05"


@pytest.fixture
def blend(scene, tmp_path):
    """A box with light and shadow: noise, so that equal pixels are no accident."""
    add_box(scene, (0, 0, 0), (0.5, 0.5, 0.5))
    add_box(scene, (0, 1, 0), (2, 0.1, 2))
    add_lamp(scene)
    bpy.ops.wm.save_as_mainfile(filepath=str(tmp_path / "scene.blend"))
    return tmp_path / "scene.blend"


def start(blend, folder, verb, *options, seconds_per_part=SECONDS_PER_PART):
    return start_lfsr(verb, blend, "-o", folder, "--display", "mini", *options, LFSR_SECONDS_PER_PART=seconds_per_part)


def parts(folder):
    with suppress(FileNotFoundError):  # the render may remove the folder at this moment
        return sorted(folder.with_name(f".{folder.name}-parts").glob("*-*-*-*.exr"))
    return []


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


def kill(program):
    """The command and its Blender, which has a group of its own."""
    for pid in (program.pid, *children(program.pid)):
        os.kill(pid, signal.SIGKILL)
    program.communicate()


def test_an_interrupted_and_killed_render_goes_on_where_it_was(blend, tmp_path):
    folder = tmp_path / "frame"
    program = start(blend, folder, *ONE_PASS)
    wait_for_parts(folder, 1, program)
    (blender,) = children(program.pid)
    program.send_signal(signal.SIGINT)
    said, _ = program.communicate(timeout=30)
    assert program.returncode == 130 and not lives(blender)
    assert f"delete {tmp_path / '.frame-parts'} to start over" in said
    assert not list(tmp_path.glob(".frame-lfsr-*")), "staging is gone"
    done, program = written(folder), start(blend, folder, *ONE_PASS)
    wait_for_parts(folder, len(done) + 1, program)
    kill(program)
    assert not folder.exists() and written(folder).items() >= done.items()
    done = written(folder)
    program, again = start(blend, folder, *ONE_PASS), {}
    while program.poll() is None:
        again |= written(folder)
        time.sleep(0.05)
    assert program.returncode == 0, program.stdout.read()
    assert again.items() >= done.items(), "what was whole is not rendered again"
    assert start(blend, tmp_path / "whole", *ONE_PASS, seconds_per_part="60").wait(120) == 0
    resumed, wanted = (read_layers(tmp_path / name / "lr_eia.exr") for name in ("frame", "whole"))
    assert set(resumed) == set(wanted)
    for layer, pixels in wanted.items():
        np.testing.assert_array_equal(resumed[layer], pixels, layer, strict=True)
    assert sorted(path.name for path in tmp_path.iterdir()) == ["frame", "scene.blend", "whole"]


def test_a_render_cancelled_in_the_panel_goes_on_with_the_next_press(tmp_path, monkeypatch):
    """With an edit it starts over; then it goes on, saved or not."""
    monkeypatch.setenv("LFSR_SECONDS_PER_PART", SECONDS_PER_PART)
    with panel.registered():
        scene = panel.artist_scene(tmp_path)
        scene.lfsr.samples = 300
        bpy.data.lights["Sun"].energy += 1  # not saved
        folder = folders.frame_folder(scene)

        def press():
            return session.start("Render EIA", render.image_job(scene))

        def cancel():
            assert bpy.ops.lfsr.cancel() == {"FINISHED"}
            assert bpy.context.window_manager.lfsr.message == "Cancelled. Render again to continue"
            return written(folder)

        press()
        panel.wait_for(lambda: len(parts(folder)) >= 1)
        done = cancel()
        bpy.data.objects["Box"].location.z += 0.1
        task = press()
        panel.wait_for(lambda: task.notices and len(parts(folder)) >= 2)
        assert task.notices == [Notice("parts-removed", {"input": "scene file"})]
        assert not set(done) & set(written(folder))
        done = cancel()
        bpy.ops.wm.save_mainfile()
        rows = sum(int(last) - int(first) for first, last in (name.split("-")[-3:-1] for name in done))
        task, fractions, again = press(), [], {}

        def ended():
            fractions.append(task.fraction)
            again.update(written(folder))
            return session.current() is None
        panel.wait_for(ended)
        assert again.items() >= done.items() and not task.notices
        fraction = RENDER_FRACTION * rows / read_layers(folder / "lr_eia.exr")["color"].shape[0]
        assert min(filter(None, fractions)) >= 0.99 * fraction > 0, "progress begins at what was kept"
        assert json.loads((folder / "report.json").read_text())["method"] == "bicubic"
        assert [path.name for path in folder.parent.iterdir()] == [folder.name]


SECONDS_TO_END = 10.0
FEW, ENDLESS = "1", "400000"


def lfsr(blend, samples):
    temporary = blend.parent / "tmp"
    temporary.mkdir(exist_ok=True)
    return start_lfsr("render", blend, "-o", blend.parent / "frame", "--display", "mini", "--method", "bicubic",
                      "--spp", samples, TMPDIR=temporary)


def rendering(blend):
    """The command in the middle of an endless render, and its Blender."""
    program = lfsr(blend, ENDLESS)
    next(line for line in program.stdout if "render" in line)
    return program, *children(program.pid)


@pytest.mark.parametrize("sent", [signal.SIGKILL, signal.SIGHUP, pytest.param(signal.SIGQUIT, marks=pytest.mark.long)])
def test_blender_ends_with_the_command(blend, sent):
    program, blender = rendering(blend)
    try:
        program.send_signal(sent)
        program.wait(20)
        wait_for(lambda: not lives(blender), SECONDS_TO_END)
    finally:
        program.kill()
    assert not list((blend.parent / "tmp").glob("blender_*"))
    assert len(list(blend.parent.glob(".frame-*"))) == (1 if sent == signal.SIGKILL else 0)
    if sent == signal.SIGKILL:
        assert lfsr(blend, FEW).wait(120) == 0
        assert sorted(path.name for path in blend.parent.iterdir()) == ["frame", "scene.blend", "tmp"]


def test_a_blender_that_is_killed_leaves_nothing_in_the_temporary_folder(blend):
    program, blender = rendering(blend)
    try:
        os.kill(blender, signal.SIGKILL)
        assert "Blender stopped with signal 9" in program.stdout.read() and program.wait(20) == 2
    finally:
        program.kill()
    assert not list((blend.parent / "tmp").iterdir())


def whole(folder):
    """Every file under its final name can be read to its end."""
    if (folder / "frame.json").exists():
        read_frame(folder)
        read_layers(folder / "lr_eia.exr")
    for name in ("eia.png", "mask.png"):
        if (folder / name).exists():
            read_png(folder / name)
    if (folder / "report.json").exists():
        read_report(folder)


@pytest.mark.parametrize("moments", [3, pytest.param(100, marks=pytest.mark.long)])
def test_kills_at_any_moment_leave_nothing_half_written(blend, moments):
    started = time.monotonic()
    assert lfsr(blend, FEW).wait(120) == 0
    duration, folder = time.monotonic() - started, blend.parent / "frame"
    for moment in range(moments):
        program = lfsr(blend, FEW)
        time.sleep(duration * (moment + 0.5) / moments)
        blenders = children(program.pid) if lives(program.pid) else []
        program.kill()
        program.wait(20)
        wait_for(lambda: not any(map(lives, blenders)), SECONDS_TO_END)  # noqa: B023
        whole(folder)
    assert lfsr(blend, FEW).wait(120) == 0
    assert sorted(path.name for path in folder.iterdir()) == ["eia.png", "frame.json", "lr_eia.exr", "mask.png",
                                                              "report.json"]
    assert sorted(path.name for path in blend.parent.iterdir()) == ["frame", "scene.blend", "tmp"]
    assert not list((blend.parent / "tmp").iterdir())
