"""Runs the stability suite: every missing cell of the chosen dials and methods, then report and page.

A *cell* is one method at one value of one dial. What is complete in the bench
folder is not made again, so an interrupted run goes on where it stopped.
"""

from __future__ import annotations

import dataclasses
import importlib.util
from collections.abc import Sequence
from pathlib import Path

from lfsr_core.reconstruct.method_name import DEFAULT_METHOD, PLAIN_CHAINS, MethodName
from lfsr_core.reconstruct.networks import catalogue
from lfsr_core.reconstruct.registry import method
from lfsr_lab.experiments.stress.dials import Dial, choose_dials, label
from lfsr_lab.experiments.stress.folder import BASELINE, Bench
from lfsr_lab.experiments.stress.measure import Scene
from lfsr_lab.experiments.stress.page import write_stress_page
from lfsr_lab.experiments.stress.report import REPORT_FILE, write_report


@dataclasses.dataclass(frozen=True)
class Choice:
    """What one run of the suite measures; LfsrError for an unknown dial or method."""

    methods: tuple[str, ...]  # names of methods, bicubic first; it is added where it lacks
    dials: tuple[Dial, ...]  # that are measured
    quick: bool = False  # only a few values of each

    @classmethod
    def of(cls, methods: Sequence[str], dial_names: Sequence[str] | None = None, quick: bool = False) -> Choice:
        """From names, without ``dial_names`` all dials."""
        dials = choose_dials(dial_names)
        methods = tuple(dict.fromkeys([BASELINE, *methods]))
        for name in methods:
            method(name)
        return cls(methods, dials, quick)

    @property
    def values(self) -> dict[Dial, tuple[float, ...]]:
        """The values of each dial, from easy to hard."""
        return {dial: dial.quick if self.quick else dial.values for dial in self.dials}


def default_methods(scale: int, parallax: tuple[bool, bool] = (True, True)) -> list[str]:
    """Bicubic, plain chains, the default, and every network with weights at ``scale``: those that the display can."""
    names = [BASELINE, *PLAIN_CHAINS, DEFAULT_METHOD]
    torch = importlib.util.find_spec("torch") is not None
    names += [entry.chain(name) for name, entry in catalogue.NETWORKS.items()
              if scale in catalogue.trained_scales(name) and (torch or entry.light_field)]
    return [name for name in dict.fromkeys(names) if MethodName.parse(name).works_with(parallax)]


def run_suite(bench: Bench, choice: Choice) -> Path:
    """Measure every missing cell in the bench folder, then write the report, tables and pictures; path of stress.json.

    LfsrError for a method that the display cannot have, for a folder begun with other settings, and where Blender
    fails.
    """
    for name in choice.methods:
        MethodName.parse(name).check_parallax(bench.settings.display.parallax)
    bench.claim()
    bench.build_scenes([(dial, value) for dial, values in choice.values.items() for value in values])
    for number, (dial, values) in enumerate(choice.values.items(), start=1):
        print(f"dial {number} of {len(choice.dials)}: {dial.name}, {len(values)} values", flush=True)
        for value in values:
            _measure(bench, dial, value, choice.methods)
    write_stress_page(bench, write_report(bench, choice.values, choice.methods))
    return bench.folder / REPORT_FILE


def _measure(bench: Bench, dial: Dial, value: float, methods: Sequence[str]) -> None:
    """Measure the missing cells of one value; reference and renders are made only for those."""
    missing = [name for name in methods if bench.read_cell(dial, value, name) is None]
    if not missing:
        return
    scene = Scene.load(bench, dial, value)
    for name in missing:
        cell = scene.measure(name)
        judged = cell.metrics.get(dial.judged)
        shown = "–" if judged is None else f"{judged:.4f}"
        print(f"  {dial.name} {label(value)} {name}: {dial.judged} {shown}", flush=True)
        bench.write_cell(dial, cell)
