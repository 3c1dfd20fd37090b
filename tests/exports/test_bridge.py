"""The session with Bridge: its displays, quilts that replace one another, and refusals."""

import contextlib
import dataclasses
import errno
import re
import socket
import subprocess
import sys
import time
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from lfsr_core.base.messages import LfsrError
from lfsr_core.exports import loopback
from lfsr_core.exports.show import Bridge, chosen
from tests.support.bridge import MONITOR, PORTRAIT, TOKEN
from tests.support.told import refuses

CALLS = ("enter_orchestration", "available_output_devices", "instance_playlist", "insert_playlist_entry", "show_window",
         "play_playlist")
QUILTS = [Path(f"/films/{name}_qs8x6a0.75.png") for name in "abc"]


def test_each_show_replaces_the_last_once_it_is_complete_and_bridge_is_told_all_of_it(bridge):
    stand_in = bridge()
    for quilt in QUILTS:
        session = Bridge()
        session.play(quilt, session.devices()[0])
        assert stand_in.shown == [str(quilt.resolve())]
    assert "delete_playlist" not in stand_in.endpoints
    session = Bridge()
    portrait = session.devices()[0]
    session.play(QUILTS[0], portrait)
    before = len(stand_in.requests)
    session.play(QUILTS[1], portrait)
    shown = [request["shown"] for request in stand_in.requests[before:]]
    first, second = ([str(quilt.resolve())] for quilt in QUILTS[:2])
    assert shown == [first] * (len(shown) - 1) + [second]
    session = Bridge()
    session.play(QUILTS[0], session.devices()[1])
    asked = [request["body"] for request in stand_in.requests[before + len(shown):]]
    (entry,) = (body for body in asked if "cols" in body)
    assert (entry["cols"], entry["rows"], entry["view_count"], entry["aspect"], entry["isRGBD"]) == (8, 6, 48, 0.75, 0)
    assert {body["head_index"] for body in asked if "head_index" in body} == {2}


@pytest.mark.parametrize("endpoint", CALLS)
@pytest.mark.parametrize(("fault", "message"), [("drop", "broke the connection at {}"),
    ("refuse", r"refuses {} \(Failure: display is in use\)"), ("empty", "answers {} with nothing")])
def test_each_call_can_fail(bridge, endpoint, fault, message):
    stand_in = bridge(f"{fault}:{endpoint}")
    if endpoint == "enter_orchestration" and fault in ("refuse", "empty"):
        message = "opened no session: update it to version 2.2 or newer"
    with pytest.raises(LfsrError, match=message.format(endpoint)):
        session = Bridge()
        session.play(QUILTS[0], session.devices()[0])
    assert stand_in.endpoints[-1] == endpoint, "nothing is asked after a failure"


NUMBERS = st.integers() | st.floats(allow_nan=False, allow_infinity=False)
TEXT = st.text(st.characters(exclude_categories=["Cs"]))  # what UTF-8 holds; a table of it takes 3 s to make
NAMES = st.sampled_from(["value", "payload", "status", "index", "hwid", "calibration", "defaultQuilt", "windowCoords",
                         "hardwareVersion", "message", "pitch", "screenW"]) | TEXT
ANSWERS = st.recursive(st.none() | st.booleans() | NUMBERS | TEXT,
                       lambda inside: st.lists(inside) | st.dictionaries(NAMES, inside))


@given(st.fixed_dictionaries({"payload": ANSWERS, "status": ANSWERS | st.just("Completion")}) | ANSWERS, ANSWERS)
def test_whatever_is_answered_is_a_display_or_a_sentence(answer, entry):
    answers = {"enter_orchestration": {"payload": {"value": TOKEN}}}
    for reply in (answer, {"status": "Completion", "payload": {"value": {"0": entry, "1": {"value": entry}}}}):
        with contextlib.suppress(LfsrError):
            for device in Bridge(lambda endpoint, _, reply=reply: answers.get(endpoint, reply)).devices():
                assert chosen([device], str(device.index)) == device and device.calibration.numbers["pitch"] > 0
    with contextlib.suppress(LfsrError):
        Bridge(lambda *_: answer)


