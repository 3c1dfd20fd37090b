"""Every measured number in README, index, guide and results is that of a record, or is listed as having none."""

import functools
import itertools
import re
from collections.abc import Callable, Iterable, Iterator
from statistics import fmean, stdev
from typing import Any

import pytest

from lfsr_core.base.records import read_record
from lfsr_core.optics.depth_scale import MODEL
from lfsr_core.optics.display import builtin_names, load_display
from lfsr_core.optics.eye import view_spread
from lfsr_core.reconstruct.methods import DEFAULT_METHOD
from lfsr_lab.experiments.chart.analysis import Chart, MeanDuel, mean_cells, mean_duels, read_chart
from lfsr_lab.experiments.denoiser import study as denoiser
from lfsr_lab.experiments.engine.truth import FLIP, RELMSE, SSIM
from lfsr_lab.experiments.gpu_budget import study as gpu_page
from lfsr_lab.experiments.gpu_budget.study import Record as GPURecord
from lfsr_lab.experiments.gpu_budget.study import read_gpus
from lfsr_lab.experiments.plan_validation.study import Validation
from lfsr_lab.experiments.rivals import study as rivals_page
from lfsr_lab.experiments.scales.study import ENOUGH, Group, Table, fit, groups_of
from lfsr_lab.experiments.sweeps import plans
from lfsr_lab.experiments.sweeps.records import Report
from tests.support.claims import ROOT, Claim, TableClaim, Values, plain, record, row_numbers, uncovered

OURS, SHIPS, FAST, STOCK = "denoise+bilinear+epi", "denoise+pool", "denoise+bilinear", "oidn+bilinear"
EIGHT_K, SHOTS, DISPLAYS = "docs/results/measurements.md", "docs/results/animations.md", "docs/results/displays.md"
STRESS, PLAN, NETWORKS = "docs/results/stress.md", "docs/guide/plan.md", "docs/results/networks.md"
POOLING = "docs/results/pooling.md"
PAPER = "docs/results/paper.md"


def cells(scene: str | None = None, name: str = "eight-k", **facts: Any) -> Iterator[dict[str, Any]]:
    """Cells of a chart that have these facts, scene by scene."""
    for row in record(name)["scenes"]:
        if scene in (None, row["scene"]):
            yield from (cell for cell in row["cells"] if all(cell[key] == value for key, value in facts.items()))


def ssims(scene: str | None, method: str, samples: int, role: str = "low", name: str = "eight-k") -> list[float]:
    return [1 - cell["errors"]["1-ssim"]["mean"]
            for cell in cells(scene, name, method=method, samples=samples, role=role)]


def seconds(scene: str | None, method: str, samples: int, role: str = "low") -> list[float]:
    return [cell["seconds"]["mean"] for cell in cells(scene, method=method, samples=samples, role=role)]


def finishing(scene: str | None, method: str) -> list[float]:
    """Seconds of the second stage with 1, 4 and 16 samples."""
    return [cell["second_stage"] for cell in cells(scene, method=method, role="low")]


def span(values: Iterable[float]) -> Values:
    numbers = list(values)
    return [min(numbers), max(numbers)]


@functools.cache
def small(name: str = "small") -> Chart:
    return read_chart(ROOT / "docs" / "results" / "measured" / f"{name}.json")


@functools.cache
def duels(name: str) -> list[MeanDuel]:
    return mean_duels(small(name).scenes)


def mean_duel(method: str, samples: int, measure: str, role: str = "low", name: str = "small") -> MeanDuel:
    """What the default needs for the error of another method; the mean of all scenes."""
    [mean] = [duel for duel in duels(name)
              if (duel.measure, duel.role, duel.method, duel.samples) == (measure, role, method, samples)]
    return mean


