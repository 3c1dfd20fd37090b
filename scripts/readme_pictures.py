"""The pictures of README.md: python scripts/readme_pictures.py SCENE.blend FRAME_FOLDER [-o docs/images]

SCENE.blend is the demo scene (scripts/lab/lfsr_lab/scenes/demo_scene.py), FRAME_FOLDER its finished frame on any
display; the README has it from `lfsr render scene.blend -o FRAME --display dense-8k --scale 4 --spp 64`. Needs bpy and
Pillow.
"""

from __future__ import annotations

import argparse
import math
import sys
import tempfile
from collections.abc import Sequence
from pathlib import Path

import bpy
from PIL import Image, ImageDraw, ImageFont

from lfsr_core.base.arrays import Array

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

from lfsr_core.base.system import atomic_path
from lfsr_core.frames.frame import EIA_FILE, read_frame
from lfsr_core.images.image_files import read_png
from lfsr_core.optics.display import DisplayProfile
from lfsr_core.optics.eye import eye_view

PANEL = (480, 270)  # pixels of each of the three pictures side by side
GAP, CAPTION_ROWS = 12, 30
DETAIL_LENSES, DETAIL_CENTRE = (16, 9), (0.75, 0.56)  # of the enlarged part of the EIA: the ring and what is behind it
LOOP_SIZE, LOOP_FRAMES, LOOP_MILLISECONDS = (480, 270), 36, 70
SWAY = 0.7  # of the viewing zone that the animated eye crosses, horizontally; half of that vertically
SAMPLES = 64


def photograph(scene_file: Path, size: tuple[int, int]) -> Image.Image:
    """The scene as Blender's own camera sees it."""
    bpy.ops.wm.open_mainfile(filepath=str(scene_file.resolve()))
    scene, render = bpy.context.scene, bpy.context.scene.render
    render.resolution_x, render.resolution_y, render.resolution_percentage = *size, 100
    render.film_transparent, render.image_settings.color_mode = True, "RGBA"
    scene.cycles.samples, scene.cycles.use_denoising = SAMPLES, True
    with tempfile.TemporaryDirectory() as name:
        render.filepath = str(Path(name, "scene.png"))
        bpy.ops.render.render(write_still=True)
        picture = Image.open(render.filepath)
        return Image.alpha_composite(Image.new("RGBA", picture.size, "black"), picture).convert("RGB")


def detail(eia: Array, profile: DisplayProfile) -> Image.Image:
    """Some elemental images of an EIA (H, W, 3), large enough to be seen one by one."""
    (px, py), (wide, high) = profile.views, DETAIL_LENSES
    column, row = (int(lenses * place - size / 2)
                   for lenses, place, size in zip(profile.lenses, DETAIL_CENTRE, DETAIL_LENSES, strict=True))
    part = eia[row * py:(row + high) * py, column * px:(column + wide) * px]
    return Image.fromarray(part).resize(PANEL, Image.Resampling.LANCZOS)


def seen(eia: Array, profile: DisplayProfile, eye_mm: tuple[float, float, float]) -> Image.Image:
    """What an eye sees through the lenses, one pixel per lens."""
    return Image.fromarray(eye_view(eia, profile, eye_mm, width=profile.lenses[0]))


def side_by_side(pictures: Sequence[tuple[str, Image.Image]]) -> Image.Image:
    """Pictures of PANEL's size with a caption below each."""
    width = len(pictures) * (PANEL[0] + GAP) - GAP
    sheet = Image.new("RGB", (width, PANEL[1] + CAPTION_ROWS), "white")
    draw, font = ImageDraw.Draw(sheet), ImageFont.load_default(17)
    for index, (caption, picture) in enumerate(pictures):
        left = index * (PANEL[0] + GAP)
        sheet.paste(picture.resize(PANEL, Image.Resampling.LANCZOS), (left, 0))
        draw.text((left + PANEL[0] / 2, PANEL[1] + CAPTION_ROWS / 2), caption, "black", font, anchor="mm")
    return sheet


def sway(eia: Array, profile: DisplayProfile) -> list[Image.Image]:
    """What an eye sees that moves along an ellipse in front of the display, once round."""
    distance = profile.viewing_distance_mm
    reach = SWAY * distance * math.tan(math.radians(profile.viewing_angle_deg) / 2)
    turns = [2 * math.pi * frame / LOOP_FRAMES for frame in range(LOOP_FRAMES)]
    eyes = [(reach * math.cos(turn), reach / 2 * math.sin(turn), distance) for turn in turns]
    return [seen(eia, profile, eye).resize(LOOP_SIZE, Image.Resampling.LANCZOS) for eye in eyes]


def main(words: Sequence[str] | None = None) -> None:
    """Write readme-steps.jpg and readme-views.webp."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("scene", type=Path, metavar="SCENE.blend")
    parser.add_argument("frame", type=Path, metavar="FRAME_FOLDER")
    parser.add_argument("-o", "--output", type=Path, default=Path("docs/images"), metavar="DIR")
    asked = parser.parse_args(words)
    profile, eia = read_frame(asked.frame).display, read_png(asked.frame / EIA_FILE)
    steps = side_by_side([
        ("1  a Blender scene", photograph(asked.scene, PANEL)),
        ("2  its elemental image array (a detail)", detail(eia, profile)),
        ("3  what an eye sees through the lenses", seen(eia, profile, (0.0, 0.0, profile.viewing_distance_mm)))])
    first, *rest = sway(eia, profile)
    with atomic_path(asked.output / "readme-steps.jpg") as path:
        steps.save(path, quality=88)
    with atomic_path(asked.output / "readme-views.webp") as path:
        first.save(path, save_all=True, append_images=rest, duration=LOOP_MILLISECONDS, loop=0, quality=70, method=6)


if __name__ == "__main__":
    main()
