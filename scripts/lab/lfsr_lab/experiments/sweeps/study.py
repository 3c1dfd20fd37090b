"""Parameter sweeps: generated scenes that grow harder, every method to its breaking point.

OUT/stress.md has the breaking points, OUT/index.html curves and the worst crop of every method.
"""

from __future__ import annotations

import argparse
import dataclasses
from collections.abc import Sequence

from lfsr_core.commands.arguments import names
from lfsr_core.optics.display import load_display
from lfsr_lab.experiments.engine.renders import SCENE_FILE, Store
from lfsr_lab.experiments.engine.report import environment, write_drawn, write_report
from lfsr_lab.experiments.sweeps.measure import BASELINE, DISPLAY_FILE, Scene, default_methods
from lfsr_lab.experiments.sweeps.page import PAGE_FILE, STEM, html, markdown, report_of
from lfsr_lab.experiments.sweeps.records import FORMAT, Report, Settings, SweepReport, near_breaks
from lfsr_lab.experiments.sweeps.sweeps import MOTION, choose_sweeps
from lfsr_lab.networks.methods import LabMethod

SAMPLES, QUICK_SAMPLES, FRAMES, QUICK_FRAMES, SCALE = 256, 32, 24, 4, 4


def add_arguments(parser: argparse.ArgumentParser) -> None:
    add = parser.add_argument
    add("--sweeps", type=names, metavar="NAME,NAME", help="default: all, see docs/results/stress.md")
    add("--methods", type=names, metavar="NAME,NAME",
        help="bicubic is added; default: bicubic, the default method, every network with weights")
    add("--quick", action="store_true",
        help=f"few values, references of {QUICK_SAMPLES} samples, {QUICK_FRAMES} frames of motion")
    add("--display", metavar="NAME|FILE.toml", help="default: the sweeps' own, 12×8 lenses")
    add("--scale", type=int, default=SCALE, metavar="N", help="default: %(default)s")
    add("--reference-spp", type=int, metavar="N", help=f"of both halves of a reference together, default: {SAMPLES}")
    add("--seeds", type=int, default=1, metavar="N",
        help="of the renders' noise at the values where methods break, default: %(default)s")
    add("--frames", type=int, metavar="N", help=f"of the moving card, default: {FRAMES}")
    add("--device", default="CPU", metavar="NAME", help="Cycles device, default: %(default)s")


def run(arguments: argparse.Namespace) -> None:
    """Measure what is missing and write tables, curves and images.

    LfsrError for an unknown sweep or method, a method that the display cannot have, a folder begun with other settings,
    and where Blender fails.
    """
    samples = arguments.reference_spp or (QUICK_SAMPLES if arguments.quick else SAMPLES)
    frames = arguments.frames or (QUICK_FRAMES if arguments.quick else FRAMES)
    settings = Settings(load_display(arguments.display or DISPLAY_FILE), arguments.scale, samples, frames,
                        arguments.device)
    store, parallax = Store(arguments.output, arguments.blender), settings.display.parallax
    methods = tuple(dict.fromkeys([BASELINE, *(arguments.methods or default_methods(settings.scale, parallax))]))
    for name in methods:
        LabMethod.parse(name).check_parallax(parallax)
    scenes = {sweep: [Scene(store, settings, sweep, value)
                      for value in (sweep.quick if arguments.quick else sweep.values)]
              for sweep in choose_sweeps(arguments.sweeps)}
    store.claim(settings)
    wanted = {scene.folder / SCENE_FILE: {"name": scene.sweep.name, "value": scene.value}
              for of_sweep in scenes.values() for scene in of_sweep}
    store.build("sweep_scenes.py", wanted, display=settings.display.to_dict(), scale=settings.scale,
                frames=settings.frames)
    sweeps = []
    for index, (sweep, of_sweep) in enumerate(scenes.items(), start=1):
        print(f"sweep {index} of {len(scenes)}: {sweep.name}, {len(of_sweep)} values", flush=True)
        sweeps.append(measured_sweep(store, of_sweep, methods, arguments.seeds))
    report = Report(FORMAT, settings, environment(), methods, tuple(sweeps))
    file, table = write_report(store.folder, STEM, report, {".md": lambda: markdown(report)})
    write_drawn(store.folder / PAGE_FILE, lambda: html(store, report), file)
    print(table.read_text(encoding="utf-8"))
    print(f"{store.folder / PAGE_FILE}: curves and the worst crop of every method")


def measured_sweep(store: Store, scenes: Sequence[Scene], methods: Sequence[str], seeds: int) -> SweepReport:
    """Measure the scenes of one sweep, those near breaking points with ``seeds`` seeds."""
    sweep, values = scenes[0].sweep, [scene.value for scene in scenes]
    store.render_all([job for scene in scenes for job in scene.jobs])
    cells = tuple(cell for scene in scenes for cell in scene.cells(methods))
    first = report_of(sweep, values, cells, methods)
    if seeds == 1 or sweep.name == MOTION:  # whose figure is one of many seeds already
        return first
    near = near_breaks(values, first.breaks.values())
    repeated = [dataclasses.replace(scene, seed=seed) for scene in scenes if scene.value in near
                for seed in range(1, seeds)]
    store.render_all([scene.job() for scene in repeated])
    others = [cell for scene in repeated for cell in scene.cells(methods)]
    return report_of(sweep, values, cells, methods, others)
