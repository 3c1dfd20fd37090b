"""What one run of ``scripts/reproduce_paper.py`` measures."""

from __future__ import annotations

import dataclasses
from pathlib import Path
from typing import Any

from lfsr_core.bench.paper.cells import VERSION
from lfsr_core.optics.display import DisplayProfile, load_display

QUICK_DISPLAY = DisplayProfile("paper-quick", (192, 112), (192.0, 112.0), (12, 7), (16, 16), 250.0, 40.0)


@dataclasses.dataclass(frozen=True)
class Settings:
    """Everything that decides what is measured.

    Attributes
    ----------
    output: folder of everything that is made.
    scenes: scene files.
    bench: folder of renders on ``display``, may be shared.
    display: for accuracy.
    timing_display: for whole frames whose time counts.
    scale: factor of the low-resolution renders.
    spp: samples per pixel that a user renders with.
    clean_spp: samples per pixel nearly free of noise.
    reference_spp: samples per pixel of a reference.
    lenses: lenses of a reference, None for all.
    convention: where views lie, see ``Job``.
    weights: folder of trained networks, None for those that ship.
    train_minutes: training per missing network, 0 trains none.
    photographs, validation: to train with, empty for those of the built-in configs.
    device: for networks.
    render_device: for Cycles.
    blender: executable, None to look for one.
    repeats: runs of everything timed but renders.
    steps: elemental images per call in Fig. 10(a).
    moves: distances of the camera array in Fig. 10(b), as a share of its own.
    resolutions: divisors of ``timing_display`` in Fig. 12(a).
    workload: elemental images per frame and their low-resolution side where only a network is timed.
    quick: whether the run only touches every figure.
    """

    output: Path
    scenes: tuple[Path, ...]
    bench: Path
    display: DisplayProfile
    timing_display: DisplayProfile
    scale: int = 4
    spp: int = 16
    clean_spp: int = 4096
    reference_spp: int = 1024
    lenses: int | None = None
    convention: str = "centred"
    weights: Path | None = None
    train_minutes: float = 0.0
    photographs: str = ""
    validation: str = ""
    device: str = "auto"
    render_device: str = "CPU"
    blender: str | None = None
    repeats: int = 10
    steps: tuple[int, ...] = (8, 16, 32, 48, 80, 128, 208)
    moves: tuple[float, ...] = (0.3, 0.45, 0.7, 1.0, 1.6)
    resolutions: tuple[int, ...] = (4, 2, 1)
    workload: tuple[int, int] = (5184, 20)
    quick: bool = False

    def facts(self) -> dict[str, Any]:
        """What the page says about the run: no paths."""
        names = ("scale", "spp", "clean_spp", "reference_spp", "lenses", "convention", "train_minutes", "repeats",
                 "quick", "render_device")
        return {**{name: getattr(self, name) for name in names}, "display": self.display.name,
                "timing_display": self.timing_display.name, "version": VERSION,
                "scenes": [scene.stem for scene in self.scenes]}


def full(output: Path, scenes: tuple[Path, ...], **changes: Any) -> Settings:
    """Settings of the whole reproduction; ``changes`` replace single ones."""
    return Settings(**{"output": output, "scenes": scenes, "bench": output / "bench", "display": load_display("small"),
                       "timing_display": load_display("bupt-32in-8k")} | changes)


def quick(output: Path, scenes: tuple[Path, ...], **changes: Any) -> Settings:
    """Settings that touch every figure in a few minutes: the numbers mean little."""
    small = {"display": QUICK_DISPLAY, "timing_display": QUICK_DISPLAY, "spp": 4, "clean_spp": 64, "reference_spp": 32,
             "repeats": 6, "steps": (8, 48, 208), "moves": (0.5, 1.0, 2.0), "resolutions": (2, 1),
             "workload": (416, 20), "quick": True}
    return full(output, scenes, **small | changes)
