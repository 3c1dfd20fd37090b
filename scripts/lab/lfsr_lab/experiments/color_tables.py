"""How near the tables of colour chains (images/baked_color.py) come to Blender's own colours, chain by chain.

    python -m lfsr_lab.experiments.color_tables [--device NAME] [--view NAME] [--colors N]
"""

from __future__ import annotations

import argparse
import dataclasses
import sys
from collections.abc import Iterable, Iterator, Sequence

import numpy as np
import PyOpenColorIO as ocio

from lfsr_core.arrays import Array
from lfsr_core.images.baked_color import BRIGHTEST, STOPS
from lfsr_core.images.color_settings import ColorSettings
from lfsr_core.images.view_transform import MIN_BAKED_PIXELS, ViewTransform, find_config
from lfsr_lab.experiments.engine.report import markdown_table

PROMISED_STEPS, PROMISED_SHARE = 3, 0.999  # of 255: no colour further off, and so many within one
COLORS, SEED = 1 << 18, 1  # the tables were tried on others
BAKED, EXACT = "table", "exact"


@dataclasses.dataclass(frozen=True)
class Row:
    """One chain of view, look and screen."""

    settings: ColorSettings
    is_baked: bool  # False where the chain itself is used
    worst: int = 0  # steps of 255 of the colour furthest off
    within_one: float = 1.0  # share of colours at most one step off

    @property
    def kept(self) -> bool:
        """True if the chain keeps what is promised."""
        return self.worst <= PROMISED_STEPS and self.within_one >= PROMISED_SHARE


def chains(devices: Sequence[str] = (), views: Sequence[str] = ()) -> Iterator[ColorSettings]:
    """Every screen, view and look that Blender offers together, of those named or of all."""
    config = ocio.Config.CreateFromFile(str(find_config(ColorSettings())))
    for device in config.getDisplays():
        for view in config.getViews(device):
            if (not devices or device in devices) and (not views or view in views):
                yield from (ColorSettings(device, view, look) for look in ("None", *_looks(config, view)))


def _looks(config: ocio.Config, view: str) -> list[str]:
    """Looks that Blender shows beside a view: its own, or where it has none those of no view."""
    names = list(config.getLookNames())
    own = [name for name in names if name.startswith(f"{view} - ")]
    return own or [name for name in names if " - " not in name]


def measure(settings: ColorSettings, colors: Array) -> Row:
    """A chain's table against the chain, on ``colors`` (1, N, 3), scene-linear."""
    baked = ViewTransform(settings, MIN_BAKED_PIXELS)
    if not baked.is_baked:
        return Row(settings, False)
    steps = np.abs(baked.to_uint8(colors).astype(np.int16) - ViewTransform(settings).to_uint8(colors)).max(-1)
    return Row(settings, True, int(steps.max()), float(np.mean(steps <= 1)))


def random_colors(count: int) -> Array:
    """(1, count, 3) scene-linear: half of every lightness and saturation, a quarter greys, a quarter of two lights."""
    random = np.random.default_rng(SEED)
    stops = random.uniform(STOPS[0] - 4, STOPS[1], (count, 1)) + random.normal(0, 1.2, (count, 3))
    colors = np.minimum(2**stops, BRIGHTEST)
    quarter = count // 4
    colors[:quarter] = colors[:quarter, :1]
    colors[quarter:2 * quarter][np.arange(quarter), random.integers(0, 3, quarter)] = 0
    return colors.astype(np.float32)[None]


def table(rows: Iterable[Row]) -> list[str]:
    """Markdown, one line per chain."""
    return markdown_table(("screen", "view", "look", "shown by", "furthest off, of 255", "within one", "as promised"), (
        (row.settings.display_device, row.settings.view_transform, row.settings.look, BAKED if row.is_baked else EXACT,
         row.worst, f"{row.within_one:.4%}", "yes" if row.kept else "NO") for row in rows))


def main(arguments: Sequence[str] | None = None) -> int:
    """Measure and print; 1 where a chain does not keep what is promised."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--device", action="append", default=[], metavar="NAME", help="only this screen")
    parser.add_argument("--view", action="append", default=[], metavar="NAME", help="only this view")
    parser.add_argument("--colors", type=int, default=COLORS, metavar="N", help="default: %(default)s")
    options = parser.parse_args(arguments)
    colors, rows = random_colors(options.colors), []
    for settings in chains(options.device, options.view):
        rows.append(measure(settings, colors))
        print(table(rows[-1:])[-1], file=sys.stderr, flush=True)
    print("\n".join(table(rows)))
    return int(not all(row.kept for row in rows))


if __name__ == "__main__":
    sys.exit(main())
