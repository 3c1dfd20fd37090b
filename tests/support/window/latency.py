"""How right the live view is since an edit, seen in a real window (see desktop.py), as a chart and as lines on paper:

    LFSR_WINDOW_BLENDER=DIR python tests/support/window/latency.py CHART.svg

An edit moves the light and an object, forth and back. After each, the screen is watched; what it showed after TIMES is
compared with a reference of the edited scene by split SSIM, both after the scene's view transform. Not denoised, for
this Blender has no denoiser. On an idle machine of 2 cores about 40 minutes for display small, most of them for
references; run nothing else beside it.
"""

import argparse
import concurrent.futures
import dataclasses
import json
import sys
import tempfile
import time
from collections.abc import Sequence
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parents[3]))

from lfsr_core.frames.reference import Reference
from lfsr_core.images.png import read_png
from lfsr_core.images.view_transform import ViewTransform
from lfsr_core.metrics.split_ssim import split_mse, split_ssim
from lfsr_core.optics.display import load_display
from lfsr_core.optics.eia import flip_order
from lfsr_lab.experiments.engine import plots
from tests.support.window.desktop import Window, blender_window
from tests.support.window.latency_chart import TIMES, Line, draw, table
from tests.support.window.pictures import SCENE
from tests.support.window.recording import Recording, Screen

SCALES = (1, 2, 4, 8)
OFFLINE = (("bilinear", 4),)    # method and scale of the alternative: press Render EIA and wait
OFFLINE_SAMPLES = (1, 4, 16, 64)
SECONDS_OF_ALL = 4      # how long every picture is kept, to find the first complete one
SECONDS_OF_PLAYBACK = 6
SECONDS_TO_RENDER = 7200
SAME = 0.75   # of pairs of views that are equal: Cycles still renders them as one
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
class Seen:
    """What one edit led to; seconds since the edit."""

    accuracy: tuple[float, ...]   # split SSIM after each of TIMES
    first: float | None           # the first picture of the edited scene, however coarse
    complete: float | None        # the first in which every rendered view is its own
    per_second: float             # pictures, from the complete one on


def measure(folder: Path, display: str, edits: int, samples: int) -> list[Line]:
    """All lines of the chart."""
    with blender_window(folder) as window:
        window.run(f"FILE = {str(folder / 'edited.blend')!r}; DISPLAY = {display!r}" + SCENE + EDIT)
        offline, halves = _offline(window, samples)
        window.run(f"from {window.get('addon.__name__')}.live import session as live")
        return [*(_live(window, scale, halves, edits) for scale in SCALES), *offline]


def _offline(window: Window, samples: int) -> tuple[list[Line], list[tuple[np.ndarray, np.ndarray]]]:
    """Lines of the alternative for the second state, and references of both."""
    halves, lines = [], []
    for state in (0, 1):
        window.run(f"edit({state}); lfsr.reference_samples, lfsr.reference_lenses = {samples}, 0")
        window.run(f"lfsr.output, lfsr.samples, lfsr.scale, lfsr.method = '//state{state}', 1, '4', 'bilinear'")
        _pressed(window, "render_eia")
        _pressed(window, "render_reference")
        [found] = window.folder.glob(f"state{state}/**/*_reference")
        halves.append(_shown_halves(Reference.read(found)))
    for method, scale in OFFLINE:
        lines.append(_waited(window, method, scale, halves[1]))
    return lines, halves


def _shown_halves(reference: Reference) -> tuple[np.ndarray, np.ndarray]:
    """As the panel would show them, (H, W, 3) in [0, 1]."""
    show, lenses = ViewTransform(reference.frame.color), reference.frame.display.lenses
    return tuple(flip_order(np.clip(show(half), 0, 1), lenses) for half in (reference.half_a, reference.half_b))


def _pressed(window: Window, button: str) -> float:
    """Seconds from pressing a button to its result."""
    began = time.monotonic()
    assert window.get(f"list(bpy.ops.lfsr.{button}('INVOKE_DEFAULT', True))") == ["FINISHED"]
    window.until("addon.jobs.session.current() is None", SECONDS_TO_RENDER)
    return time.monotonic() - began


def _waited(window: Window, method: str, scale: int, halves: tuple[np.ndarray, np.ndarray]) -> Line:
    seconds, accuracy = [], []
    for samples in OFFLINE_SAMPLES:
        name = f"{method}{scale}-{samples}"
        window.run(f"lfsr.output, lfsr.samples, lfsr.scale, lfsr.method = '//{name}', {samples}, '{scale}', {method!r}")
        seconds.append(_pressed(window, "render_eia"))
        [found] = (window.folder / name).glob("**/eia.png")
        accuracy.append((split_ssim(read_png(found)[..., :3] / 255, *halves),))
        say(f"offline {name}: {accuracy[-1][0]:.3f} after {seconds[-1]:.1f} s")
    return Line(f"Render EIA {method}, s = {scale}", tuple(seconds), tuple(accuracy))


