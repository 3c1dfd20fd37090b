"""Renders that are kept: made once, recognised when they are there, and never taken for another one."""

import dataclasses
from pathlib import Path

import pytest

from lfsr_core.base.errors import LfsrError
from lfsr_core.frames.frame import FRAME_FILE, LOW_RES_FILE, REFERENCE_FILES, write_frame
from lfsr_core.frames.request import Request
from lfsr_core.pipeline.store import cached, is_complete
from tests.support.requests import make_request
from tests.support.synthetic import MINI, frame_of, write_reference, write_render


@pytest.fixture
def job(tmp_path):
    return make_request(output=str(tmp_path / "f"), display=MINI, scale=2, samples=16)


class Renderer:
    """Writes what Blender would and counts how often."""

    def __init__(self) -> None:
        self.jobs: list[Request] = []

    def __call__(self, job: Request) -> None:
        self.jobs.append(job)
        folder = Path(job.output)
        if job.kind == "reference":
            write_reference(folder, samples=job.sampling.samples, lens_list=job.lens_list)
        else:
            write_render(folder, scale=job.sampling.scale, samples=job.sampling.samples)


def refuse(job: Request) -> None:
    pytest.fail(f"{job.output} is there and must not be rendered")


@pytest.mark.parametrize("kind", ["render", "reference"])
def test_a_render_is_made_once(job, kind):
    job = dataclasses.replace(job, kind=kind, scale=2 if kind == "render" else 1)
    render = Renderer()
    folder = cached(job, render)
    assert folder == Path(job.output) and render.jobs == [job] and is_complete(folder, kind)
    assert cached(job, refuse) == folder


@pytest.mark.parametrize("missing", [FRAME_FILE, LOW_RES_FILE])
def test_what_is_incomplete_is_made_again(job, missing):
    render = Renderer()
    (cached(job, render) / missing).unlink()
    assert not is_complete(Path(job.output))
    cached(job, render)
    assert len(render.jobs) == 2 and is_complete(Path(job.output))


def test_another_render_is_refused(job):
    cached(job, Renderer())
    with pytest.raises(LfsrError, match="with scale 2, but scale 4 was asked for"):
        cached(job.sampled(scale=4), refuse)


def test_a_render_whose_result_differs_from_the_job_is_refused(job):
    with pytest.raises(LfsrError, match="with scale 4, but scale 2 was asked for"):
        cached(job, lambda wanted: write_render(Path(wanted.output), scale=4))


def test_a_reference_may_have_samples_and_lenses_of_its_own(job):
    job = dataclasses.replace(job, kind="reference", scale=1)
    folder = cached(dataclasses.replace(job, spp=64, lens_list=((0, 0), (1, 1))), Renderer())
    assert all((folder / name).exists() for name in REFERENCE_FILES)
    assert cached(job, refuse) == folder
    write_frame(folder, frame_of(2))
    with pytest.raises(LfsrError, match="with scale 2, but scale 1 was asked for"):
        cached(job, refuse)
