"""The bench folder of the stability suite: its scenes, references, renders and measured cells, made once each."""

from __future__ import annotations

import dataclasses
import functools
import subprocess
import tempfile
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from lfsr_core.bench.cells import Cells
from lfsr_core.bench.stress.dials import Dial
from lfsr_core.bench.stress.records import Cell, Settings
from lfsr_core.errors import LfsrError
from lfsr_core.files import write_json
from lfsr_core.frames.frame import FRAME_FILE, LOW_RES_FILE, REFERENCE_FILES
from lfsr_core.frames.job import Job
from lfsr_core.progress import ProgressBar
from lfsr_core.reconstruct.method_name import MethodName
from lfsr_core.records import read_record, write_record
from lfsr_core.render.blender import Blender, find_blender, scene_script
from lfsr_core.render.process import run_job
from lfsr_core.render.protocol import EXIT_BAD_INPUT, parse_progress

DISPLAY_FILE = Path(__file__).parent / "stress.toml"
SETTINGS_FILE, SCENE_FILE, CELLS = "settings.json", "scene.blend", "cells"
BASELINE, LAYERS = "bicubic", ("albedo", "normal")
FIXED_SEED = 0


@dataclasses.dataclass(frozen=True)
class Bench:
    """A bench folder, in which missing scenes and renders are made when they are asked for.

    Attributes
    ----------
    folder: where everything lies.
    settings: what decides its figures.
    executable: of Blender, None to look for one.
    """

    folder: Path
    settings: Settings
    executable: str | None = None

    @property
    def blender(self) -> Blender:
        """Looked for only where something is missing."""
        return _blender(self.executable)

    def claim(self) -> None:
        """Record the settings of a new folder; LfsrError if it was begun with other ones."""
        path = self.folder / SETTINGS_FILE
        if path.exists():
            found = read_record(path, Settings, "the settings of a stability suite")
            for field in dataclasses.fields(Settings):
                if getattr(found, field.name) != getattr(self.settings, field.name):
                    raise LfsrError(f"{self.folder} was begun with other settings ({field.name} differs, see "
                                    f"{SETTINGS_FILE} there): choose another folder or the same settings")
        write_record(path, self.settings)

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
        """Low-resolution frame folder, rendered if it is missing.

        Parameters
        ----------
        dial, value: whose scene.
        frame: number of the frame, other than 1 only of the moving card.
        seed: of Cycles' noise.
        """
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

    def read_cell(self, dial: Dial, value: float, method: str) -> Cell | None:
        """A measured cell; None if it is missing or was measured with other weights or versions of the method."""
        made_with = fingerprint(method)
        found = self._cells(dial, value).read(_cell_name(dial, value, method), made_with)
        return found and dataclasses.replace(found, **made_with)

    def write_cell(self, dial: Dial, cell: Cell) -> None:
        """Keep a cell that was measured now."""
        self._cells(dial, cell.value).write(_cell_name(dial, cell.value, cell.method), {}, cell)

    def _cells(self, dial: Dial, value: float) -> Cells[Cell]:
        return Cells(self.scene_folder(dial, value) / CELLS, Cell, key=None)


_blender = functools.cache(find_blender)


def _cell_name(dial: Dial, value: float, method: str) -> str:
    return f"{method}-{dial.name}-spp{dial.samples(value)}"


def fingerprint(method: str) -> dict[str, Any]:
    """What a cell of a method depends on besides its scene, as two fields of the cell."""
    name = MethodName.parse(method)
    return {"weights": name.weights_digest, "versions": name.versions}


def run_script(blender: Blender, script: Path, argument: Path) -> None:
    """Run a script of scripts/ in Blender; LfsrError with its own sentence, or with its last line after a crash."""
    command = blender.script_command(script, str(argument))
    done = subprocess.run(command, capture_output=True, text=True, errors="replace", check=False)
    last: dict[str, Any] = {}
    for line in done.stdout.splitlines():
        last = parse_progress(line) or last
    if done.returncode == EXIT_BAD_INPUT and last.get("stage") == "error":
        raise LfsrError(str(last.get("message")))
    if done.returncode or last.get("stage") != "done":
        lines = (done.stderr.strip() or done.stdout.strip() or "nothing").splitlines()
        raise LfsrError(f"Blender stopped with exit code {done.returncode} in {script.name}, last saying "
                        f"{lines[-1]!r}: run the script by hand to see more")
