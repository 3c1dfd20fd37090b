"""How right the live view is since an edit, seen in a real window, as a chart and as lines of text:

    LFSR_WINDOW_BLENDER=DIR python scripts/lab/live_latency.py CHART.svg

An edit moves the light and an object, forth and back. What the screen shows after each of TIMES is compared with a
reference of the edited scene by split SSIM, both after the scene's view transform; not denoised, for this Blender has
no denoiser. On an idle machine of 2 cores about 40 minutes for display small, most of them for references.
"""

from __future__ import annotations

import argparse
import concurrent.futures
import dataclasses
import json
import statistics
import sys
import tempfile
import time
from collections.abc import Sequence
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parents[2]))

from lfsr_core.base.arrays import Array
from lfsr_core.images.color import ViewTransform
from lfsr_core.images.image_files import read_png
from lfsr_core.metrics.eia_metrics import Reference, split_ssim
from lfsr_core.optics.display import load_display
from lfsr_core.optics.rays import flip_order
from lfsr_lab.experiments.engine import plots
from lfsr_lab.experiments.engine.truth import split_mse
from tests.support.window.desktop import Window, blender_window
from tests.support.window.pictures import SCENE

Halves = tuple[Array, Array]
Pictures = list[tuple[float, Array]]  # what was shown, uint8 (H, W, 3), and since when

TIMES = (1 / 30, 1 / 10, 1 / 3, 1.0, 3.0, 10.0, 30.0)
SCALES = (1, 2, 4, 8)
OFFLINE_SAMPLES = (1, 4, 16, 64)    # of the alternative: press Render EIA and wait
SECONDS_OF_PLAYBACK = 6
SECONDS_TO_RENDER = 7200
SAME = 0.75   # of pairs of views that are equal: Cycles still renders them as one
FOOTER = ("Median of the edits, thin lines from the worst to the best. Split SSIM against a reference of the edited "
          "scene. Render EIA: the same scene offline, from pressing the button to the image.")
EDIT = """
import time
def edit(state):
    light, torus = bpy.data.objects["Area"], bpy.data.objects["Torus"]
    light.location, light.rotation_euler = (((3, -4, 5), (0.7, 0, 0.6)), ((-3.5, -4, 4), (0.7, 0, -0.7)))[state]
    torus.location = ((1.35, 1.0, 0.9), (1.0, -0.4, 1.3))[state]
    return time.monotonic()
monkey = bpy.data.objects["Suzanne"]
monkey.modifiers[0].levels = monkey.modifiers[0].render_levels
for frame, turn in ((1, 0.0), (120, 3.0)):
    monkey.rotation_euler.z = turn
    monkey.keyframe_insert("rotation_euler", frame=frame)
scene.render.film_transparent = False
lfsr = scene.lfsr
lfsr.display, lfsr.live_rays, lfsr.live_denoise = DISPLAY, 0, False
bpy.ops.lfsr.array_fit("EXEC_DEFAULT", True)
bpy.ops.wm.save_mainfile()
"""


@dataclasses.dataclass(frozen=True)
class Line:
    """One line of the chart."""

    name: str
    seconds: Sequence[float]
    accuracy: Sequence[Sequence[float]]   # split SSIM of every edit, for each of ``seconds``
    measures: dict[str, list[float | None]] = dataclasses.field(default_factory=dict)


