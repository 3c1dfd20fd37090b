"""Training scenes of ``training_scenes.py`` and random crops of them."""

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

SAMPLES = (1, 4, 16)  # of the renders in a file
CLEANEST = 32  # samples of the cleanest render; more are simulated
TEXTURED = 0.25  # of the crops get a texture: the scenes' own are seldom as fine as pixels
FINEST, COARSEST, MOST_SHIFT = 1.8, 8.0, 3.0  # period and movement from one elemental image to the next, in pixels
WITHOUT_GUIDES = 0.15  # of the crops
AROUND = 12  # pixels that the network may see around a crop
EXPOSURE, MOST_EXPOSURE = 1.2, 3.0  # stops, standard deviation and limit
SHOWN_AROUND = 5  # pixels whose neighbours count as shown


@dataclasses.dataclass(frozen=True)
class Scene:
    layers: dict[str, Array]  # as training/produce.py names them, (H, W, 4) and (H, W, 6) float16
    ei: tuple[int, int]  # (h, w) of an elemental image in pixels, (1, 1) where there are none
    scale: int
    validates: bool

    @property
    def is_tiled(self) -> bool:
        """Whether elemental images have views along both axes."""
        return min(self.ei) > 1


@dataclasses.dataclass(frozen=True)
class Crop:
    """A part of a scene, aligned with its elemental images; tensors (1, C, H, W)."""

    inputs: Tensor  # what the network sees, with pixels around
    target: Tensor  # scene-linear >= 0
    shown: Tensor  # 1 where anything shows
    inside: tuple[slice, slice]  # of the inputs, where the target lies
    ei: tuple[int, int]
    scale: int
    is_tiled: bool


def load_scenes(folder: str | Path, count: int = 0, *, guides: bool = False) -> list[Scene]:
    """Read every scene of a folder, or the first ``count`` and all that validate; LfsrError where there is none."""
    scenes = [load_scene(path, guides=guides) for path in sorted(Path(folder).glob("scene_*.npz"))]
    training = [scene for scene in scenes if not scene.validates]
    if not training or len(training) == len(scenes):
        raise LfsrError(f"{folder} holds {len(training)} training scenes and {len(scenes) - len(training)} that "
                        "validate, but both are needed: make at least ten with training_scenes.py")
    return training[:count or None] + [scene for scene in scenes if scene.validates]


