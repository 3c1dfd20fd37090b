"""What one run of ``python -m lfsr_lab.experiments.seed_paper`` measures."""

from __future__ import annotations

import dataclasses
from pathlib import Path
from typing import Any

from lfsr_core.optics.display import DisplayProfile, load_display

CELLS = "cells"  # folder of measurements
VERSION = 5  # increase it when a measurement of the same inputs yields other numbers
SCALE = 4  # factor of the low-resolution renders
QUICK_DISPLAY = DisplayProfile("paper-quick", (192, 112), (192.0, 112.0), (12, 7), (16, 16), 250.0, 40.0)


@dataclasses.dataclass(frozen=True)
class Settings:
    """Everything that decides what is measured."""

    output: Path  # folder of everything that is made
    scenes: tuple[Path, ...]  # scene files
    bench: Path  # folder of renders on ``display``, may be shared
    display: DisplayProfile  # for accuracy
    timing_display: DisplayProfile  # for times of whole frames
    spp: int = 16  # samples per pixel that a user renders with
    clean_spp: int = 4096  # samples per pixel nearly free of noise
    reference_spp: int = 1024  # samples per pixel of a reference
    weights: Path | None = None  # folder of trained networks, None for those that ship
    train_epochs: int = 0  # training per missing network, 0 trains none
    photographs: str = ""  # to train with, empty for those of the built-in configs
    device: str = "auto"  # for networks
    render_device: str = "CPU"  # for Cycles
    blender: str | None = None  # executable, None to look for one
    repeats: int = 10  # runs of everything timed but renders
    steps: tuple[int, ...] = (8, 16, 32, 48, 80, 128, 208)  # elemental images per call in Fig. 10(a)
    moves: tuple[float, ...] = (0.3, 0.45, 0.7, 1.0, 1.6)  # distances of the camera array in Fig. 10(b), 1: its own
    resolutions: tuple[int, ...] = (4, 2, 1)  # divisors of ``timing_display`` in Fig. 12(a)
    workload: tuple[int, int] = (5184, 20)  # elemental images and their side where only a network is timed
    quick: bool = False  # whether the run only touches every figure

    def facts(self) -> dict[str, Any]:
        """Return what the page says about the run: no paths."""
        names = ("spp", "clean_spp", "reference_spp", "train_epochs", "repeats", "quick", "render_device")
        return {**{name: getattr(self, name) for name in names}, "display": self.display.name,
                "timing_display": self.timing_display.name, "version": VERSION,
                "scenes": [scene.stem for scene in self.scenes]}


def make_settings(output: Path, scenes: tuple[Path, ...], is_quick: bool = False, **changes: Any) -> Settings:
    """Return the settings of a run; ``is_quick`` touches every figure in minutes, and its numbers mean little."""
    values: dict[str, Any] = {"display": load_display("small"), "timing_display": load_display("bupt-32in-8k")}
    if is_quick:
        values = {"display": QUICK_DISPLAY, "timing_display": QUICK_DISPLAY, "spp": 4, "clean_spp": 64, "repeats": 6,
                  "reference_spp": 32, "steps": (8, 48, 208), "moves": (0.5, 1.0, 2.0), "resolutions": (2, 1),
                  "workload": (416, 20), "quick": True}
    return Settings(output, scenes, **{"bench": output / "bench", **values, **changes})
