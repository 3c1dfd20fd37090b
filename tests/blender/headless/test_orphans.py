"""However the command ends, Blender ends with it, and the next run clears away what was left."""

import os
import signal
import sys
import time

import bpy
import pytest

from lfsr_core.frames.frame import read_frame
from lfsr_core.frames.request import read_report
from lfsr_core.images.exr import read_layers
from lfsr_core.images.png import read_png
from tests.support.processes import children, lives, start_lfsr, wait_for
from tests.support.scenes import add_box, emission

pytestmark = pytest.mark.skipif(sys.platform != "linux", reason="looks into /proc")
SECONDS_TO_END = 10.0
FEW, ENDLESS = "1", "400000"


@pytest.fixture
def blend(scene, tmp_path):
    add_box(scene, (0, 0, 0), (0.5, 0.5, 0.5), emission((1, 0.5, 0.2)))
    bpy.ops.wm.save_as_mainfile(filepath=str(tmp_path / "scene.blend"))
    return tmp_path / "scene.blend"


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


@pytest.mark.parametrize("moments", [5, pytest.param(100, marks=pytest.mark.long)])
def test_kills_at_any_moment_leave_nothing_half_written(blend, moments):
    started = time.monotonic()
    assert lfsr(blend, FEW).wait(120) == 0
    duration, folder = time.monotonic() - started, blend.parent / "frame"
    for moment in range(moments):
        program = lfsr(blend, FEW)
        time.sleep(duration * (moment + 0.5) / moments)
        found = children(program.pid) if lives(program.pid) else []
        program.kill()
        program.wait(20)
        wait_for(lambda: not any(map(lives, found)), SECONDS_TO_END)  # noqa: B023
        whole(folder)
    assert lfsr(blend, FEW).wait(120) == 0
    assert sorted(path.name for path in folder.iterdir()) == ["eia.png", "frame.json", "lr_eia.exr", "mask.png",
                                                              "report.json"]
    assert sorted(path.name for path in blend.parent.iterdir()) == ["frame", "scene.blend", "tmp"]
    assert not list((blend.parent / "tmp").iterdir())
