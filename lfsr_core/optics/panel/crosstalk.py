"""How much of what an eye sees belongs to other views than the one whose place it is at.

Rays are traced from the eye to the subpixels that it sees; what those show is split over views as the weave does.
A subpixel is as wide as several views where a light field has more of them than the panel has subpixels behind a lens.
"""

from __future__ import annotations

import dataclasses

import numpy as np

from lfsr_core.arrays import Array
from lfsr_core.optics.display import DisplayProfile
from lfsr_core.optics.panel.subpixel_rays import Geometry, subpixel_rays
from lfsr_core.optics.panel.trace import trace

PLACES = (0.25, 0.5, 0.75)  # of the viewing zone
POINTS = 20_000
BORDER = 0.9  # share of the panel that is looked at: beyond it an eye at the side looks past the panel


@dataclasses.dataclass(frozen=True)
class ViewSpread:
    """What an eye at the centre of a view sees, averaged over the panel and some places of the zone; shares of 1."""

    own: float  # light of that view
    neighbours: float  # light of views beside it
    others: float  # light of any further view: crosstalk
    error: float  # mean of the views seen less the eye's, in views across: 0 where the weave is right


def view_spread(profile: DisplayProfile, seed: int = 0) -> ViewSpread:
    """By ``POINTS`` rays from each of ``PLACES``; ``profile`` must be woven."""
    random, parts = np.random.default_rng(seed), []
    for place in PLACES:
        view = tuple(round(place * (count - 1)) for count in profile.views)
        off = np.stack(_views_off(profile, view, random))
        on_place = np.clip(1 - np.abs(off), 0, None).prod(0)
        beside = sum(np.clip(1 - np.abs(off - step), 0, None) for step in (-1, 0, 1)).prod(0)
        parts.append((on_place.mean(), (beside - on_place).mean(), (1 - beside).mean(), off[0].mean()))
    return ViewSpread(*map(float, np.mean(parts, 0)))


def _views_off(profile: DisplayProfile, view: tuple[int, int], random: np.random.Generator) -> list[Array]:
    """Views, across and down, by which what an eye at the centre of ``view`` sees lies off it, at random points."""
    geometry = Geometry.of(profile)
    across, down = ((number - (count - 1) / 2) * geometry.spacing
                    for number, count in zip(view, profile.views, strict=True))
    x, y = ((random.random(POINTS) - 0.5) * size * BORDER for size in geometry.lens_plane)
    seen = trace(profile, (across, -down, geometry.distance), x, y)
    off = np.zeros((2, POINTS))
    for channel in range(3):
        rays = subpixel_rays(profile, channel, seen.row, seen.column)
        chosen = seen.channel == channel if seen.channel.min() >= 0 else np.arange(POINTS) % 3 == channel
        for axis, place in enumerate((rays.view_x, rays.view_y)):
            inside = np.clip(place, 0, profile.views[axis] - 1)
            off[axis] = np.where(chosen, inside - view[axis], off[axis])
    return [values[seen.on_panel] for values in off]
