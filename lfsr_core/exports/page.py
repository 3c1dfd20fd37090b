"""The viewer: one HTML file that shows finished EIAs as an eye in front of the display sees them.

The page contains each EIA as WebP in base64 text; ``viewer/viewer.glsl`` finds lens and view for every pixel. The page
loads no other file, so it opens from a disk.
"""

import base64
import dataclasses
import html
import json
import re
import tempfile
from collections.abc import Sequence
from pathlib import Path

import numpy as np
import OpenImageIO as oiio

from lfsr_core.base.arrays import Array
from lfsr_core.base.messages import LfsrError, Notice, Progress, Tell, silent
from lfsr_core.base.system import atomic_path
from lfsr_core.frames.folder import frame_folders, one_display
from lfsr_core.frames.frame import EIA_FILE, VIEWER_FILE, read_frame
from lfsr_core.images.image_files import opened, read_png
from lfsr_core.optics.display import DisplayProfile
from lfsr_core.optics.eye import gap_mm
from lfsr_core.optics.rays import to_elemental_images

PARTS = Path(__file__).parent / "viewer"
BEST, USUAL_QUALITY, STILL_QUALITY = 100, 95, 85
# Mean difference of 255 in lenses that show something: lossy WebP halves the resolution of colour, too much for small
# elemental images of strong colours. Rendered 8K images lose 1.0 at the usual quality (measured).
MOST_LOSS = 2.0
MOST_LOSSLESS = 60_000  # values of the still image: lossy WebP halves the resolution of colour
MOST_SIDE = 16383  # pixels, of WebP
MOST_PAGE_BYTES = 400_000_000  # that browsers hold in one page
WARN_BYTES = 30_000_000


@dataclasses.dataclass(frozen=True)
class Page:
    """A viewer page."""

    path: Path
    bytes: int


