"""Crosstalk of a lens sheet: how much of what an eye sees belongs to views other than its own.

Rays are traced from the eye to the subpixels that it sees, and these are divided among views as in the weave.
A subpixel is as wide as several views if there are more views than subpixels behind a lens.
"""

from __future__ import annotations

import dataclasses

import numpy as np

from lfsr_core.optics.display import DisplayProfile
from lfsr_core.optics.panel.subpixel_rays import Geometry, subpixel_rays
from lfsr_core.optics.panel.trace import trace

PLACES = (0.25, 0.5, 0.75)  # of the viewing zone
POINTS = 20_000
BORDER = 0.9  # fraction of the panel that is measured: near its edge an eye at the side looks past the panel


@dataclasses.dataclass(frozen=True)
class ViewSpread:
    """Fractions of the light that an eye at the centre of a view sees, mean over the panel and places in the zone."""

    own: float  # from that view
    neighbours: float  # from the views beside it
    others: float  # from any other view: crosstalk
    error: float  # mean difference of the views seen from the eye's, in views across: 0 if the weave is correct


def view_spread(profile: DisplayProfile) -> ViewSpread:
    """Measure a display with a lens sheet by ``POINTS`` rays from each of ``PLACES``."""
    random, parts, geometry = np.random.default_rng(0), [], Geometry.of(profile)
    for place in PLACES:
        view = [round(place * (count - 1)) for count in profile.views]
        # An eye at the centre of that view looks at random points.
        across, down = ((number - (count - 1) / 2) * geometry.spacing
                        for number, count in zip(view, profile.views, strict=True))
        x, y = ((random.random(POINTS) - 0.5) * size * BORDER for size in geometry.lens_plane)
        seen = trace(profile, (across, -down, geometry.distance), x, y)
        off = np.zeros((2, POINTS))  # distances, in views across and down, of what it sees there
        for channel in range(3):
            rays = subpixel_rays(profile, channel, seen.row, seen.column)
            chosen = seen.channel == channel if seen.channel.min() >= 0 else np.arange(POINTS) % 3 == channel
            for axis, shown in enumerate((rays.view_x, rays.view_y)):
                inside = np.clip(shown, 0, profile.views[axis] - 1)
                off[axis] = np.where(chosen, inside - view[axis], off[axis])
        off = off[:, seen.on_panel]
        on_place = np.clip(1 - np.abs(off), 0, None).prod(0)
        beside = sum(np.clip(1 - np.abs(off - step), 0, None) for step in (-1, 0, 1)).prod(0)
        parts.append((on_place.mean(), (beside - on_place).mean(), (1 - beside).mean(), off[0].mean()))
    return ViewSpread(*map(float, np.mean(parts, 0)))
