"""Small rendered scenes to train on, as scripts/lab/lfsr_lab/scenes/training_scenes.py stores them."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np

LENSES, VIEWS, SCALE = (8, 6), 16, 4


def write_scenes(folder: Path) -> Path:
    """Three scenes of waves with exponential noise."""
    rng = np.random.default_rng(0)
    height, width = LENSES[1] * VIEWS, LENSES[0] * VIEWS
    y, x = np.mgrid[:height, :width]
    for index in range(3):
        image = np.stack([0.5 + 0.4 * np.sin(x / 9 + index + c) * np.cos(y / 11) for c in range(3)], -1)
        low = image.reshape(height // SCALE, SCALE, width // SCALE, SCALE, 3).mean((1, 3))
        noisy = low * rng.exponential(1, low.shape)
        normal = np.broadcast_to([1.0, 0.0, 0.0], low.shape)
        layers = np.concatenate([noisy, np.ones_like(low[..., :1]), low * 3, normal], -1)
        halves = {f"ref_{half}": np.concatenate([image * rng.normal(1, 0.02, image.shape), image[..., :1] * 0 + 1], -1)
                  for half in "ab"}
        denoised = {f"{kind}_4": low * rng.normal(1, 0.2, low.shape) for kind in ("oidn", "guided")}
        arrays = {"lr_4": layers, **denoised, **halves}
        meta = json.dumps({"spps": [4], "lenses": LENSES})
        np.savez(folder / f"scene_{index}.npz", meta=meta, **{k: v.astype(np.float16) for k, v in arrays.items()})
    return folder
