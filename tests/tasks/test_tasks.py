"""Making as the panel asks for it: what differs from the command's."""

import dataclasses
from pathlib import Path
from typing import Any

import pytest

from lfsr_core.base.notices import Notice
from lfsr_core.base.records import to_data
from lfsr_core.frames.frame import read_frame, write_frame
from lfsr_core.process.protocol import parse_progress, told_of
from lfsr_core.tasks.tasks import make, reference
from tests.support.animations import film_request
from tests.support.played_blender import played_blender


@pytest.fixture
def folder(tmp_path) -> Path:
    played_blender(tmp_path / "blender")
    return tmp_path


def press(folder: Path, frames: list[int] | None, blender: str | None = None, options: dict[str, Any] | None = None,
          **changes: Any) -> list[tuple[int, str]]:
    done = make(to_data(film_request(folder, **changes)), {"method": "bicubic"}, [blender or str(folder / "blender"),
                "--"], frames, **options or {})
    return [(result["frame"], result["state"]) for result in done["made"]]


def test_frames_of_other_settings_are_made_again(folder):
    assert press(folder, [1, 2]) == [(1, "made"), (2, "made")]
    assert press(folder, [1, 2, 3]) == [(1, "kept"), (2, "kept"), (3, "made")]
    assert press(folder, [1], samples=64) == [(1, "made")]
    assert read_frame(folder / "film" / "0001").samples == 64
    assert press(folder, [2], options={"overwrite": True}) == [(2, "made")]


def test_frames_of_another_device_or_an_older_scene_are_kept(folder, capsys):
    press(folder, [1, 2])
    for name, changes in (("0001", {"content": "of yesterday"}), ("0002", {"device": "OPTIX"})):
        path = folder / "film" / name
        write_frame(path, dataclasses.replace(read_frame(path), **changes))
    assert press(folder, [1, 2], blender="/must/not/run", device="CPU") == [(1, "kept"), (2, "kept")]
    told = [told_of(record) for line in capsys.readouterr().out.splitlines() if (record := parse_progress(line))]
    assert [notice.values["first"] for notice in told if isinstance(notice, Notice)] == [1]


def test_an_image_is_made_anew_with_a_test_image_before_it_and_its_views(folder, capsys):
    views, test = folder / "views.npy", film_request(folder, output=str(folder / "test"), scale=4)
    for _ in range(2):
        assert press(folder, None, options={"test": to_data(test), "views": str(views)}) == [(None, "made")]
    assert views.is_file() and (folder / "test" / "eia.png").is_file() and (folder / "film" / "eia.png").is_file()
    assert '"test-made"' in capsys.readouterr().out


def test_a_frame_that_fails_is_said(folder):
    press(folder, [1, 2])
    (folder / "film" / "0002" / "eia.png").unlink()
    (folder / "film" / "0002" / "eia.png" / "x").mkdir(parents=True)
    assert press(folder, [1, 2], blender="/must/not/run") == [(1, "kept"), (2, "failed")]


def test_a_reference_of_some_lenses_is_compared(folder):
    press(folder, None)
    metrics = reference(to_data(film_request(folder)), str(folder / "reference"), 16, 64,
                        [str(folder / "blender"), "--"])["metrics"]
    assert 0.3 < metrics["ssim_lens_fg"] <= 1 and len(read_frame(folder / "reference").lens_list) == 16
