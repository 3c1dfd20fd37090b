"""What a method costs besides its measured seconds: multiply-adds, parameters, and the start of a program."""

from __future__ import annotations

import subprocess
import sys
import time
from pathlib import Path
from typing import Any

from lfsr_core import networks
from lfsr_core.bench.chart_cells import fingerprint_of_weights, scratch_copy
from lfsr_core.errors import LfsrError
from lfsr_core.files import read_json, write_json

FRESH_FILE = "fresh-process.json"
COUNTED_LENSES = (4, 3)


def network_cost(name: str, scale: int, low_views: tuple[int, int]) -> dict[str, Any]:
    """Parameters and multiply-adds per low-resolution pixel of the networks in a method; None where it has none.

    ``low_views`` (w, h): pixels of a low-resolution elemental image. Open Image Denoise is not counted: it does not
    tell.
    """
    counts = [_count(part, scale, low_views) for part in name.split("+") if part in networks.NETWORKS]
    if not counts:
        return {"parameters": None, "multiply_adds_per_low_pixel": None}
    return {"parameters": sum(count for count, _ in counts),
            "multiply_adds_per_low_pixel": float(sum(work for _, work in counts))}


def _count(part: str, scale: int, low_views: tuple[int, int]) -> tuple[int, float]:
    import torch

    from lfsr_core.networks.count import multiply_adds, parameters
    from lfsr_core.networks.lightfield import LightFieldNet

    network = networks.build(part, scale).eval()
    w, h = low_views
    if not isinstance(network, LightFieldNet):
        return parameters(network), multiply_adds(network, h, w)
    # Several lenses: some of its convolutions may go across them.
    sx, sy = COUNTED_LENSES
    features = torch.zeros(sx * sy, network.config.input_channels, h, w)
    return parameters(network), multiply_adds(network, h * sy, w * sx, features, features[:, :3], COUNTED_LENSES)


def fresh_seconds(folder: Path, name: str, chart_folder: Path, again: bool = False) -> float:
    """Wall seconds of `lfsr upscale` in a process of its own, start included; measured once per method and chart."""
    path, key = chart_folder / FRESH_FILE, f"{name} {fingerprint_of_weights(name)}"
    known = read_json(path, "seconds of fresh processes") if path.exists() else {}
    if key not in known or again:
        with scratch_copy(folder) as copy:
            known[key] = _timed([sys.executable, "-m", "lfsr_core.cli", "upscale", str(copy), "--method", name])
        write_json(path, known)
    return known[key]


def _timed(command: list[str]) -> float:
    started = time.perf_counter()
    finished = subprocess.run(command, capture_output=True, text=True, check=False)
    if finished.returncode:
        raise LfsrError(f"`{' '.join(command[3:])}` failed ({finished.stderr.strip()}): choose another method")
    return round(time.perf_counter() - started, 3)