def equal_error_row(row: list[str]) -> Values:
    """Numbers of a row: value and interval of each measure, ∞ without one, and the scenes where they are not all."""
    methods, _, samples = row[0].replace("`", "").rpartition(", ")
    role, method = ("direct", "oidn") if methods.startswith("every view") else ("low", methods)
    numbers = list[float]()
    for of, measure in itertools.product(("rays", "seconds"), (SSIM, FLIP)):
        duel = mean_duel(method, int(samples), measure, role)
        cost = getattr(duel, of)
        numbers += [value for value in (cost.value, cost.low, cost.high) if value is not None]
        numbers += [] if duel.scenes == len(small().scenes) else [duel.scenes]
    return numbers


# Animations.
WAYS = {"one seed": "fixed seeds, every frame alone", "a seed per frame": "seeds that change, every frame alone",
        "temporal averaging": "averaged over 5 frames, 5 seeds in turn"}
MOVING = {"an object moves": "object", "the light moves": "light", "a figure dances": "dance"}


def shot(name: str, way: str, samples: int) -> dict[str, float]:
    [figures] = [row["figures"] for row in record("shots")["rows"]
                 if (row["shot"], row["way"], row["samples"]) == (name, WAYS[way], samples)]
    return figures


def shot_rows() -> Any:
    """A function of rows, which name the animation in its first row only."""
    name = ""

    def row(of: list[str]) -> Values:
        nonlocal name
        title, _, way = of[0].replace("*", "").rpartition(": ")
        name = MOVING.get(title, name)
        measured = shot(name, way, int(of[1]))
        return [measured["ssim"], measured["flicker"], measured["lag"]]

    return row


# Displays: against the panel's own subpixels where it has a lens sheet, else against every view.
KINDS = ("integral", "lenticular", "hexagonal")
MADE = {"default": "default", "every view, OIDN,": "every view", "direct subpixel rendering,": "direct subpixels",
        "one render per view,": "view by view"}


def points(kind: str, way: str, samples: int) -> list[dict[str, Any]]:
    return [point for row in record("displays")["rows"] if row["kind"] == kind for point in row["points"]
            if (point["way"], point["samples"]) == (way, samples)]


def eyes(kind: str, way: str, samples: int) -> list[float]:
    return [(point["straight"] or point["accuracy"])["ssim_eye"] for point in points(kind, way, samples)]


def cpu(kind: str, way: str, samples: int) -> list[float]:
    return [point["render_cpu"] + point["finish_cpu"] for point in points(kind, way, samples)]


def display_row(row: list[str]) -> Values:
    way, samples = re.fullmatch(r"(.*?)(?: at)? (\d+) samples?", row[0]).groups()  # type: ignore[union-attr]
    return [value for kind in KINDS for values in (eyes, cpu) for value in values(kind, MADE[way], int(samples))]


def below(kind: str, samples: int) -> list[float]:
    return [every - ours for every, ours in zip(eyes(kind, "every view", 16), eyes(kind, "default", samples),
                                                strict=True)]


# Known and unseen scenes.
REFINE, BOTH = "oidn-both+refine+epi", "oidn-both+bilinear+epi"  # of version 0.1
GROUPS = {"known": "known", "unseen": "unseen", "real": "real", "panels": "display"}


@functools.cache
def judged() -> denoiser.Record:
    return read_record(ROOT / "docs/results/measured/denoiser.json", denoiser.Record, "means of denoisers")


def scenes(*groups: str) -> list[str]:
    return list(dict.fromkeys(mean.scene for mean in judged().means if not groups or mean.group in groups))


def gained(samples: int, *others: str) -> dict[str, float]:
    """By how much ours is above the best of other methods on each scene where both are known."""
    gains = {}
    for scene in scenes():
        ours, *its = (judged().mean(scene, samples, name) for name in (OURS, *others))
        if ours is not None and any(value is not None for value in its):
            gains[scene] = ours - max(value for value in its if value is not None)
    return gains