def test_displays_are_listed_and_one_chosen_by_index_name_or_proportions(bridge):
    bridge()
    devices = Bridge().devices()
    assert chosen(devices, None).name == "LKG-P1" and chosen(devices, "2").name == "LKG-J2"
    assert chosen(devices, "lkg-j2").index == 2 and chosen(devices, None, 16 / 9).name == "LKG-J2"
    refuses(r"display 'LKG-9' is not among .* choose one of 1 \(LKG-P1\), 2 \(LKG-J2\)", chosen, devices, "LKG-9")
    twins = [dataclasses.replace(devices[1], index=7), *devices]
    assert chosen(twins, "7").index == 7
    refuses(r"several displays called 'LKG-J2': choose one of 7 \(LKG-J2\), .* number", chosen, twins, "LKG-J2")
    refuses("for a panel of width / height 1.778, but display 'LKG-P1' has 0.750: render", chosen, devices, "1", 16 / 9)
    bridge()
    portrait, large = Bridge().devices()
    assert (portrait.index, portrait.name, portrait.hardware) == (1, "LKG-P1", "portrait")
    assert portrait.corner == (3840, 0) and portrait.quilt["tileX"] == 8
    assert portrait.calibration.numbers["slope"] == -7.083540916442871
    assert large.calibration.mode == 2 and len(large.calibration.cells) == 2
    bridge()
    session = Bridge(lambda endpoint, body: loopback.put(endpoint, body | {"orchestration": "older"}))
    refuses(r"refuses available_output_devices \(UnknownOrchestration\)", session.devices)
    for devices in [[], [MONITOR]]:
        bridge(devices=devices)
        refuses("sees no Looking Glass: connect the display and switch it on", Bridge().devices)


@pytest.mark.parametrize("entry", [
    {}, {"value": 3}, "text", {"value": {"hwid": {"value": None}, "index": {"value": "first"},
                                         "windowCoords": {"value": [1, 2]}, "calibration": {"value": "{"}}}])
def test_a_display_of_which_little_is_known(bridge, entry):
    bridge(devices=[entry, PORTRAIT])
    unknown, portrait = Bridge().devices()
    assert portrait.name == "LKG-P1" and unknown.corner == (0, 0)
    with pytest.raises(LfsrError, match="the calibration of display '' in Bridge"):
        _ = unknown.calibration
    assert chosen([unknown], None, 16 / 9) == unknown, "Bridge may know better"


def test_a_call_to_this_computer_returns_the_answers_data_also_by_the_other_protocol(bridge, monkeypatch):
    stand_in = bridge()
    assert loopback.put("enter_orchestration", {"name": "default"})["payload"]["value"] == TOKEN
    (request,) = stand_in.requests
    assert request["body"] == {"name": "default"} and request["headers"]["Content-Type"] == "application/json"
    assert request["headers"]["Host"] == f"localhost:{stand_in.server_port}"
    assert loopback.put("no_such_endpoint", {}) is None and loopback.ADDRESSES == ("127.0.0.1", "::1")
    with socket.socket() as held:  # so that nobody else answers at the other address
        held.bind(("127.0.0.1", 0))
        try:
            server = socket.create_server(("::1", held.getsockname()[1]), family=socket.AF_INET6)
        except OSError:
            pytest.skip("this computer has no IPv6")
        with server:
            monkeypatch.setenv(loopback.PORT_VARIABLE, str(server.getsockname()[1]))
            refuses("did not answer", loopback.put, "x", {}, 0.2)
            server.accept()[0].close()


@pytest.mark.parametrize(("fault", "message"), [
    ("hang", "did not answer x within 0.5 s: end it"), ("drip", "did not answer x within 0.5 s"),
    *((fault, "broke the connection at x") for fault in ("drop", "half", "chunk")),
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
    refuses(f"^Looking Glass Bridge is not running: nothing listens on port {port} of this computer",
            loopback.put, "x", {})
    def connect(place, seconds, real=socket.create_connection):
        if place[0] == "::1":
            raise OSError(errno.EADDRNOTAVAIL, "Cannot assign requested address")
        return real(place, seconds)

    monkeypatch.setattr(socket, "create_connection", connect)
    monkeypatch.setenv(loopback.PORT_VARIABLE, "1")
    refuses("^Looking Glass Bridge is not running: nothing listens on port 1", loopback.put, "x", {})
    for port in ["", "0", "65536", "-1", "80 ", "example.org:80", "٣", "1e3", "999999999999"]:
        monkeypatch.setenv(loopback.PORT_VARIABLE, port)
        refuses("LFSR_BRIDGE_PORT is .* must be a port from 1 to 65535", loopback.put, "x", {})


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
    assert len(places) == 2 and set(places) == {repr(("127.0.0.1", stand_in.server_port))}
