"""What an animation costs beside Blender's own: python -m lfsr_lab.experiments.animations.cost DIR [SCENE.blend]

CPU seconds of whole processes with all that they started, interleaved, the first round thrown away; once for the first
frame alone and once for all, so that the difference is what a frame costs once everything has started. Each way renders
the same rays of the same frames:

- Blender's own animation render, through the same camera and settings, nothing else made of it
- our render of the frames alone, as `lfsr render --frames` does it before it finishes them
- `lfsr render --frames`, all frames finished
- the same with `--workers 1` and `--workers 2`

Run it on a machine that does nothing else. The Blender is the bpy package. Tables go to DIR/animation.md.
"""

from __future__ import annotations

import argparse
import dataclasses
import os
import shutil
import statistics
import subprocess
import sys
import time
from collections.abc import Sequence
from pathlib import Path

from lfsr_core.frames.frame import LOW_RES_FILE
from lfsr_core.frames.job import Job, read_job
from lfsr_core.optics.display import load_display
from lfsr_core.records import write_record
from lfsr_core.render.blender import find_blender
from lfsr_core.render.process import Listener, run_jobs
from lfsr_core.sequence.animation import SecondStage, animation_of
from lfsr_core.sequence.numbers import parse_frames

ROOT = Path(__file__).resolve().parents[5]
BLENDER, RENDER, LFSR = "Blender's own", "our render alone", "lfsr render --frames"
WORKERS = ("--workers 1", "--workers 2")
OWN_BLENDER, OWN_RENDER, SCENE = "--blenders-own", "--our-render", "--make-scene"  # what a started process is to do


@dataclasses.dataclass(frozen=True)
class Cost:
    """Of one run of all frames, in seconds."""

    cpu: float
    wall: float
    frame: float = 0.0  # CPU seconds that each frame after the first adds


def main(arguments: Sequence[str]) -> None:
    """Measure as the command line asks."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("folder", type=Path, metavar="DIR")
    parser.add_argument("scene", type=Path, nargs="?", metavar="SCENE.blend", help="default: a box that moves")
    parser.add_argument("--frames", default="1-8", help="one range of at least two, default: %(default)s")
    parser.add_argument("--display", default="small")
    parser.add_argument("--scale", type=int, default=2)
    parser.add_argument("--spp", type=int, default=64)
    parser.add_argument("--repeats", type=int, default=3)
    parser.add_argument("--method", default="bicubic", help="of the second stage, default: %(default)s")
    parser.add_argument("--no-workers", action="store_true")
    given = parser.parse_args(arguments)
    if len(parse_frames(given.frames)) < 2:
        parser.error("give at least two frames, as in --frames 1-8")
    given.folder.mkdir(parents=True, exist_ok=True)
    if given.scene is None:
        given.scene = given.folder.resolve() / "box.blend"
        _run([sys.executable, __file__, SCENE, str(given.scene)], given.folder / "scene.log")
    text = table(measure(given), given)
    (given.folder / "animation.md").write_text(text)
    print(text)


def measure(given: argparse.Namespace) -> dict[str, list[Cost]]:
    """Costs by way, in the order of the repeats."""
    job = Job(output=str(given.folder.resolve() / "film"), display=load_display(given.display), scale=given.scale,
              spp=given.spp, scene=str(given.scene.resolve()))
    write_record(given.folder / "job.json", job)
    numbers = parse_frames(given.frames)
    first, every = commands(given, job, str(numbers[0])), commands(given, job, given.frames)
    found: dict[str, list[Cost]] = {name: [] for name in every}
    for round_ in range(given.repeats + 1):
        for name in every:
            one, cost = (_anew(command, job, given.folder) for command in (first[name], every[name]))
            cost = dataclasses.replace(cost, frame=(cost.cpu - one.cpu) / (len(numbers) - 1))
            print(f"round {round_}: {name}: {cost.cpu:.1f} CPU s, {cost.frame:.2f} a frame, {cost.wall:.1f} s",
                  file=sys.stderr, flush=True)
            if round_ or not given.repeats:
                found[name].append(cost)
    return found


def commands(given: argparse.Namespace, job: Job, frames: str) -> dict[str, list[str]]:
    """Command lines of every way to render some frames."""
    film = [sys.executable, "-m", "lfsr_core.cli", "render", job.scene, "-o", job.output, "--frames", frames,
            "--display", given.display, "--scale", str(given.scale), "--spp", str(given.spp), "--method", given.method,
            "--layers", "none", "--device", "CPU"]
    ways = {name: [sys.executable, __file__, word, str(given.folder / "job.json"), frames]
            for name, word in ((BLENDER, OWN_BLENDER), (RENDER, OWN_RENDER))} | {LFSR: film}
    return ways if given.no_workers else ways | {words: [*film, *words.split()] for words in WORKERS}


def _anew(command: list[str], job: Job, folder: Path) -> Cost:
    """Run it with nothing rendered yet."""
    shutil.rmtree(job.output, ignore_errors=True)
    return _run(command, folder / "run.log")


def _run(command: list[str], log: Path) -> Cost:
    """Run it to its end; the CPU time is that of the process and all that it waited for."""
    started = time.perf_counter()
    with log.open("w") as output:
        child = subprocess.Popen(command, stdout=output, stderr=subprocess.STDOUT,
                                 env=os.environ | {"PYTHONPATH": str(ROOT)})
        _, status, usage = os.wait4(child.pid, 0)
    child.returncode = os.waitstatus_to_exitcode(status)
    if child.returncode:
        raise SystemExit(f"{' '.join(command)} failed:\n{log.read_text()[-2000:]}")
    return Cost(usage.ru_utime + usage.ru_stime, time.perf_counter() - started)


def table(found: dict[str, list[Cost]], given: argparse.Namespace) -> str:
    """Markdown: median and span of each way, and what it adds to Blender's own."""
    own = statistics.median(cost.frame for cost in found[BLENDER])
    lines = [f"{len(parse_frames(given.frames))} frames of {given.scene.name}, {given.display} at scale {given.scale}, "
             f"{given.spp} samples, {given.method}; {os.cpu_count()} cores, median of {max(1, given.repeats)}", "",
             "| | CPU s | a frame after the first | from – to | against Blender's own | wall s |",
             "|---|---|---|---|---|---|"]
    for name, costs in found.items():
        frame = [cost.frame for cost in costs]
        middle = statistics.median(frame)
        lines.append(f"| {name} | {statistics.median(cost.cpu for cost in costs):.1f} | {middle:.2f} | "
                     f"{min(frame):.2f} – {max(frame):.2f} | {middle / own - 1:+.1%} | "
                     f"{statistics.median(cost.wall for cost in costs):.1f} |")
    return "\n".join(lines) + "\n"


