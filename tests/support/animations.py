"""Animations of a synthetic light field, and a Blender that is played by a script."""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence
from pathlib import Path

from lfsr_core.pipeline.animation import Animation, SecondStage, animation_of
from lfsr_core.pipeline.engine import Result, Tools
from tests.support.noisy_renders import JOB
from tests.support.played_blender import played_blender

SECOND = SecondStage("bicubic")


def animation(folder: Path, frames: range | tuple[int, ...], second: SecondStage = SECOND, **changes) -> Animation:
    """An animation of a scene file in ``folder``, to be rendered into its ``film``."""
    scene = folder / "scene.glb"
    if not scene.exists():
        scene.write_text("a scene")
    job = dataclasses.replace(JOB, **{"scene": str(scene), "output": str(folder / "film"), "scale": 2} | changes)
    return animation_of(job, frames, second)


def played_tools(folder: Path, chunk: int) -> Tools:
    """Tools with a played Blender in ``folder``, which takes ``chunk`` frames at a time."""
    return Tools(played_blender(folder / "blender"), chunk=chunk)


def states(results: Sequence[Result]) -> list[str]:
    return [result.state for result in results]


def images(folder: Path) -> dict[str, bytes]:
    """Bytes of every finished image under ``folder``, by its frame."""
    return {path.parent.name: path.read_bytes() for path in folder.glob("*/eia.png")}
