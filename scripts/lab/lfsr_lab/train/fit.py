"""Fit one of our networks to one scene, from a few reference lenses, in seconds to a minute.

The weights serve that scene only, also over an animation. Their gain is measured on
lenses that the fit has not seen.
"""

from __future__ import annotations

import copy
import dataclasses
import time
from pathlib import Path

import numpy as np
import torch
from torch import Tensor

from lfsr_core.arrays import Array
from lfsr_core.errors import LfsrError
from lfsr_core.frames.frame import LOW_RES_FILE, read_frame
from lfsr_core.frames.low_res import low_resolution, read_world
from lfsr_core.frames.reference import Reference, check_reference
from lfsr_core.images.exr import read_finite
from lfsr_core.progress import Progress, silent
from lfsr_core.reconstruct.networks import catalogue, numpy_network
from lfsr_core.reconstruct.registry import method
from lfsr_core.reconstruct.world import prepared, world_behind
from lfsr_lab.networks import checkpoint
from lfsr_lab.networks.lightfield import LightFieldNet, conserve, display_values, encode, upscale
from lfsr_lab.networks.networks import load
from lfsr_lab.train.ssim import split_error_map, split_ssim_map

BATCH, RATE, MIN_LENSES = 16, 5e-4, 8
LENSES_PER_TEST_LENS = 4  # one lens in four tests the fit
STEPS_PER_MESSAGE = 25


@dataclasses.dataclass(frozen=True)
class FitOptions:
    """What to fit, and how long."""

    network: str = "refine"
    lenses: int = 24  # foreground lenses to learn from, at most
    seconds: float = 60.0
    seed: int = 0

    def __post_init__(self) -> None:
        if not catalogue.spec(self.network).light_field:
            raise LfsrError(f"network {self.network!r} was trained on photographs and cannot be fitted: "
                            "choose refine or light")
        if not (self.lenses >= MIN_LENSES and self.seconds >= 0 and 0 <= self.seed < 2**32):
            raise LfsrError(f"cannot fit {str(self.lenses)[:20]} lenses for {self.seconds} s from seed "
                            f"{str(self.seed)[:20]}: give at least {MIN_LENSES} lenses, at least 0 seconds and a seed "
                            "from 0 to 4294967295")


@dataclasses.dataclass(frozen=True)
class Fitted:
    """Result of a fit."""

    lenses: int  # learned from
    steps: int
    unseen_lenses: int  # the reference's other foreground lenses, which test the fit
    before: float  # mean split SSIM of the unseen lenses with the general weights
    after: float


@dataclasses.dataclass(frozen=True)
class Lenses:
    """Training data of N foreground lenses."""

    features: Tensor  # (N, C, h, w) network inputs
    base: Tensor  # (N, 3, h, w), what the network corrects
    light: Tensor  # (N, 3, 1, 1) rendered mean light
    halves: tuple[Tensor, Tensor]  # of the reference, (N, 3, h·s, w·s) sRGB values
    behind: Tensor  # scene-linear light of a separate world, (N, 3, h·s, w·s), or (N, 3, 1, 1) zeros without one
    scale: int

    def take(self, index: Array) -> Lenses:
        """Select the lenses of ``index``."""
        chosen = torch.from_numpy(index)
        return dataclasses.replace(self, features=self.features[chosen], base=self.base[chosen],
                                   light=self.light[chosen], behind=self.behind[chosen],
                                   halves=(self.halves[0][chosen], self.halves[1][chosen]))


