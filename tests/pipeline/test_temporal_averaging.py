"""Temporal averaging: a frame is finished when its neighbours are rendered, and again when more are there."""

import shutil

import pytest

from lfsr_core.frames.finish import Finish, read_report
from lfsr_core.frames.frame import read_frame
from lfsr_core.pipeline.make import KEPT, MADE, finish_frame, requests_of
from tests.support.animations import FINISH, film, film_request, images, states
from tests.support.played_blender import played_blender
from tests.support.synthetic import fails
from tests.support.told import refuses

AVERAGED = Finish("bicubic", temporal_averaging=1)


@pytest.fixture(scope="module")
def finished(tmp_path_factory):
    folder = tmp_path_factory.mktemp("shared")
    film(folder, range(1, 4), AVERAGED, blender=played_blender(folder / "blender"), chunk=2)
    return folder


@pytest.fixture
def made(finished, tmp_path):
    for name in ("film", "scene.glb", "blender"):
        (shutil.copytree if name == "film" else shutil.copy2)(finished / name, tmp_path / name)
    return tmp_path


def neighbours(folder):
    return [read_report(path).neighbours for path in sorted((folder / "film").glob("0*"))]


def test_every_frame_has_noise_of_its_own_and_sees_those_beside_it(finished):
    frames = [read_frame(path) for path in sorted((finished / "film").glob("0*"))]
    assert [frame.seed for frame in frames] == [5, 6, 7], "one for each averaged frame, from the job's on"
    assert neighbours(finished) == [(2, 3), (1, 3), (1, 2)]


def test_alone_every_frame_has_the_same_noise(tmp_path):
    assert {request.seed for request in requests_of(film_request(tmp_path), FINISH, range(1, 4))} == {5}


def test_the_picture_is_that_of_the_second_stage_alone(made):
    before = images(made / "film")
    finish_frame(made / "film" / "0002", AVERAGED)
    assert images(made / "film") == before
    finish_frame(made / "film" / "0002", FINISH)
    assert images(made / "film")["0002"] != before["0002"]


def test_a_frame_is_finished_again_when_more_lie_beside_it(made):
    assert states(film(made, range(1, 4), AVERAGED)) == [KEPT] * 3
    assert states(film(made, range(1, 5), AVERAGED, blender=str(made / "blender"))) == [KEPT, KEPT, MADE, MADE]
    assert neighbours(made) == [(2, 3), (1, 3), (2, 4), (2, 3)]


def test_frames_of_other_seeds_are_refused(made):
    refuses("seed 6.*seed 5", film, made, (2,))


@pytest.mark.parametrize("words, sentence", [
    (["--temporal-averaging", "1"], "without --frames"), (["--frames", "1-3", "--temporal-averaging", "9"], "0 to 8"),
    (["--frame", "2", "--temporal-averaging", "9"], "0 to 8"),
    (["--frames", "1-3", "--temporal-averaging", "1", "--cluster", "tcp://x"], "cluster")])
def test_what_does_not_go_together_is_refused(tmp_path, capsys, words, sentence):
    (tmp_path / "scene.glb").write_text("a scene")
    arguments = ["render", str(tmp_path / "scene.glb"), "-o", str(tmp_path / "film"), "--display", "mini", *words]
    assert sentence in fails(arguments, capsys)