def group_rows() -> Any:
    """A function of rows, which name their samples in the first row only; the last column has no record."""
    samples = ""

    def row(of: list[str]) -> Values:
        nonlocal samples
        samples = of[0] or samples
        names = (OURS, BOTH) if "not offered" in of[3] else (OURS, REFINE, BOTH)
        del of[5:]
        return [judged().group_mean(GROUPS[of[1]], int(samples), name, metric) or 0.0 for name in names
                for metric in ("ssim", "flip", "relative")]

    return row


@functools.cache
def sweeps() -> Report:
    return read_record(ROOT / "docs/results/measured/stress.json", Report, "a report of the sweeps")


def figures(name: str, method: str) -> dict[float, list[float]]:
    """The judged figures of a method along a sweep, one per seed."""
    [report] = [sweep for sweep in sweeps().sweeps if sweep.name == name]
    return {value: [figure for figure in row if figure is not None] for value, row in report.figures(method).items()}


def sweep(name: str, method: str) -> dict[float, float]:
    """The judged figure of a method along a sweep, mean over seeds."""
    return {value: fmean(row) for value, row in figures(name, method).items()}


# The choice of scale.
@functools.cache
def scale_groups(name: str) -> list[Group]:
    return groups_of(read_record(ROOT / f"docs/results/measured/{name}.json", Table, "accuracies of scales"))


@functools.cache
def left_out() -> dict[tuple[str, int], float]:
    return fit(scale_groups("scales")).left_out


def always_4() -> dict[tuple[str, int], float]:
    """What scale 4 loses against the best scale."""
    return {(group.scene, group.rays): max(group.ssims.values()) - group.ssims[4] for group in scale_groups("scales")}


def places_gains() -> Values:
    gains = [[cell["two places"][0] - cell["every view"][0] for scene in record("pooling-places")["scenes"].values()
              if (cell := scene.get(f"scale 4, {samples} samples"))] for samples in (1, 4, 16, 64)]
    return [*map(fmean, gains[:3]), len(gains[0]), -min(map(min, gains)), fmean(gains[3]), len(gains[3])]


def deep_gains() -> Values:
    pairs = [[(cell["before"], cell["after"]) for scene in record("pooling-deep")["scenes"].values()
              if (cell := scene.get(f"scale 4, {samples} samples")) and cell["deep"] > 0.02] for samples in (1, 4, 16)]
    gains = [[new[0] - old[0] for old, new in row] for row in pairs]
    return [*map(fmean, gains), *map(len, gains), -min(map(min, gains)),
            *(fmean(new[1] / old[1] for old, new in row) for row in pairs)]


def unprepared_gains(state: str, samples: int, names: Iterable[str] = ()) -> list[tuple[float, float]]:
    """Gain of SSIM and ratio of FLIP in each scene, at equal rays: the better of the scales 4 and 2."""
    scenes = record("pooling-unprepared")["scenes"]
    cells = [[scenes[name][f"scale 4, {samples} samples"], scenes[name][f"scale 2, {samples // 4} samples"]]
             for name in names or scenes]
    pairs = [(max(cell["before"] for cell in row), max(cell[state] for cell in row)) for row in cells]
    return [(after[0] - before[0], after[1] / before[1]) for before, after in pairs]


def unprepared() -> Values:
    means = [list(map(fmean, zip(*unprepared_gains(state, samples), strict=True)))
             for state in ("unseen", "after") for samples in (4, 16)]
    deep = [fmean(gain for gain, _ in unprepared_gains("after", samples, record("pooling-unprepared")["deep"]))
            for samples in (4, 16)]
    lost = [-unprepared_gains("after", samples, [name])[0][0] for name, samples in (
        ("robot", 4), ("robot", 16), ("spiral", 16))]
    order = [(0, 0), (1, 0), (0, 1), (1, 1), (2, 0), (3, 0), (2, 1), (3, 1)]
    return [*(means[row][column] for row, column in order), *deep, *lost]