def fit(folder: str | Path, reference: str | Path, output: str | Path, options: FitOptions | None = None,
        progress: Progress = silent) -> Fitted:
    """Continue training one of our networks on a few lenses of a reference; return its gain on other lenses.

    Parameters
    ----------
    folder : frame folder, rendered with albedo and normal
    reference : reference folder of the same frame, of all or of sampled lenses
    output : weights file to write, .safetensors
    options : network, number of lenses, time and seed
    progress : called every few steps

    Raises
    ------
    LfsrError : if the folders do not fit each other, a layer is missing or there are too few lenses
    """
    options = options or FitOptions()
    data = lenses_of(Path(folder), Path(reference), options.network)
    order = np.random.default_rng(options.seed).permutation(len(data.features))
    count = min(options.lenses, len(order) - max(1, len(order) // LENSES_PER_TEST_LENS))
    if count < MIN_LENSES:
        raise LfsrError(f"{reference} shows {len(order)} foreground lenses, but a fit needs {MIN_LENSES} and some to "
                        "test it: render a reference of more lenses")
    seen, unseen = data.take(order[:count]), data.take(order[count:])
    network, entry = load(options.network, data.scale), catalogue.spec(options.network)
    assert isinstance(network, LightFieldNet)
    torch.manual_seed(options.seed)
    before = score(network, unseen)
    network, steps = _descend(network, seen, options.seconds, progress)
    fitted = Fitted(count, steps, len(order) - count, before, score(network, unseen))
    facts = {**dataclasses.asdict(options), "fitted_to": str(folder), **dataclasses.asdict(fitted)}
    checkpoint.save(output, network, entry.trained_at or data.scale, facts, entry.options)
    return fitted


def lenses_of(folder: Path, reference: Path, name: str) -> Lenses:
    """Read the foreground lenses of ``reference`` and the network's inputs in ``folder``; LfsrError if they differ."""
    frame = read_frame(folder)
    check_reference(frame, read_frame(reference))
    low = low_resolution(read_finite(folder / LOW_RES_FILE)[0], frame, read_world(folder, frame))
    chain = method(catalogue.spec(name).chain(name))
    low = prepared(low, chain)
    known = Reference.read(reference)
    chosen = known.lenses[known.foreground]
    shipped = numpy_network.load(catalogue.weights_path(name, frame.scale))
    missing = [layer for layer in shipped.layers if layer not in low.layers]
    if missing:
        raise LfsrError(f"{folder} lacks the layers {', '.join(missing)} that {name!r} needs: "
                        "render it again with --layers albedo,normal")
    features, base = numpy_network.network_inputs(shipped, low, chosen)
    rendered = low.rendered[tuple(chosen.T)]
    a, b = (display_values(encode(_planes(half[known.foreground]))) for half in known.linear_images())
    behind = np.zeros((len(chosen), 1, 1, 3), np.float32) if low.world is None else (
        world_behind(chain.upscaler, low, chosen))
    return Lenses(_planes(features), _planes(base), _planes(rendered).mean((2, 3), keepdim=True), (a, b),
                  _planes(behind), frame.scale)


def score(network: LightFieldNet, data: Lenses) -> float:
    """Mean split SSIM of the finished EIs."""
    with torch.no_grad():
        parts = [data.take(index) for index in np.array_split(np.arange(len(data.base)), -(-len(data.base) // BATCH))]
        sums = [split_ssim_map(finished_images(network, part), *part.halves).mean() * len(part.base) for part in parts]
    return round(float(sum(sums)) / len(data.base), 5)


def finished_images(network: LightFieldNet, data: Lenses) -> Tensor:
    """Finished EIs (N, 3, h·s, w·s) in sRGB values, as the second stage computes them."""
    clean = conserve(network(data.features, data.base), data.light)
    return display_values(upscale(clean, data.scale), data.behind)


def _descend(network: LightFieldNet, seen: Lenses, seconds: float, progress: Progress) -> tuple[LightFieldNet, int]:
    """Do gradient steps for ``seconds``; return the network and the number of steps."""
    network = copy.deepcopy(network).train()
    optimizer = torch.optim.Adam(network.parameters(), RATE)
    started, steps, rng = time.monotonic(), 0, np.random.default_rng(torch.initial_seed() % 2**32)
    while (elapsed := time.monotonic() - started) < seconds:
        for group in optimizer.param_groups:
            group["lr"] = RATE * max(0.05, 1 - elapsed / seconds)
        batch = seen.take(rng.choice(len(seen.base), min(BATCH, len(seen.base)), replace=False))
        optimizer.zero_grad(set_to_none=True)
        guide = display_values(upscale(batch.base, batch.scale), batch.behind)
        split_error_map(finished_images(network, batch), *batch.halves, guide).mean().backward()
        optimizer.step()
        steps += 1
        if steps % STEPS_PER_MESSAGE == 0:
            progress("fit", elapsed / seconds, f"{steps} steps")
    return network.eval(), steps


def _planes(values: Array) -> Tensor:
    return torch.from_numpy(np.ascontiguousarray(values.transpose(0, 3, 1, 2)))
