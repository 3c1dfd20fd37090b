"""Which lenses a plan samples, with which neighbours, and how they are arranged.

A denoiser looks at the neighbours of a lens. So a sampled lens is rendered with a block of lenses around it. The
blocks of all sampled lenses side by side are one small EIA, the mosaic, on which a method runs as on a whole frame.
"""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Iterable, Mapping, Sequence

import numpy as np

from lfsr_core.base.arrays import Array
from lfsr_core.frames.low_res import LowResEIA
from lfsr_core.optics.display import DisplayProfile
from lfsr_core.optics.lens_sampling import systematic_sample
from lfsr_core.plan.candidates import Candidate, low_pixels, samples_of

CONTEXT = 16  # low-resolution pixels around a sampled lens that a denoiser should see
WIDE_ENOUGH = 32  # pixels across an elemental image that needs no neighbours: most of it is far from the border
MOST_REACH = 2  # lenses on each side; more neighbours would cost more than the lens
REACH_IN_A_VIEW = 4  # for displays with parallax along one axis, whose elemental images are one pixel high
LEAST_LENSES, MOST_LENSES = 12, 192
EDGE_PART = 6  # one in so many sampled lenses lies beside the foreground, where the quick render may have missed it
LEAST_OF_STRATUM = 4
STRATA = ("foreground", "edge", "rest")
PLACES = np.array([1 << 32, 1])  # make one number of a row and a column

Lens = tuple[int, int]


@dataclasses.dataclass(frozen=True)
class Budget:
    """Cost of the sample, in mean path samples of a whole frame."""

    allowed: float  # at most, unless the least number of lenses takes more
    quick: float  # of the quick look at every lens
    cost_ratio: float  # of a path sample in a sampled lens, which shows more, to one in the mean lens
    reference: float  # path samples per sampled lens of the reference
    renders: Mapping[tuple[int, int], float]  # path samples per sampled lens of each render, by (scale, spp)

    @property
    def lenses(self) -> int:
        """Number of lenses that the budget allows, from LEAST_LENSES to MOST_LENSES.

        Renders that would take more than the reference do not count.
        """
        usual = self.reference + sum(cost for cost in self.renders.values() if cost < self.reference)
        affordable = int((self.allowed - self.quick) / (usual * self.cost_ratio))
        return min(max(affordable, LEAST_LENSES), MOST_LENSES)

    def cost(self, lenses: int, renders: Iterable[tuple[int, int]], reference: bool = True) -> float:
        """Cost of these renders of so many lenses and, unless it is there, of their ``reference``."""
        per_lens = self.reference * reference + sum(self.renders[key] for key in renders)
        return lenses * self.cost_ratio * per_lens


def reach(display: DisplayProfile, scale: int) -> int:
    """Neighbours on each side of a sampled lens at ``scale``."""
    if not all(display.parallax):
        return REACH_IN_A_VIEW
    width = min(display.low_views(scale))
    return 0 if width >= WIDE_ENOUGH else min(math.ceil(CONTEXT / width), MOST_REACH)


def budget(display: DisplayProfile, wanted: Sequence[Candidate], reference_spp: int, quick: float, cost_ratio: float,
           fraction: float, least: float = 0.0) -> Budget:
    """Budget of a sample of the candidates ``wanted``: a fraction of the path samples of the costliest one's frame.

    ``least``: path samples that are always allowed.
    """
    lenses = math.prod(display.lenses)
    renders = {(scale, spp): (2 * reach(display, scale) + 1) ** 2 * low_pixels(display, scale) / lenses * spp
               for scale, spp in {(candidate.scale, candidate.spp) for candidate in wanted}}
    costliest = max(samples_of(candidate, display) for candidate in wanted)
    reference = math.prod(display.views) * reference_spp
    return Budget(max(fraction * costliest, least), quick, cost_ratio, reference, renders)


def strata_masks(mask: Array, wide: Array) -> dict[str, Array]:
    """(sy, sx) bool by name of STRATA: the foreground ``mask``, its border in ``wide``, and all other lenses."""
    return {"foreground": mask, "edge": wide & ~mask, "rest": ~(mask | wide)}


def looks(least: int, most: int) -> tuple[int, ...]:
    """Numbers of lenses after each look of a sample that grows from ``least`` to ``most``, each about twice the last.

    A render starts with Blender, so lenses come in groups; and the fewer the looks, the narrower their bounds.
    """
    count = 1 + round(math.log2(most / least))
    ratio = (most / least) ** (1 / max(count - 1, 1))
    return (*(round(least * ratio**number) for number in range(count - 1)), most)


def samples(masks: Mapping[str, Array], counts: Sequence[int], seed: int, every: bool) -> list[dict[str, list[Lens]]]:
    """Choose random (row, column) lenses of each stratum, spread over it: those that each look adds.

    At least LEAST_OF_STRATUM of each stratum that has them. ``counts``: lenses after each look, about; looks that add
    none are left out. ``every``: True samples "rest" too, which the metric of the foreground ignores.
    """
    random, left, found = np.random.default_rng(seed), {name: np.argwhere(masks[name]) for name in STRATA}, []
    before = dict.fromkeys(STRATA, 0)
    for count in counts:
        sizes, added = _sizes(masks, count, every), {}
        for name in STRATA:
            chosen = systematic_sample(left[name], sizes[name] - before[name], random)
            left[name] = left[name][~np.isin(left[name] @ PLACES, chosen @ PLACES)]
            added[name] = sorted((int(row), int(column)) for row, column in chosen)
        before = sizes
        if any(added.values()):
            found.append(added)
    return found


def _sizes(masks: Mapping[str, Array], count: int, every: bool) -> dict[str, int]:
    """Number of lenses of each stratum in a sample of ``count``."""
    few = max(LEAST_OF_STRATUM, count // EDGE_PART)
    sizes = {"edge": few, "rest": few if every else 0}
    sizes = {name: min(size, int(masks[name].sum())) for name, size in sizes.items()}
    return sizes | {"foreground": min(max(LEAST_OF_STRATUM, count - sum(sizes.values())),
                                      int(masks["foreground"].sum()))}


def with_neighbours(lenses: Sequence[Lens], reach_: int, grid: tuple[int, int]) -> tuple[list[Lens], Array]:
    """Lenses to render, and the index into them of each lens of each block, (n, 2·reach + 1, 2·reach + 1).

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
        """Nearly square mosaic of ``blocks`` (n, side, side); unused places repeat the last block."""
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
        """(n,) bool: the values of a mask (rows, columns) of the rendered tiles at each block's centre."""
        centres: Array = tiles.reshape(-1)[self.index[tuple(self.centres.T)]]
        return centres
