"""``lfsr compare DIR REFDIR``."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from lfsr_core.metrics.compare import Metrics

NAME = "compare"
HELP = "measure a finished frame against a reference: print a table, write report.json"

MEANING = {
    "p": "fraction of the lenses that show foreground",
    "ssim_eia": "SSIM of the whole EIA (split: the reference's noise cancels)",
    "ssim_eia_fg": "the same, foreground elemental images only",
    "ssim_lens": "mean SSIM of single elemental images (split)",
    "ssim_lens_fg": "the same, foreground lenses only",
    "psnr_fg": "PSNR in dB of foreground elemental images (split)",
    "ssim_views_fg": "SSIM of the decoded views, foreground (split)",
    "ssim_eia_plain": "ordinary SSIM against the mean of the halves, as in the paper",
    "ssim_ceiling": "ordinary SSIM of one half of the reference against the other",
    "ssim_lens_plain": "mean ordinary SSIM of single elemental images against the mean of the halves",
    "ssim_lens_ceiling": "the same, one half of the reference against the other",
    "flip": "mean FLIP difference, 0 is identical",
    "recall": "fraction of the reference's foreground lenses in the mask",
}


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Arguments of this verb."""
    parser.add_argument("folder", type=Path, metavar="DIR", help="finished frame folder")
    parser.add_argument("reference", type=Path, metavar="REFDIR", help="folder of `lfsr reference`")


def run(arguments: argparse.Namespace) -> None:
    """Compare and print."""
    from lfsr_core.metrics.compare import compare_folders

    print("\n".join(table(compare_folders(arguments.folder, arguments.reference))))


def table(metrics: Metrics) -> list[str]:
    """One line per known metric (value, 95 % interval of a sample of lenses, meaning), then one per note."""
    lines = [f"{name:17} {getattr(metrics, name):8.4f}{_spread(metrics, name):10}  {meaning}"
             for name, meaning in MEANING.items() if getattr(metrics, name) is not None]
    return [*lines, *metrics.notes]


def _spread(metrics: Metrics, name: str) -> str:
    half_width = metrics.ci95.get(name)
    return "" if half_width is None else f" ± {half_width:.4f}"
