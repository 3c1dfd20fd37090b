"""The bench folder of the stability suite: its scenes, references, renders and measured cells, made once each."""

from __future__ import annotations

import dataclasses
import tempfile
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from lfsr_core.errors import LfsrError
from lfsr_core.files import write_json
from lfsr_core.frames.job import Job
from lfsr_core.reconstruct.method_name import MethodName
from lfsr_core.records import read_record, write_record
from lfsr_core.render.blender import find_blender
from lfsr_core.render.store import cached, with_blender
from lfsr_lab.experiments.cells import Cells
from lfsr_lab.experiments.stress.dials import Dial
from lfsr_lab.experiments.stress.records import Cell, Settings
from lfsr_lab.scenes import scene_script
from lfsr_lab.scenes.running import run_script

DISPLAY_FILE = Path(__file__).parent / "stress.toml"
SETTINGS_FILE, SCENE_FILE, CELLS = "settings.json", "scene.blend", "cells"
BASELINE, LAYERS = "bicubic", ("albedo", "normal")
FIXED_SEED = 0


@dataclasses.dataclass(frozen=True)
class Bench:
    """A bench folder, in which missing scenes and renders are made when they are asked for."""

    folder: Path  # where everything lies
    settings: Settings  # what decides its figures
    executable: str | None = None  # of Blender, None to look for one

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
            run_script(find_blender(self.executable), scene_script("stress_scenes.py"), job, missing)

    def reference(self, dial: Dial, value: float) -> Path:
        """Reference folder of one scene, rendered if it is missing."""
        return self._kept(dial, value, "reference", kind="reference", scale=1, clamp_indirect=0.0,
                          spp=self.settings.reference_samples)

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
        return self._kept(dial, value, f"s{scale}-spp{spp}{suffix}", scale=scale, spp=spp, layers=LAYERS, seed=seed,
                          frame=frame)

    def _kept(self, dial: Dial, value: float, name: str, **job: Any) -> Path:
        folder = self.scene_folder(dial, value)
        return cached(Job(output=str(folder / name), display=self.settings.display, device=self.settings.device,
                          scene=str((folder / SCENE_FILE).resolve()), **job), with_blender(self.executable))

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


def _cell_name(dial: Dial, value: float, method: str) -> str:
    return f"{method}-{dial.name}-spp{dial.samples(value)}"


def fingerprint(method: str) -> dict[str, Any]:
    """What a cell of a method depends on besides its scene, as two fields of the cell."""
    name = MethodName.parse(method)
    return {"weights": name.weights_digest, "versions": name.versions}
