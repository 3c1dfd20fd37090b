"""Encode numbered PNG frames as MP4 with Blender's own video output."""

from __future__ import annotations

from pathlib import Path

import bpy

from lfsr_core.base.errors import LfsrError
from lfsr_core.exports.options import H264_SIDE
from lfsr_core.process.protocol import emit

from ..compat import literal_path, video_output

NAME = "encode"  # the first word of this job's arguments


def run(frames_folder: str, film_file: str, frames_a_second: str) -> Path:
    """Encode the PNG images of a folder as MP4 and return the film; LfsrError if this Blender cannot."""
    folder, film, rate = Path(frames_folder), Path(film_file), float(frames_a_second)
    frames = sorted(folder.glob("*.png"))
    if not frames:
        raise LfsrError(f"{folder} has no PNG frames to encode: export again")
    if not bpy.app.ffmpeg.supported:
        raise LfsrError("this Blender was built without FFmpeg and cannot write MP4: choose another format")
    # A scene with nothing but the frames, in their own colours.
    scene = bpy.data.scenes.new("Film")
    strip = scene.sequence_editor_create().strips.new_image("Frames", str(frames[0]), channel=1, frame_start=1)
    for frame in frames[1:]:
        strip.elements.append(frame.name)
    strip.frame_final_duration = len(frames)  # for the appended elements to count
    scene.frame_start, scene.frame_end = 1, len(frames)
    scene.display_settings.display_device, scene.view_settings.view_transform = "sRGB", "Standard"
    render, size = scene.render, (strip.elements[0].orig_width, strip.elements[0].orig_height)
    render.resolution_x, render.resolution_y, render.resolution_percentage = *size, 100
    render.fps, render.fps_base = round(rate), round(rate) / rate
    for name, value in video_output().items():
        setattr(render.image_settings, name, value)
    video, codec = render.ffmpeg, "H264" if max(size) <= H264_SIDE else "H265"
    video.format, video.codec, video.constant_rate_factor, video.gopsize = "MPEG4", codec, "PERC_LOSSLESS", 30
    render.use_file_extension, render.filepath = False, literal_path(str(film))
    bpy.app.handlers.render_write.append(
        lambda scene, *_: emit(stage="encode", fraction=scene.frame_current / len(frames), message="encoding"))
    bpy.ops.render.render(animation=True, scene=scene.name)
    if not film.is_file() or not film.stat().st_size:
        raise LfsrError(f"{film} was not written: free some space or choose another folder")
    return film
