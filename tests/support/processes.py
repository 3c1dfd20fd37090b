"""The command as a process of its own, and the processes that it starts."""

import json
import os
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

ROOT = Path(__file__).resolve().parents[2]
SECONDS = 120


def start_lfsr(*words: object, **variables: object) -> subprocess.Popen[str]:
    """Start the command with these words and ``variables`` of the environment."""
    return subprocess.Popen([sys.executable, "-m", "lfsr_core", *map(str, words)], cwd=ROOT, text=True,
                            stdout=subprocess.PIPE, stderr=subprocess.STDOUT,
                            env=os.environ | {name: str(value) for name, value in variables.items()})


def run_lfsr(*words: object, code: int = 0) -> str:
    """Run the command to its end, which must be ``code``, and return what it printed."""
    program = start_lfsr(*words)
    said, _ = program.communicate(timeout=2 * SECONDS)
    assert program.returncode == code and "Traceback" not in said, said
    return said


def run_script(name: str, *words: object) -> tuple[int, list[dict[str, Any]]]:
    """Run a script of the laboratory's scenes to its end: its exit code, and the messages that it printed."""
    script = ROOT / "scripts" / "lab" / "lfsr_lab" / "scenes" / name
    done = subprocess.run([sys.executable, script, *map(str, words)], capture_output=True, text=True, check=False)
    lines = [line.removeprefix("LFSR ") for line in done.stdout.splitlines() if line.startswith("LFSR ")]
    return done.returncode, [json.loads(line) for line in lines]


def children(pid: int) -> list[int]:
    """Process ids of the living children of ``pid``, on Linux."""
    return [int(line) for line in Path(f"/proc/{pid}/task/{pid}/children").read_text().split()]


def lives(pid: int) -> bool:
    """True unless the process has ended, on Linux."""
    stat = Path(f"/proc/{pid}/stat")
    return stat.exists() and stat.read_text().rsplit(")", 1)[1].split()[0] not in "ZX"


def wait_for(condition: Callable[[], object], seconds: float = SECONDS) -> None:
    """Wait until ``condition``."""
    ends = time.monotonic() + seconds
    while not condition():
        assert time.monotonic() < ends
        time.sleep(0.02)
