"""``lfsr``, with a played Blender, without the time that Python takes to import it: a server that forks for each call.

What is started is a process of its own, with its arguments, environment, folder, streams and exit code.
"""

import contextlib
import json
import os
import signal
import socket
import subprocess
import sys
import time
import traceback
from collections.abc import Iterator
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
# Without site-packages, so that it starts in a few hundredths of a second.
CLIENT = """#!{python} -ISE
import json, os, socket, sys
with socket.socket(socket.AF_UNIX) as link:
    link.connect({address!r})
    request = json.dumps([{kind!r}, sys.argv, dict(os.environ), os.getcwd()]).encode()
    socket.send_fds(link, [len(request).to_bytes(8, "big")], [0, 1, 2])
    link.sendall(request)
    sys.exit(int(link.makefile().readline() or 70))
"""


@contextlib.contextmanager
def warm_lfsr(folder: Path) -> Iterator[Path]:
    """The command's file in ``folder``, to be called inside the block."""
    # Folders of tests have longer names than sockets may have.
    address = f"/tmp/lfsr-warm-{os.getpid()}-{time.monotonic_ns()}"
    for kind in ("lfsr", "blender"):
        (folder / kind).write_text(CLIENT.format(python=sys.executable, address=address, kind=kind))
        (folder / kind).chmod(0o755)
    command = [sys.executable, "-m", "tests.support.warm_lfsr", address, str(folder / "blender")]
    with subprocess.Popen(command, cwd=ROOT, stdout=subprocess.PIPE, text=True) as server:
        try:
            assert server.stdout.readline() == "ready\n"
            yield folder / "lfsr"
        finally:
            server.kill()
            Path(address).unlink(missing_ok=True)


def serve(address: str, blender: str) -> None:
    """Import what calls need, then answer them until the end."""
    from lfsr_core.cli import main
    from lfsr_core.pipeline import (
        make,  # noqa: F401
        merge,  # noqa: F401
    )
    from lfsr_core.reconstruct import second_stage  # noqa: F401, a call would import it
    from tests.support.noisy_renders import play

    def lfsr(arguments: list[str]) -> int:
        return main([*arguments, "--blender", blender] if arguments[0] == "render" else arguments)

    with socket.socket(socket.AF_UNIX) as listening:
        listening.bind(address)
        listening.listen()
        print("ready", flush=True)
        while True:
            link, _ = listening.accept()
            if not os.fork():
                if os.fork():  # so that nobody has to wait for the other
                    os._exit(0)
                _answer(link, {"lfsr": lfsr, "blender": play})
            os.wait()
            link.close()


def _answer(link: socket.socket, calls: dict) -> None:
    """Do one call in this process, as if it had been started for it."""
    code = 1
    try:
        size, streams, _, _ = socket.recv_fds(link, 8, 3)
        request = link.makefile("rb").read(int.from_bytes(size, "big"))
        kind, sys.argv, environment, folder = json.loads(request)
        for number, stream in enumerate(streams):
            os.dup2(stream, number)
        os.environ.clear()
        os.environ.update(environment)
        os.chdir(folder)
        code = calls[kind](sys.argv[1:])
    except SystemExit as end:
        code = end.code
    except BaseException:
        traceback.print_exc()
    finally:
        sys.stdout.flush()
        sys.stderr.flush()
        link.sendall(f"{int(code or 0)}\n".encode())
        os._exit(0)


if __name__ == "__main__":
    signal.signal(signal.SIGINT, signal.SIG_DFL)
    serve(*sys.argv[1:])
