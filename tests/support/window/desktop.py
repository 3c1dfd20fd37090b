"""A virtual screen with a real Blender window on it, and the extension installed as an artist installs it.

LFSR_WINDOW_BLENDER names the folder that scripts/window_blender.sh made: Blender,
Xvfb, xdotool and ImageMagick run inside it. LFSR_SCREENSHOTS names a folder where the screenshots are kept.
"""

import json
import os
import shutil
import socket
import subprocess
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import pytest

SIZE = (1280, 1000)   # software OpenGL pays for every pixel
AGENT = Path(__file__).with_name("agent.py")
SCRIPTS = Path(__file__).resolve().parents[3] / "scripts"
SCRIPT = SCRIPTS / "window_blender.sh"
TAB = "[region.active_panel_category for region in bpy.context.area.regions if region.type == 'UI'][0]"
VARIABLE, SCREENSHOTS = "LFSR_WINDOW_BLENDER", "LFSR_SCREENSHOTS"
NEEDS_WINDOW = [pytest.mark.window, pytest.mark.skipif(
    VARIABLE not in os.environ, reason=f"no {VARIABLE}: scripts/window_blender.sh makes a Blender with a window")]
SECONDS_TO_START = 120
SECONDS_TO_INSTALL = 120
SECONDS_TO_RENDER = 240
TASK, STATE = "addon.jobs.session.current()", "bpy.context.window_manager.lfsr"
SCENE = """
scene = bpy.context.scene
bpy.data.batch_remove([*scene.objects])
bpy.ops.mesh.primitive_monkey_add(location=(0, 0, 1)); bpy.ops.object.shade_smooth()
bpy.context.object.data.materials.append(paint := bpy.data.materials.new("Red"))
paint.node_tree.nodes["Principled BSDF"].inputs["Base Color"].default_value = 0.8, 0.3, 0.2, 1
bpy.ops.mesh.primitive_plane_add(size=60, location=(0, 0, -0.2))
bpy.context.object.name = "Floor"
bpy.ops.object.light_add(type="AREA", radius=3, location=(3, -4, 5))
bpy.context.object.data.energy = 600
for item in scene.objects:
    item.select_set(item.name == "Suzanne")
scene.lfsr.display, scene.lfsr.scale, scene.lfsr.samples, scene.lfsr.method = "mini", "2", 2, "bilinear"
scene.render.engine, scene.render.resolution_x = "CYCLES", 321
scene.cycles.samples, scene.cycles.pixel_filter_type = 77, "GAUSSIAN"
bpy.ops.wm.save_as_mainfile(filepath=FILE)
"""


def inside(*command: object) -> list[str]:
    """``command`` as it runs inside the folder of the window's Blender; it sees the tests' folders."""
    # Those lie in the system's temporary folder, which the script shares; temporary files stay in the suite's own.
    return ["env", f"TMPDIR={os.environ['PYTEST_DEBUG_TEMPROOT']}", str(SCRIPT), os.environ[VARIABLE],
            "env", f"TMPDIR={os.environ['TMPDIR']}", *map(str, command)]


