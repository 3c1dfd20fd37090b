"""The viewer's file: its size, its image, what it is made of, and what is refused."""

import base64
import io
import re
import shutil
import sys
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from lfsr_core.base.messages import LfsrError, Notice
from lfsr_core.exports import page
from lfsr_core.exports.page import PARTS, fewer_views, write_page
from lfsr_core.images.image_files import read_png, write_png
from lfsr_core.optics.display import DisplayProfile, load_display
from lfsr_core.optics.rays import to_elemental_images
from tests.support.finished import DIRECT, MINI, TALL, finished
from tests.support.small_disk import on_a_small_disk
from tests.support.told import Told, refuses

OVERHEAD = 100_000  # bytes


def images(path) -> list[np.ndarray]:
    """The images in a page, read by pillow."""
    texts = re.findall(r'class="eia">([^<]*)<', path.read_text(encoding="utf-8"))
    return [np.asarray(Image.open(io.BytesIO(base64.b64decode(text)))) for text in texts]


def test_lossless_is_the_image_and_by_default_nothing_is_lost_where_that_would_show_or_fetched(folder, tmp_path):
    (image,) = images(write_page([folder], tmp_path / "page.html", 100).path)
    np.testing.assert_array_equal(image, read_png(folder / "eia.png"))
    for quality in (None, 1, 90, 100):
        written = write_page([folder], tmp_path / "page.html", quality)
        assert written.bytes == written.path.stat().st_size <= (folder / "eia.png").stat().st_size + OVERHEAD
    text = write_page([folder], tmp_path / "page.html").path.read_text(encoding="utf-8")
    assert not re.search(r"""(?:src|href)\s*=\s*["'](?!data:)|url\(|@import|https?://|fetch\(|XMLHttp""", text)
    assert not re.search(r"/\*(?:STYLE|SHADER|SCRIPT)\*/|<!--IMAGES", text)
    (strong,) = images(write_page([folder], tmp_path / "page.html").path)
    np.testing.assert_array_equal(strong, read_png(folder / "eia.png"))
    grey = finished(tmp_path / "grey", TALL)
    panel = read_png(grey / "eia.png").mean(axis=2, keepdims=True) / 4 + 90
    write_png(grey / "eia.png", np.rint(panel).astype(np.uint8).repeat(3, axis=2))
    (weak,) = images(write_page([grey]).path)
    assert 0 < np.abs(weak.astype(float) - read_png(grey / "eia.png")).mean() <= page.MOST_LOSS


@pytest.mark.skipif(sys.platform == "win32", reason="needs a POSIX limit on file size")
def test_a_full_temporary_folder_is_told_and_no_page_has_a_cut_image(folder, tmp_path):
    copy = shutil.copytree(folder, tmp_path / "frame")
    blocks = len(page.encode_webp(read_png(copy / "eia.png"), 100)) // 4096
    assert blocks
    for size in (4096, blocks * 4096):  # the image is cut while it is written, and when it is closed
        said = on_a_small_disk(size, "from lfsr_core.exports.page import write_page\n"
                               "write_page([sys.argv[2]], quality=100)", copy)
        assert "refused: the EIA cannot be written as WebP" in said, said
    assert not (copy / "view.html").exists()


def test_default_place_an_animation_and_frames_of_one_number(tmp_path):
    for number in (2, 10, 1):
        finished(tmp_path / "Scene" / f"{number:04d}", frame=number)
    (tmp_path / "Scene" / "0005").mkdir()  # one that is not finished
    written = write_page(tmp_path / "Scene")
    assert written.path == tmp_path / "Scene" / "view.html"
    text = written.path.read_text(encoding="utf-8")
    assert '"labels": ["1", "2", "10"]' in text and len(images(written.path)) == 3
    takes = [finished(tmp_path / take / "frame") for take in "ab"]
    text = write_page(takes, tmp_path / "both.html").path.read_text(encoding="utf-8")
    assert '"labels": ["a/frame", "b/frame"]' in text, "they are named after their folders"


def test_fewer_views_keep_every_lens_and_the_documents_example_is_of_this_viewer():
    wide = DisplayProfile.from_dict(MINI.to_dict() | {
        "lenses": [4096, 2], "views": [5, 5], "panel_pixels": [20480, 10], "panel_mm": [2048.0, 1.0]})
    image = np.zeros((10, 20480, 3), np.uint8)
    image[..., 0] = np.arange(20480) % 5
    image[..., 1] = (np.arange(20480) // 5) % 256
    less = fewer_views(image, wide)
    assert less.shape == (6, 12288, 3)
    tiles = to_elemental_images(less, wide.lenses)
    assert (tiles[..., 1] == (np.arange(4096) % 256)[None, :, None, None]).all()
    np.testing.assert_array_equal(tiles[0, 0, 0, :, 0], [0, 2, 4])
    page = (Path(__file__).parents[2] / "docs" / "examples" / "viewer.html").read_text(encoding="utf-8")
    for part in ("viewer.css", "viewer.glsl", "viewer.js", "controls.js"):
        assert (PARTS / part).read_text(encoding="utf-8") in page, part
    assert load_display("bupt-32in-8k").title in page


def test_what_is_refused_and_a_large_page_noted(folder, tmp_path, monkeypatch):
    with pytest.raises(LfsrError, match="shown together: give frames of one display"):
        write_page([folder, finished(tmp_path / "direct", DIRECT)], tmp_path / "page.html")
    (tmp_path / "empty").mkdir()
    for quality in (0, 101, -5):
        refuses(f"quality is {quality}", write_page, [folder], tmp_path / "page.html", quality)
    refuses("is no frame folder and holds none", write_page, [tmp_path / "empty"])
    refuses("does not exist", write_page, [tmp_path / "nowhere"])
    refuses("there are no frames to show", write_page, [])
    assert not list(tmp_path.glob("**/*.html"))
    monkeypatch.setattr(page, "WARN_BYTES", 1000)
    told = Told()
    made = write_page([folder], tmp_path / "page.html", tell=told)
    assert Notice("page-large", {"bytes": made.bytes}) in told.notices
    monkeypatch.setattr(page, "MOST_PAGE_BYTES", 1000)
    refuses("would be over", write_page, [folder], tmp_path / "page.html")