def pooling_gain(scene: str, samples: int) -> float:
    return record("pooling")["scenes"][scene]["renders"][f"scale 4, {samples} samples"]["gain"]


@functools.cache
def notebook(title: str) -> str:
    """What docs/notebook/paper.md, the only record of that run, says of a figure."""
    return (ROOT / "docs/notebook/paper.md").read_text(encoding="utf-8").split(f"\n## {title}")[1].split("\n## ")[0]


def notebook_rows(title: str) -> list[list[str]]:
    """Rows of the table of a figure."""
    lines = [line for line in notebook(title).split("\n") if line[:1] == "|"]
    return [[cell.strip() for cell in line.strip("|").split("|")] for line in lines][2:]


def nearest(title: str, quoted: list[str]) -> Values:
    """Of each quoted number that of the notebook's which comes nearest, in its unit or a thousandth of it."""
    values = [value for number in row_numbers(notebook(title)) for value in (plain(number), plain(number) / 1000)]
    either = [*values, *(-value for value in values)]  # what one gains the other loses
    return [min(either, key=lambda value: abs(value - plain(number))) for number in quoted]


VIEWER = [(ROOT / "docs/examples/viewer.html").stat().st_size / 1e6]
CLAIMS: list[Claim | TableClaim] = [
    Claim("README.md", "its SSIM is {}, ours {}.", lambda: [
        fmean(ssims(None, *of)) for of in (("oidn", 1, "direct", "small"), (DEFAULT_METHOD, 16, "low", "small"))]),
    *(Claim(document, words, lambda: span(
        every / ours for every, ours in zip(
            seconds(None, "oidn", 1, "direct"), seconds(None, DEFAULT_METHOD, 16), strict=True)))
      for document, words in (("README.md", "{} to {} times as long"),
                              (EIGHT_K, "16 samples it takes {} to {} times as long"))),
    TableClaim(EIGHT_K, "| method | SSIM |", lambda row: [
        fmean(values) for name in ["oidn" if "every view" in row[0] else row[0].strip("`")]
        for role in ["direct" if name == "oidn" else "low"] for of in ("1-ssim", FLIP) for samples in (1, 4, 16, 64)
        if (values := [1 - value if of == "1-ssim" else value for cell in cells(
            None, "small", method=name, samples=samples, role=role) for value in [cell["errors"][of]["mean"]]])]),
    Claim("README.md", "is a page of `lfsr view` (8K, {} MB;", lambda: VIEWER),
    Claim("docs/guide/viewer.md", "96×54 lenses, {} MB)", lambda: VIEWER),
    Claim("docs/guide/live.md", "first complete image of *small* appears {} to {} s after an edit", lambda: span(
        second for row in record("live-latency") for second in row["measures"].get("complete", []))),
    *(Claim(EIGHT_K, words, lambda method=method: [fmean(ssims(None, method, samples)) for samples in (1, 4, 16)])
      for words, method in (("with 1, 4 and 16 samples**: {}, {}, {} `ssim_lens_fg`", DEFAULT_METHOD),
                            ("mirrored as ours, have {}, {}, {}:", STOCK))),
    Claim(EIGHT_K, "HDR-FLIP of the default is {}, {} and {} of that", lambda: [
        fmean(one["errors"][FLIP]["mean"] / other["errors"][FLIP]["mean"] for one, other in zip(
            *(cells(method=method, samples=samples, role="low") for method in (DEFAULT_METHOD, FAST)), strict=True))
        for samples in (1, 4, 16)]),
    Claim(EIGHT_K, "whose second stage takes {} of its time", lambda: [
        fmean(fast / ours for fast, ours in zip(finishing(None, FAST), finishing(None, DEFAULT_METHOD), strict=True))]),
    Claim(EIGHT_K, "needs {} of its rays by 1 − SSIM; of its time, in the scenes that have that error, {}, and {} by "
          "HDR-FLIP", lambda: [cost.value for cost in (
              mean_duel(STOCK, 16, SSIM, name="eight-k").rays, mean_duel(STOCK, 16, SSIM, name="eight-k").seconds,
              mean_duel(STOCK, 16, FLIP, name="eight-k").seconds)]),
    *(Claim(EIGHT_K, words, lambda samples=samples: span(
        (cell["errors"]["1-ssim"]["high"] - cell["errors"]["1-ssim"]["low"]) / 2
        for method in (DEFAULT_METHOD, FAST, STOCK) for cell in cells(method=method, samples=samples, role="low")))
      for words, samples in (("over lenses is ± {} to {} at 16 samples", 16), ("± {} to {} at 1:", 1))),
    TableClaim(EIGHT_K, "| scene | `denoise+pool` (default) |", lambda row: [
        fmean(ssims(None if row[0] == "mean" else row[0], method, samples))
        for method in (DEFAULT_METHOD, FAST, STOCK, "bicubic") for samples in (1, 4, 16)]),
    TableClaim(EIGHT_K, "| scene | every view, 1 sample, `oidn` |", lambda row: [
        *(value for of in (("oidn", 1, "direct"), *((DEFAULT_METHOD, samples) for samples in (1, 4, 16)))
          for value in (seconds(row[0], *of)[0], ssims(row[0], *of)[0])), max(finishing(row[0], DEFAULT_METHOD))]),
    Claim(EIGHT_K, "the default, `denoise+pool`, needs {} of its rays by 1 − SSIM and {} by HDR-FLIP", lambda: [
        mean_duel(STOCK, 16, measure).rays.value or 0 for measure in (SSIM, FLIP)]),
    *(Claim(EIGHT_K, words, lambda samples=samples: [
        mean_duel(STOCK, samples, measure).seconds.value for measure in (SSIM, FLIP)])
      for words, samples in (("the default needs {} of the time by 1 − SSIM and {} by HDR-FLIP", 16),
                             ("with 64 samples {} and {}", 64))),
    Claim(EIGHT_K, "bias² is {} of relMSE with 1 sample and {} with 64", lambda: [
        cell.errors["bias2"].mean / cell.errors[RELMSE].mean for samples in (1, 64)
        for cell in mean_cells(small().scenes) if (cell.method, cell.samples) == (small().settings.ours, samples)]),
    TableClaim(EIGHT_K, "| other method, samples | rays: 1 − SSIM |", equal_error_row),
    *(Claim(SHOTS, words, lambda samples=samples: span(
        shot(name, "temporal averaging", samples)["ssim"] - shot(name, "a seed per frame", samples)["ssim"]
        for name in ("object", "light")))
      for words, samples in (("gains {} to {} split SSIM over a seed per frame at 4 samples", 4),
                             ("and {} to {} at 16", 16))),
    *(Claim(SHOTS, words, lambda way=way: span(
        shot(name, "temporal averaging", samples)["flicker"] / shot(name, way, samples)["flicker"]
        for name in ("object", "light") for samples in (4, 16)))
      for words, way in (("flickers {} to {} times as much as fixed seeds", "one seed"),
                         ("fixed seeds, {} to {} times as much as changing seeds", "a seed per frame"))),
    *(Claim(SHOTS, words, lambda way=way: span(shot(name, way, 16)["change"] for name in (*MOVING.values(), "turn")))
      for words, way in (("between frames {} (an object that turns) to {} times as much", "one seed"),
                         ("with changing seeds {} to {}.", "a seed per frame"))),
    TableClaim(SHOTS, "| | samples | split SSIM | flicker | lag |", shot_rows(), first=2),
    TableClaim(DISPLAYS, "| method | integral | lenticular | hexagonal |", display_row),
    Claim(DISPLAYS, "lies within {} of every view with 16 on both", lambda: [
        max(below("lenticular", 4) + below("hexagonal", 4))]),
    Claim(DISPLAYS, "lies {} to {} below every view with 16, in {} to {} of a second for {} to {}.", lambda: [
        *span(below("integral", 16)), *span(cpu("integral", "default", 16)), *span(cpu("integral", "every view", 16))]),
    TableClaim(NETWORKS, "| samples | scenes | `denoise+bilinear+epi`, the default |", group_rows(), first=2),
    Claim(NETWORKS, "mean over 22 scenes: **{}** at 1 sample, **{}** at 4, **{}** at 16, **{}** at 64", lambda: [
        fmean(gained(samples, REFINE, BOTH).values()) for samples in (1, 4, 16, 64)]),
    TableClaim(STRESS, "| choice | mean | largest | above .005 |", lambda row: [of for values in [{
        "predicted loss": [group.lost(MODEL) for group in scale_groups("scales")],
        "the same, fitted without that scene": [*left_out().values()],
        "always scale 4": [*always_4().values()]}[row[0]]] for of in (
            fmean(values), max(values), sum(value > ENOUGH for value in values), len(values))]),
    TableClaim(STRESS, "| sweep | from – to |", lambda row: [
        plain(number) for line in plans.table(sweeps(), read_record(
            ROOT / "docs/results/measured/plan-stress.json", Validation, "a validation of plans").plans)
        if line.startswith(f"| {row[0]} |")
        for cell in line.strip("|").split("|")[1:] for number in row_numbers(cell)]),
    *(Claim(STRESS, words, lambda name=name, value=value, methods=methods: [
        sweep(name, method)[value] for method in methods]) for words, name, value, methods in (
            ("denoising alone scores {}, bicubic {}, the default {}:", "depth-behind", 1.5, (FAST, "bicubic", SHIPS)),
            ("at one usable depth bicubic is above it ({}, {})", "depth-behind", 1, (SHIPS, "bicubic")),
            ("at two to either side ({}, {})", "depth-range", 2, (SHIPS, "bicubic")),
            ("behind one the default scores {}, bicubic {}", "mirror", 1.5, (SHIPS, "bicubic")),
            ("a fiftieth of the lenses\n  ({}, {})", "share", 0.02, (SHIPS, "bicubic")),
            ("before plain black ({}, {})", "background", 0, (FAST, SHIPS)),
            ("on dark surfaces ({}, {})", "lamps", 0.5, (FAST, SHIPS)))),
    Claim(STRESS, "between elemental images (by {} at most)", lambda: [
        max(value - sweep("border", SHIPS)[at] for at, value in sweep("border", "bicubic").items())]),
    Claim(STRESS, "scores {} ± {}, bicubic {}, the default {} ± {}.", lambda: [
        of(figures("glass-texture", method)[1.5]) for method, of in (
            (FAST, fmean), (FAST, stdev), ("bicubic", fmean), (SHIPS, fmean), (SHIPS, stdev))]),
    Claim(STRESS, "at the breaking points {} of {} plans met", lambda: [
        record("plan-stress")["summary"]["chosen"] * record("plan-stress")["summary"]["met"],
        record("plan-stress")["summary"]["plans"]]),
    Claim(STRESS, "where the default has {} (and the frame {}).", lambda: [
        fmean(row["actuals"][at] + promised * row["errors"][at] for row in record("plan-stress")["plans"]
              if row["scene"] == "share-0.05" for at in [row["measured"].index(f"s4-spp16 {SHIPS}")])
        for promised in (True, False)]),
    Claim(STRESS, "loses {} when fitted without the scene, and always scale 4 {}", lambda: [
        fmean(loss for (scene, _), loss in losses.items() if scene != "print") for losses in (left_out(), always_4())]),
    Claim(POOLING, "by {}, {} and {} with 1, 4 and 16 samples, mean of {} scenes, {} worse at most; with 64 by {}, "
                   "mean of {}", places_gains),
    Claim(POOLING, "an elemental image: {}, {} and {} with\n1, 4 and 16 samples on {}, {} and {} deep scenes, {} worse "
                   "at most, HDR-FLIP × {}, {} and {} (", deep_gains),
    Claim(POOLING, "scales 4 and 2): {} and {} with the rays of 4 and 16 samples, HDR-FLIP × {} and {}; since what "
                   "they showed is mended, **{} and {}**, × {} and {}, the five deep ones {} and {}. *Robot*, which "
                   "mirrors, loses {} and {}, *spiral* {} with 16", unprepared),
    TableClaim(POOLING, "| samples | scenes | before | after |", lambda row: [
        fmean(scene["renders"][f"scale 4, {row[0]} samples"][when][place]
              for scene in record("pooling")["scenes"].values() if row[1] in ("all", scene["group"]))
        for when in ("before", "after") for place in range(3)], first=2),
    *(Claim(POOLING, words, lambda without=without: [
        fmean(pooling_gain(scene, samples) for scene in record("pooling")["scenes"] if scene != without)
        for samples in (1, 4, 16, 64)])
      for words, without in (("**{}, {}, {} and {}** with 1, 4, 16 and 64 samples", ""),
                             ("without it {}, {}, {} and {}", "print"))),
    # The better of scales 4 and 2 with equal rays.
    Claim(POOLING, "rise from {} to {} with the rays of 4 samples, {} to {} with those of 16, {} to {} with those of "
          "64", lambda: [
              fmean(max(scene["renders"][name][when][0] for name in (f"scale 4, {samples} samples",
                                                                     f"scale 2, {samples // 4} samples"))
                    for scene in record("pooling")["scenes"].values())
              for samples in (4, 16, 64) for when in ("before", "after")]),
    Claim(POOLING, "maple {} and hair {} with 1 sample, glitter {} with 4, vase {} with 16, *deepglass* {} with "
          "64", lambda: [pooling_gain(*which) for which in (("maple", 1), ("hair", 1), ("glitter", 4), ("vase", 16),
                                                            ("deepglass", 64))]),
    TableClaim(POOLING, "| panel, scene | 4 samples, before | after |", lambda row: [
        value for samples in ("4", "16") for part in record("pooling")["panels"][row[0]][samples] for value in part]),
    Claim(PAPER, "everywhere**: {} to {} times as fast", lambda: span(
        float(row[-1]) for row in notebook_rows("Fig. 12(a)") if row[1] != "direct")),
    Claim(PAPER, "its adversary adds {} to {} at 16 samples", lambda: nearest("Fig. 9", [".002", ".004"])),
    Claim(PAPER, "out of reach on two CPU cores**: {} frames", lambda: nearest("Fig. 12(a)", [".11"])),
    TableClaim(PAPER, "| | claim | measured here |", lambda row: nearest(row[0], row_numbers(row[2])), first=2),
    TableClaim(PAPER, "| resolution, scale | render, s |", lambda row: [
        float(line[place]) for line in notebook_rows("Fig. 12(a)") if line[:2] == row[0].split(", ")
        for place in (2, 3, 5)])]