def our_render(job: Job, frames: str) -> None:
    """Render as the engine does, and finish nothing."""
    jobs = animation_of(job, parse_frames(frames), SecondStage("bicubic")).jobs
    run_jobs(jobs, find_blender(None), Listener())


def blenders_own(job: Job, frames: str) -> None:
    """Render the range by Blender's own operator, with the camera and settings of our render."""
    import bpy

    from blender_addon.render.cycles import RenderSettings, Shot, cycles_settings, encoded_camera
    from blender_addon.render.frame_folder import prepared
    from blender_addon.scene.open import open_scene

    numbers = parse_frames(frames)
    scene = open_scene(job.scene)
    scene.frame_start, scene.frame_end, scene.frame_step = numbers[0], numbers[-1], 1
    with prepared(scene, dataclasses.replace(job, frame=numbers[0])) as frame:
        shot = Shot(frame.rays, frame.matrix_world, frame.layout, frame.clip)
        settings = RenderSettings(job.spp, job.seed, frame.layers, job.device, job.clamp_indirect, frame.world_visible)
        with encoded_camera(scene, shot), cycles_settings(scene, settings, frame.rays.size):
            scene.render.filepath = str(Path(job.output, f"####_{LOW_RES_FILE}"))
            bpy.ops.render.render(animation=True, scene=scene.name)
    written = len(list(Path(job.output).glob(f"*_{LOW_RES_FILE}")))
    if written != len(numbers):
        raise SystemExit(f"Blender wrote {written} of {len(numbers)} frames")


def make_scene(path: str) -> None:
    """A box that moves over a floor, in the light of a sun and the sky."""
    import bpy

    bpy.ops.wm.read_factory_settings(use_empty=True)
    scene = bpy.context.scene
    scene.world = bpy.data.worlds.new("Sky")
    scene.render.film_transparent = True  # a world that shows is a render of its own, which Blender would not make
    bpy.ops.mesh.primitive_plane_add(size=8, location=(0, 0, -0.6))
    bpy.ops.mesh.primitive_cube_add(size=0.8)
    box = bpy.context.object
    for frame, x in ((1, -0.5), (24, 0.5)):
        box.location.x = x
        box.keyframe_insert("location", frame=frame)
    bpy.ops.object.light_add(type="SUN", rotation=(0.7, 0.2, 0.4))
    bpy.context.object.data.energy = 3
    bpy.ops.object.camera_add(location=(0, -4, 0.8), rotation=(1.4, 0, 0))
    scene.camera = bpy.context.object
    bpy.ops.wm.save_as_mainfile(filepath=path)


if __name__ == "__main__":
    if sys.argv[1:2] == [SCENE]:
        make_scene(sys.argv[2])
    elif sys.argv[1:2] == [OWN_BLENDER]:
        blenders_own(read_job(sys.argv[2]), sys.argv[3])
    elif sys.argv[1:2] == [OWN_RENDER]:
        our_render(read_job(sys.argv[2]), sys.argv[3])
    else:
        main(sys.argv[1:])
