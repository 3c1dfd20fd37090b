"""Which lenses a plan looks at, with which neighbours, and how they lie together.

A denoiser sees the neighbours of a lens. So a sampled lens is rendered with a
block of them around it; the blocks of all sampled lenses side by side are one
small EIA, the mosaic, on which a method runs as on a whole one.
"""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Iterable, Mapping, Sequence

import numpy as np

from lfsr_core.arrays import Array
from lfsr_core.frames.low_res import LowResEIA
from lfsr_core.optics.display import DisplayProfile
from lfsr_core.optics.lens_sampling import systematic_sample
from lfsr_core.plan.candidates import Candidate, low_pixels, samples_of

CONTEXT = 16  # low-resolution pixels around a sampled lens that a denoiser should see
WIDE_ENOUGH = 32  # elemental images so wide need no neighbours: most of their pixels are far from the border
MOST_REACH = 2  # lenses on each side; beyond it the neighbours would cost more than the lens
REACH_IN_A_VIEW = 4  # where views differ along one axis: the denoiser sees whole views, a pixel per lens
LEAST_LENSES, MOST_LENSES = 12, 96
EDGE_SHARE = 6  # one sampled lens in so many lies beside the foreground, where the quick render may have missed it
LEAST_OF_STRATUM = 4
STRATA = ("foreground", "edge", "rest")

Lens = tuple[int, int]


@dataclasses.dataclass(frozen=True)
class QuickCost:
    """What the quick look cost, and what it says of costs."""

    samples: float  # path samples that were spent on every lens
    cost_ratio: float  # of a sample in a sampled lens, which shows more, to one in the mean lens


@dataclasses.dataclass(frozen=True)
class Budget:
    """What the sample may cost, in mean path samples of a whole frame."""

    allowed: float  # in all
    quick: QuickCost  # of the quick look
    reference: float  # path samples that one sampled lens of the reference takes
    renders: Mapping[tuple[int, int], float]  # the same of the renders, by (scale, spp)

    @property
    def lenses(self) -> int:
        """How many that pays for, at least LEAST_LENSES even where it does not.

        Counted without renders that would take more than the reference itself.
        """
        usual = self.reference + sum(cost for cost in self.renders.values() if cost < self.reference)
        affordable = int((self.allowed - self.quick.samples) / (usual * self.quick.cost_ratio))
        return min(max(affordable, LEAST_LENSES), MOST_LENSES)

    def cost(self, lenses: int, renders: Iterable[tuple[int, int]]) -> float:
        """Of the whole sample, with these renders of so many lenses."""
        per_lens = self.reference + sum(self.renders[key] for key in renders)
        return self.quick.samples + lenses * self.quick.cost_ratio * per_lens


def reach(display: DisplayProfile, scale: int) -> int:
    """Neighbours on each side of a sampled lens at ``scale``."""
    if not all(display.parallax):
        return REACH_IN_A_VIEW
    width = min(display.low_views(scale))
    return 0 if width >= WIDE_ENOUGH else min(math.ceil(CONTEXT / width), MOST_REACH)


def budget(display: DisplayProfile, wanted: Sequence[Candidate], reference_spp: int, quick: QuickCost,
           share: float) -> Budget:
    """What a sample may cost.

    Parameters
    ----------
    display, wanted : the display and the candidates that are sampled
    reference_spp : samples per pixel of all parts of the reference
    quick : as in Budget
    share : of the path samples of the costliest candidate's frame that the sample may take
    """
    lenses = math.prod(display.lenses)
    renders = {(scale, spp): (2 * reach(display, scale) + 1) ** 2 * low_pixels(display, scale) / lenses * spp
               for scale, spp in {(candidate.scale, candidate.spp) for candidate in wanted}}
    costliest = max(samples_of(candidate, display) for candidate in wanted)
    return Budget(share * costliest, quick, math.prod(display.views) * reference_spp, renders)


def strata_masks(mask: Array, wide: Array) -> dict[str, Array]:
    """(sy, sx) bool by name of STRATA: the foreground ``mask``, what ``wide`` has beside it, all others."""
    return {"foreground": mask, "edge": wide & ~mask, "rest": ~(mask | wide)}


def sample(masks: Mapping[str, Array], count: int, seed: int, whole: bool) -> dict[str, list[Lens]]:
    """Random (row, column) lenses of each stratum, spread over it; none that has LEAST_OF_STRATUM lenses gets fewer.

    Parameters
    ----------
    masks : of ``strata_masks``
    count : lenses in all, about
    seed : of the random numbers
    whole : True samples "rest" too, which cannot count for the foreground
    """
    random, few = np.random.default_rng(seed), max(LEAST_OF_STRATUM, count // EDGE_SHARE)
    sizes = {"edge": few, "rest": few if whole else 0}
    sizes = {name: min(size, int(masks[name].sum())) for name, size in sizes.items()}
    sizes["foreground"] = min(max(LEAST_OF_STRATUM, count - sum(sizes.values())), int(masks["foreground"].sum()))
    return {name: _as_lenses(systematic_sample(np.argwhere(masks[name]), sizes[name], random)) for name in STRATA}


def _as_lenses(places: Array) -> list[Lens]:
    return sorted((int(row), int(column)) for row, column in places)


def with_neighbours(lenses: Sequence[Lens], reach_: int, grid: tuple[int, int]) -> tuple[list[Lens], Array]:
    """Lenses to render, and which of them each block shows: indices (n, 2·reach + 1, 2·reach + 1).

    ``grid`` (sx, sy). Beyond the display's edge a block repeats the lens at the edge.
    """
    offsets = np.arange(-reach_, reach_ + 1)
    places = np.asarray(lenses)
    rows = np.clip(places[:, 0, None] + offsets, 0, grid[1] - 1)[:, :, None]
    columns = np.clip(places[:, 1, None] + offsets, 0, grid[0] - 1)[:, None, :]
    flat = np.broadcast_to(rows * grid[0] + columns, (len(places), len(offsets), len(offsets)))
    listed, index = np.unique(flat, return_inverse=True)
    return [(int(n) // grid[0], int(n) % grid[0]) for n in listed], index.reshape(flat.shape)


@dataclasses.dataclass(frozen=True)
class Mosaic:
    """Blocks of lenses side by side, as one small EIA."""

    index: Array  # (rows, columns) of its lenses, into a list of rendered ones
    centres: Array  # (n, 2) row and column of each block's middle

    @classmethod
    def of(cls, blocks: Array) -> Mosaic:
        """Nearly square mosaic of ``blocks`` (n, side, side); spare places repeat the last one."""
        count, side, _ = blocks.shape
        across = math.isqrt(count - 1) + 1
        down = math.ceil(count / across)
        filled = blocks[np.minimum(np.arange(across * down), count - 1)].reshape(down, across, side, side)
        places = np.stack(np.divmod(np.arange(count), across), -1) * side + side // 2
        return cls(filled.transpose(0, 2, 1, 3).reshape(down * side, across * side), places)

    @property
    def side(self) -> int:
        """Lenses across a block."""
        return 2 * int(self.centres[0, 0]) + 1

    def of_render(self, low: LowResEIA) -> LowResEIA:
        """The mosaic of a rendered list of lenses, whose tiles ``low`` holds in reading order."""
        return low.each(lambda layer: layer.reshape(-1, *layer.shape[2:])[self.index])

    def of_mask(self, tiles: Array) -> Array:
        """(n,) bool: what a mask (rows, columns) of the rendered tiles says of each block's centre."""
        return tiles.reshape(-1)[self.index[tuple(self.centres.T)]]
