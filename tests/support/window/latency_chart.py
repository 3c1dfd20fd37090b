"""The chart of latency.py: accuracy against time since the edit."""

import dataclasses
import statistics
from collections.abc import Sequence

from matplotlib.figure import Figure

from lfsr_lab.experiments.engine import plots

TIMES = (1 / 30, 1 / 10, 1 / 3, 1.0, 3.0, 10.0, 30.0)
FOOTER = ("Median of the edits, thin lines from the worst to the best. Split SSIM against a reference of the edited "
          "scene. Render EIA: the same scene offline, from pressing the button to the image.")
MEASURES = {"first": "first change", "complete": "first complete EIA", "per_second": "pictures/s while refining",
            "playing": "pictures/s in playback", "playing_complete": "of them complete"}


@dataclasses.dataclass(frozen=True)
class Line:
    """One line of the chart."""

    name: str
    seconds: tuple[float, ...]
    accuracy: tuple[tuple[float, ...], ...]   # split SSIM of every edit, for each of ``seconds``
    measures: dict[str, list[float | None]] = dataclasses.field(default_factory=dict)   # by MEASURES

    @property
    def medians(self) -> list[float]:
        """Of the accuracy."""
        return [statistics.median(values) for values in self.accuracy]


def draw(lines: Sequence[Line]) -> Figure:
    """The chart."""
    figure, [axes] = plots.panel_sheet(1, 1, FOOTER)
    values = [value for line in lines for values in line.accuracy for value in values]
    seconds = [second for line in lines for second in line.seconds]
    low, high = (plots.height(value) for value in (min(values), max(values)))
    plots.time_axis(axes, min(seconds) / 1.15, max(seconds) * 1.15)
    plots.value_axis(axes, low - 0.1, high + 0.3, toward_one=True)
    axes.grid(color=plots.GRID)
    axes.set_title("Live: SSIM of everything, seconds after an edit", loc="left", fontsize=16, weight="bold", pad=21)
    curves = [plots.Curve(line.name, plots.COLORS[index], plots.MARKERS[index], line.seconds, line.medians)
              for index, line in enumerate(lines)]
    for curve, line in zip(curves, lines, strict=True):
        plots.draw_curve(axes, curve)
        axes.vlines(line.seconds, [min(values) for values in line.accuracy], [max(values) for values in line.accuracy],
                    color=curve.color, linewidth=1.2, alpha=0.6)
    plots.name_curves(axes, curves)
    return figure


def table(lines: Sequence[Line]) -> str:
    """Everything as Markdown: median, and least and most in brackets."""
    rows = []
    for line in lines:
        cells = [f"{plots.time_text(seconds)}: {_spread(values)}"
                 for seconds, values in zip(line.seconds, line.accuracy, strict=True)]
        rows.append(f"{line.name} | " + " | ".join(cells))
        rows += [f"    {words}: {_spread(line.measures[name])}" for name, words in MEASURES.items()
                 if name in line.measures]
    return "\n".join(rows)


def _spread(values: Sequence[float | None]) -> str:
    known = [value for value in values if value is not None]
    if not known:
        return "never"
    missing = f", {len(values) - len(known)} never" if len(known) < len(values) else ""
    return f"{statistics.median(known):.3f} [{min(known):.3f}, {max(known):.3f}]{missing}"
