"""Fig. 10(b) and 12(b): what foreground selection saves, by the share of foreground and by scene."""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from lfsr_core.bench import plots
from lfsr_core.bench.paper import renders, timing, weights
from lfsr_core.bench.paper.cells import Cells
from lfsr_core.bench.paper.figure import Figure
from lfsr_core.bench.paper.records import Results, Seconds
from lfsr_core.bench.paper.renders import Shot
from lfsr_core.bench.paper.settings import Settings
from lfsr_core.bench.paper.verdict import Difference, mean_interval, overall, paired, sentence
from lfsr_core.bench.tables import markdown_table, number
from lfsr_core.frames.frame import read_frame
from lfsr_core.reconstruct.second_stage import UpscaleOptions, panel_image

if TYPE_CHECKING:
    from matplotlib.figure import Figure as Sheet

NETWORK = "paper"
KINDS = ("with", "without")
CLAIM_SHARE = "Foreground selection saves time, the more the smaller the foreground is."
CLAIM_SCENES = "Foreground selection saves time on every model."


@dataclasses.dataclass(frozen=True, kw_only=True)
class Selection:
    """The second stage of one frame with and without foreground selection.

    Attributes
    ----------
    p: share of foreground lenses.
    seconds: of every run "with" and "without".
    """

    p: float
    seconds: Seconds

    @property
    def saved_each(self) -> list[float]:
        """Seconds that selection saves in each pair of runs."""
        return [a - b for a, b in zip(self.seconds["without"], self.seconds["with"], strict=True)]

    @property
    def saved(self) -> Difference:
        """Their mean."""
        return mean_interval(self.saved_each)

    @property
    def medians(self) -> list[float]:
        """Milliseconds with and without."""
        return [timing.median_ms(self.seconds[kind]) for kind in KINDS]

    @property
    def cells(self) -> list[str]:
        """Both as cells of a table."""
        return [number(ms, digits=1) for ms in self.medians]


@dataclasses.dataclass(frozen=True, kw_only=True)
class MovedSelection(Selection):
    """From one distance.

    Attributes
    ----------
    distance: of the camera array from the display, as a share of its own.
    """

    distance: float = 1.0


@dataclasses.dataclass(frozen=True, kw_only=True)
class SceneSelection(Selection):
    """Of one scene.

    Attributes
    ----------
    scene: its name.
    render: seconds of the first stage.
    """

    scene: str
    render: float


@dataclasses.dataclass(frozen=True, kw_only=True)
class Shares(Results):
    """Selection for one scene seen from several distances.

    Attributes
    ----------
    rows: one per distance.
    scene: its name.
    """

    rows: tuple[MovedSelection, ...]
    scene: str = ""

    @property
    def by_share(self) -> list[MovedSelection]:
        """Rows from the smallest foreground to the largest."""
        return sorted(self.rows, key=lambda row: row.p)


@dataclasses.dataclass(frozen=True, kw_only=True)
class Scenes(Results):
    """Selection for several scenes, the ``rows``."""

    rows: tuple[SceneSelection, ...]


def measure_share(settings: Settings) -> Shares:
    """The whole second stage with and without selection, for the first scene seen from several distances."""
    cells, scene = Cells(settings.output, "fig10b"), settings.scenes[0]
    rows = tuple(cells.get(MovedSelection, f"{scene.stem}-{share:g}", _inputs(settings, scene, distance=share),
                           lambda share=share: _moved(settings, scene, share)) for share in settings.moves)
    return Shares(rows=rows, scene=scene.stem, load=cells.load)


def measure_scenes(settings: Settings) -> Scenes:
    """The second stage of every scene with and without selection."""
    cells = Cells(settings.output, "fig12b")
    rows = tuple(cells.get(SceneSelection, scene.stem, _inputs(settings, scene),
                           lambda scene=scene: _of_scene(settings, scene)) for scene in settings.scenes)
    return Scenes(rows=rows, load=cells.load)


def _inputs(settings: Settings, scene: Path, **more: Any) -> dict[str, Any]:
    return {"scene": scene.stem, "display": settings.timing_display.to_dict(), "scale": settings.scale,
            "spp": settings.spp, "repeats": settings.repeats, "device": settings.device, **more}


def _moved(settings: Settings, scene: Path, share: float) -> MovedSelection:
    return MovedSelection(distance=share, **_times(settings, _render(settings, renders.moved(settings, scene, share))))


