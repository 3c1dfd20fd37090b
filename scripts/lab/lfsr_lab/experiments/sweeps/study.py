"""Parameter sweeps: generated scenes that grow harder, every method to its breaking point.

OUT/stress.md has the breaking points; `lfsr study report` draws the curves.
"""

import argparse
import dataclasses
from collections.abc import Sequence

from markupsafe import Markup

from lfsr_core.base.messages import LfsrError
from lfsr_core.commands.common import names
from lfsr_core.optics.display import load_display
from lfsr_lab.experiments.engine.plots import COLORS, MARKERS, Curve, draw_curves, panel_sheet, svg
from lfsr_lab.experiments.engine.records import SCENE_FILE, Store
from lfsr_lab.experiments.engine.report import environment, inline_svg, markdown_table, write_report
from lfsr_lab.experiments.sweeps import records
from lfsr_lab.experiments.sweeps.measure import BASELINE, DISPLAY_FILE, Scene, default_methods
from lfsr_lab.experiments.sweeps.records import MOTION, Sweep, choose_sweeps, label
from lfsr_lab.networks.methods import LabMethod

STEM = "stress"
LEGEND = ("A number is the first value of the sweep where the method breaks: **b** below bicubic, **s** 0.05 below its "
          "own start; in brackets where else it may be with 95 % confidence over the seeds. – : it never breaks. ? : "
          "nothing could be measured.")


def report_of(sweep: Sweep, values: Sequence[float], cells: tuple[records.Cell, ...], methods: Sequence[str],
              others: Sequence[records.Cell] = ()) -> records.SweepReport:
    """Return what the cells of a sweep say; ``others`` are those of further seeds, in their order."""
    figures: dict[str, dict[float, list[float | None]]] = {method: {} for method in methods}
    for cell in (*cells, *others):
        figures[cell.method].setdefault(cell.value, []).append(cell.metrics.get(sweep.judged))
    breaks = {method: records.breaking_point(values, quality, figures[BASELINE]) for method, quality in figures.items()}
    repeats = [records.Repeat(value, method, tuple(by_seed)) for method, quality in figures.items()
               for value, by_seed in quality.items() if len(by_seed) > 1]
    return records.SweepReport(sweep.name, sweep.meaning, sweep.unit, sweep.judged, tuple(values), cells, breaks,
                       tuple(repeats))


def markdown(report: records.Report) -> str:
    """Return the breaking points of every method, then the figures of every sweep."""
    breaks = [[sweep.name, sweep.span, *map(sweep.break_text, report.methods)] for sweep in report.sweeps]
    lines = ["# Parameter sweeps", "", str(report.settings), "", "## Breaking points", "", LEGEND, "",
             *markdown_table(["sweep", "from – to", *report.methods], breaks)]
    for sweep in report.sweeps:
        lines += ["", f"## {sweep.name}", "", f"{sweep.meaning.capitalize()}; values are {sweep.unit}.", ""]
        for metric in sweep.shown:
            columns = {method: sweep.series(method, metric) for method in report.methods}
            if metric == sweep.judged:  # the reference's own noise is of the same kind
                columns["ssim_ceiling"] = sweep.series(BASELINE, "ssim_ceiling")
            rows = zip(map(label, sweep.values), *columns.values(), strict=True)
            lines += [*markdown_table([metric, *columns], rows), ""]
    return "\n".join(lines).rstrip() + "\n"


def curves(sweep: records.SweepReport, methods: Sequence[str]) -> Markup | None:
    """Draw the judged figure along the sweep, one step of it per step across; None where nothing could be measured."""
    drawn = []
    figure, (axes,) = panel_sheet(1)
    axes.set_xticks(range(len(sweep.values)), map(label, sweep.values))
    for index, method in enumerate(methods):
        points = [(place, value) for place, value in enumerate(sweep.series(method, sweep.judged)) if value is not None]
        if points:
            color, marker = COLORS[index % len(COLORS)], MARKERS[index // len(COLORS) % len(MARKERS)]
            x, y = zip(*points, strict=True)
            drawn.append(Curve(method, color, marker, x, y))
            if broken := sweep.breaks[method]:
                axes.plot(sweep.values.index(broken.value), broken.quality, "o", ms=13, mfc="none", mec=color)
    if not drawn:
        return None
    draw_curves(axes, drawn, sweep.judged)
    return inline_svg(svg(figure), f"{sweep.judged} along {sweep.name}")


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
    """Measure what is missing and write the tables.

    LfsrError for an unknown sweep or method, a method that the display cannot have, a folder begun with other settings,
    and where Blender fails.
    """
    if arguments.seeds < 1:
        raise LfsrError(f"--seeds is {arguments.seeds}, but it must be 1 or more")
    samples, frames = (QUICK_SAMPLES, QUICK_FRAMES) if arguments.quick else (SAMPLES, FRAMES)
    samples = samples if arguments.reference_spp is None else arguments.reference_spp
    frames = frames if arguments.frames is None else arguments.frames
    settings = records.Settings(load_display(arguments.display or DISPLAY_FILE), arguments.scale, samples, frames,
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
    report = records.Report(records.FORMAT, settings, environment(), methods, tuple(sweeps))
    _, table = write_report(store.folder, STEM, report, {".md": lambda: markdown(report)})
    print(table.read_text(encoding="utf-8"))


def measured_sweep(store: Store, scenes: Sequence[Scene], methods: Sequence[str], seeds: int) -> records.SweepReport:
    """Measure the scenes of one sweep, those near breaking points with ``seeds`` seeds."""
    sweep, values = scenes[0].sweep, [scene.value for scene in scenes]
    store.render_all([job for scene in scenes for job in scene.jobs])
    cells = tuple(cell for scene in scenes for cell in scene.cells(methods))
    first = report_of(sweep, values, cells, methods)
    if seeds == 1 or sweep.name == MOTION:  # whose figure is one of many seeds already
        return first
    near = records.near_breaks(values, first.breaks.values())
    repeated = [dataclasses.replace(scene, seed=seed) for scene in scenes if scene.value in near
                for seed in range(1, seeds)]
    store.render_all([scene.job() for scene in repeated])
    others = [cell for scene in repeated for cell in scene.cells(methods)]
    return report_of(sweep, values, cells, methods, others)
