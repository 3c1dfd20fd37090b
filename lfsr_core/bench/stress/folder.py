"""Runs the stability suite: scenes, references, renders and one small JSON file per cell.

A *cell* is one method at one value of one dial. What is complete in the bench
folder is not made again, so an interrupted run goes on where it stopped.
"""

from __future__ import annotations

import dataclasses
import functools
import subprocess
import tempfile
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from lfsr_core.bench.stress.dials import Dial
from lfsr_core.errors import LfsrError
from lfsr_core.files import read_json, write_json
from lfsr_core.frames.frame import FRAME_FILE, LOW_RES_FILE, REFERENCE_FILES
from lfsr_core.frames.job import Job
from lfsr_core.optics.display import DisplayProfile
from lfsr_core.progress import ProgressBar
from lfsr_core.reconstruct.method_name import MethodName
from lfsr_core.render.blender import Blender, find_blender, scene_script
from lfsr_core.render.process import run_job
from lfsr_core.render.protocol import EXIT_BAD_INPUT, parse_progress

DISPLAY_FILE = Path(__file__).parent / "stress.toml"
SETTINGS_FILE, SCENE_FILE, CELLS, FORMAT = "settings.json", "scene.blend", "cells", 1
BASELINE, LAYERS = "bicubic", ("albedo", "normal")
FIXED_SEED = 0


@dataclasses.dataclass(frozen=True)
class Settings:
    """What decides every figure of a bench folder besides the dials and methods.

    ``reference_samples``: of both halves together. ``frames``: of the moving card.
    """

    display: DisplayProfile
    scale: int
    reference_samples: int
    frames: int
    device: str = "CPU"

    def __post_init__(self) -> None:
        self.display.low_views(self.scale)
        if self.scale < 2:
            raise LfsrError(f"scale is {self.scale}, but the suite compares upscaling methods: choose 2 or more")
        if self.reference_samples < 2 or self.frames < 2:
            raise LfsrError(f"a reference has {self.reference_samples} samples and the motion {self.frames} frames, "
                            "but both need at least 2")

    def to_dict(self) -> dict[str, Any]:
        """As kept in settings.json."""
        return dataclasses.asdict(self) | {"display": self.display.to_dict(), "format": FORMAT}


@dataclasses.dataclass(frozen=True)
class Bench:
    """A bench folder: makes the scenes and renders that are missing in it, with Blender or the one named."""

    folder: Path
    settings: Settings
    executable: str | None = None

    @property
    def blender(self) -> Blender:
        """Looked for only where something is missing."""
        return _blender(self.executable)

    def scene_folder(self, dial: Dial, value: float) -> Path:
        """Folder of one scene."""
        return self.folder / dial.scene_name(value)

    def build_scenes(self, wanted: Sequence[tuple[Dial, float]]) -> None:
        """Write the missing scene.blend files, all in one Blender."""
        missing = {self.scene_folder(dial, value) / SCENE_FILE: (dial.name, value) for dial, value in wanted}
        scenes = [{"dial": dial, "value": value, "path": str(path.resolve())}
                  for path, (dial, value) in missing.items() if not path.exists()]
        if not scenes:
            return
        print(f"building {len(scenes)} scenes", flush=True)
        with tempfile.TemporaryDirectory() as name:
            job = Path(name) / "scenes.json"
            write_json(job, {"display": self.settings.display.to_dict(), "scale": self.settings.scale,
                             "frames": self.settings.frames, "scenes": scenes})
            run_script(self.blender, scene_script("stress_scenes.py"), job)

    def reference(self, dial: Dial, value: float) -> Path:
        """Reference folder of one scene, rendered if it is missing."""
        folder = self.scene_folder(dial, value) / "reference"
        if not all((folder / name).exists() for name in (*REFERENCE_FILES, FRAME_FILE)):
            self._run(dial, value, folder, kind="reference", scale=1, spp=self.settings.reference_samples,
                      clamp_indirect=0.0)
        return folder

    def render(self, dial: Dial, value: float, frame: int = 1, seed: int = FIXED_SEED) -> Path:
        """Low-resolution frame folder, rendered if it is missing."""
        spp, scale = dial.samples(value), self.settings.scale
        suffix = "" if (frame, seed) == (1, FIXED_SEED) else f"-frame{frame}-seed{seed}"
        folder = self.scene_folder(dial, value) / f"s{scale}-spp{spp}{suffix}"
        if not all((folder / name).exists() for name in (LOW_RES_FILE, FRAME_FILE)):
            self._run(dial, value, folder, scale=scale, spp=spp, layers=LAYERS, seed=seed, frame=frame)
        return folder

    def _run(self, dial: Dial, value: float, folder: Path, **job: Any) -> None:
        scene, progress = self.scene_folder(dial, value) / SCENE_FILE, ProgressBar()
        print(f"  {folder.relative_to(self.folder)}", flush=True)
        try:
            run_job(Job(output=str(folder), display=self.settings.display, scene=str(scene.resolve()),
                        device=self.settings.device, **job), self.blender, progress, progress.note)
        finally:
            progress.close()


_blender = functools.cache(find_blender)


def run_script(blender: Blender, script: Path, argument: Path) -> None:
    """Run a script of scripts/ in Blender; LfsrError with its own sentence, or with its last line after a crash."""
    command = blender.script_command(script, str(argument))
    done = subprocess.run(command, capture_output=True, text=True, errors="replace",
                          check=False)
    last: dict[str, Any] = {}
    for line in done.stdout.splitlines():
        last = parse_progress(line) or last
    if done.returncode == EXIT_BAD_INPUT and last.get("stage") == "error":
        raise LfsrError(str(last.get("message")))
    if done.returncode or last.get("stage") != "done":
        lines = (done.stderr.strip() or done.stdout.strip() or "nothing").splitlines()
        raise LfsrError(f"Blender stopped with exit code {done.returncode} in {script.name}, last saying "
                        f"{lines[-1]!r}: run the script by hand to see more")


def cell_path(bench: Bench, dial: Dial, value: float, name: str) -> Path:
    """File of one cell."""
    return bench.scene_folder(dial, value) / CELLS / f"{name}-{dial.name}-spp{dial.samples(value)}.json"


def read_cell(bench: Bench, dial: Dial, value: float, name: str) -> dict[str, Any] | None:
    """A measured cell; None if it is missing or was measured with other weights or another version of the method."""
    path = cell_path(bench, dial, value, name)
    if not path.exists():
        return None
    cell = read_json(path, "a cell of the stability suite")
    method = MethodName.parse(name)
    current = {"weights": method.weights_digest, "versions": method.versions}
    return cell if all(cell.get(key) == value for key, value in current.items()) else None