class Screen:
    """The upper left corner of a virtual screen, read from the file in which Xvfb keeps its pixels."""

    def __init__(self, folder: Path, size: tuple[int, int]) -> None:
        path = folder / "Xvfb_screen0"
        numbers = np.fromfile(path, ">u4", 25)  # the header of an XWD file
        height, bytes_per_line, colors = int(numbers[5]), int(numbers[12]), int(numbers[19])
        pixels = np.memmap(path, "<u4", "r", int(numbers[0]) + 12 * colors, (height, bytes_per_line // 4))
        self._pixels = pixels[:size[1], :size[0]]

    def record(self, seconds: float) -> Pictures:
        """Every picture of this long, the first at once; times are of ``time.monotonic``."""
        began, shown = time.monotonic(), np.array(self._pixels)
        pictures = [(began, shown)]
        while time.monotonic() < began + seconds:
            if not np.array_equal(self._pixels, shown):
                changed = time.monotonic()
                time.sleep(0.003)  # one that is half drawn is read again
                shown = np.array(self._pixels)
                pictures.append((changed, shown))
            time.sleep(1 / 120)
        return [(since, np.stack([(pixels >> shift & 255).astype(np.uint8) for shift in (16, 8, 0)], -1))
                for since, pixels in pictures]


def measure(folder: Path, display: str, edits: int, samples: int) -> list[Line]:
    """All lines of the chart."""
    with blender_window(folder) as window:
        window.run(f"FILE = {str(folder / 'edited.blend')!r}; DISPLAY = {display!r}" + SCENE + EDIT)
        halves = [reference(window, state, samples) for state in (0, 1)]
        seconds, accuracy = [], []
        for count in OFFLINE_SAMPLES:
            window.run(f"lfsr.output, lfsr.samples, lfsr.scale, lfsr.method = '//{count}', {count}, '4', 'bilinear'")
            seconds.append(pressed(window, "render_eia"))
            [image] = (folder / str(count)).glob("**/eia.png")
            accuracy.append([split_ssim(read_png(image)[..., :3] / 255, *halves[1])])
        window.run(f"from {window.get('addon.__name__')}.live import session as live")
        return [*(live(window, scale, halves, edits) for scale in SCALES),
                Line("Render EIA bilinear, s = 4", seconds, accuracy)]


def reference(window: Window, state: int, samples: int) -> Halves:
    """Both halves of an edited scene's reference as the panel would show them, (H, W, 3) in [0, 1]."""
    window.run(f"edit({state}); lfsr.reference_samples, lfsr.reference_lenses = {samples}, 0")
    window.run(f"lfsr.output, lfsr.samples, lfsr.scale, lfsr.method = '//state{state}', 1, '4', 'bilinear'")
    pressed(window, "render_eia")
    pressed(window, "render_reference")
    [folder] = window.folder.glob(f"state{state}/**/*_reference")
    reference = Reference.read(folder)
    show, lenses = ViewTransform(reference.frame.color), reference.frame.display.lenses
    first, second = (flip_order(np.clip(show(half), 0, 1), lenses) for half in (reference.half_a, reference.half_b))
    return first, second


def pressed(window: Window, button: str) -> float:
    """Seconds from pressing a button to its result."""
    began = time.monotonic()
    assert window.get(f"list(bpy.ops.lfsr.{button}('INVOKE_DEFAULT', True))") == ["FINISHED"]
    window.until("addon.jobs.session.current() is None", SECONDS_TO_RENDER)
    return time.monotonic() - began


def live(window: Window, scale: int, halves: Sequence[Halves], edits: int) -> Line:
    """Edits forth and back at one pixel size, then playback."""
    window.run(f"edit(0); lfsr.live_scale = '{scale}'")
    size = load_display(window.get("lfsr.display")).panel_pixels
    assert window.get("list(bpy.ops.lfsr.live())") == ["FINISHED"]
    window.settle()
    window.place(window.windows()[-1], *size)
    window.until(f"live.live().render.resolution_x == {size[0]} and live.message() == ''", 20)
    screen = Screen(window.folder, size)
    screen.record(TIMES[-1])
    accuracy: list[list[float]] = []
    measures: dict[str, list[float | None]] = {"first": [], "complete": [], "per_second": []}
    for number in range(edits):
        state = 1 - number % 2
        with concurrent.futures.ThreadPoolExecutor(1) as beside:
            asked = beside.submit(window.get, f"edit({state})")
            pictures = screen.record(TIMES[-1] + 1)
            moment = asked.result()
        # The first picture, however noisy, that is nearer to the scene after the edit than to the one before; and the
        # first of those in which every rendered view is its own.
        new = [(since - moment, picture) for since, picture in pictures if since > moment and
               split_mse(picture / 255, *halves[state]) < split_mse(picture / 255, *halves[1 - state])]
        complete = next((seconds for seconds, picture in new if is_complete(picture, scale)), None)
        later = sum(complete is not None and since > moment + complete for since, _ in pictures)
        accuracy.append([split_ssim(next(picture for since, picture in reversed(pictures) if since <= moment + seconds)
                                    / 255, *halves[state]) for seconds in TIMES])
        measures["first"].append(new[0][0] if new else None)
        measures["complete"].append(complete)
        measures["per_second"].append(later / (TIMES[-1] - complete) if complete else 0.0)
    window.run("bpy.context.scene.frame_set(1); bpy.ops.screen.animation_play()")
    pictures = screen.record(SECONDS_OF_PLAYBACK)[1:]
    window.run("bpy.ops.screen.animation_cancel(restore_frame=True); bpy.ops.lfsr.live()")
    window.settle()
    measures["playing"] = [len(pictures) / SECONDS_OF_PLAYBACK]
    measures["playing_complete"] = [sum(is_complete(picture, scale) for _, picture in pictures) / SECONDS_OF_PLAYBACK]
    return Line(f"live, s = {scale}", TIMES, list(zip(*accuracy, strict=True)), measures)


def is_complete(picture: Array, scale: int) -> bool:
    """True if neighbouring views have their own noise: a coarser step of Cycles repeats one in 2×2 or more."""
    height, width = picture.shape[:2]
    row, first = np.arange(height // 2 // scale) * 2 * scale + scale // 2, np.arange(width // 2 // scale) * 2 * scale
    left = first + scale // 2   # between the centres of two views, or on them
    one, other = (picture[row][:, column] for column in (left, left + max(scale - 1, 1)))
    return bool((one == other).all(-1).mean() < SAME)


def draw(lines: Sequence[Line]) -> str:
    """The chart as SVG."""
    figure, [axes] = plots.panel_sheet(1, footer=FOOTER)
    values = [value for line in lines for values in line.accuracy for value in values]
    seconds = [second for line in lines for second in line.seconds]
    plots.time_axis(axes, min(seconds) / 1.15, max(seconds) * 1.15)
    plots.value_axis(axes, plots.height(min(values)) - 0.1, plots.height(max(values)) + 0.3)
    axes.grid(color=plots.GRID)
    axes.set_title("Live: SSIM of everything, seconds after an edit", loc="left", fontsize=16, weight="bold", pad=21)
    curves = [plots.Curve(line.name, color, marker, line.seconds, list(map(statistics.median, line.accuracy)))
              for line, color, marker in zip(lines, plots.COLORS, plots.MARKERS, strict=False)]
    for curve, line in zip(curves, lines, strict=True):
        plots.draw_curve(axes, curve)
        axes.vlines(line.seconds, list(map(min, line.accuracy)), list(map(max, line.accuracy)), color=curve.color,
                    linewidth=1.2, alpha=0.6)
    plots.name_curves(axes, curves)
    return plots.svg(figure)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("chart", type=Path)
    parser.add_argument("--display", default="small")
    parser.add_argument("--edits", type=int, default=5)
    parser.add_argument("--reference-samples", type=int, default=1024)
    arguments = parser.parse_args()
    with tempfile.TemporaryDirectory() as scratch:
        lines = measure(Path(scratch), arguments.display, arguments.edits, arguments.reference_samples)
    arguments.chart.write_text(draw(lines), encoding="utf-8")
    arguments.chart.with_suffix(".json").write_text(json.dumps([dataclasses.asdict(line) for line in lines], indent=1),
                                                    encoding="utf-8")
    for line in lines:
        print(line.name, *(f"{plots.time_text(seconds)}: {statistics.median(values):.3f}"
                           for seconds, values in zip(line.seconds, line.accuracy, strict=True)), line.measures)


if __name__ == "__main__":
    main()
