"""Executables that play Blender: they write what Blender would for a job of a synthetic light field.

``played_blender`` and ``warm_lfsr`` cost no time for imports: a server of this test process forks for each call. What
is started is a process of its own all the same, with its arguments, environment, folder, streams and exit code.
"""

import atexit
import functools
import json
import os
import signal
import socket
import subprocess
import sys
import textwrap
import traceback
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
COLD = """#!{python}
import sys
sys.path.insert(0, {root!r})
if "--version" in sys.argv:
    print("Blender 5.0.1")
    sys.exit()
from tests.support import noisy_renders
sys.exit(noisy_renders.play(sys.argv[1:]))
"""
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


def played_blender(path: Path, kind: str = "play") -> str:
    """Write the executable to ``path``, and return its name; ``kind``: the function that is called, see ``serve``."""
    return _executable(path, CLIENT.format(python=sys.executable, address=_server(), kind=kind))


def cold_blender(path: Path) -> str:
    """One that needs no server, and may be changed or killed."""
    return _executable(path, COLD.format(python=sys.executable, root=str(ROOT)))


def changed_blender(path: Path, code: str) -> str:
    """One that runs ``code`` before each render; ``here`` is its path."""
    return _executable(path, f"#!{sys.executable}\nimport json, os, signal, sys, time\nfrom pathlib import Path\n"
                             f"here = {str(path)!r}\nif '--version' not in sys.argv:\n{textwrap.indent(code, '    ')}\n"
                             f"os.execv({played_blender(path.with_name('inner'))!r}, sys.argv)\n")


def warm_lfsr(folder: Path) -> Path:
    """Write the command to ``folder``, which renders with the played Blender beside it."""
    played_blender(folder / "blender")
    return Path(played_blender(folder / "lfsr", "lfsr"))


def _executable(path: Path, text: str) -> str:
    path.write_text(text)
    path.chmod(0o755)
    return str(path)


@functools.cache
def _server() -> str:
    """Start the server of this process and return its address."""
    # Folders of tests have longer names than sockets may have.
    address = f"/tmp/lfsr-warm-{os.getpid()}"
    server = subprocess.Popen([sys.executable, "-m", "tests.support.played_blender", address], cwd=ROOT, text=True,
                              stdin=subprocess.DEVNULL, stdout=subprocess.PIPE)
    atexit.register(lambda: (server.kill(), server.wait(), Path(address).unlink(missing_ok=True)))
    assert server.stdout.readline() == "ready\n"
    return address


def serve(address: str) -> None:
    """Import what calls need, then answer them until the end."""
    from lfsr_core.cli import main
    from lfsr_core.pipeline import make, merge  # noqa: F401
    from lfsr_core.reconstruct import second_stage  # noqa: F401, a call would import it
    from tests.support.noisy_renders import play

    def lfsr(arguments: list[str]) -> int:
        blender = str(Path(sys.argv[0]).with_name("blender"))
        return main([*arguments, "--blender", blender] if arguments[0] == "render" else arguments)

    Path(address).unlink(missing_ok=True)
    with socket.socket(socket.AF_UNIX) as listening:
        listening.bind(address)
        listening.listen()
        print("ready", flush=True)
        while True:
            link, _ = listening.accept()
            if not os.fork():
                if os.fork():  # so that nobody has to wait for the other
                    os._exit(0)
                _answer(link, {"lfsr": lfsr, "play": play})
            os.wait()
            link.close()


def _answer(link: socket.socket, calls: dict) -> None:
    """Do one call in this process, as if it had been started for it."""
    code = 1
    try:
        size, streams, _, _ = socket.recv_fds(link, 8, 3)
        kind, sys.argv, environment, folder = json.loads(link.makefile("rb").read(int.from_bytes(size, "big")))
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
    serve(sys.argv[1])