def _live(window: Window, scale: int, halves: Sequence[tuple[np.ndarray, np.ndarray]], edits: int) -> Line:
    """Edits forth and back at one pixel size."""
    window.run(f"edit(0); lfsr.live_scale = '{scale}'")
    size = load_display(window.get("lfsr.display")).panel_pixels
    assert window.get("list(bpy.ops.lfsr.live_start())") == ["FINISHED"]
    window.settle()
    window.place(window.windows()[-1], *size)
    window.until(f"live.live().render.resolution_x == {size[0]} and live.message() == ''", 20)
    screen = Screen(window.folder, size)
    screen.record(TIMES[-1], 0, ())
    seen = []
    for number in range(edits):
        state = 1 - number % 2
        seen.append(_judged(*_edited(window, screen, state), scale, (halves[1 - state], halves[state])))
        say(f"live {scale}: {seen[-1]}")
    playback = _playback(window, screen, scale)
    window.run("bpy.ops.lfsr.live_stop()")
    window.settle()
    return Line(f"live, s = {scale}", TIMES, tuple(zip(*(one.accuracy for one in seen), strict=True)), {
        "first": [one.first for one in seen], "complete": [one.complete for one in seen],
        "per_second": [one.per_second for one in seen], **playback})


def _edited(window: Window, screen: Screen, state: int) -> tuple[float, Recording]:
    """Moment of an edit and what the screen showed from just before it."""
    with concurrent.futures.ThreadPoolExecutor(1) as beside:
        moment = beside.submit(window.get, f"edit({state})")
        recording = screen.record(TIMES[-1] + 1, SECONDS_OF_ALL, TIMES)
        return moment.result(), recording


def _judged(moment: float, recording: Recording, scale: int,
            halves: Sequence[tuple[np.ndarray, np.ndarray]]) -> Seen:
    """``halves``: before and after the edit."""
    new = [(seen - moment, picture) for seen, picture in recording.pictures
           if seen > moment and _is_nearer(picture, halves)]
    complete = next((seconds for seconds, picture in new if is_complete(picture, scale)), None)
    later = sum(complete is not None and seen > moment + complete for seen in recording.changes)
    return Seen(tuple(split_ssim(recording.at(moment + seconds) / 255, *halves[1]) for seconds in TIMES),
                new[0][0] if new else None, complete,
                later / (TIMES[-1] - complete) if complete else 0.0)


def _is_nearer(picture: np.ndarray, halves: Sequence[tuple[np.ndarray, np.ndarray]]) -> bool:
    """True if a picture, however noisy, is nearer to the scene after the edit than to the one before."""
    before, after = (split_mse(picture / 255, *pair) for pair in halves)
    return after < before


def is_complete(picture: np.ndarray, scale: int) -> bool:
    """True if neighbouring views have their own noise: a coarser step of Cycles repeats one in 2×2 or more."""
    height, width = picture.shape[:2]
    row, first = np.arange(height // 2 // scale) * 2 * scale + scale // 2, np.arange(width // 2 // scale) * 2 * scale
    left = first + scale // 2   # between the centres of two views, or on them
    pairs = [picture[row][:, column] for column in (left, left + max(scale - 1, 1))]
    return bool((pairs[0] == pairs[1]).all(-1).mean() < SAME)


def _playback(window: Window, screen: Screen, scale: int) -> dict[str, list[float]]:
    """Pictures per second, and complete ones, while the timeline plays."""
    window.run("bpy.context.scene.frame_set(1); bpy.ops.screen.animation_play()")
    recording = screen.record(SECONDS_OF_PLAYBACK, SECONDS_OF_PLAYBACK, ())
    window.run("bpy.ops.screen.animation_cancel(restore_frame=True)")
    complete = sum(is_complete(picture, scale) for _, picture in recording.pictures[1:-1])
    return {"playing": [len(recording.changes) / SECONDS_OF_PLAYBACK], "playing_complete":
            [complete / SECONDS_OF_PLAYBACK]}


def say(text: str) -> None:
    print(text, file=sys.stderr, flush=True)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("chart", type=Path)
    parser.add_argument("--display", default="small")
    parser.add_argument("--edits", type=int, default=5)
    parser.add_argument("--reference-samples", type=int, default=1024)
    arguments = parser.parse_args()
    with tempfile.TemporaryDirectory() as scratch:
        lines = measure(Path(scratch), arguments.display, arguments.edits, arguments.reference_samples)
    arguments.chart.write_text(plots.svg(draw(lines)), encoding="utf-8")
    arguments.chart.with_suffix(".json").write_text(json.dumps([dataclasses.asdict(line) for line in lines], indent=1))
    print(table(lines))


if __name__ == "__main__":
    main()
