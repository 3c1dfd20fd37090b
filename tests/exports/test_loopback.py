"""Calls to a program on this computer: every way in which it can fail, and that there is no other address."""

import errno
import re
import socket
import subprocess
import sys
import time

import pytest

from lfsr_core.base.errors import LfsrError
from lfsr_core.exports import loopback
from tests.support.bridge import TOKEN
from tests.support.told import refuses


def test_a_call_to_this_computer_returns_the_answers_data(bridge):
    stand_in = bridge()
    answer = loopback.put("enter_orchestration", {"name": "default"})
    assert answer["payload"]["value"] == TOKEN
    (request,) = stand_in.requests
    assert request["body"] == {"name": "default"} and request["headers"]["Content-Type"] == "application/json"
    assert request["headers"]["Host"] == f"localhost:{stand_in.port}"
    assert loopback.put("no_such_endpoint", {}) is None
    assert loopback.ADDRESSES == ("127.0.0.1", "::1")


@pytest.mark.parametrize(("fault", "message"), [
    ("hang", "did not answer x within 0.5 s: end it"), ("drip", "did not answer x within 0.5 s"),
    ("drop", "broke the connection at x"), ("half", "broke the connection at x"),
    ("error", "answers x with the HTTP status 500, expected 200"), ("redirect", "answers x with the HTTP status 307"),
    ("nonsense", "answers x with what is not JSON"),
    ("huge", "answers x with what is not JSON (more than 16000000 bytes)")])
def test_each_fault_is_one_sentence_in_time(bridge, fault, message):
    bridge(f"{fault}:x")
    started = time.monotonic()
    with pytest.raises(LfsrError, match=re.escape(f"Looking Glass Bridge {message}")):
        loopback.put("x", {}, 0.5 if fault in ("hang", "drip") else 20.0)
    assert time.monotonic() - started < 20


def test_nobody_listens_there_is_no_other_protocol_or_no_port(monkeypatch):
    with socket.create_server(("127.0.0.1", 0)) as free:
        port = free.getsockname()[1]
    monkeypatch.setenv(loopback.PORT_VARIABLE, str(port))
    refuses(f"is not running: nothing listens on port {port} of this computer. Start it", loopback.put, "x", {})
    def connect(place, seconds, real=socket.create_connection):
        if place[0] == "::1":
            raise OSError(errno.EADDRNOTAVAIL, "Cannot assign requested address")
        return real(place, seconds)

    monkeypatch.setattr(socket, "create_connection", connect)
    monkeypatch.setenv(loopback.PORT_VARIABLE, "1")
    refuses("is not running: nothing listens on port 1", loopback.put, "x", {})
    for port in ["", "0", "65536", "-1", "80 ", "example.org:80", "٣", "1e3", "999999999999"]:
        monkeypatch.setenv(loopback.PORT_VARIABLE, port)
        refuses("LFSR_BRIDGE_PORT is .* must be a port from 1 to 65535", loopback.put, "x", {})


def test_a_server_of_the_other_protocol_is_found(monkeypatch):
    try:
        server = socket.create_server(("::1", 0), family=socket.AF_INET6)
    except OSError:
        pytest.skip("this computer has no IPv6")
    with server:
        monkeypatch.setenv(loopback.PORT_VARIABLE, str(server.getsockname()[1]))
        refuses("did not answer", loopback.put, "x", {}, 0.2)
        server.accept()[0].close()


WATCHED = """
import sys
places = []
sys.addaudithook(lambda event, data: places.append(repr(data[-1])) if event in ("socket.connect", "socket.sendto")
                 else places.append(event) if event.startswith("urllib") else None)
from lfsr_core.cli import main
code = main(sys.argv[1:])
print("PLACES", *places, sep="|")
sys.exit(code)
"""


@pytest.mark.parametrize("fault", [[], ["redirect:available_output_devices"]])
def test_no_other_address_is_ever_asked_for(bridge, monkeypatch, fault):
    stand_in = bridge(*fault)
    for name in ("http_proxy", "HTTP_PROXY", "all_proxy", "ALL_PROXY"):
        monkeypatch.setenv(name, "http://192.0.2.7:3128")
    done = subprocess.run([sys.executable, "-c", WATCHED, "displays", "--bridge"], capture_output=True, text=True)
    assert done.returncode == (2 if fault else 0), done.stderr
    places = done.stdout.strip().splitlines()[-1].split("|")[1:]
    assert len(places) == 2 and set(places) == {repr(("127.0.0.1", stand_in.port))}
