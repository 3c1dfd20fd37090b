"""What an animation costs beside Blender's own.

CPU seconds of whole processes with all that they started: Blender's own animation render of the same rays, and
`lfsr render --frames`; each for the first frame alone and for all, in turn, the first round thrown away, so that the
difference is what a frame adds. Run it on a machine that does nothing else. The Blender is the bpy package.
"""

from __future__ import annotations

import argparse
import dataclasses
import os
import shutil
import statistics
import subprocess
import sys
from pathlib import Path

from lfsr_core.base.records import write_record
from lfsr_core.frames.frame import LOW_RES_FILE
from lfsr_core.frames.request import Request, Sampling, parse_frames, read_request
from lfsr_core.optics.display import load_display

DISPLAY, SCALE, SAMPLES, ROUNDS, OWN = "small", 2, 64, 3, "Blender's own"


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Arguments of this study."""
    parser.add_argument("scene", type=Path, metavar="SCENE.blend")
    parser.add_argument("frames", metavar="A-B", help="such as 1-6")


def run(arguments: argparse.Namespace) -> None:
    """Print the CPU seconds of every way and what each frame after the first adds."""
    folder, scene, frames = arguments.output, arguments.scene, arguments.frames
    folder.mkdir(parents=True, exist_ok=True)
    job = Request(str(folder.resolve() / "film"), load_display(DISPLAY), str(scene.resolve()),
                  sampling=Sampling(SCALE, SAMPLES))
    write_record(folder / "job.json", job)
    film = [sys.executable, "-m", "lfsr_core.cli", "render", job.scene, "-o", job.output, "--display", DISPLAY,
            "--scale", str(SCALE), "--spp", str(SAMPLES), "--method", "bicubic", "--device", "CPU", "--frames"]
    ways = {OWN: [sys.executable, __file__, str(folder / "job.json")], "lfsr render --frames": film}
    numbers = parse_frames(frames)
    first, *rounds = [{name: [_seconds([*way, part], job) for part in (str(numbers[0]), frames)]
                       for name, way in ways.items()} for _ in range(ROUNDS)]
    for name in first:
        added = [(seconds[name][1] - seconds[name][0]) / (len(numbers) - 1) for seconds in rounds]
        whole = statistics.median(seconds[name][1] for seconds in rounds)
        print(f"{name}: {whole:.1f} CPU seconds, {statistics.median(added):.2f} per frame after the first "
              f"({min(added):.2f} to {max(added):.2f})")


def _seconds(command: list[str], job: Request) -> float:
    shutil.rmtree(job.output, ignore_errors=True)
    before = os.times()
    subprocess.run(command, check=True, stdout=subprocess.DEVNULL)
    after = os.times()
    return after.children_user + after.children_system - before.children_user - before.children_system


def blenders_own(job: Request, frames: str) -> None:
    """Render the range by Blender's own operator, with the camera and settings of our render."""
    import bpy

    from blender_addon.render.cycles import RenderSettings, Shot, cycles_settings, encoded_camera
    from blender_addon.render.frame_folder import prepared
    from blender_addon.scene.open import open_scene

    numbers, scene = parse_frames(frames), open_scene(job.scene)
    scene.frame_start, scene.frame_end, scene.frame_step = numbers[0], numbers[-1], 1
    with prepared(scene, dataclasses.replace(job, frame=numbers[0])) as frame:
        shot = Shot(frame.rays, frame.matrix_world, frame.layout, frame.clip)
        settings = RenderSettings(job.sampling.samples, job.seed, frame.layers, job.device, job.clamp_indirect,
                                  frame.world_visible)
        with encoded_camera(scene, shot), cycles_settings(scene, settings, frame.rays.size):
            scene.render.filepath = str(Path(job.output, f"####_{LOW_RES_FILE}"))
            bpy.ops.render.render(animation=True, scene=scene.name)
    written = len(list(Path(job.output).glob(f"*_{LOW_RES_FILE}")))
    if written != len(numbers):
        raise SystemExit(f"Blender wrote {written} of {len(numbers)} frames")


if __name__ == "__main__":  # a process of Blender's own
    blenders_own(read_request(sys.argv[1]), sys.argv[2])