@pytest.mark.parametrize("claim", CLAIMS, ids=lambda claim: f"{claim.document}: {claim.words}")
def test_a_quoted_number_is_that_of_its_record(claim):
    assert claim.wrong() == []


GENERATED: dict[str, Callable[[], str]] = {
    "docs/results/gpu-budget.md": lambda: gpu_page.markdown(read_gpus(), read_record(
        ROOT / "docs/results/measured/gpu-budget.json", GPURecord, "measured steps").measured),
    "docs/results/rivals.md": lambda: rivals_page.markdown(record("rivals"))}

# Words whose numbers no record here has: settings and thresholds, file sizes and times of other programs, and what was
# measured once with weights or by ways that are not kept (the notebook has those).
WITHOUT: dict[str, list[str]] = {
    "docs/guide/artist-guide.md": ["| 0.25 |", "; .95 for most images"],
    "docs/guide/extension.md": [
        "1.1 MB, valid", "(T 3.5)", "(T 3.6)", "(T 2.1)", "(T 3.8)", "1.2 GB"],
    "docs/guide/farms.md": ["seeds that change flicker 1.2 to 3 times", "(12.4 against 12.0 CPU seconds",
                            "took 49.8 s for what one process did in 40.1 s"],
    "docs/guide/live.md": ["screenshots differ by .9 to 1.6 of 255"], PLAN: ["at most 1.2 times the cheapest"],
    "docs/guide/viewer.md": ["eia.png: 14.7 MB", "| 1.4 MB | 1.4 of 255 |", "| 2.1 MB | 1.0 of 255 |", "11.0 MB"],
    SHOTS: ["(.9 lens pitches a frame)", "below .003 in SSIM and .1 in the others"],
    NETWORKS: [
        "1.0 instead of 1.4 GB", "+.010 to +.014", "gain .023, .011, .008 and .003 at 1, 4, 16 and 64 samples",
        ".007 to 0 on unseen generated ones, and lose .005, .002 and .001", "by more than .01",
        "22.2 against 22.1 dB", ".001 below the best here and .07 above it there", "SSIM .899 (.870 before)",
        "1.08 of the reference's with one seed for all frames (1.08 before), 1.42 with a new seed for each (1.31)"],
    STRESS: [
        ".05 below its own first score", "first score less .05", "on `small` with .25,", "above .005"],
    "docs/guide/displays.md": ["(15.6″) `looking-glass-15.6`", "## Looking Glass 8.9″", "`looking-glass-8.9`",
                               "Bridge 2.6.3.", "(2.2 or newer)"],
    POOLING: ["HDR-FLIP × .94, .92, .94 and .95", "gains .09 to .23", "(.9 lenses)", "(.5 lenses per",
              "1.5 · samples^−.19", "up to 1.55 lenses", "if that is .15 at most; from .4 on", "before nothing .4",
              "mirror scores .75, along the first hit .40; tiles behind glass .86 and .84"]}
