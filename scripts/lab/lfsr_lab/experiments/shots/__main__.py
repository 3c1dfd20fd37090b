"""What frames of an animation can share, measured by one command that can be stopped and started again.

    python -m lfsr_lab.experiments.shots -o OUT            everything, about an hour on two cores
    python -m lfsr_lab.experiments.shots -o OUT --quick    three frames and few samples, minutes; figures of no worth
    python -m lfsr_lab.experiments.shots --cost NAME       only what sharing costs on a display, at scale 4

What is complete in OUT is not done again. docs/results/animations.md shows OUT/shots.json, shots.md and shots.svg.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Iterator, Sequence
from pathlib import Path

from lfsr_core.errors import LfsrError, did_you_mean
from lfsr_core.optics.display import load_display
from lfsr_lab.experiments.engine.environment import check_packages, environment
from lfsr_lab.experiments.engine.report import exit_code
from lfsr_lab.experiments.shots.measure import cost_of_sharing
from lfsr_lab.experiments.shots.renders import NAMES, Bench, Settings
from lfsr_lab.experiments.shots.report import Found, Report, write_report
from lfsr_lab.experiments.shots.ways import ALONE, EACH, FITS, WAYS, Shot

COST_SCALE = 4
QUICK = {"frames": 3, "samples": (4,), "more": (), "reference_samples": 16, "reference_lenses": 34}


def main(argv: Sequence[str] | None = None) -> int:
    """Exit code 0, 2 after bad input, 130 if stopped."""
    arguments = _parser().parse_args(argv)
    return exit_code("shots", lambda: run(arguments))


def run(arguments: argparse.Namespace) -> None:
    """Render and measure what is missing, then write the report."""
    if arguments.cost:
        seconds = cost_of_sharing(load_display(arguments.cost), COST_SCALE)
        print(f"{arguments.cost}, scale {COST_SCALE}: {seconds:.2f} CPU seconds per neighbouring frame")
        return
    check_packages()
    names = _names(arguments.only)
    settings = Settings(seed=arguments.seed, **(QUICK if arguments.quick else {}))
    bench = Bench(arguments.output, settings, arguments.blender)
    bench.claim()
    found: list[Found] = []
    for name in names:
        bench.render(name)
        found += _measured(Shot.read(bench, name, 1 if arguments.quick else arguments.fit_seconds))
    quick = " --quick" if arguments.quick else f" --fit-seconds {arguments.fit_seconds:g}"
    command = f"python -m lfsr_lab.experiments.shots -o OUT --seed {arguments.seed}{quick}"
    write_report(Report(settings, environment(), command, tuple(found)), arguments.output)
    print((arguments.output / "shots.md").read_text(encoding="utf-8"))


def _measured(shot: Shot) -> Iterator[Found]:
    settings = shot.bench.settings
    cells = [(way, spp) for spp in settings.samples for way in WAYS] + [(ALONE, spp) for spp in settings.more]
    most = settings.samples[-1]
    cells += [(way, spp) for spp in settings.samples for way in FITS if way.fitted != EACH or spp == most]
    for way, spp in cells:
        figures = shot.figures(way, spp)
        print(f"{shot.name}, {way.name}, {spp} samples: split SSIM {figures.ssim:.4f}, flicker {figures.flicker:.2f}, "
              f"low-frequency error {figures.offset:.2f}, lag {figures.lag:.2f}", flush=True)
        yield Found(shot.name, way.name, spp, figures)


def _names(text: str | None) -> tuple[str, ...]:
    names = tuple(text.split(",")) if text else NAMES
    for name in names:
        if name not in NAMES:
            raise LfsrError(f"animation {name[:30]!r} is unknown: {did_you_mean(name, NAMES)}It must be one of "
                            f"{', '.join(NAMES)}")
    return names


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(prog="python -m lfsr_lab.experiments.shots", description=__doc__.splitlines()[0])
    parser.add_argument("-o", "--output", type=Path, default=Path("shots"), metavar="OUT",
                        help="of everything that is made, default: %(default)s")
    parser.add_argument("--cost", metavar="NAME", help="display on which to measure only what sharing costs")
    parser.add_argument("--only", metavar="NAME,NAME", help=f"of {', '.join(NAMES)}")
    parser.add_argument("--quick", action="store_true", help="three frames and few samples")
    parser.add_argument("--seed", type=int, default=0, metavar="N", help="of renders and fits, default: %(default)s")
    parser.add_argument("--fit-seconds", type=float, default=30, metavar="N", help="of each fit, default: %(default)s")
    parser.add_argument("--blender", metavar="PATH", help="Blender 4.5 or newer; default: the bpy package, then PATH")
    return parser


if __name__ == "__main__":
    sys.exit(main())
