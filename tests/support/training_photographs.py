"""Small photographs to train on."""

from pathlib import Path

import cv2
import numpy as np

from lfsr_lab.train.config import TrainConfig
from lfsr_lab.train.photographs.task import Photographs


def some_photographs(count=3, height=40, width=52, seed=0):
    """Smooth random some_photographs, a little different in size."""
    random, images = np.random.default_rng(seed), []
    for index in range(count):
        coarse = random.random((6, 7, 3), dtype=np.float32)
        image = cv2.resize(coarse, (width + 4 * index, height), interpolation=cv2.INTER_CUBIC)
        images.append((image.clip(0, 1) * 255).astype(np.uint8))
    return Photographs(tuple(f"{index}.png" for index in range(count)), tuple(images))


def write_photographs(folder: Path) -> Path:
    """Write the same photographs as PNG files."""
    folder.mkdir()
    for name, image in zip(some_photographs().names, some_photographs().images, strict=True):
        cv2.imwrite(str(folder / name), image[..., ::-1])
    return folder


def small(photographs, **changes):
    """A run of a second."""
    return TrainConfig(**{"network": "paper", "photographs": str(photographs), "scale": 2, "crop": 16,
                          "crops_per_photograph": 4, "batch": 4, "epochs": 3, "rate": 1e-3, "validate_every": 2,
                          "checkpoint_every": 2, "validation": str(photographs)} | changes)
