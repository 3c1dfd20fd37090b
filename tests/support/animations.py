"""Animations of a synthetic light field, made with a Blender that is played by a script."""

from collections.abc import Sequence
from pathlib import Path
from typing import Any

from lfsr_core.frames.frame import Finish, Request
from lfsr_core.pipeline.make import Made, make
from tests.support.noisy_renders import JOB
from tests.support.requests import changed

FINISH = Finish("bicubic")


def film_request(folder: Path, **changes: Any) -> Request:
    """A request of a scene file in ``folder``, to be rendered into its ``film``; sampling at scale 2."""
    scene = folder / "scene.glb"
    if not scene.exists():
        scene.write_text("a scene")
    fields = {name: changes.pop(name) for name in list(changes) if name in Request.__dataclass_fields__}
    request = changed(JOB, **{"scene": str(scene), "output": str(folder / "film")} | fields)
    return request.sampled(**{"scale": 2} | changes)


def film(folder: Path, frames: Sequence[int], finish: Finish = FINISH, *, blender: str = "/must/not/run",
         changes: dict[str, Any] | None = None, **options: Any) -> list[Made]:
    """Make ``frames`` of that request with ``blender``; ``options``: of ``make``."""
    return make(film_request(folder, **changes or {}), finish, frames, blender=blender, **options)


def states(made: Sequence[Made]) -> list[str]:
    return [result.state for result in made]


def images(folder: Path) -> dict[str, bytes]:
    """Bytes of every finished image under ``folder``, by its frame."""
    return {path.parent.name: path.read_bytes() for path in folder.glob("*/eia.png")}
