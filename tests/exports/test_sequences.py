"""Exports of an animation: every frame on its own or in one film, in the order of the frames."""

import re
import shutil

import av
import numpy as np
import pytest
from PIL import Image

from lfsr_core.cli import main
from lfsr_core.exports.films import eye_place
from lfsr_core.exports.formats import export
from lfsr_core.exports.light_field import on_screen, read_light_field
from lfsr_core.exports.options import FORMATS, ExportOptions
from lfsr_core.frames.folder import frame_folders
from lfsr_core.images.png import read_png, write_png
from tests.support.finished import DIRECT, finished
from tests.support.synthetic import fails
from tests.support.told import refuses

NAMES = ("0002", "0010", "10000")  # by name the last would come before the second


@pytest.fixture(scope="module")
def film(tmp_path_factory):
    """Three frames, each darker than the one before, and what else may lie beside them."""
    folder = tmp_path_factory.mktemp("film")
    for number, name in enumerate(NAMES):
        frame = finished(folder / name, frame=int(name))
        write_png(frame / "eia.png", read_png(frame / "eia.png") // (number + 1))
    finished(folder / "0002_reference")
    (folder / "0002_reference" / "eia.png").unlink()
    (folder / "parts").mkdir()
    return folder


@pytest.mark.parametrize("name", sorted(set(FORMATS) - {"sway", "wiggle", "quilt-film"}))
def test_each_frame_is_what_its_own_export_is(film, tmp_path, name):
    files = export(film, name, tmp_path / "all")
    expected = [path for frame in NAMES for path in export(film / frame, name, tmp_path / frame)]
    assert [path.read_bytes() for path in files] == [path.read_bytes() for path in expected]
    assert len(set(files)) == len(files)
    if len(files) == len(NAMES):
        assert [re.search(r"two_depths_(\d+)_", path.name)[1] for path in files] == list(NAMES)
    else:
        assert list(dict.fromkeys(path.parent.name for path in files)) == list(NAMES)


@pytest.mark.parametrize("kind", ["mp4", "png"])
def test_the_film_plays_the_animation_while_the_eye_sways(film, tmp_path, kind):
    files = export(film, "sway", tmp_path, ExportOptions(type=kind, width=320, fps=12))
    if kind == "png":
        found = [np.asarray(Image.open(path)) for path in files]
    else:
        with av.open(str(files[0])) as video:
            assert video.streams.video[0].average_rate == 12
            found = [frame.to_ndarray(format="rgb24") for frame in video.decode(video=0)]
    for number, name in enumerate(NAMES):
        field = read_light_field(film / name)
        expected = on_screen(field.seen_from(*eye_place(field, number / 3)), field.display, 320)
        assert np.abs(found[number].astype(float) - expected).mean() < (4 if kind == "mp4" else 1e-9)
    assert len(found) == 3


def test_the_command(film, tmp_path, capsys):
    assert main(["export", str(film), "--format", "quilt", "-o", str(tmp_path / "quilts")]) == 0
    assert capsys.readouterr().out == f"{tmp_path / 'quilts'}: 3 files\n"
    assert main(["export", str(film), "--format", "hci", "--views", "3", "-o", str(tmp_path / "hci")]) == 0
    assert sorted(path.name for path in (tmp_path / "hci").iterdir()) == sorted(NAMES)
    assert main(["view", str(film), "-o", str(tmp_path / "view.html")]) == 0
    assert '"labels": ["2", "10", "10000"]' in (tmp_path / "view.html").read_text()
    assert [folder.name for folder in frame_folders(film)] == list(NAMES)


def test_what_cannot_be_is_said_and_leaves_nothing(film, tmp_path, capsys):
    (tmp_path / "empty").mkdir()
    assert "holds none with an eia.png" in fails(["export", str(tmp_path / "empty"), "--format", "sway"], capsys)
    assert "has no option 'fps'" in fails(["export", str(film), "--format", "quilt", "--fps", "9"], capsys)
    mixed = shutil.copytree(film / "0002", tmp_path / "mixed" / "0001").parent
    finished(mixed / "0002", DIRECT)
    refuses("0002 is for display 'direct' and .*0001 for 'mini'", export, mixed, "sway")
    finished(mixed / "0003")
    shutil.rmtree(mixed / "0002")
    (mixed / "0003" / "eia.png").write_bytes(b"x")
    refuses("eia.png", export, mixed, "sway")
    assert not (mixed / "export").exists()