class Window:
    """A running Blender: Python runs inside it, keys and clicks come from outside."""

    def __init__(self, stream: Any, environment: dict[str, str], process: subprocess.Popen, folder: Path) -> None:
        self._stream, self._environment = stream, environment
        self.process, self.folder = process, folder

    def run(self, source: str) -> Any:
        """Execute ``source`` on Blender's main thread; returns its variable ``value``."""
        self._stream.write(json.dumps(source) + "\n")
        self._stream.flush()
        answer = self._stream.readline()
        assert answer, f"Blender ended with {self.process.poll()}"
        answer = json.loads(answer)
        assert "error" not in answer, answer["error"]
        return answer["value"]

    def get(self, expression: str) -> Any:
        """Value of ``expression`` inside Blender."""
        return self.run(f"value = {expression}")

    def until(self, expression: str, seconds: float) -> Any:
        """Wait until ``expression`` is true inside Blender; its value."""
        ends = time.monotonic() + seconds
        while not (value := self.get(expression)):
            assert time.monotonic() < ends, f"not within {seconds} s: {expression}"
            time.sleep(0.05)
        return value

    def settle(self) -> None:
        """Wait until Blender has drawn what it was told and read the keys it was sent."""
        # The agent answers once per turn of Blender's loop, and every turn ends with a redraw.
        for _ in range(4):
            self.run("value = None")
            time.sleep(0.05)

    def xdotool(self, *arguments: object) -> None:
        """Keys and pointer, as from a person."""
        subprocess.run(inside("xdotool", *arguments), env=self._environment, check=True, timeout=30)
        self.settle()

    def windows(self) -> list[str]:
        """Numbers of Blender's windows on the screen, the newest last."""
        ended = subprocess.run(inside("xdotool", "search", "--onlyvisible", "--class", "Blender"),
                               env=self._environment, check=True, timeout=30, capture_output=True, text=True)
        return ended.stdout.split()

    def place(self, number: str, width: int, height: int) -> None:
        """Move a window to the screen's upper left corner and give it this size, as a window manager does."""
        self.xdotool("windowsize", number, width, height)
        self.xdotool("windowmove", number, 0, 0)

    def click(self, x: int, y: int) -> None:
        """Press the left button at pixel (x, y) from the top left."""
        # In two steps, so that Blender notices which button is under the pointer.
        self.xdotool("mousemove", x - 2, y - 2)
        self.xdotool("mousemove", x, y)
        self.xdotool("click", 1)

    def scroll_down(self) -> None:
        """Turn the wheel over the sidebar until its end."""
        x, width = self.get("[(r.x, r.width) for r in bpy.context.area.regions if r.type == 'UI'][0]")
        self.xdotool("mousemove", x + width // 2, 600)
        self.xdotool("click", "--repeat", 30, "--delay", 20, 5)

    def close_others(self) -> None:
        """Close every window of Blender but the first."""
        self.run("for other in list(bpy.context.window_manager.windows)[1:]:\n"
                 "    with bpy.context.temp_override(window=other):\n"
                 "        bpy.ops.wm.window_close()")

    def open_tab(self) -> tuple[int, int, int, int]:
        """Open the sidebar at the tab Light Field; its place on the screen: left, top, width, height."""
        self.run("bpy.context.space_data.show_region_ui = True")
        self.settle()
        x, y, width, height = self.get("[(r.x, r.y, r.width, r.height) for r in bpy.context.area.regions "
                                       "if r.type == 'UI'][0]")
        top = self.get("bpy.context.window.height") - y - height
        for below in range(100, 500, 20):   # down the column of tabs
            self.click(x + width - 12, top + below)
            if self.get(TAB) == "Light Field":
                break
        assert self.get(TAB) == "Light Field"
        return x, top, width, height

    def screenshot(self, name: str) -> Path:
        """Picture of the whole screen."""
        self.settle()
        path = self.folder / f"{name}.png"
        subprocess.run(inside("import", "-window", "root", path), env=self._environment, check=True, timeout=60)
        return path


@contextmanager
def blender_window(folder: Path) -> Iterator[Window]:
    """A fresh Blender in a window that fills the screen, with the extension built, installed and enabled."""
    subprocess.run([sys.executable, SCRIPTS / "build_extension.py", "--output", folder / "built"], check=True)
    [archive] = (folder / "built").glob("*.zip")
    with _screen(folder) as display, socket.create_server(("127.0.0.1", 0)) as server:
        environment = os.environ | {"DISPLAY": display, "HOME": str(folder),
                                    "TMPDIR": os.environ["PYTEST_DEBUG_TEMPROOT"],  # which Blender's system sees
                                    "BLENDER_USER_RESOURCES": str(folder / "blender")}
        shutil.copy(AGENT, folder)
        install = inside("blender", "--command", "extension", "install-file", "--repo", "user_default", "--enable",
                         archive)
        start = inside("blender", "--gpu-backend", "opengl", "--window-geometry", 0, 0, *SIZE,
                       "--python", folder / AGENT.name, "--", server.getsockname()[1])
        with (folder / "blender.log").open("w") as log:
            subprocess.run(inside("blender", "--command", "extension", "validate", archive), env=environment,
                           stdout=log, stderr=subprocess.STDOUT, check=True, timeout=SECONDS_TO_INSTALL)
            subprocess.run(install, env=environment, stdout=log, stderr=subprocess.STDOUT, check=True,
                           timeout=SECONDS_TO_INSTALL)
            process = subprocess.Popen(start, env=environment, stdout=log, stderr=subprocess.STDOUT)
        try:
            server.settimeout(SECONDS_TO_START)
            connection, _ = server.accept()
            with connection, connection.makefile("rw", encoding="utf-8") as stream:
                yield Window(stream, environment, process, folder)
        finally:
            _end(process)
            for picture in folder.glob("*.png") if SCREENSHOTS in os.environ else ():
                shutil.copy(picture, os.environ[SCREENSHOTS])


@contextmanager
def monkey_window(folder: Path) -> Iterator[Window]:
    """The same with a monkey over a floor, to be rendered for *mini*, as scene.blend in ``folder``."""
    with blender_window(folder) as window:
        window.run(f"FILE = {str(folder / 'scene.blend')!r}" + SCENE)
        yield window


@contextmanager
def _screen(folder: Path) -> Iterator[str]:
    """A virtual screen whose pixels lie in a file of ``folder``, for scripts/lab/live_latency.py."""
    reader, writer = os.pipe()
    command = inside("Xvfb", "-displayfd", writer, "-screen", "0", f"{SIZE[0]}x{SIZE[1]}x24", "+extension", "GLX",
                     "-fbdir", folder)
    process = subprocess.Popen(command, pass_fds=[writer], stderr=subprocess.DEVNULL)
    os.close(writer)
    try:
        with os.fdopen(reader) as numbers:
            yield f":{numbers.readline().strip()}"
    finally:
        _end(process)


def _end(process: subprocess.Popen) -> None:
    if process.poll() is None:
        process.terminate()
        try:
            process.wait(3)
        except subprocess.TimeoutExpired:
            process.kill()
            process.wait()
