"""A stand-in for Looking Glass Bridge, which serves HTTP on this computer as Bridge 2.6.3 is known to.

Only PUT counts: POST and unknown endpoints are answered with 200 and nothing. ``instance_playlist`` of a known name
keeps its entries, and playing what is playing already changes nothing. (After ``delete_playlist``, which is never sent,
Bridge answers nothing any more.)
"""

import contextlib
import json
import socket
import threading
from collections.abc import Iterator
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from typing import Any

from tests.calibration.test_makers import CELLS, NEW, OLD

TOKEN = "3ab41b3c-70a1"
HUGE = 17_000_000


def wrapped(value: object) -> dict[str, object]:
    return {"name": "", "type": "WSTRING", "value": value}


def device(index: int, name: str, hardware: str, calibration: dict | None, quilt: dict | None = None) -> dict:
    """An entry of available_output_devices; ``calibration`` with plain numbers, None for a plain monitor."""
    text = json.dumps({"configVersion": "3.0", "serial": name} | {
        key: {"value": value} if isinstance(value, (int, float)) and key != "CellPatternMode" else value
        for key, value in calibration.items()}) if calibration else ""
    fields = {"calibration": text, "defaultQuilt": json.dumps(quilt) if quilt else "", "hardwareVersion": hardware,
              "hwid": name, "index": index, "state": "ok", "windowCoords": {"x": 1920 * (index + 1), "y": 0}}
    return wrapped({key: wrapped(value) for key, value in fields.items()})


class Handler(BaseHTTPRequestHandler):
    """One request; a fault is a method of its name."""

    def do_GET(self) -> None:
        self._answer(None)

    do_POST = do_GET

    def do_PUT(self) -> None:
        endpoint, body = self.path.strip("/"), json.loads(self.rfile.read(int(self.headers["Content-Length"])))
        with self.server.lock:
            answer = self.server.answer(endpoint, body)
            self.server.requests.append({"endpoint": endpoint, "body": body, "shown": self.server.shown,
                                         "headers": dict(self.headers)})
        fault = self.server.faults.get(endpoint)
        with contextlib.suppress(OSError):
            getattr(self, f"_{fault}")() if fault else self._answer(answer)

    def _answer(self, data: object) -> None:
        self._send(b"" if data is None else json.dumps(data).encode())

    def _send(self, content: bytes, status: int = 200, length: int | None = None, **headers: str) -> None:
        self.send_response(status)
        self.send_header("Content-Length", str(len(content) if length is None else length))
        for name, value in headers.items():
            self.send_header(name, value)
        self.end_headers()
        self.wfile.write(content)

    def _hang(self) -> None:
        self.server.ended.wait()

    def _drip(self) -> None:
        """A letter at a time."""
        for letter in b"HTTP/1.0 200 OK\r\n" + 3600 * b"x":
            self.wfile.write(bytes([letter]))
            self.server.ended.wait(0.2)

    def _refuse(self) -> None:
        self._answer({"status": wrapped("Failure"), "payload": wrapped({"message": wrapped("display is in use")})})

    def _nonsense(self) -> None:
        self._send(b"<html>I am no Bridge</html>")

    def _empty(self) -> None:
        self._send(b"")

    def _drop(self) -> None:
        self.connection.shutdown(socket.SHUT_RDWR)

    def _chunk(self) -> None:
        self.send_response(200)
        self.send_header("Transfer-Encoding", "chunked")
        self.end_headers()
        self.wfile.write(b"-5\r\nhello\r\n0\r\n\r\n")

    def _half(self) -> None:
        self._send(b'{"status"', length=500)

    def _error(self) -> None:
        self._send(b"broken", 500)

    def _redirect(self) -> None:
        self._send(b"", 307, Location="http://192.0.2.1:33334/" + self.path)

    def _huge(self) -> None:
        self._send(HUGE * b" ")

    def log_message(self, *_: object) -> None:
        """Say nothing."""


class StandIn(ThreadingHTTPServer):
    """What Bridge knows, and what was asked of it, in order, with the files that were shown after each request."""

    daemon_threads = True

    def __init__(self, devices: list, faults: dict[str, str]) -> None:
        super().__init__(("127.0.0.1", 0), Handler)
        self.devices, self.faults, self.lock, self.ended = devices, faults, threading.Lock(), threading.Event()
        self.requests: list[dict[str, Any]] = []
        self.playlists: dict[str, list[dict]] = {}
        self.playing = ""
        self.shown: list[str] | None = None

    @property
    def endpoints(self) -> list[str]:
        return [request["endpoint"] for request in self.requests]

    def answer(self, endpoint: str, body: dict) -> dict | None:
        """Answer to a PUT, None for an unknown endpoint."""
        if endpoint == "enter_orchestration":
            return {"name": endpoint, "payload": wrapped(TOKEN), "status": wrapped("Completion")}
        if (method := getattr(self, f"_{endpoint}", None)) is None:
            return None
        if body.get("orchestration") != TOKEN:
            return {"name": endpoint, "status": wrapped("UnknownOrchestration")}
        return {"name": endpoint, "orchestration": wrapped(TOKEN)} | method(body)

    def _available_output_devices(self, _: dict) -> dict:
        devices = {str(number): entry for number, entry in enumerate(self.devices)}
        return {"payload": wrapped(devices), "status": wrapped("Completion")}

    def _instance_playlist(self, body: dict) -> dict:
        self.playlists.setdefault(body["name"], [])
        return {"payload": wrapped({"name": wrapped(body["name"])}), "status": wrapped("Completion")}

    def _insert_playlist_entry(self, body: dict) -> dict:
        if body["name"] not in self.playlists:
            return {"status": wrapped("Failure")}
        self.playlists[body["name"]].append(body)
        return {"payload": wrapped({"index": wrapped(str(body["index"]))}), "status": wrapped("Completion")}

    def _show_window(self, _: dict) -> dict:
        return {"status": wrapped("Completion")}

    def _play_playlist(self, body: dict) -> dict:
        if not (entries := self.playlists.get(body["name"])):
            return {"payload": wrapped({"message": wrapped("no such playlist")}), "status": wrapped("Failure")}
        if self.playing != body["name"]:
            self.playing, self.shown = body["name"], [entry["uri"] for entry in entries]
        return {"payload": wrapped({"message": wrapped("ok")}), "status": wrapped("Pending")}

@contextlib.contextmanager
def stand_in(devices: list, *faults: str) -> Iterator[StandIn]:
    """Run one; ``faults`` as KIND:ENDPOINT."""
    with StandIn(devices, {endpoint: kind for kind, endpoint in (fault.split(":") for fault in faults)}) as server:
        threading.Thread(target=server.serve_forever, kwargs={"poll_interval": 0.01}, daemon=True).start()
        try:
            yield server
        finally:
            server.ended.set()
            server.shutdown()


MONITOR = device(0, "", "thirdparty", None)
PORTRAIT = device(1, "LKG-P1", "portrait", OLD, {"quiltX": 3360, "quiltY": 3360, "tileX": 8, "tileY": 6,
                                                 "quiltAspect": 0.75})
GEN3 = device(2, "LKG-J2", "16_gen3_landscape", NEW | {"CellPatternMode": 2, "subpixelCells": CELLS},
              {"quiltX": 7680, "quiltY": 4320, "tileX": 8, "tileY": 6, "quiltAspect": 1.77777})
DEVICES = [MONITOR, PORTRAIT, GEN3]
