"""Training scenes of ``training_scenes.py``, and batches of random crops of them on the device that trains."""

from __future__ import annotations

import dataclasses
import json
import math
from collections.abc import Sequence
from pathlib import Path

import numpy as np
import torch
from torch import Tensor
from torch.nn import functional

from lfsr_core.base.arrays import Array
from lfsr_core.base.messages import LfsrError
from lfsr_core.base.records import from_data
from lfsr_lab.networks.denoiser import hdr_encode, normal_encode
from lfsr_lab.train.loop import open_data

# Samples, and number among the renders with as many.
RENDERS = ("1_0", "1_1", "1_2", "1_3", "4_0", "4_1", "4_2", "16_0", "16_1")
COUNTS = tuple(int(name.partition("_")[0]) for name in RENDERS)
GUIDED = tuple(dict.fromkeys(COUNTS))  # samples of the guides in a file
KINDS = {"color": 4, "guides": 6}  # layers and their channels
TEXTURED = 0.25  # of the crops get a texture: the scenes' own are seldom as fine as pixels
FINEST, COARSEST, MOST_SHIFT = 1.8, 8.0, 3.0  # period and movement from one elemental image to the next, in pixels
WITHOUT_GUIDES = 0.15  # of the crops
AROUND, AT_BORDER = 12, 0.3  # pixels that the network may see around a crop; how often it lies at the image's border
EXPOSURE, MOST_EXPOSURE = 1.2, 3.0  # stops, standard deviation and limit
SHOWN_AROUND = 5  # pixels whose neighbours count as shown


@dataclasses.dataclass(frozen=True)
class Scene:
    layers: Tensor  # (C, H, W) float16: target and its opacity, colours of RENDERS, guides of GUIDED
    ei: tuple[int, int]  # (h, w) of an elemental image in pixels, (1, 1) where there are none
    scale: int
    validates: bool

    @property
    def lenses(self) -> tuple[int, int]:
        return self.layers.shape[1] // self.ei[0], self.layers.shape[2] // self.ei[1]


@dataclasses.dataclass(frozen=True)
class Crops:
    """Parts of scenes with elemental images of one size, aligned with these; tensors (B, C, H, W)."""

    inputs: Tensor  # what the network sees, with pixels around
    target: Tensor  # scene-linear >= 0
    shown: Tensor  # 1 where anything shows
    inside: tuple[slice, slice]  # of the inputs, where the target lies
    ei: tuple[int, int]
    scales: tuple[int, ...]  # (B,)

    @property
    def is_tiled(self) -> bool:
        """Whether elemental images have views along both axes."""
        return min(self.ei) > 1


def load_scenes(folder: str | Path, count: int = 0) -> list[Scene]:
    """Read every scene of a folder, or the first ``count`` and all that validate; LfsrError where there is none."""
    scenes = [load_scene(path) for path in sorted(Path(folder).glob("scene_*.npz"))]
    training = [scene for scene in scenes if not scene.validates]
    if not training or len(training) == len(scenes):
        raise LfsrError(f"{folder} holds {len(training)} training scenes and {len(scenes) - len(training)} that "
                        "validate, but both are needed: make at least ten with training_scenes.py")
    return training[:count or None] + [scene for scene in scenes if scene.validates]


