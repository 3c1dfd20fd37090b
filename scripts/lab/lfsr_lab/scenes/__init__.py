"""Scenes that are made inside Blender: to train on, to measure with, and the demo."""

from __future__ import annotations

from pathlib import Path


def scene_script(name: str) -> Path:
    """Path of a script of this package, to be run in Blender."""
    return Path(__file__).parent / name
