"""Calls to a program on this computer: the only module of the product that opens a connection.

The contract: ``put`` sends one JSON object by HTTP PUT to a port of this computer and returns the JSON that comes back,
within ``seconds``, or raises an LfsrError of one sentence. The address is one of ADDRESSES, the loopback interface:
nothing is resolved, redirected or sent through a proxy. Only the port can be chosen, by PORT_VARIABLE.
"""

import contextlib
import http.client
import json
import os
import socket
import threading
from typing import Any

from lfsr_core.base.messages import LfsrError
from lfsr_core.base.system import MOST_JSON_BYTES, parse_json

ADDRESSES = ("127.0.0.1", "::1")  # tried in this order
PORT, PORT_VARIABLE = 33334, "LFSR_BRIDGE_PORT"
SECONDS = 10.0  # for one call
PROGRAM = "Looking Glass Bridge"


def put(endpoint: str, body: dict[str, Any], seconds: float = SECONDS) -> Any:
    """Send ``body`` to an endpoint; return the data of the answer, None for an empty one.

    LfsrError if nobody listens, if the answer is late, breaks off, is not JSON or has another status than 200.
    """
    try:
        status, content = _exchange(endpoint, json.dumps(body).encode(), seconds)
    except TimeoutError:
        raise LfsrError(f"{PROGRAM} did not answer {endpoint} within {seconds:g} s: end it and start it "
                        "again") from None
    except LfsrError:  # a ValueError too
        raise
    except (OSError, ValueError, http.client.HTTPException) as error:  # ValueError: a chunk's size is not a number
        raise LfsrError(f"{PROGRAM} broke the connection at {endpoint} ({str(error) or type(error).__name__}): end it "
                        "and start it again") from None
    if status != http.client.OK:
        raise LfsrError(f"{PROGRAM} answers {endpoint} with the HTTP status {status}, expected 200: end it and start "
                        "it again")
    try:
        if len(content) > MOST_JSON_BYTES:
            raise ValueError(f"more than {MOST_JSON_BYTES} bytes")
        return parse_json(content) if content.strip() else None
    except ValueError as error:
        raise LfsrError(f"{PROGRAM} answers {endpoint} with what is not JSON ({error}): check what listens on port "
                        f"{port()}") from None


def port() -> int:
    """Return the port of the program on this computer; LfsrError if the variable is no port."""
    text = os.environ.get(PORT_VARIABLE, str(PORT))
    if not (text.isascii() and text.isdigit() and len(text) <= 5 and 1 <= int(text) <= 65535):
        raise LfsrError(f"{PORT_VARIABLE} is {text[:50]!r}, but it must be a port from 1 to 65535")
    return int(text)


def _exchange(endpoint: str, content: bytes, seconds: float) -> tuple[int, bytes]:
    """Status and content of the answer; LfsrError if nobody listens, TimeoutError after ``seconds`` in all."""
    for address in ADDRESSES:
        try:
            line = socket.create_connection((address, port()), seconds)
            break
        except TimeoutError:
            raise
        except OSError:  # nobody listens, or this computer has no such address
            continue
    else:
        raise LfsrError(f"{PROGRAM} is not running: nothing listens on port {port()} of this computer. Start it, with "
                        "the display connected")
    connection = http.client.HTTPConnection(ADDRESSES[0], port())
    connection.sock = line
    late = threading.Event()

    def cut() -> None:
        late.set()
        with contextlib.suppress(OSError):
            line.shutdown(socket.SHUT_RDWR)

    watch = threading.Timer(seconds, cut)
    watch.daemon = True
    watch.start()
    try:
        connection.request("PUT", f"/{endpoint}", content, {
            "Host": f"localhost:{port()}", "Content-Type": "application/json", "Connection": "close"})
        with connection.getresponse() as answer:
            response = answer.status, answer.read(MOST_JSON_BYTES + 1)
            if answer.length and len(response[1]) <= MOST_JSON_BYTES:
                raise http.client.IncompleteRead(response[1], answer.length)
    except (OSError, ValueError, http.client.HTTPException):
        if late.is_set():
            raise TimeoutError from None
        raise
    finally:
        watch.cancel()
        connection.close()
        line.close()
    if late.is_set():
        raise TimeoutError
    return response
