"""Runs inside Blender with the extension enabled: executes what the test sends, on the main thread, as a button would.

    blender --python agent.py -- PORT

Each line is JSON text of a Python source; the answer is one with "value" (of that variable, if set) or "error".
"""

import importlib
import json
import queue
import socket
import sys
import threading
import traceback

import bpy

SECONDS = 0.02
_jobs: queue.SimpleQueue = queue.SimpleQueue()
ADDON = "bl_ext.user_default.lfsr"
_names: dict = {"bpy": bpy}


def main() -> None:
    bpy.context.preferences.view.show_splash = False
    _names["addon"] = importlib.import_module(ADDON)
    connection = socket.create_connection(("127.0.0.1", int(sys.argv[sys.argv.index("--") + 1])))
    threading.Thread(target=_listen, args=(connection,), daemon=True).start()
    bpy.app.timers.register(_work, persistent=True)


def _listen(connection: socket.socket) -> None:
    with connection.makefile("rw", encoding="utf-8") as stream:
        for line in stream:
            answer: queue.SimpleQueue = queue.SimpleQueue()
            _jobs.put((json.loads(line), answer))
            stream.write(json.dumps(answer.get()) + "\n")
            stream.flush()


def _work() -> float:
    while not _jobs.empty():
        source, answer = _jobs.get()
        _names.pop("value", None)
        try:
            with bpy.context.temp_override(**_place()):
                exec(source, _names)
            answer.put({"value": _names.get("value")})
        except BaseException:
            answer.put({"error": traceback.format_exc()})
    return SECONDS


def _place() -> dict:
    """The first window's 3D view, where the sidebar's buttons are."""
    window = bpy.context.window_manager.windows[0]
    if (area := next((area for area in window.screen.areas if area.type == "VIEW_3D"), None)) is None:
        return {"window": window}
    region = next(region for region in area.regions if region.type == "WINDOW")
    return {"window": window, "area": area, "region": region}


main()
