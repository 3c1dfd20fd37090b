#!/usr/bin/env bash
# Make an 8K elemental image array from nothing: environment, scene, render, images, numbers.
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/.."
out=${1:-out/demo}
lenses=4  # of the reference, which takes longer than all else
started=$SECONDS

report() { printf '\n\033[1m[%3d s] %s\033[0m\n' $((SECONDS - started)) "$*"; }

report "Environment"
venv=$(./scripts/setup.sh blender)
lfsr=$venv/bin/lfsr
mkdir -p "$out"

report "A scene from Blender's own shapes -> $out/scene.blend"
"$venv/bin/python" -W ignore scripts/lab/lfsr_lab/scenes/demo_scene.py "$out/scene.blend" >"$out/scene.log" 2>&1 || { cat "$out/scene.log"; exit 1; }

report "20×20 views for each of 96×54 lenses at 16 samples, denoised and upscaled to 80×80 views"
"$lfsr" render "$out/scene.blend" -o "$out/frame" --display bupt-32in-8k --scale 4 --spp 16

report "Decoded views, epipolar images, and what an eye 15 cm to the left and 10 cm up sees"
"$lfsr" views "$out/frame" --eye=-150,100,1000

report "A page that shows it in any browser"
"$lfsr" view "$out/frame"

report "The reference for $lenses random lenses: every view, 1024 samples, in two independent halves"
"$lfsr" reference "$out/scene.blend" -o "$out/reference" --display bupt-32in-8k --spp 1024 --lenses $lenses

report "The quality of the image"
"$lfsr" compare "$out/frame" "$out/reference"

report "Done. Open $out/frame/view.html in a browser. The images are in $out/frame:"
cat <<END
  eia.png      the 7680×4320 elemental image array, in the order a physical lens array needs
  views.png    5×5 of the 80×80 decoded views, topmost and leftmost camera first
  epi_x.png    epipolar images: an upright line is a point on the display, a slanted line
  epi_y.png    a point before or behind it
  eye.png      what the simulated eye sees through the lenses
  mask.png     which lenses see the foreground
  view.html    open this in a browser to see what a person in front of the display sees; drag to look around
  report.json  the numbers above with the seconds of every stage

The numbers compare $out/frame with a path-traced reference that was neither upscaled nor denoised.
SSIM is 1 and FLIP 0 for a perfect image. "split" means that the reference's own noise cancels; in
ssim_lens_plain it does not, so even a perfect image scores little more than ssim_lens_ceiling there.
The ± is the 95 % confidence interval over $lenses lenses; for a narrower one add --lenses 48 to "lfsr reference" and
wait for ten minutes on two cores.
END
