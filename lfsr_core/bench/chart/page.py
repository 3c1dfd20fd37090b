"""The chart as a page: one HTML file, no script, nothing loaded from elsewhere."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from html import escape
from typing import Any

from lfsr_core.bench.chart import findings as words
from lfsr_core.bench.chart.panels import drawn, label, mean_panel, scene_panel, seconds_text
from lfsr_core.bench.chart.tables import METRICS, number_of
from lfsr_core.bench.plots import time_text

STYLE = """
:root{color-scheme:light}*{box-sizing:border-box}
body{margin:0;font:17px/1.5 system-ui,sans-serif;color:#222;background:#fff}
main{max-width:1120px;margin:0 auto;padding:20px 16px 60px}
h1{font-size:clamp(1.6rem,5vw,2.4rem);line-height:1.15;margin:.2em 0 .4em}
h2{font-size:1.35rem;margin:2.2em 0 .5em}
p,li{max-width:46em}.lead{font-size:1.15rem}.quiet{color:#555;font-size:.92rem}
.first{display:grid;grid-template-columns:minmax(0,1fr) minmax(0,1fr);gap:12px 36px;align-items:start}
.charts{display:grid;grid-template-columns:repeat(auto-fit,minmax(min(100%,440px),1fr));gap:18px 24px}
svg{width:100%;height:auto;display:block}
.scroll{overflow-x:auto}table{border-collapse:collapse;font-size:.92rem;font-variant-numeric:tabular-nums}
th,td{text-align:right;padding:4px 10px;border-bottom:1px solid #e4e4e4;white-space:nowrap}
th{font-weight:600;vertical-align:bottom}th.l,td.l{text-align:left}
td.l{white-space:normal}h3{font-size:1.05rem;margin:1.2em 0 .3em}
.win,.loss{white-space:nowrap}.win{color:#00603f;font-weight:600}.loss{color:#a33300;font-weight:600}
summary{cursor:pointer;padding:6px 0;font-weight:600}
@media(max-width:820px){.first{grid-template-columns:minmax(0,1fr)}main{padding:12px 10px 40px}
th,td{padding:4px 5px}table{font-size:.84rem}}
"""
LOSSES_SHOWN = 6
OUTCOMES = {"win": '<span class="win">✔ win</span>', "loss": '<span class="loss">✘ loss</span>'}


def page(chart: dict[str, Any]) -> str:
    """The whole HTML file."""
    parts = [*_first_screen(chart), *_charts(chart), *_direct(chart), *_others(chart), *_numbers(chart), *_how(chart)]
    return ('<!doctype html><html lang="en"><head><meta charset="utf-8">'
            '<meta name="viewport" content="width=device-width,initial-scale=1">'
            f"<title>How good, how soon: light-field methods measured</title><style>{STYLE}</style></head><body><main>"
            + "\n".join(parts) + "</main></body></html>\n")


def _first_screen(chart: dict[str, Any]) -> Iterator[str]:
    settings, count = chart["settings"], len(chart["scenes"])
    yield "<h1>How good, how soon?</h1>"
    yield f'<p class="lead">{escape(words.headline(chart))}</p>'
    yield '<div class="first"><div><h2 style="margin-top:0">Which method when</h2>'
    rows = [[f"from {seconds}", escape(method), value] for seconds, method, value in words.advice(chart)]
    yield _table(["you can wait", "use", "SSIM"], rows, left=(0, 1))
    yield (f'<p class="quiet">Nothing measured was both faster and better than these. Times are for the display '
           f"{escape(settings['display'])} on {_machine(chart)}: Cycles and second stage together, "
           f"{f'geometric mean of {count} scenes' if count > 1 else 'one scene'}. “Every view” means rendering at full "
           f"resolution instead of one view in {settings['scale'] ** 2}. Steps under 15 % of time or .005 of SSIM are "
           "left out.</p></div>")
    hero = mean_panel(chart) if count > 1 else scene_panel(chart, chart["scenes"][0])
    yield f"<div>{drawn([hero]) if hero else ''}</div></div>"


def _charts(chart: dict[str, Any]) -> Iterator[str]:
    if len(chart["scenes"]) > 1:
        yield "<h2>Scene by scene</h2>"
    yield ('<p class="quiet">Up is better, left is sooner; the scale stretches towards 1. The pale band is the '
           "Pareto front: nothing lies above or left of it. Numbers at the points are samples per pixel; bars are the "
           "95 % interval over lenses and the spread of the repeats; grey dots are the other methods, in the tables "
           "below.</p>")
    if len(chart["scenes"]) > 1:
        panels = (drawn([scene_panel(chart, scene)]) for scene in chart["scenes"])
        yield f'<div class="charts">{"".join(f"<div>{panel}</div>" for panel in panels)}</div>'


def _direct(chart: dict[str, Any]) -> Iterator[str]:
    settings, ours = chart["settings"], escape(chart["settings"]["ours"])
    yield f"<h2>{ours} against rendering every view</h2>"
    yield ("<p>How long we need to be as accurate as each direct render. ≤: our fastest measured point is already "
           "better. Never: no number of samples that was measured gets there.</p>")
    for name in sorted(settings["direct_methods"], key=lambda name: name != words.RIVAL[1]):
        table, rival = _duels_by_scene(chart, name), escape(label((words.DIRECT, name), ours))
        is_main = name == words.RIVAL[1]
        yield (f"<h3>{rival}</h3>{table}" if is_main else
               f"<details><summary>The same against {rival}, no denoiser</summary>{table}</details>")
    yield (f"<h2>Where {ours} loses</h2><p>A rival wins where we need as long as it does for its accuracy, or longer, "
           "or never get there. Numbers after a scene are the rival’s samples.</p>")
    lost = words.losses(chart)
    yield _list(lost[:LOSSES_SHOWN])
    if len(lost) > LOSSES_SHOWN:
        yield f"<details><summary>{len(lost) - LOSSES_SHOWN} more</summary>{_list(lost[LOSSES_SHOWN:])}</details>"
    best = words.best_of_others(chart)
    rows = [[escape(scene), _ratio(ratio, known), _ratio(opened, known), _met(ratio, known), escape(best[scene])]
            for scene, ratio, known, opened in words.goals(chart)]
    yield ("<h2>The target</h2><p>At every accuracy that rendering all views with OIDN reaches at 1 to 4 samples, "
           "ours should need a quarter of the time or less. The worst accuracy of each scene, without and with the "
           "time that opening the scene takes:</p>")
    yield _table(["scene", "ours ÷ its", "with opening", "", "best other method"], rows, left=(0, 3, 4))


def _list(sentences: Sequence[str]) -> str:
    return f"<ul>{''.join(f'<li>{escape(sentence)}</li>' for sentence in sentences)}</ul>"


def _duels_by_scene(chart: dict[str, Any], rival: str) -> str:
    rows = []
    for scene in chart["scenes"]:
        duels = [duel for duel in words.duels_with_direct(scene) if duel["method"] == rival]
        rows += [[escape(scene["scene"]) if index == 0 else "", *_duel(duel, chart)[1:]]
                 for index, duel in enumerate(duels)]
    return _table(["scene", "samples", "SSIM", "it takes", "we take", "ours ÷ its", ""], rows, left=(0, 6))


def _ratio(ratio: float | None, known: bool) -> str:
    return "not measured" if not known else "never" if ratio is None else f"{ratio:.2f}"


def _met(ratio: float | None, known: bool) -> str:
    if not known:
        return ""
    if ratio is None or ratio > words.TARGET:
        return OUTCOMES["loss"].replace("loss</", "missed</")
    return OUTCOMES["win"].replace("win</", "an eighth</" if ratio <= words.STRETCH else "a quarter</")


def _duel(duel: dict[str, Any], chart: dict[str, Any]) -> list[str]:
    name = escape(label((duel["role"], duel["method"]), chart["settings"]["ours"]))
    at_most = "≤ " if duel["bound"] else ""
    needs, ratio = (("never", "–") if duel["needs_seconds"] is None else
                    (at_most + time_text(duel["needs_seconds"]), f"{at_most}{duel['ratio']:.2f}"))
    return [name, str(duel["samples"]), f"{duel['value']:.3f}", time_text(duel["seconds"]), needs, ratio,
            OUTCOMES[duel["outcome"]]]


def _others(chart: dict[str, Any]) -> Iterator[str]:
    yield "<h2>Against every other method, and the reverse</h2>"
    head = ["method", "samples", "SSIM", "it takes", "we take", "ours ÷ its", ""]
    back = ["method", "our samples", "our SSIM", "we take", "it takes", "its ÷ ours", ""]
    for scene in chart["scenes"]:
        low = [_duel(duel, chart) for duel in words.duels_with_low(scene)]
        reverse = [_duel(duel, chart) for duel in scene["analysis"][0]["reverse"]]
        yield f"<details><summary>{escape(scene['scene'])}: what we need to be as accurate as the others</summary>"
        yield _table(head, low, left=(0, 6)) + "</details>"
        yield f"<details><summary>{escape(scene['scene'])}: what the others need to be as accurate as we are</summary>"
        yield _table(back, reverse, left=(0, 6)) + "</details>"


def _numbers(chart: dict[str, Any]) -> Iterator[str]:
    yield "<h2>All numbers</h2>"
    head = ["method", "samples", "seconds (spread)", "second stage ms", "method ms", *METRICS]
    for scene in chart["scenes"]:
        lenses = scene["reference"]["lenses"]
        yield (f"<details><summary>{escape(scene['scene'])}: subject in {scene['p']:.0%} of the lenses, reference of "
               f"{scene['reference']['samples']} samples, {'every lens' if lenses is None else f'{lenses} lenses'}"
               "</summary>")
        rows = [_cell(cell, chart) for cell in scene["cells"]]
        yield _table(head, rows, left=(0,)) + "</details>"
    rows = [[escape(cost["method"]), _count(cost["multiply_adds_per_low_pixel"]), _count(cost["parameters"]),
             f"{cost['fresh_process_seconds']:.1f} s"] for cost in chart["methods"]]
    yield "<details><summary>What each method costs</summary>"
    yield _table(["method", "multiply-adds per low pixel", "parameters", "in a process of its own"], rows, left=(0,))
    yield ('<p class="quiet">Multiply-adds and parameters are of networks of this project; Open Image Denoise does not '
           "tell its own. A process of its own also pays for starting Python and loading libraries.</p></details>")


def _count(value: float | None) -> str:
    return "–" if value is None else f"{value:,.0f}"


def _cell(cell: dict[str, Any], chart: dict[str, Any]) -> list[str]:
    name = escape(label((cell["role"], cell["method"]), chart["settings"]["ours"]))
    second = sorted(cell["second_stage_seconds"])[len(cell["second_stage_seconds"]) // 2]
    return [name, str(cell["samples"]), seconds_text(cell), f"{1000 * second:.0f}",
            f"{1000 * cell['stage_seconds']['upscale']:.1f}", *(number_of(cell, metric) for metric in METRICS)]


def _how(chart: dict[str, Any]) -> Iterator[str]:
    settings, environment = chart["settings"], chart["environment"]
    versions = ", ".join(f"{name} {number}" for name, number in environment["versions"].items())
    yield "<h2>How it was measured</h2><ul>"
    yield f"<li>{_machine(chart)}, {environment['system']}, Python {environment['python']}, {escape(versions)}.</li>"
    yield ("<li>Time is Cycles’ render plus the second stage from reading the render to the written PNG, in a running "
           f"process: one run first that is not counted, then the median of {settings['repeats']}. Renders: median of "
           f"{settings['render_repeats']}. Opening the scene, the same for all, is left out: {words.opening(chart)}. "
           "All renders carry albedo and normal layers, also for methods that need none.</li>")
    yield ("<li>Accuracy is SSIM over lenses that see the subject, against a path-traced reference in two halves so "
           "that its own noise cancels. The dotted line is a low-resolution render of "
           f"{settings['ceiling_spp']} samples, rendered on its own, finished by the best method for it.</li>")
    yield ("<li>Intervals over lenses are wider than the differences between methods, because all methods see the same "
           "lenses: they say how much another subject could move the number.</li>")
    yield "".join(f"<li>Left out: {escape(sentence)}.</li>" for sentence in chart["skipped"])
    yield '</ul><p class="quiet">Everything here is in chart.json beside this page.</p>'


def _machine(chart: dict[str, Any]) -> str:
    environment = chart["environment"]
    gpu = f" and {environment['gpu']}" if environment["gpu"] else ""
    return escape(f"{environment['cores']} cores of {environment['cpu']}{gpu}")


def _table(head: Sequence[str], rows: Iterable[Sequence[str]], left: Sequence[int]) -> str:
    """A table whose columns ``left`` are texts; cells are HTML."""
    def line(tag: str, cells: Sequence[str]) -> str:
        return "<tr>" + "".join(f'<{tag}{" class=l" if index in left else ""}>{cell}</{tag}>'
                                for index, cell in enumerate(cells)) + "</tr>"
    return (f'<div class="scroll"><table><thead>{line("th", head)}</thead><tbody>'
            f'{"".join(line("td", row) for row in rows)}</tbody></table></div>')
