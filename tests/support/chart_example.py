"""A chart made by formulas, for tests of what is drawn from it: nothing in it was measured."""

from __future__ import annotations

from typing import Any

from lfsr_core.bench.chart.analysis import CEILING, DIRECT, LOW, METRICS, analyse
from lfsr_core.metrics.eia_metrics import METRIC_NAMES

# name: (accuracy without noise, noise at one sample, seconds of the second stage)
LOW_METHODS = {"oidn+bilinear": (0.96, 0.22, 0.7), "bicubic": (0.97, 0.6, 0.1), "nearest": (0.85, 0.62, 0.08),
               "oidn+bicubic": (0.965, 0.25, 0.7), "oidn+lanczos": (0.962, 0.26, 0.8), "espcn": (0.955, 0.64, 0.2)}
DIRECT_METHODS = {"none": (1.0, 0.7, 0.4), "oidn": (0.99, 0.17, 2.5)}


def example(scenes: int = 6) -> dict[str, Any]:
    """Chart of so many scenes."""
    rows = [_scene(f"Scene{index + 1}", 1 + 0.7 * index) for index in range(scenes)]
    methods = [{"method": name, "parameters": 24_336 if name == "espcn" else None,
                "multiply_adds_per_low_pixel": 24_192.0 if name == "espcn" else None, "fresh_process_seconds": 1.5}
               for name in LOW_METHODS]
    settings = {"display": "small", "scale": 4, "spps": [1, 4, 16, 64], "direct_spps": [1, 4, 16],
                "methods": list(LOW_METHODS), "direct_methods": list(DIRECT_METHODS), "ours": "oidn+bilinear",
                "reference_spp": 1024, "lenses": None, "ceiling_spp": 4096, "repeats": 3, "render_repeats": 1}
    environment = {"cpu": "Example processor", "cores": 2, "memory_gib": 24.0, "system": "Linux", "python": "3.11.7",
                   "gpu": None, "versions": {"lfsr": "0.1", "numpy": "1.26.4"}}
    return {"format": 1, "settings": settings, "environment": environment, "methods": methods,
            "skipped": ["paper-gan at scale 4: paper-gan has no weights for it"], "scenes": rows}


def _scene(name: str, slowness: float) -> dict[str, Any]:
    cells = [_cell(LOW, method, 4, samples, slowness) for samples in (1, 4, 16, 64) for method in LOW_METHODS]
    cells += [_cell(DIRECT, method, 1, samples, slowness) for samples in (1, 4, 16) for method in DIRECT_METHODS]
    cells += [_cell(CEILING, method, 4, 4096, slowness) for method in LOW_METHODS]
    return {"scene": name, "blender": "5.0.1", "p": 0.3, "cells": cells,
            "reference": {"samples": 1024, "lenses": None, "seconds": 900.0},
            "analysis": [analyse(cells, "oidn+bilinear", metric) for metric in METRICS]}


def _cell(role: str, method: str, scale: int, samples: int, slowness: float) -> dict[str, Any]:
    best, noise, second = (DIRECT_METHODS if role == DIRECT else LOW_METHODS)[method]
    value = best - noise * (0.7 + 0.1 * slowness) * samples**-0.5
    render = slowness * (0.8 + 0.09 * samples * (16 if role == DIRECT else 1))
    seconds = [second, second * 1.1, second * 1.2]
    metrics = dict.fromkeys((*METRIC_NAMES, "recall"), value) | {"flip": (1 - value) / 4, "psnr_fg": 40 * value}
    return {"role": role, "method": method, "scale": scale, "samples": samples, "render_seconds": [render],
            "open_seconds": 0.9, "second_stage_seconds": seconds, "device": "CPU", "notes": [], "load_average": 0.5,
            "stage_seconds": {"load": 0.1, "mask": 0.0, "upscale": second - 0.05, "assemble": 0.0, "color": 0.0,
                              "write": 0.05},
            "seconds": {"median": render + seconds[1], "least": render + seconds[0], "most": render + seconds[2]},
            "metrics": metrics, "ci95": {"ssim_eia_fg": 0.01, "ssim_eia": 0.004, "psnr_fg": 0.3}}
