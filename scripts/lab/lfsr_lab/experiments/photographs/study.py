"""Calibration from simulated photographs of random lens sheets: how many are accepted, how far off, any in silence.

Each sheet is photographed once as people do it: stored in one of eight orientations, in perspective, distorted,
blurred, noisy, vignetted, as JPEG. Then come photographs that must be refused, and pairs. What is complete in OUT is
not done again; OUT/photographs.md has the tables.
"""

from __future__ import annotations

import argparse
import dataclasses
import itertools
import json
import sys
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
from PIL import Image

from lfsr_core.base.errors import LfsrError
from lfsr_core.base.files import write_json
from lfsr_core.calibration.fit import Photograph, combine, see
from lfsr_core.calibration.patterns import pattern
from lfsr_core.calibration.photo import read_photograph
from lfsr_core.optics.display import DisplayProfile
from lfsr_lab.experiments.photographs.camera import BAD, Shot, jpeg, nominal, shot, unit, wrong

Case = tuple[str, Callable[[Path], dict[str, Any]]]
PITCH, TILT = 1e-5, 1e-4
BINS = {"blur": (0.4, 0.9, 1.4, 2.0), "noise": (0.001, 0.004, 0.008, 0.012), "quality": (60, 72, 84, 96),
        "exposure": (0.5, 0.7, 0.9, 1.1), "vignette": (0, 0.17, 0.33, 0.5), "bend": (0, 0.02, 0.04, 0.07),
        "mixing": (0, 0.03, 0.05, 0.08), "fill": (0.7, 0.77, 0.85, 0.92)}


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Arguments of this study."""
    for name, count in (("sheets", 100), ("bad", 5), ("pairs", 20)):
        parser.add_argument(f"--{name}", type=int, default=count, metavar="N", help="default: %(default)s")


def run(arguments: argparse.Namespace) -> None:
    """Measure what is missing and write the tables."""
    for name, measure in cases(arguments.sheets, arguments.bad, arguments.pairs):
        path = arguments.output / f"{name}.json"
        if not path.exists():
            found = measure(arguments.output)
            write_json(path, found)
            print(time.strftime("%H:%M:%S"), name, found.get("refused") or f"{found['wrong'][0]:.1e}", file=sys.stderr)
    (arguments.output / "photographs.md").write_text(tables(arguments.output), encoding="utf-8")
    print(arguments.output / "photographs.md")


def cases(sheets: int, bad: int, pairs: int) -> Iterator[Case]:
    """Names and measurements, in order."""
    yield from ((f"sheet-{n:03}", lambda folder, n=n: measured(folder, n, 1)) for n in range(sheets))
    yield from ((f"bad-{kind.replace(' ', '-')}-{n}", lambda folder, kind=kind, n=n: measured(folder, n, 1, kind))
                for n in range(bad) for kind in BAD)
    yield from ((f"pair-{n:03}", lambda folder, n=n: measured(folder, n, 2)) for n in range(pairs))


def measured(folder: Path, number: int, photographs: int, bad: str = "") -> dict[str, Any]:
    """Photograph the sheet of this number and calibrate by it: the shots, and the errors or the refusal."""
    random = np.random.default_rng(number)
    profile = nominal(random, number % 2 == 0)
    real = unit(random, profile)
    shots = [shot(random, 1000 * number + n) for n in range(photographs)]
    shown = pattern(profile, "band" if bad == "other pattern" else "phase")
    result: dict[str, Any] = {"cylinders": number % 2 == 0, "shots": [dataclasses.asdict(one) for one in shots]}
    try:
        seen = [see(profile, photographed(folder, shown, real, one, bad)) for one in shots]
        found = combine(profile, seen)
    except LfsrError as error:
        return result | {"refused": str(error)}
    return result | {"wrong": wrong(found.profile, real), "errors": dataclasses.astuple(found.errors),
                     "place": [float(np.abs(one.view.camera(one.eye_mm[2]) - one.eye_mm[:2]).max()) for one in seen]}


def photographed(folder: Path, shown: Any, real: DisplayProfile, one: Shot, bad: str) -> Photograph:
    """The photograph, read from the JPEG that it was saved as."""
    one = dataclasses.replace(one, **BAD.get(bad, {}))
    path = folder / "photograph.jpg"
    folder.mkdir(parents=True, exist_ok=True)
    path.write_bytes(jpeg(shown, real, one))
    if bad == "grey":
        Image.open(path).convert("L").convert("RGB").save(path)
    if bad == "cropped":
        picture = Image.open(path)
        picture.crop((0, 0, int(picture.width * 0.93), int(picture.height * 0.9))).save(path, quality=90)
    x, y, z = one.eye_mm
    return Photograph(read_photograph(path), (-x - 60, y, z) if bad == "another place" else one.eye_mm)


def tables(folder: Path) -> str:
    """Tables in Markdown of everything in ``folder``."""
    found = {path.stem: json.loads(path.read_text()) for path in sorted(folder.glob("*-*.json"))}
    sheets, pairs = ([one for name, one in found.items() if name.startswith(start)] for start in ("sheet", "pair"))
    lines = ["| photographs | accepted | pitch: median, most | tilt: median, most | middle, most | wrong in silence |",
             "|---|---|---|---|---|---|", _row("all", sheets),
             _row("cylinders", [one for one in sheets if one["cylinders"]]),
             _row("small lenses", [one for one in sheets if not one["cylinders"]])]
    for name, edges in BINS.items():
        for low, high in itertools.pairwise(edges):
            part = [one for one in sheets if low <= _value(one, name) < high]
            lines.append(_row(f"{name} {low:g} to {high:g}", part))
    for flagged in (True, False):
        for number in range(1, 9):
            part = [one for one in sheets if (one["shots"][0]["orientation"], one["shots"][0]["flagged"])
                    == (number, flagged)]
            lines.append(_row(f"orientation {number}, {'in EXIF' if flagged else 'not in EXIF'}", part))
    lines.append(_row("pairs", pairs))
    for kind in BAD:
        start = f"bad-{kind.replace(' ', '-')}-"
        lines.append(_row(kind, [one for name, one in found.items() if name.startswith(start)]))
    reasons = sorted(f"- {name}: {one['refused']}" for name, one in found.items() if "refused" in one)
    return "\n".join([*lines, "", *reasons, ""])


def _value(one: dict[str, Any], name: str) -> float:
    value = one["shots"][0][name]
    return abs(value[0]) if isinstance(value, list) else float(value)


def _row(name: str, part: list[dict[str, Any]]) -> str:
    errors = np.abs([one["wrong"] for one in part if "wrong" in one])
    if not len(errors):
        return f"| {name} | 0 of {len(part)} | | | | 0 |"
    silent = int(((errors[:, 0] > PITCH) | (errors[:, 1] > TILT)).sum())
    (pitch, tilt, _), most = np.median(errors, 0), errors.max(0)
    return (f"| {name} | {len(errors)} of {len(part)} | {pitch:.1e}, {most[0]:.1e} | {tilt:.1e}, {most[1]:.1e} | "
            f"{most[2]:.4f} | {silent} |")
