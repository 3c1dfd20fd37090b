"""``lfsr compare DIR REFDIR``."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import Any

NAME = "compare"
HELP = "measure a finished frame against a reference; into report.json and as a table"

MEANING = {
    "p": "share of lenses that see the foreground",
    "ssim_eia": "SSIM over the whole EIA (split: the reference's noise cancels)",
    "ssim_eia_fg": "the same over foreground elemental images of that EIA",
    "ssim_lens": "SSIM of each elemental image on its own, mean over lenses (split)",
    "ssim_lens_fg": "the same over foreground lenses",
    "psnr_fg": "PSNR in dB over foreground elemental images (split)",
    "ssim_views_fg": "SSIM of the decoded views, foreground (split)",
    "ssim_eia_plain": "ordinary SSIM against the mean of the halves, as in the paper",
    "ssim_ceiling": "ordinary SSIM of one half of the reference against the other",
    "ssim_lens_plain": "ordinary SSIM of each elemental image on its own, against the mean of the halves",
    "ssim_lens_ceiling": "the same of one half of the reference against the other",
    "flip": "mean FLIP difference, 0 is identical",
    "recall": "share of the reference's foreground lenses that the mask found",
}


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Arguments of this verb."""
    parser.add_argument("folder", type=Path, metavar="DIR", help="finished frame folder")
    parser.add_argument("reference", type=Path, metavar="REFDIR", help="folder of `lfsr reference`")


def run(arguments: argparse.Namespace) -> None:
    """Compare and print."""
    from lfsr_core.metrics.compare import compare_folders

    print("\n".join(table(compare_folders(arguments.folder, arguments.reference))))


def table(metrics: dict[str, Any]) -> list[str]:
    """One line per known metric (value, 95 % interval of a sample of lenses, meaning), then one per note."""
    lines = [f"{name:17} {metrics[name]:8.4f}{_spread(metrics, name):10}  {meaning}"
             for name, meaning in MEANING.items() if metrics.get(name) is not None]
    return lines + metrics.get("notes", [])


def _spread(metrics: dict[str, Any], name: str) -> str:
    half_width = metrics.get("ci95", {}).get(name)
    return "" if half_width is None else f" ± {half_width:.4f}"
