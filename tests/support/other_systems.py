"""Run the command as Windows and macOS would, on Linux: see ``stand_in/sitecustomize.py``."""

import dataclasses
import os
import subprocess
import sys
from pathlib import Path

ROOT = Path(__file__).parents[2]
STAND_IN = Path(__file__).parent / "stand_in"
FOLDER = "Jürgen's Filme – 光"  # no code page of Windows has all of its letters


def names(folder: Path) -> list[str]:
    """What is in a folder."""
    return sorted(path.name for path in folder.iterdir())


@dataclasses.dataclass(frozen=True)
class System:
    """A system that this one stands in for, as ``sys.platform`` names it."""

    name: str

    def start(self, *words: object) -> subprocess.Popen[str]:
        """Start Python with these words; what it prints is in the code page of western Windows."""
        environment = os.environ | {
            "LFSR_STAND_IN": self.name, "PYTHONPATH": os.pathsep.join(map(str, (STAND_IN, ROOT))),
            "PYTHONIOENCODING": "cp1252", "PYTHONWARNDEFAULTENCODING": "1", "PYTHONDONTWRITEBYTECODE": "1"}
        return subprocess.Popen([sys.executable, *map(str, words)], env=environment, text=True, encoding="cp1252",
                                stdout=subprocess.PIPE, stderr=subprocess.STDOUT)

    def lfsr(self, *commands: list[str]) -> str:
        """Run commands to their end in one process, where each must be good, and return what they printed."""
        program = self.start("-c", f"from lfsr_core.cli import main\nfor words in {list(commands)!a}:\n"
                             "    assert main(words) == 0")
        said, _ = program.communicate(timeout=240)
        assert program.returncode == 0 and "Traceback" not in said, said
        return said


SYSTEMS = [System("win32"), System("darwin")]
