"""The store of a study: each render is made once."""

from __future__ import annotations

from lfsr_core.frames.folder import FrameFolder
from lfsr_lab.experiments.engine.renders import Store
from tests.support.played_blender import played_blender
from tests.support.requests import make_request
from tests.support.synthetic import MINI


def test_a_render_that_is_asked_for_twice_is_made_once(tmp_path):
    (tmp_path / "disc.blend").touch()
    job = make_request(str(tmp_path / "render"), MINI, scene=str(tmp_path / "disc.blend"), scale=2, samples=4)
    made = []
    Store(tmp_path, played_blender(tmp_path / "blender")).render_all([job, job], lambda done: made.append(done.output))
    assert made == [job.output] and FrameFolder(tmp_path / "render").holds()