def load_scene(path: Path, *, guides: bool = False) -> Scene:
    """Read one scene; LfsrError where the file is damaged or of another format."""
    with open_data(path, "a scene of training_scenes.py", "make it again") as content, np.load(content) as file:
        known = json.loads(str(file["meta"])).items()
        meta = from_data(_Meta, {name: value for name, value in known if name in _Meta.__dataclass_fields__}, "meta")
        kinds = {"color": 4} | ({"guides": 6} if guides else {})
        layers = {name: file[name] for name in file.files if name.partition("_")[0] in kinds}
        for name, layer in layers.items():
            if (layer.ndim != 3 or layer.shape[2] != kinds[name.partition("_")[0]] or layer.dtype.kind != "f"
                    or not np.isfinite(layer).all()):
                raise ValueError(f"a layer of shape {layer.shape} and type {layer.dtype}")
        across, down = (1 if meta.is_direct or count == 1 else count // meta.scale for count in meta.views)
        present = {name.rpartition("_")[0] for name in layers} | set(layers)
        [(height, width)] = {layer.shape[:2] for layer in layers.values()}
        wanted = {"color_target", *(f"color_{samples}" for samples in SAMPLES)}
        if not present >= wanted or height % down or width % across:
            raise ValueError(f"layers {', '.join(layers)} of {width}×{height} pixels")
        return Scene(layers, (down, across), meta.scale, meta.validates)


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


def noisy(scene: Scene, samples: int, rng: np.random.Generator) -> Array:
    """Colour (H, W, 3) float32 of a random render with ``samples``: 1, 2, 4, 8, 16, 32, or more from the target."""
    each = max(count for count in SAMPLES if count <= samples)
    names = [name for name in scene.layers if name.startswith(f"color_{each}_")]
    chosen = rng.permutation(names)[:min(samples, CLEANEST) // each]
    mean = np.mean([scene.layers[name][..., :3].astype(np.float32) for name in chosen], 0)
    if samples > CLEANEST:
        clean = scene.layers["color_target"][..., :3].astype(np.float32)
        mean = clean + math.sqrt(CLEANEST / samples) * (mean - clean)
    return np.asarray(mean)


def crop(scene: Scene, samples: int, rng: np.random.Generator, side: int, *, mirror: bool,
         augment: bool = True) -> Crop:
    """Return about ``side``² pixels of a scene; with ``augment`` anywhere, in any light, colour and orientation.

    ``mirror``: mirror every other elemental image, as the product does.
    """
    clean = scene.layers["color_target"].astype(np.float32)
    images = [noisy(scene, samples, rng), clean[..., :3], clean[..., 3:]]
    if guides := [name for name in scene.layers if name.startswith("guides") and name != "guides_target"]:
        near = min(guides, key=lambda name: abs(int(name.split("_")[1]) - samples))
        # Imported light fields have none, and the same weights are to denoise them.
        kept = not augment or rng.random() >= WITHOUT_GUIDES
        images.append(scene.layers[near].astype(np.float32) * np.float32(kept))
    if augment and rng.random() < TEXTURED:
        images = textured(images, samples, scene.ei, scene.scale, rng)
    if mirror:
        images = [mirrored(image, scene.ei) for image in images]
    images, margins = _cut(images, scene.ei, side, rng if augment else None)
    ei = scene.ei
    if augment:
        images, margins, ei = _augmented(images, margins, ei, rng)
    rendered, target, alpha, *rest = (torch.from_numpy(np.ascontiguousarray(image.transpose(2, 0, 1)))[None]
                                      for image in images)
    height, width = target.shape[2:]
    inside = (slice(margins[0], height - margins[1]), slice(margins[2], width - margins[3]))
    seen = [hdr_encode(rendered)]
    if rest:
        seen += [rest[0][:, :3].clamp(0, 1), normal_encode(rest[0][:, 3:])]
    shown = functional.max_pool2d((alpha > 0).float(), SHOWN_AROUND, 1, SHOWN_AROUND // 2)
    cut = (..., *inside)
    return Crop(torch.cat(seen, 1), target.clamp(min=0)[cut], shown[cut], inside, ei, scene.scale, scene.is_tiled)


def textured(images: Sequence[Array], samples: int, ei: tuple[int, int], scale: int,
             rng: np.random.Generator) -> list[Array]:
    """Print a fine periodic texture on everything: noisy colour, target, alpha, and the guides where there are some.

    It lies at a random depth, so that it moves from one elemental image to the next, and is as noisy as ``samples``
    random points in each pixel make it.
    """
    rendered, target, alpha, *rest = images
    clean, spread = _printed((target.shape[0], target.shape[1]), ei, scale, rng)
    drawn = np.clip(clean + spread * rng.normal(size=spread.shape) / math.sqrt(samples), 0, 1).astype(np.float32)
    darkest = rng.uniform(0.05, 0.7, 3).astype(np.float32)

    def shade(texture: Array) -> Array:
        return darkest + (1 - darkest) * texture[..., None]

    guides = [np.concatenate([image[..., :3] * shade(drawn), image[..., 3:]], -1) for image in rest]
    return [rendered * shade(drawn), target * shade(clean), alpha, *guides]


def _printed(size: tuple[int, int], ei: tuple[int, int], scale: int,
             rng: np.random.Generator) -> tuple[Array, Array]:
    """Mean and standard deviation (H, W) float32 within each pixel of a chequered or woven texture in [0, 1].

    The rays of a pixel cover the cell of one finished view at least; a lens widens it where depth is small.
    """
    period = np.exp(rng.uniform(math.log(FINEST), math.log(COARSEST)))
    turn, shift, sharp = rng.uniform(0, math.pi), rng.uniform(-MOST_SHIFT, MOST_SHIFT), rng.uniform(1, 8)
    within = ((np.arange(3) + 0.5) / 3 - 0.5) * rng.uniform(1 / scale, 1)
    places = []
    for length, pixels in zip(size, ei, strict=True):
        index = np.arange(length)
        moved = index % pixels - (index // pixels) * shift if pixels > 1 else index
        places.append((moved[:, None] + within).ravel())
    y, x = np.meshgrid(*places, indexing="ij", sparse=True)
    along, across = x * math.cos(turn) + y * math.sin(turn), y * math.cos(turn) - x * math.sin(turn)
    phase, wave = rng.uniform(0, 2 * math.pi), 2 * math.pi / period
    value = np.sin(along * wave + phase)
    if rng.random() < 0.7:
        value = value * np.sin(across * wave)
    value = (np.tanh(sharp * value) / math.tanh(sharp) + 1) / 2
    cells = value.reshape(size[0], 3, size[1], 3)
    return cells.mean((1, 3)).astype(np.float32), cells.std((1, 3)).astype(np.float32)


def mirrored(image: Array, ei: tuple[int, int]) -> Array:
    """Mirror every other elemental image of (H, W, C), as ``lfsr_core``'s denoiser does; its own inverse."""
    (h, w), (height, width, channels) = ei, image.shape
    result = image.reshape(height // h, h, width // w, w, channels).copy()
    result[1::2] = result[1::2, ::-1]
    result[:, :, 1::2] = result[:, :, 1::2, ::-1]
    return result.reshape(image.shape)


def _cut(images: Sequence[Array], ei: tuple[int, int], side: int,
         rng: np.random.Generator | None) -> tuple[list[Array], list[int]]:
    """Cut whole elemental images, and margins (above, below, left, right) around them."""
    cuts, margins = [], list[int]()
    size = images[0].shape[:2]
    for length, other, pixels in zip(size, size[::-1], ei, strict=True):
        wanted = min(length, max(side, side * side // other) if other < side else side)
        count = max(wanted // pixels, 1)
        free = length // pixels - count
        start = pixels * (free // 2 if rng is None else int(rng.integers(free + 1)))
        stop = start + count * pixels
        before, after = (int(rng.integers(AROUND + 1)) if rng is not None else 0 for _ in range(2))
        before, after = min(before, start), min(after, length - stop)
        cuts.append(slice(start - before, stop + after))
        margins += [before, after]
    return [image[cuts[0], cuts[1]] for image in images], margins


def _augmented(images: Sequence[Array], margins: list[int], ei: tuple[int, int],
               rng: np.random.Generator) -> tuple[list[Array], list[int], tuple[int, int]]:
    """Change exposure, order of colours and orientation; the last image may be albedo and normal."""
    gain = np.float32(2 ** np.clip(rng.normal(0, EXPOSURE), -MOST_EXPOSURE, MOST_EXPOSURE))
    order = rng.permutation(3)
    rendered, target, alpha, *rest = images
    result = [rendered[..., order] * gain, target[..., order] * gain, alpha,
              *(np.concatenate([image[..., :3][..., order], image[..., 3:]], -1) for image in rest)]
    above, below, left, right = margins
    if rng.random() < 0.5:
        result, above, below = [image[::-1] for image in result], below, above
    if rng.random() < 0.5:
        result, left, right = [image[:, ::-1] for image in result], right, left
    if rng.random() < 0.5:
        result, ei = [image.swapaxes(0, 1) for image in result], (ei[1], ei[0])
        above, below, left, right = left, right, above, below
    return result, [above, below, left, right], ei

