"""Validation of networks for photographs on rendered light fields, per EI."""

from __future__ import annotations

from pathlib import Path

import torch
from torch import nn

from lfsr_core.errors import LfsrError
from lfsr_lab.networks.srgb import srgb_encode
from lfsr_lab.train.lightfields.data import Scene, from_eis, load_scenes, make_batch
from lfsr_lab.train.lightfields.task import foreground
from lfsr_lab.train.ssim import masked_mean, split_ssim_map

PREFERRED_SAMPLES = 16


class SceneValidation:
    """Rendered scenes (*.npz of training_scenes.py) in ``folder``; LfsrError if there are none of that ``scale``."""

    def __init__(self, folder: str | Path, scale: int, device: torch.device) -> None:
        self._scenes, self._device = load_scenes(folder), device
        for scene in self._scenes:
            found = scene.halves.shape[-1] // next(iter(scene.low.values())).shape[-1]
            if found != scale:
                raise LfsrError(f"scene {scene.name} in {folder} has scale {found}, expected {scale}: "
                                f"validate on scenes rendered for that scale")

    @torch.no_grad()
    def figures(self, network: nn.Module) -> dict[str, float]:
        """Mean split SSIM and PSNR over foreground EIs, for noisy and denoised input at 16 samples, or at the most."""
        rows = [_score(network, scene, self._device) for scene in self._scenes]
        return {f"scenes.{name}": round(sum(row[name] for row in rows) / len(rows), 5) for name in rows[0]}


def _score(network: nn.Module, scene: Scene, device: torch.device) -> dict[str, float]:
    samples = PREFERRED_SAMPLES if PREFERRED_SAMPLES in scene.low else max(scene.low)
    batch = make_batch([scene], samples, device)
    a, b = (srgb_encode(half) for half in batch.halves.unbind(1))
    mask = foreground(batch, a.shape)
    scores = {}
    for name, layer in (("raw", "color"), ("oidn", "oidn")):
        image = from_eis(network(srgb_encode(batch.layers[layer])).clamp(0, 1), batch.lenses)
        error = masked_mean((image - a) * (image - b), mask).clamp_min(1e-9)
        scores[f"ssim_{name}{samples}"] = float(masked_mean(split_ssim_map(image, a, b), mask))
        scores[f"psnr_{name}{samples}"] = float(-10 * error.log10())
    return scores
