"""Train every comparator at once: ``python -m lfsr_lab.train.suite --cache … --output …``.

Each run is a process of its own; on a GPU they share it, and because one step
of such a small network is mostly launch time, eight cost little more than one.
"""

from __future__ import annotations

import argparse
import multiprocessing
import shutil
import sys
import time
from collections.abc import Sequence
from concurrent.futures import ProcessPoolExecutor, as_completed
from pathlib import Path

from lfsr_core.errors import LfsrError
from lfsr_core.files import write_json

RUNS = (
    # Longest first.
    ("paper-gan", 4), ("paper", 2), ("fsrcnn", 4), ("paper-6", 4), ("paper-5", 4), ("paper-4", 4), ("paper-3", 4),
    ("espcn", 4), ("paper", 4), ("paper", 8), ("fsrcnn", 2), ("fsrcnn", 8), ("espcn", 2), ("espcn", 8),
    ("paper", 3), ("fsrcnn", 3), ("espcn", 3),
)


def main(argv: Sequence[str] | None = None) -> int:
    """Exit code 0 if every run wrote its weights, 2 after bad input."""
    arguments = _parser().parse_args(argv)
    try:
        results = train_all(arguments)
    except LfsrError as error:
        print(f"suite: {error}", file=sys.stderr)
        return 2
    print(*(f"{name}: {line}" for name, line in sorted(results.items())), sep="\n")
    return 0 if all("error" not in line for line in results.values()) else 1


def train_all(arguments: argparse.Namespace) -> dict[str, dict]:
    """Train RUNS in parallel; weights, provenance, logs and suite.json land in the output folder."""
    output = Path(arguments.output)
    chosen = [(name, scale) for name, scale in RUNS
              if arguments.only is None or f"{name}-x{scale}" in arguments.only.split(",")]
    if not chosen:
        raise LfsrError(f"--only {arguments.only} chooses nothing: use names such as paper-x4")
    started, results = time.monotonic(), {}
    context = multiprocessing.get_context("spawn")
    with ProcessPoolExecutor(arguments.jobs, mp_context=context) as pool:
        waiting = {pool.submit(_train_one, name, scale, vars(arguments)): f"{name}-x{scale}" for name, scale in chosen}
        for future in as_completed(waiting):
            name = waiting[future]
            results[name] = _result(future)
            print(f"{time.monotonic() - started:7.1f} s  {name}: {results[name]}", flush=True)
            write_json(output / "suite.json", {"seconds": time.monotonic() - started, "runs": results})
    return results


def _result(future) -> dict:
    # One failed run must not take the others' results with it; the exit code still shows it.
    error = future.exception()
    return {"error": f"{type(error).__name__}: {error}"} if error else future.result()


def _train_one(name: str, scale: int, settings: dict) -> dict:
    """One run in its own process; copies its weights to the top of the output folder."""
    import torch

    from lfsr_lab.train.config import load_config
    from lfsr_lab.train.loop import CHECKPOINT, RunOptions
    from lfsr_lab.train.session import train

    torch.set_num_threads(settings["threads"])
    values = [f"scale={scale}", f"photographs={settings['cache']}", f"validation={settings['validation']}"]
    config = load_config(name, [*values, *settings["set"]])
    folder = Path(settings["output"]) / f"{name}-x{scale}"
    trained = train(config, folder, settings["device"], RunOptions(resume=(folder / CHECKPOINT).exists()))
    if trained.weights is None:
        raise LfsrError(f"training of {name} was stopped: run the suite again to go on")
    for suffix in (".safetensors", ".json"):
        shutil.copy(trained.weights.with_suffix(suffix), settings["output"])
    shutil.copy(folder / "log.jsonl", Path(settings["output"]) / f"{folder.name}.log.jsonl")
    return {"seconds": round(trained.outcome.seconds, 1), **trained.outcome.validation}


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(prog="suite", description="Train every comparator at once.")
    parser.add_argument("--cache", required=True, help="training photographs: cache file or folder")
    parser.add_argument("--validation", default="", help="validation photographs: cache file or folder")
    parser.add_argument("--output", required=True, help="folder for weights, provenance and logs")
    parser.add_argument("--device", default="auto", choices=("auto", "cpu", "cuda"))
    parser.add_argument("--jobs", type=int, default=6, help="runs at a time")
    parser.add_argument("--threads", type=int, default=2, help="CPU threads of each run")
    parser.add_argument("--only", help="comma-separated runs such as paper-x4,espcn-x4")
    parser.add_argument("--set", action="append", default=[], metavar="KEY=VALUE", help="change a setting in all runs")
    return parser


if __name__ == "__main__":
    sys.exit(main())