def write_page(folders: str | Path | Sequence[str | Path], output: str | Path | None = None,
               quality: int | None = None, tell: Tell = silent) -> Page:
    """Write the viewer of one finished frame folder, or of several as an animation.

    ``folders``: frame folders of one display, or folders of frame folders, in order; ``output``: the HTML file, by
    default ``view.html`` in the first folder; ``quality``: of the WebP, 1 to 100 (lossless), None for 95, or 100 where
    the loss would show. LfsrError where an image is missing or the displays differ; no page is written then.
    """
    if quality is not None and not 1 <= quality <= BEST:
        raise LfsrError(f"quality is {quality}, but it must be from 1 to {BEST} (lossless)")
    if not (every := [folders] if isinstance(folders, str | Path) else folders):
        raise LfsrError("there are no frames to show: name their folders")
    path = Path(output) if output else Path(every[0]) / VIEWER_FILE
    if path.suffix.lower() not in (".html", ".htm"):
        raise LfsrError(f"the viewer is an HTML page, but {path} was given: give FILE.html")
    frames = {folder: read_frame(folder) for given in every for folder in frame_folders(given)}
    profile = one_display(frames)
    # Numbers of the frames, or where two have the same, the ends of their folders' paths that tell them apart.
    labels, paths = [str(frame.frame) for frame in frames.values()], [folder.resolve().parts for folder in frames]
    for depth in range(1, max(map(len, paths)) + 1):
        if len(set(labels)) == len(labels):
            break
        labels = ["/".join(parts[-depth:]) for parts in paths]
    images, (width, height) = list[str](), profile.eia_pixels
    for number, folder in enumerate(frames):
        tell(Progress("view", number / len(frames), str(folder)))
        pixels = read_png(folder / EIA_FILE)
        if pixels.shape[:2] != (height, width):
            raise LfsrError(f"{folder / EIA_FILE} has {pixels.shape[1]}×{pixels.shape[0]} pixels, but display "
                            f"{profile.name!r} has {width}×{height}: upscale the folder again")
        if max(width, height) > MOST_SIDE:
            pixels = fewer_views(pixels, profile)
            tell(Notice("page-reduced", {"width": pixels.shape[1], "height": pixels.shape[0], "eia_width": width,
                                         "eia_height": height, "most": MOST_SIDE}))
        encoded = encode_webp(pixels, quality or USUAL_QUALITY)
        if quality is None and loss(pixels, encoded, profile.lenses) > MOST_LOSS:
            encoded = encode_webp(pixels, BEST)
        images.append(base64.b64encode(encoded).decode("ascii"))
        if sum(map(len, images)) > MOST_PAGE_BYTES:
            raise LfsrError(f"the page would be over {MOST_PAGE_BYTES / 1e6:.0f} MB after {number + 1} of "
                            f"{len(frames)} frames: give fewer frames or a lower quality")
    # The middle view, which the page shows until its EIA is decoded, and where WebGL is missing.
    eis = to_elemental_images(read_png(next(iter(frames)) / EIA_FILE), profile.lenses)
    middle = np.ascontiguousarray(eis[:, :, profile.views[1] // 2, profile.views[0] // 2])
    still = encode_webp(middle, BEST if middle.size <= MOST_LOSSLESS else STILL_QUALITY)
    url = f"data:image/webp;base64,{base64.b64encode(still).decode()}"
    data = json.dumps({  # lengths in millimetres, pairs as (across, down)
        "name": profile.title or profile.name, "lenses": profile.lenses, "views": profile.views,
        "panel_mm": profile.panel_mm,
        "distance_mm": profile.viewing_distance_mm, "gap_mm": gap_mm(profile),
        "spacing_mm": profile.camera_spacing_mm,  # between view positions at the viewing distance
        "angle_deg": profile.viewing_angle_deg, "flipped": profile.ei_order == "flipped",
        "labels": labels}).replace("<", "\\u003c")
    tags = "\n".join(f'<script type="application/octet-stream" class="eia">{image}</script>' for image in images)
    style, shader, script, controls, text = ((PARTS / name).read_text(encoding="utf-8") for name in (
        "viewer.css", "viewer.glsl", "viewer.js", "controls.js", "viewer.html"))
    parts = {"/*STYLE*/": style, "/*SHADER*/": shader, "/*SCRIPT*/": script + controls,
             "TITLE": html.escape(profile.title or profile.name),
             "ASPECT": f"{profile.panel_mm[0]:g}/{profile.panel_mm[1]:g}",
             "STILL": url, "DATA": data, "<!--IMAGES-->": tags}
    # All at once, so that nothing inserted is taken for a mark.
    text = re.sub("|".join(map(re.escape, parts)), lambda mark: parts[mark[0]], text)
    with atomic_path(path) as temporary:
        temporary.write_text(text, encoding="utf-8")
    tell(Progress("view", 1.0, path.name))
    size = path.stat().st_size
    if size > WARN_BYTES:
        tell(Notice("page-large", {"bytes": size}))
    return Page(path, size)


def fewer_views(pixels: Array, profile: DisplayProfile) -> Array:
    """Every n-th view of each lens of an EIA (H, W, 3), with the smallest n for which WebP can hold the result."""
    (sx, sy), (px, py) = profile.lenses, profile.views
    step = -(-max(pixels.shape[:2]) // MOST_SIDE)
    while max(sx * -(-px // step), sy * -(-py // step)) > MOST_SIDE:
        step += 1
    middle = (step - 1) // 2  # of each group of views
    tiles = pixels.reshape(sy, py, sx, px, 3)[:, min(middle, py - 1)::step, :, min(middle, px - 1)::step]
    return np.ascontiguousarray(tiles).reshape(sy * tiles.shape[1], sx * tiles.shape[3], 3)


def loss(pixels: Array, encoded: bytes, lenses: tuple[int, int]) -> float:
    """Mean difference, of 255, between a WebP file and (H, W, 3), in elemental images that show something."""
    with tempfile.TemporaryDirectory(prefix="lfsr-") as folder:
        path = Path(folder, "eia.webp")
        path.write_bytes(encoded)
        with opened(path) as source:
            assert source is not None
            decoded = np.asarray(source.read_image("uint8"))[..., :3]
    difference = to_elemental_images(np.where(decoded > pixels, decoded - pixels, pixels - decoded), lenses)
    shows = np.ptp(to_elemental_images(pixels, lenses), axis=(2, 3)).max(-1) > 8
    return float(difference.mean((2, 3, 4))[shows].mean()) if shows.any() else 0.0


def encode_webp(pixels: Array, quality: int) -> bytes:
    """Encode uint8 (H, W, 3) as WebP; quality 100 is lossless."""
    spec = oiio.ImageSpec(pixels.shape[1], pixels.shape[0], 3, "uint8")
    spec.attribute("compression", "lossless" if quality == BEST else f"webp:{quality}")
    with tempfile.TemporaryDirectory(prefix="lfsr-") as folder:
        path = Path(folder, "eia.webp")
        output = oiio.ImageOutput.create(str(path))
        written = output and output.open(str(path), spec) and output.write_image(pixels)
        written = output and output.close() and written
        encoded = path.read_bytes() if written else b""
        # OpenImageIO overlooks a full disk where it closes the file; bytes 4 to 8 state the size of what follows.
        if not encoded or len(encoded) < 8 + int.from_bytes(encoded[4:8], "little"):
            reason = (output.geterror() if output else oiio.geterror()) or "the file is cut"
            raise LfsrError(f"the EIA cannot be written as WebP ({reason.strip()[:100]}): free some space for "
                            "temporary files")
    return encoded
