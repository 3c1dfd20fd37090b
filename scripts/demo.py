"""Make an 8K elemental image array from nothing: environment, scene, render, images, numbers.

    python scripts/demo.py [DIR]
"""

from __future__ import annotations

import subprocess
import sys
import time
from pathlib import Path

from setup import ROOT, USUAL, program, ready, run

DISPLAY, LENSES = "bupt-32in-8k", 4  # lenses of the reference, which takes longer than all else
STARTED = time.monotonic()
EXPLANATION = """\
  eia.png      the 7680×4320 elemental image array, in the order a physical lens array needs
  views.png    5×5 of the 80×80 decoded views, topmost and leftmost camera first
  epi_x.png    epipolar images: an upright line is a point on the display, a slanted line
  epi_y.png    a point before or behind it
  eye.png      what the simulated eye sees through the lenses
  mask.png     which lenses see the foreground
  view.html    open this in a browser to see what a person in front of the display sees; drag to look around
  report.json  the numbers above with the seconds of every stage

The numbers compare {frame} with a path-traced reference that was neither upscaled nor denoised.
SSIM is 1 and FLIP 0 for a perfect image. "split" means that the reference's own noise cancels; in
ssim_lens_plain it does not, so even a perfect image scores little more than ssim_lens_ceiling there.
The ± is the 95 % confidence interval over {lenses} lenses; for a narrower one add --lenses 48 to "lfsr reference" and
wait for ten minutes on two cores."""


def main(output: Path) -> None:
    """Run every step into the folder ``output``; the first failure ends the program with its exit code."""
    report("Environment")
    folder = ready(USUAL)
    lfsr = program(folder, "lfsr")
    scene, frame, reference = (output / name for name in ("scene.blend", "frame", "reference"))
    (ROOT / output).mkdir(parents=True, exist_ok=True)
    report(f"A scene from Blender's own shapes -> {scene}")
    make_scene(program(folder, "python"), scene)
    report("20×20 views for each of 96×54 lenses at 16 samples, denoised and upscaled to 80×80 views")
    run([lfsr, "render", scene, "-o", frame, "--display", DISPLAY, "--scale", 4, "--spp", 16])
    report("Decoded views, epipolar images, and what an eye 15 cm to the left and 10 cm up sees")
    run([lfsr, "views", frame, "--eye=-150,100,1000"])
    report("A page that shows it in any browser")
    run([lfsr, "view", frame])
    report(f"The reference for {LENSES} random lenses: every view, 1024 samples, in two independent halves")
    run([lfsr, "reference", scene, "-o", reference, "--display", DISPLAY, "--spp", 1024, "--lenses", LENSES])
    report("The quality of the image")
    run([lfsr, "compare", frame, reference])
    report(f"Done. Open {frame / 'view.html'} in a browser. The images are in {frame}:")
    print(EXPLANATION.format(frame=frame, lenses=LENSES))


def make_scene(python: Path, scene: Path) -> None:
    """Run the demo scene's script; its output is shown only if it fails."""
    command = [str(python), "-W", "ignore", "scripts/lab/lfsr_lab/scenes/demo_scene.py", str(scene)]
    done = subprocess.run(command, cwd=ROOT, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, check=False)
    (ROOT / scene).with_suffix(".log").write_bytes(done.stdout)
    if done.returncode:
        print(done.stdout.decode("utf-8", "replace"))
        sys.exit(done.returncode)


def report(sentence: str) -> None:
    """Print a heading with the seconds since the start, bold on a terminal."""
    line = f"[{time.monotonic() - STARTED:3.0f} s] {sentence}"
    print(f"\n\033[1m{line}\033[0m" if sys.stdout.isatty() else f"\n{line}", flush=True)


if __name__ == "__main__":
    sys.stdout.reconfigure(errors="replace")  # type: ignore[union-attr]  # a terminal without × shows ? for it
    main(Path(sys.argv[1] if len(sys.argv) > 1 else "out/demo"))
