"""Move this Blender's windows on the desktop, which Blender itself does not do: under X11 and Windows.

Elsewhere (Wayland, macOS) no window is found, and the user drags it.
"""

from __future__ import annotations

import ctypes
import os
import sys
from collections.abc import Iterator

Rectangle = tuple[int, int, int, int]  # left, top, width, height in pixels of the desktop
WITHOUT_Z_ORDER = 0x0004
LIBRARY = "libX11.so.6"


def windows() -> set[int]:
    """Return the system's numbers of this process's windows; none where they cannot be moved."""
    return _of_windows() if sys.platform == "win32" else _of_x11()


def move(window: int, place: Rectangle) -> None:
    """Move one of ``windows`` and give it that size."""
    if sys.platform == "win32":
        ctypes.windll.user32.SetWindowPos(ctypes.c_void_p(window), None, *place, WITHOUT_Z_ORDER)
        return
    with _X11() as server:
        server.library.XMoveResizeWindow(server.display, ctypes.c_ulong(window), *place)


def _of_windows() -> set[int]:
    found: set[int] = set()
    if sys.platform == "win32":
        user = ctypes.windll.user32

        @ctypes.WINFUNCTYPE(ctypes.c_bool, ctypes.c_void_p, ctypes.c_void_p)
        def visit(window: int, _: int) -> bool:
            process = ctypes.c_ulong()
            user.GetWindowThreadProcessId(ctypes.c_void_p(window), ctypes.byref(process))
            if process.value == os.getpid() and user.IsWindowVisible(ctypes.c_void_p(window)):
                found.add(window)
            return True
        user.EnumWindows(visit, None)
    return found


def _of_x11() -> set[int]:
    with _X11() as server:
        return {window for window in server.below(server.root) if server.process(window) == os.getpid()}


class _X11:
    """A connection to the X server; without one, its tree is empty."""

    def __enter__(self) -> _X11:
        self.display = self.root = None
        try:
            self.library = ctypes.CDLL(LIBRARY)
        except OSError:
            return self  # a system without X11
        self.library.XOpenDisplay.restype = ctypes.c_void_p
        self.library.XDefaultRootWindow.restype = self.library.XInternAtom.restype = ctypes.c_ulong
        self.display = ctypes.c_void_p(self.library.XOpenDisplay(None))
        if self.display:
            self.root = self.library.XDefaultRootWindow(self.display)
        return self

    def __exit__(self, *_: object) -> None:
        if self.display:
            self.library.XCloseDisplay(self.display)  # which sends what was asked first

    def below(self, window: int | None) -> Iterator[int]:
        """Yield all windows in a window."""
        if window is None:
            return
        root, parent, count = ctypes.c_ulong(), ctypes.c_ulong(), ctypes.c_uint()
        children = ctypes.POINTER(ctypes.c_ulong)()
        self.library.XQueryTree(self.display, ctypes.c_ulong(window),
                                *map(ctypes.byref, (root, parent, children, count)))
        found = children[:count.value]
        if found:
            self.library.XFree(children)
        for child in found:
            yield child
            yield from self.below(child)

    def process(self, window: int) -> int | None:
        """Return the process that a window says it belongs to."""
        atom = self.library.XInternAtom(self.display, b"_NET_WM_PID", 0)
        kind, bits, items, rest = ctypes.c_ulong(), ctypes.c_int(), ctypes.c_ulong(), ctypes.c_ulong()
        data = ctypes.POINTER(ctypes.c_ulong)()
        self.library.XGetWindowProperty(
            self.display, ctypes.c_ulong(window), ctypes.c_ulong(atom), ctypes.c_long(0), ctypes.c_long(1), 0,
            ctypes.c_ulong(0), *map(ctypes.byref, (kind, bits, items, rest, data)))
        if not items.value:
            return None
        value = int(data[0])
        self.library.XFree(data)
        return value