def load_scene(path: Path) -> Scene:
    """Read one scene; LfsrError where the file is damaged or of another format."""
    with open_data(path, "a scene of training_scenes.py", "make it again") as content, np.load(content) as file:
        facts = json.loads(str(file["meta"])).items()
        meta = from_data(_Meta, {name: value for name, value in facts if name in _Meta.__dataclass_fields__}, "meta")
        names = [*(f"color_{name}" for name in ("target", *RENDERS)), *(f"guides_{count}_0" for count in GUIDED)]
        layers = [file[name] for name in names]
        for name, layer in zip(names, layers, strict=True):
            if (layer.ndim != 3 or layer.shape[2] != KINDS[name.partition("_")[0]] or layer.dtype.kind != "f"
                    or not np.isfinite(layer).all()):
                raise ValueError(f"a layer of shape {layer.shape} and type {layer.dtype}")
        across, down = (1 if meta.is_direct or count == 1 else count // meta.scale for count in meta.views)
        [(height, width)] = {layer.shape[:2] for layer in layers}
        if height % down or width % across:
            raise ValueError(f"layers of {width}×{height} pixels")
        colors, guides = layers[1:len(RENDERS) + 1], layers[len(RENDERS) + 1:]
        stack = np.concatenate([layers[0], *(layer[..., :3] for layer in colors), *guides], -1).astype(np.float16)
        stack = np.ascontiguousarray(mirrored(stack, (down, across)).transpose(2, 0, 1))
        return Scene(torch.from_numpy(stack), (down, across), meta.scale, meta.validates)


@dataclasses.dataclass(frozen=True)
class _Meta:
    """What a file says of its scene, as far as training needs it."""

    scale: int
    views: tuple[int, int]
    is_direct: bool
    validates: bool

    def __post_init__(self) -> None:
        if min(self.scale, *self.views) < 1 or any(1 < count < self.scale for count in self.views):
            raise LfsrError(f"the scale is {self.scale} and views are {self.views}")


def mirrored(image: Array, ei: tuple[int, int]) -> Array:
    """Mirror every other elemental image of (H, W, C), as ``lfsr_core``'s denoiser does; its own inverse."""
    (h, w), (height, width, channels) = ei, image.shape
    result = image.reshape(height // h, h, width // w, w, channels).copy()
    result[1::2] = result[1::2, ::-1]
    result[:, :, 1::2] = result[:, :, 1::2, ::-1]
    return result.reshape(image.shape)


def crops(scenes: Sequence[Scene], samples: Sequence[int], rng: np.random.Generator, side: int, device: torch.device, *,
          augment: bool = True) -> Crops:
    """Cut about ``side``² pixels from each of ``scenes``, whose elemental images have one size.

    ``samples``: per pixel, of each. With ``augment`` anywhere, in any light, colour and orientation.
    """
    ei = scenes[0].ei
    spans, margins = [], list[tuple[int, int]]()
    for axis, pixels in enumerate(ei):
        lenses = min(scene.lenses[axis] for scene in scenes)
        before, after = (int(rng.integers(AROUND + 1)) if augment else 0 for _ in range(2))
        if rng.random() < AT_BORDER or lenses <= 2 + 2 * -(-AROUND // pixels):
            before = after = 0
        first, last = -(-before // pixels), -(-after // pixels)
        count = max(min(side // pixels, lenses - first - last), 1)
        starts = []
        for scene in scenes:
            free = scene.lenses[axis] - last - count
            start = pixels * (int(rng.integers(first, free + 1)) if augment else (first + free) // 2)
            starts.append((start, slice(start - before, start + count * pixels + after)))
        spans.append(starts)
        margins.append((before, after))
    parts = torch.stack([scene.layers[:, down, across].to(device, torch.float32)
                         for scene, (_, down), (_, across) in zip(scenes, *spans, strict=True)])
    clean, alpha, renders, guides = parts.split((3, 1, 3 * len(RENDERS), KINDS["guides"] * len(GUIDED)), 1)
    mixed, shrink = zip(*(_mix(count, rng) for count in samples), strict=True)
    noisy = torch.einsum("brchw,br->bchw", renders.unflatten(1, (len(RENDERS), 3)),
                         torch.tensor(np.array(mixed), dtype=torch.float32, device=device))
    less = torch.tensor(shrink, dtype=torch.float32, device=device)[:, None, None, None]
    rendered = (clean + less * (noisy - clean)).clamp(min=0)
    nearest = [min(range(len(GUIDED)), key=lambda place, count=count: abs(GUIDED[place] - count))  # type: ignore[misc]
               for count in samples]
    guides = guides.unflatten(1, (len(GUIDED), KINDS["guides"]))[torch.arange(len(scenes)), nearest]
    if augment:
        places = [[start for start, _ in axis] for axis in spans]
        print_textures((rendered, clean, guides), samples, places, margins, scenes, rng)
        # Imported light fields have none, and the same weights are to denoise them.
        guides = guides * torch.tensor(rng.random(len(scenes)) >= WITHOUT_GUIDES, device=device)[:, None, None, None]
        stops = np.clip(rng.normal(0, EXPOSURE, len(scenes)), -MOST_EXPOSURE, MOST_EXPOSURE)
        gain = torch.tensor(2 ** stops, dtype=torch.float32, device=device)[:, None, None, None]
        order = torch.tensor(np.array([rng.permutation(3) for _ in scenes]), device=device)[:, :, None, None]
        rendered, clean = (gain * image.gather(1, order.expand_as(image)) for image in (rendered, clean))
        guides = torch.cat([guides[:, :3].gather(1, order.expand_as(clean)), guides[:, 3:]], 1)
    shown = functional.max_pool2d((alpha > 0).float(), SHOWN_AROUND, 1, SHOWN_AROUND // 2)
    images = torch.cat([hdr_encode(rendered), guides[:, :3].clamp(0, 1), normal_encode(guides[:, 3:]),
                        clean.clamp(min=0), shown], 1)
    if augment:
        for axis in (0, 1):
            if rng.random() < 0.5:
                images, margins[axis] = images.flip(2 + axis), margins[axis][::-1]
        if rng.random() < 0.5:
            images, margins, ei = images.transpose(2, 3), margins[::-1], ei[::-1]
    down, across = (slice(before, length - after) for (before, after), length in
                    zip(margins, images.shape[2:], strict=True))
    return Crops(images[:, :9], images[:, 9:12, down, across], images[:, 12:, down, across], (down, across), ei,
                 tuple(scene.scale for scene in scenes))


def _mix(samples: int, rng: np.random.Generator) -> tuple[Array, float]:
    """Weights of RENDERS whose mean has at most ``samples``, and by how much noise is less with all of them."""
    largest = max(count for count in COUNTS if count <= samples)
    chosen = rng.permutation([place for place, count in enumerate(COUNTS) if count == largest])[:samples // largest]
    weights = np.zeros(len(RENDERS))
    weights[chosen] = 1 / len(chosen)
    return weights, math.sqrt(largest * len(chosen) / samples)


def print_textures(images: Sequence[Tensor], samples: Sequence[int], places: Sequence[Sequence[int]],
                   margins: Sequence[tuple[int, int]], scenes: Sequence[Scene], rng: np.random.Generator) -> None:
    """Print a fine periodic texture on everything in TEXTURED of the crops: noisy colour, target and albedo.

    It lies at a random depth, so that it moves from one elemental image to the next, and is as noisy as ``samples``
    random points in each pixel make it.
    """
    rendered, clean, guides = images
    noise = torch.Generator(rendered.device).manual_seed(int(rng.integers(2**31)))
    for index in np.flatnonzero(rng.random(len(scenes)) < TEXTURED):
        scene = scenes[index]
        axes = [(start[index] - before, image) for start, (before, _), image in
                zip(places, margins, rendered.shape[2:], strict=True)]
        clear, spread = printed(axes, scene.ei, scene.scale, rng, rendered.device)
        chance = torch.randn(spread.shape, generator=noise, device=spread.device)
        drawn = (clear + spread / math.sqrt(samples[index]) * chance).clamp(0, 1)
        darkest = torch.tensor(rng.uniform(0.05, 0.7, 3), dtype=torch.float32, device=clear.device)[:, None, None]
        for image, texture in ((rendered, drawn), (clean, clear), (guides[:, :3], drawn)):
            image[index] *= darkest + (1 - darkest) * texture


def printed(axes: Sequence[tuple[int, int]], ei: tuple[int, int], scale: int, rng: np.random.Generator,
            device: torch.device) -> tuple[Tensor, Tensor]:
    """Mean and standard deviation (H, W) within each pixel of a chequered or woven texture in [0, 1].

    ``axes``: first pixel and their number, down and across, in an image with every other elemental image mirrored. The
    rays of a pixel cover the cell of one finished view at least; a lens widens it where depth is small.
    """
    period = np.exp(rng.uniform(math.log(FINEST), math.log(COARSEST)))
    turn, shift, sharp = rng.uniform(0, math.pi), rng.uniform(-MOST_SHIFT, MOST_SHIFT), rng.uniform(1, 8)
    within = ((np.arange(3) + 0.5) / 3 - 0.5) * rng.uniform(1 / scale, 1)
    lines = []
    for (first, length), pixels in zip(axes, ei, strict=True):
        index = first + np.arange(length)
        lens, view = np.divmod(index, pixels)
        view = np.where(lens % 2 == 1, pixels - 1 - view, view)
        moved = view - lens * shift if pixels > 1 else index
        lines.append(torch.tensor((moved[:, None] + within).ravel(), dtype=torch.float32, device=device))
    y, x = lines[0][:, None], lines[1][None]
    along, across = x * math.cos(turn) + y * math.sin(turn), y * math.cos(turn) - x * math.sin(turn)
    phase, wave = rng.uniform(0, 2 * math.pi), 2 * math.pi / period
    value = torch.sin(along * wave + phase)
    if rng.random() < 0.7:
        value = value * torch.sin(across * wave)
    cells = ((torch.tanh(sharp * value) / math.tanh(sharp) + 1) / 2).reshape(axes[0][1], 3, axes[1][1], 3)
    cells = cells.transpose(1, 2).flatten(2)
    return cells.mean(2), cells.std(2, correction=0)
