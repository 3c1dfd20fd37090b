"""``lfsr view``, ``lfsr export`` and ``lfsr import`` from their arguments to their files."""

import pytest

from lfsr_core.cli import main
from lfsr_core.exports.light_field import read_light_field
from tests.support.finished import finished
from tests.support.synthetic import fails


@pytest.fixture
def folder(tmp_path):
    return finished(tmp_path / "frame")


def test_view(folder, tmp_path, capsys):
    assert main(["view", str(folder)]) == 0
    assert (folder / "view.html").is_file() and "view.html: 0.1 MB" in capsys.readouterr().out
    second = finished(tmp_path / "second", frame=2)
    assert main(["view", str(folder), str(second), "-o", str(tmp_path / "film.html"), "--quality", "80"]) == 0
    assert (tmp_path / "film.html").read_text(encoding="utf-8").count('class="eia"') == 2


@pytest.mark.parametrize(("options", "names"), [
    (["quilt"], ["two_depths_qs2x4a1.333.png"]),
    (["quilt", "--views", "6", "--grid", "6x1"], ["two_depths_qs6x1a1.333.png"]),
    (["views", "--views", "2"], ["view_000_000.png", "view_000_001.png", "view_001_000.png", "view_001_001.png"]),
    (["stereo", "--eyes-mm", "30", "--width", "64"], ["two_depths_stereo_30mm.png"])])
def test_export(folder, capsys, options, names):
    assert main(["export", str(folder), "--format", *options]) == 0
    target = folder / "export" / options[0]
    assert str(target) in capsys.readouterr().out
    assert sorted(path.name for path in target.iterdir()) == names


def test_there_and_back(folder, tmp_path, capsys):
    views, back = str(tmp_path / "views"), tmp_path / "back"
    assert main(["export", str(folder), "--format", "hci", "--views", "4", "-o", views]) == 0
    assert main(["import", views, "-o", str(back)]) == 0
    assert f"next: lfsr view {back}" in capsys.readouterr().out
    assert (read_light_field(back).views == read_light_field(folder).resampled((4, 4))).all()
    assert main(["import", views, "-o", str(tmp_path / "low"), "--scale", "2", "--angle-deg", "20"]) == 0
    assert "next: lfsr upscale" in capsys.readouterr().out
    assert main(["upscale", str(tmp_path / "low"), "--method", "bilinear"]) == 0
    assert main(["view", str(tmp_path / "low")]) == 0


def test_what_cannot_be(folder, tmp_path, capsys):
    assert "does not exist" in fails(["view", str(tmp_path / "nowhere")], capsys)
    assert "has no option 'width'" in fails(["export", str(folder), "--format", "pleno", "--width", "9"], capsys)
    assert "is no folder" in fails(["import", str(tmp_path / "nowhere"), "-o", str(tmp_path / "frame")], capsys)
    for options in [["--format", "quitl"], ["--format", "quilt", "--grid", "8by6"], []]:
        with pytest.raises(SystemExit) as caught:
            main(["export", str(folder), *options])
        assert caught.value.code == 2
