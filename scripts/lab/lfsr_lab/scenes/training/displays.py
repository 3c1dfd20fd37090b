"""Displays that the training scenes are rendered for: true pixels, pitches and angles, few lenses."""

from __future__ import annotations

import numpy as np

from lfsr_core.optics.display import DisplayProfile, load_display

TRAIN = "train"
# lenses, views, lens pitch and distance in mm, weight: like `small`, `bupt-32in-8k`, `dense-8k`.
SORTS = (((16, 12), (40, 40), 14.76, 500.0, 0.6), ((12, 8), (80, 80), 7.38, 1000.0, 0.15),
         ((24, 18), (40, 40), 3.69, 1000.0, 0.1), ((16, 12), (40, 40), 7.38, 1000.0, 0.15))


def training_display(rng: np.random.Generator) -> DisplayProfile:
    """One of the sorts; at half of them the viewing angle is random."""
    weights = np.array([sort[-1] for sort in SORTS])
    angle = 40.0 if rng.random() < 0.5 else round(float(rng.uniform(25, 50)), 1)
    return _display(SORTS[rng.choice(len(SORTS), p=weights / weights.sum())], angle)


def _display(sort: tuple, angle: float) -> DisplayProfile:
    lenses, views, pitch, distance, _ = sort
    return DisplayProfile(TRAIN, tuple(n * k for n, k in zip(lenses, views, strict=True)),
                          tuple(n * pitch for n in lenses), lenses, views, distance, angle)


def choose_display(name: str, rng: np.random.Generator) -> DisplayProfile:
    """``train`` varies by scene; any other name or TOML file is that display for all."""
    return training_display(rng) if name == TRAIN else load_display(name)


def check_display(name: str, scale: int) -> None:
    """LfsrError for an unknown display, or where the scale does not divide its views."""
    for profile in [_display(sort, 40.0) for sort in SORTS] if name == TRAIN else [load_display(name)]:
        profile.low_views(scale)
