"""``lfsr compare DIR REFDIR``: metrics against a reference."""

from __future__ import annotations

import argparse
import dataclasses
from pathlib import Path
from typing import TYPE_CHECKING, Any

from lfsr_core.commands.sentences import sentence

if TYPE_CHECKING:
    from lfsr_core.metrics.compare import Metrics

NAME = "compare"
HELP = "measure a finished frame against a reference: print a table, write report.json"


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Arguments of this verb."""
    parser.add_argument("folder", type=Path, metavar="DIR", help="finished frame folder")
    parser.add_argument("reference", type=Path, metavar="REFDIR", help="folder of `lfsr reference`")


def run(arguments: argparse.Namespace) -> Any:
    """Compare and print."""
    from lfsr_core.metrics.compare import compare_folders

    metrics = compare_folders(arguments.folder, arguments.reference)
    print("\n".join(table(metrics)))
    return metrics


def table(metrics: Metrics) -> list[str]:
    """One line per known metric (value, 95 % interval of a sample of lenses, meaning), then one per note."""
    spread = {name: f" ± {half_width:.4f}" for name, half_width in metrics.ci95.items() if half_width is not None}
    lines = [f"{field.name:17} {value:8.4f}{spread.get(field.name, ''):10}  {field.metadata['meaning']}"
             for field in dataclasses.fields(metrics) if field.metadata
             and (value := getattr(metrics, field.name)) is not None]
    return [*lines, *map(sentence, metrics.notes)]
