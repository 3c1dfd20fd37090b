"""The animation as the panel renders it: what differs from the command's."""

from __future__ import annotations

import dataclasses
from pathlib import Path

import pytest

from lfsr_core.base.records import to_data
from lfsr_core.frames.frame import read_frame, write_frame
from lfsr_core.process.protocol import parse_progress
from lfsr_core.tasks.blender_tasks import animation
from tests.support.noisy_renders import JOB
from tests.support.played_blender import played_blender


@pytest.fixture
def film(tmp_path) -> Path:
    (tmp_path / "scene.glb").write_text("a scene")
    return tmp_path / "film"


def press(film: Path, frames: list[int], overwrite: bool = False, blender: str | None = None, **changes) -> dict:
    changes = {"scene": str(film.with_name("scene.glb")), "output": str(film), "scale": 2} | changes
    blender = blender or played_blender(film.with_name("blender"))
    return animation(to_data(dataclasses.replace(JOB, **changes)), frames, {"method": "bicubic"},
                     [blender, "--"], overwrite)


def test_frames_of_other_settings_are_made_again_and_progress_is_of_those(film, capsys):
    assert press(film, [1, 2])["sentence"].startswith("2 frames: 2 made, 0 kept, 0 failed")
    capsys.readouterr()
    done = press(film, [1, 2, 3])
    assert done["sentence"].startswith("3 frames: 1 made, 2 kept") and done["table"].count("kept") == 2
    records = [parse_progress(line) for line in capsys.readouterr().out.splitlines()]
    assert [record["message"] for record in records] == ["finishing frame 3"] and records[0]["fraction"] == 1
    assert press(film, [1], spp=64)["sentence"].startswith("1 frames: 1 made")
    assert read_frame(film / "0001").samples == 64
    assert press(film, [2], overwrite=True)["sentence"].startswith("1 frames: 1 made")


def test_frames_of_another_device_or_an_older_scene_are_kept(film, capsys):
    press(film, [1, 2])
    for name, changes in (("0001", {"content": "of yesterday"}), ("0002", {"device": "OPTIX"})):
        write_frame(film / name, dataclasses.replace(read_frame(film / name), **changes))
    assert press(film, [1, 2], blender="/must/not/run", device="CPU")["sentence"].startswith("2 frames: 0 made, 2 kept")
    assert "1 frame is older than this file" in capsys.readouterr().out


def test_a_frame_that_fails_is_said(film):
    press(film, [1, 2])
    (film / "0002" / "eia.png").unlink()
    (film / "0002" / "eia.png" / "x").mkdir(parents=True)
    done = press(film, [1, 2], blender="/must/not/run")
    assert done["failed"].startswith("frame 2: ") and "eia.png cannot be written" in done["failed"]
