"""Batches of rendered training scenes, with real Monte Carlo noise and two reference halves."""

from __future__ import annotations

import dataclasses
import json
import zipfile
from pathlib import Path

import numpy as np
import torch
from einops import rearrange
from torch import Tensor

from lfsr_core.arrays import Array
from lfsr_core.errors import LfsrError
from lfsr_core.reconstruct.networks.numpy_network import ENCODED, MAX_LOG2_SAMPLES
from lfsr_lab.networks.lightfield import LightFieldConfig, encode

DENOISED = ("oidn", "guided")  # the two images of oidn-both
LAYER_CHANNELS = {"color": slice(0, 3), "alpha": slice(3, 4), "albedo": slice(4, 7), "normal": slice(7, 10)}


@dataclasses.dataclass
class Scene:
    """One rendered scene, half floats."""

    name: str
    lenses: tuple[int, int]
    low: dict[int, Tensor]  # by samples: (10, H/s, W/s) RGBA, albedo, normal
    denoised: dict[int, Tensor]  # by samples: (6, H/s, W/s) without and with guides
    halves: Tensor  # (2, 3, H, W), composited over black


@dataclasses.dataclass
class Batch:
    """Inputs of B scenes as N = B·sy·sx elemental images, and their reference halves."""

    layers: dict[str, Tensor]  # (N, C, h, w) each; "guide" is the colour of the render with most samples, denoised
    samples: int
    halves: Tensor  # (B, 2, 3, H, W)
    lenses: tuple[int, int]


def load_scenes(folder: str | Path) -> list[Scene]:
    """Read every ``*.npz`` of training_scenes.py in ``folder``, sorted by name; LfsrError if there is none."""
    paths = sorted(Path(folder).glob("*.npz"))
    if not paths:
        raise LfsrError(f"{folder} holds no training scenes (*.npz): render some with training_scenes.py")
    return [load_scene(path) for path in paths]


def load_scene(path: Path) -> Scene:
    """Read one scene file; LfsrError if it is not one."""
    try:
        with np.load(path) as data:
            meta = json.loads(str(data["meta"]))
            low = {spp: _planes(_bounded_albedo(data[f"lr_{spp}"])) for spp in meta["spps"]}
            denoised = {spp: torch.cat([_planes(data[f"{kind}_{spp}"]) for kind in DENOISED]) for spp in meta["spps"]}
            halves = torch.stack([_planes(data[key])[:3] for key in ("ref_a", "ref_b")])
    except (OSError, ValueError, KeyError, EOFError, zipfile.BadZipFile) as error:
        raise LfsrError(f"{path} cannot be read as a training scene ({error}): render it again") from None
    return Scene(path.stem, tuple(meta["lenses"]), low, denoised, halves)


def _bounded_albedo(low: Array) -> Array:
    """(H, W, 10) with albedo limited to 1, because Cycles adds emission to it."""
    return np.concatenate([low[..., :4], np.minimum(low[..., 4:7], 1), low[..., 7:]], -1)


def _planes(array: Array) -> Tensor:
    return torch.from_numpy(np.ascontiguousarray(array.transpose(2, 0, 1)))


def make_batch(scenes: list[Scene], samples: int, device: torch.device | str = "cpu",
               rng: np.random.Generator | None = None) -> Batch:
    """Return a batch on ``device`` of scenes of one shape, rendered with ``samples`` per pixel.

    ``rng`` augments all scenes alike; None leaves them as they are.
    """
    low, denoised, guide, halves = (torch.stack(planes).to(device).float() for planes in (
        [scene.low[samples] for scene in scenes], [scene.denoised[samples] for scene in scenes],
        [scene.denoised[max(scene.denoised)][:3] for scene in scenes], [scene.halves for scene in scenes]))
    lenses, clean = scenes[0].lenses, torch.cat([denoised, guide], 1)
    if rng is not None:
        low, clean, halves, lenses = _augment(low, clean, halves, lenses, rng)
    layers = {name: low[:, part] for name, part in LAYER_CHANNELS.items()}
    layers |= dict(zip((*DENOISED, "guide"), clean.split(3, 1), strict=True))
    return Batch({name: to_eis(value, lenses) for name, value in layers.items()}, samples, halves, lenses)


def _augment(low: Tensor, clean: Tensor, halves: Tensor, lenses: tuple[int, int], rng: np.random.Generator):
    """Mirror, transpose, change exposure and tint: each maps a light field to a light field."""
    normal_x, normal_y = 7, 8
    low = low.clone()
    if rng.random() < 0.5:
        low, clean, halves = low.flip(-1), clean.flip(-1), halves.flip(-1)
        low[:, normal_x] *= -1
    if rng.random() < 0.5:
        low, clean, halves = low.flip(-2), clean.flip(-2), halves.flip(-2)
        low[:, normal_y] *= -1
    if rng.random() < 0.5:
        low, clean, halves = low.transpose(-1, -2), clean.transpose(-1, -2), halves.transpose(-1, -2)
        # Rows count downwards and Y upwards: transposing the image maps (x, y) to (-y, -x).
        low = torch.cat([low[:, :7], -low[:, 8:9], -low[:, 7:8], low[:, 9:]], 1)
        lenses = lenses[::-1]
    order = torch.as_tensor(rng.permutation(3), device=low.device)
    gain = torch.as_tensor(2 ** (rng.normal(0, 0.5, (low.shape[0], 1)) + rng.normal(0, 0.15, (low.shape[0], 3))),
                           device=low.device, dtype=torch.float32)[:, :, None, None]
    low = torch.cat([low[:, order] * gain, low[:, 3:4], low[:, 4 + order], low[:, 7:]], 1)
    clean = torch.cat([image[:, order] * gain for image in clean.split(3, 1)], 1)
    return low, clean, halves[:, :, order] * gain[:, None], lenses


def to_eis(image: Tensor, lenses: tuple[int, int]) -> Tensor:
    """(B, C, H, W) -> (B·sy·sx, C, h, w)."""
    sx, sy = lenses
    return rearrange(image, "b c (sy h) (sx w) -> (b sy sx) c h w", sx=sx, sy=sy)


def from_eis(eis: Tensor, lenses: tuple[int, int]) -> Tensor:
    """(B·sy·sx, C, h, w) -> (B, C, H, W)."""
    sx, sy = lenses
    return rearrange(eis, "(b sy sx) c h w -> b c (sy h) (sx w)", sx=sx, sy=sy)


def network_inputs(layers: dict[str, Tensor], samples: int, config: LightFieldConfig) -> tuple[Tensor, Tensor]:
    """Compute the features (N, C, h, w) and base (N, 3, h, w) of ``config`` from linear layers of EIs."""
    values = {name: encode(layers[name]) if name in ENCODED else layers[name] for name in config.inputs}
    level = torch.full_like(layers["alpha"], float(np.log2(samples)) / MAX_LOG2_SAMPLES)
    base = values[config.base] if config.base in values else encode(layers[config.base])
    return torch.cat([values[name] for name in config.inputs] + [level], 1), base
