"""Whole frames, measured: ``python -m lfsr_core.bench.chart.frames SCENE… -o DIR --json FILE``.

Each scene goes through the same commands a user types: `lfsr render`, `lfsr
reference --lenses N`, `lfsr compare`. What is complete in DIR is not done again.
"""

from __future__ import annotations

import argparse
import json
import subprocess
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from lfsr_core.bench.environment import environment
from lfsr_core.errors import LfsrError
from lfsr_core.files import read_json, write_json
from lfsr_core.frames.frame import REFERENCE_FILES, REPORT_FILE, read_frame
from lfsr_core.reconstruct.method_name import layers_of
from lfsr_core.records import to_data

STAGES = ("render", "load", "mask", "upscale", "assemble", "color", "write")
METRICS = ("ssim_eia", "ssim_eia_fg", "psnr_fg", "ssim_views_fg", "ssim_eia_plain", "ssim_ceiling", "flip")


def measure(scene: Path, options: argparse.Namespace) -> dict[str, Any]:
    """Render, reference and comparison of one scene, as far as they are missing; one JSON-ready row."""
    folder, reference = options.output / scene.stem, options.output / f"{scene.stem}-reference"
    display = ("--display", options.display)
    if not (folder / REPORT_FILE).exists():
        _lfsr("render", scene, "-o", folder, *display, "--scale", options.scale, "--spp", options.spp,
              "--layers", ",".join(layers_of(options.methods)) or "none", "--method", options.methods[0])
    if not all((reference / name).exists() for name in REFERENCE_FILES):
        _lfsr("reference", scene, "-o", reference, *display, "--spp", options.reference_spp, "--lenses", options.lenses)
    return {"scene": scene.stem, "reference_seconds": read_frame(reference).seconds,
            "methods": {method: _report(folder, reference, method) for method in options.methods}}


def _report(folder: Path, reference: Path, method: str) -> dict[str, Any]:
    """report.json of one method with its metrics; upscaled afresh so that every time is of this run."""
    _lfsr("upscale", folder, "--method", method)
    _lfsr("compare", folder, reference)
    return read_json(folder / REPORT_FILE, "the report of this run")


def _lfsr(*words: object) -> None:
    command = [sys.executable, "-m", "lfsr_core.cli", *map(str, words)]
    print("$ lfsr", *map(str, words), flush=True)
    if subprocess.run(command, check=False).returncode:
        raise LfsrError(f"`lfsr {' '.join(map(str, words))}` failed: correct what it says and run this again")


def markdown(rows: Sequence[dict[str, Any]]) -> str:
    """Two tables: seconds per stage, and metrics with their 95 % intervals over lenses."""
    times = [_line(row["scene"], method, *(f"{report['seconds'].get(stage, 0):.2f}" for stage in STAGES),
                   f"{report['peak_bytes'] / 2**30:.2f}", f"{report['foreground_share']:.3f}")
             for row in rows for method, report in row["methods"].items()]
    quality = [_line(row["scene"], method, *(_with_interval(report["metrics"], name) for name in METRICS))
               for row in rows for method, report in row["methods"].items()]
    return "\n".join([_line("scene", "method", *STAGES, "peak GiB", "p"), _line(*["---"] * 11), *times, "",
                      _line("scene", "method", *METRICS), _line(*["---"] * 9), *quality]) + "\n"


def _line(*cells: object) -> str:
    return "| " + " | ".join(map(str, cells)) + " |"


def _with_interval(metrics: dict[str, Any], name: str) -> str:
    value, half = metrics.get(name), metrics.get("ci95", {}).get(name)
    if value is None:
        return "–"
    return f"{value:.3f}" if half is None else f"{value:.3f} ± {half:.3f}"


def main(argv: Sequence[str] | None = None) -> int:
    """Measure every scene, then write the JSON and print the tables."""
    parser = argparse.ArgumentParser(prog="frames", description=__doc__.splitlines()[0])
    parser.add_argument("scenes", nargs="+", type=Path)
    parser.add_argument("-o", "--output", type=Path, required=True, help="folder of the frame folders")
    parser.add_argument("--json", type=Path, required=True)
    parser.add_argument("--display", default="bupt-32in-8k")
    parser.add_argument("--scale", type=int, default=4)
    parser.add_argument("--spp", type=int, default=16)
    parser.add_argument("--methods", type=lambda text: text.split(","),
                        default=["oidn-both+refine+epi", "oidn+bilinear", "oidn-fast+bilinear", "light", "bicubic"])
    parser.add_argument("--reference-spp", type=int, default=1024)
    parser.add_argument("--lenses", type=int, default=24)
    options = parser.parse_args(argv)
    settings = {name: getattr(options, name) for name in ("display", "scale", "spp", "reference_spp", "lenses")}
    rows = []
    for scene in options.scenes:
        rows.append(measure(scene, options))
        write_json(options.json, {"settings": settings, "environment": to_data(environment()), "scenes": rows})
    print(markdown(json.loads(options.json.read_text(encoding="utf-8"))["scenes"]))
    return 0


if __name__ == "__main__":
    sys.exit(main())
