"""Which backend and how many EIs per call: measured once per machine, remembered in the user's cache."""

from __future__ import annotations

import hashlib
import json
import os
import platform
import sys
import time
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import torch
from torch import Tensor

from lfsr_core.errors import LfsrError
from lfsr_core.files import read_json, write_json
from lfsr_core.networks.backends import Backend

REPEATS = 2
# Low-resolution pixels per call that are tried: 16 and 64 EIs of 20×20 on a CPU, whose cache they fill;
# 324 to 5184 on a GPU.
TRIED_PIXELS = {"cpu": (6_400, 25_600), "cuda": (129_600, 518_400, 2_073_600)}


def cache_file() -> Path:
    """File of remembered choices, in the user's cache folder."""
    if sys.platform == "win32":
        base = os.environ.get("LOCALAPPDATA") or Path.home() / "AppData" / "Local"
    elif sys.platform == "darwin":
        base = Path.home() / "Library" / "Caches"
    else:
        base = os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache"
    return Path(base) / "lfsr" / "inference.json"


def choose(backends: Sequence[Backend], apply: Callable[[Backend, Tensor], Tensor], example: Tensor,
           identity: str, step: int | None = None) -> tuple[Backend, int]:
    """Fastest backend and step for EIs like ``example`` (1, h, w, 3).

    ``apply`` runs a batch as the engine will. ``identity`` names the network; the
    choice is looked up under it, the machine, the versions and the EI's size.
    """
    named = {backend.name: backend for backend in backends}
    key = _key(identity, example, sorted(named), step)
    known = _remembered().get(key)
    if known and known["backend"] in named:
        return named[known["backend"]], known["step"]
    best = min(_trials(backends, apply, example, step))
    _, name, steps = best
    _remember(key, {"backend": name, "step": steps})
    return named[name], steps


def _trials(backends: Sequence[Backend], apply: Callable[[Backend, Tensor], Tensor], example: Tensor,
            step: int | None) -> list[tuple[float, str, int]]:
    """(seconds per EI, backend, step) of every combination."""
    results = []
    for backend in backends:
        pixels = example.shape[1] * example.shape[2]
        sizes = [step] if step else sorted({max(1, tried // pixels) for tried in TRIED_PIXELS[backend.device.type]})
        eis = example.to(backend.device).expand(max(sizes), *example.shape[1:]).contiguous()
        for size in sizes:
            results.append((_seconds(backend, apply, eis.split(size)) / len(eis), backend.name, size))
    return results


def _seconds(backend: Backend, apply: Callable[[Backend, Tensor], Tensor], batches: Sequence[Tensor]) -> float:
    """Best of a few runs, the first one not counted."""
    times = []
    for _ in range(1 + REPEATS):
        started = time.perf_counter()
        for batch in batches:
            apply(backend, batch)
        if backend.device.type == "cuda":
            torch.cuda.synchronize()
        times.append(time.perf_counter() - started)
    return min(times[1:])


def _key(identity: str, example: Tensor, names: list[str], step: int | None) -> str:
    machine = [platform.machine(), platform.processor(), os.cpu_count(), torch.get_num_threads(), torch.__version__]
    if torch.cuda.is_available():
        machine.append(torch.cuda.get_device_name())
    facts = json.dumps([identity, list(example.shape[1:]), names, step, machine])
    return hashlib.sha256(facts.encode()).hexdigest()[:24]


def _remembered() -> dict[str, Any]:
    """Choices so far; none if the file is missing or damaged, because it can always be measured again."""
    try:
        known = read_json(cache_file(), "remembered inference settings")
    except LfsrError:
        return {}
    return known if isinstance(known, dict) else {}


def _remember(key: str, choice: dict[str, Any]) -> None:
    try:
        write_json(cache_file(), {**_remembered(), key: choice})
    except LfsrError as error:
        # The choice holds for this run; only the next one measures again.
        print(f"lfsr: {error}", file=sys.stderr)