def _of_scene(settings: Settings, scene: Path) -> SceneSelection:
    folder = _render(settings, scene)
    return SceneSelection(scene=scene.stem, render=read_frame(folder).seconds["render"], **_times(settings, folder))


def _render(settings: Settings, scene: Path) -> Path:
    return renders.low_resolution(settings, Shot(scene, settings.scale, settings.spp, settings.timing_display))


def _times(settings: Settings, folder: Path) -> dict[str, Any]:
    method = weights.untrained_method(settings, NETWORK, settings.scale)
    runs = {"with": lambda: panel_image(folder, method),
            "without": lambda: panel_image(folder, method, UpscaleOptions(selection=False))}
    return {"p": float(renders.foreground(folder).mean()), "seconds": timing.take_turns(runs, settings.repeats)}


def draw_share(results: Shares, _output: Path) -> Sheet:
    """Milliseconds over the share of foreground."""
    sheet, grid = plots.sheet(5, 3)
    rows = results.by_share
    for kind, color, line in zip(KINDS, plots.COLORS, _medians(rows), strict=False):
        grid[0, 0].plot([row.p for row in rows], line, marker="o", color=color, label=f"{kind} selection")
    grid[0, 0].set(xlabel="share of foreground lenses", ylabel="second stage, ms", ylim=(0, None), xlim=(0, 1.02))
    grid[0, 0].legend(frameon=False)
    return sheet


def draw_scenes(results: Scenes, _output: Path) -> Sheet:
    """Two bars per scene."""
    sheet, grid = plots.sheet(6, 3)
    names = [f"{row.scene}\np = {row.p:.2f}" for row in results.rows]
    for index, (kind, bars) in enumerate(zip(KINDS, _medians(results.rows), strict=True)):
        grid[0, 0].bar([place + 0.4 * index - 0.2 for place in range(len(names))], bars, 0.38,
                       color=plots.COLORS[index], label=f"{kind} selection")
    grid[0, 0].set_xticks(range(len(names)), names, fontsize=7)
    grid[0, 0].set_ylabel("second stage, ms")
    grid[0, 0].margins(y=0.25)
    grid[0, 0].legend(frameon=False, fontsize=8, loc="upper left", ncols=2)
    return sheet


def _medians(rows: Sequence[Selection]) -> list[tuple[float, ...]]:
    """Milliseconds of every row, with selection and without."""
    return list(zip(*(row.medians for row in rows), strict=True))


def table_share(results: Shares) -> list[str]:
    """Distance, share of foreground, both times."""
    rows = [[f"{row.distance:g}", number(row.p), *row.cells] for row in results.rows]
    return markdown_table(["distance", "p", "ms with selection", "ms without"], rows)


def table_scenes(results: Scenes) -> list[str]:
    """Times of every scene."""
    rows = [[row.scene, number(row.p), number(row.render), *row.cells] for row in results.rows]
    return markdown_table(["scene", "p", "render, s", "ms with selection", "ms without"], rows)


def line_share(results: Shares) -> str:
    """Saved time at every share, and whether a smaller foreground saves more."""
    rows = results.by_share
    found = {f"p = {row.p:.2f}": row.saved for row in rows}
    words = sentence("Selection saves time", found, "s")
    least, most = rows[0], rows[-1]
    if least.p == most.p:
        return f"{overall(found, {})} {words} Every distance has the same share, so nothing tells how it matters."
    order = {"": paired(least.saved_each, most.saved_each)}
    statement = f"It saves more at p = {least.p:.2f} than at p = {most.p:.2f}"
    return f"{overall(found, order)} {words} {sentence(statement, order, 's')}"


def line_scenes(results: Scenes) -> str:
    """Saved time per scene, also as a share of the frame."""
    found = {row.scene: row.saved for row in results.rows}
    shares = [100 * row.saved.value / (row.render + row.medians[1] / 1e3) for row in results.rows]
    return (f"{overall(found)} {sentence('Selection saves time', found, 's')} That is {min(shares):.1f} to "
            f"{max(shares):.1f} % of a whole frame with its render.")


SHARE = Figure("fig10b", "Fig. 10(b): share of foreground", CLAIM_SHARE, Shares, measure_share, table_share,
               line_share, draw_share)
SCENES = Figure("fig12b", "Fig. 12(b): foreground selection", CLAIM_SCENES, Scenes, measure_scenes, table_scenes,
                line_scenes, draw_scenes)