DOCUMENTS = ["README.md", "docs/index.md", *(f"docs/{folder}/{path.name}" for folder in ("guide", "results")
                                             for path in sorted((ROOT / "docs" / folder).glob("*.md")))]


@pytest.mark.parametrize("document", [name for name in DOCUMENTS if name not in GENERATED])
def test_every_number_with_a_point_has_a_record_or_says_why_not(document):
    assert uncovered(document, CLAIMS, WITHOUT.get(document, [])) == []


@pytest.mark.parametrize("document", GENERATED)
def test_a_generated_page_is_what_its_record_makes(document):
    assert (ROOT / document).read_text(encoding="utf-8") == GENERATED[document]()


def test_the_displays_of_the_guide_have_the_depths_and_views_of_their_profiles():
    sections = (ROOT / "docs/guide/displays.md").read_text(encoding="utf-8").split("\n## ")[2:]
    matches = [re.search(r"`([\w.-]+)`.*?(\d+) mm in front, (\d+) mm behind(?:; own view (\d+) %, others (\d+) %)?",
                         section, re.DOTALL) for section in sections]
    assert sum(one is not None for one in matches) == 9 and len(sections) == 11
    for name, front, behind, *views in (one.groups() for one in matches if one):
        profile = load_display(name)
        assert [round(mm) for mm in profile.depth_range_mm()] == [int(front), int(behind)], name
        if all(views):
            spread = view_spread(profile)
            assert [round(100 * spread.own), round(100 * spread.others)] == list(map(int, views)), name
    sold = [name for name in builtin_names() if name.startswith(("looking", "cube", "liti"))]
    assert [name for name in sold if f"`{name}`" not in "".join(sections)] == []
