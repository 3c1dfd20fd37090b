"""How long a step will take: exact where its speed is even, and never a surprise where it is not."""

from __future__ import annotations

import dataclasses

import pytest

from blender_addon.jobs import estimate
from blender_addon.jobs.estimate import StepClock
from lfsr_core.optics.display import load_display
from tests.support.requests import make_request

OPENING = 30.0  # seconds before the work begins


@pytest.fixture(autouse=True)
def nothing_learned(monkeypatch):
    monkeypatch.setattr(estimate, "_slower", {})


@pytest.mark.parametrize("kept", [0.0, 0.4])
def test_even_work_is_told_exactly_whatever_came_before_it(kept):
    """``kept``: fraction that an earlier run has left."""
    clock = StepClock(0.0)
    for second in range(int(OPENING)):
        assert clock.left(second) is None and clock.share(second) == 0
    clock.take(OPENING - 5, kept)
    clock.take(OPENING, kept)
    for second in range(1, 20):
        done = kept + (1 - kept) * second / 20
        clock.take(OPENING + second, done)
        assert clock.left(OPENING + second) == pytest.approx(20 - second)
        assert clock.left(OPENING + second + 0.5) == pytest.approx(19.5 - second), "it counts down between reports"
        assert done <= clock.share(OPENING + second + 0.5) < 1


@pytest.mark.parametrize("rates", [(1.0, 0.25), (0.3, 1.0), (0.5, 0.5), (0.02, 0.02)])
def test_other_programs_that_take_cores_meanwhile_do_not_mislead(rates):
    """100 CPU seconds, of which the first 30 seconds get another part of the machine than the rest; few reports."""
    clock, cpu, reports, times = StepClock(0.0), [0.0], [0.0, 0.02, 0.5], []
    while cpu[-1] < 100:
        cpu.append(cpu[-1] + rates[len(cpu) > 30])
    for second, spent in enumerate(cpu):
        if reports and spent / 100 >= reports[0]:
            clock.take(second, reports.pop(0), spent)
        else:
            clock.beat(second, spent)
        times.append(clock.left(second + 0.5))
    for second in range(max(36, len(cpu) // 5), len(cpu) - 1):  # at a new rate it takes some beats
        assert times[second] == pytest.approx(len(cpu) - 1 - second - 0.5, rel=0.25, abs=2.0), second


def test_silence_never_ends_at_nothing_left():
    clock = StepClock(0.0)
    clock.take(0.0, 0.0)
    clock.take(1.0, 0.5)
    left = [clock.left(second) for second in range(1, 60)]
    assert min(left) > 0 and left[0] == pytest.approx(1.0) and left[-1] > 20
    shares = [clock.share(second) for second in range(1, 60)]
    assert min(shares) >= 0.5 and max(shares) < 1


def test_what_is_expected_counts_until_it_is_learned():
    clock = StepClock(100.0, 8.0)
    clock.take(101.0, 0.9)  # a second stage's steps are not even
    assert clock.left(102.0) == pytest.approx(6.0) and clock.share(104.0) == pytest.approx(0.9)
    assert clock.share(99.9) == 0.9
    assert estimate.expected("Upscaling", 4.0) == 4.0
    estimate.learn("Upscaling", 4.0, 12.0)
    assert estimate.expected("Upscaling", 2.0) == pytest.approx(6.0)
    estimate.learn("Upscaling", 6.0, 6.0)
    assert estimate.expected("Upscaling", 2.0) == pytest.approx(6.0) and estimate.expected("Denoising", 2.0) == 2.0


def test_a_larger_image_and_a_denoiser_take_longer():
    small, large = load_display("mini"), load_display("bupt-32in-8k")
    seconds = [estimate.second_stage(small, 2, "bilinear"), estimate.second_stage(large, 4, "bilinear"),
               estimate.second_stage(large, 4, "denoise+bilinear+epi"), estimate.second_stage(large, 1, "denoise")]
    assert seconds == sorted(seconds) and seconds[-1] > 2 * seconds[-2]


def test_the_speed_of_an_earlier_render_steadies_the_first_report():
    clock = StepClock(0.0, before=100.0)
    clock.take(10.0, 0.0)
    assert clock.left(10.0) == pytest.approx(100.0) and clock.worked(30.0) == pytest.approx(20.0)
    clock.take(13.0, 0.01)  # by itself it would make 300 seconds of it
    assert 97.0 < clock.left(13.0) < 115.0
    clock.take(160.0, 0.5)
    # The latest half went at the speed of 300 seconds.
    assert clock.left(160.0) == pytest.approx(150 - 100 * estimate.TRUST / (0.5 + estimate.TRUST), rel=0.01)
    resumed = StepClock(0.0, before=100.0)
    resumed.take(10.0, 0.6)
    assert resumed.left(10.0) == pytest.approx(40.0) and resumed.worked(30.0) is None


def test_later_samples_of_a_render_take_less_than_its_first():
    clock = StepClock(0.0, is_render=True)
    clock.take(0.0, 0.0)
    clock.take(1.0, 1 / 64)
    assert clock.left(1.0) == pytest.approx(63 * estimate.FIRST_PACE)
    clock.take(1.0 + 31 * 0.7, 0.5)
    assert clock.left(1.0 + 31 * 0.7) == pytest.approx(32 * 0.7 * estimate.PACE, rel=0.05)


def test_a_scenes_speed_holds_for_other_settings_of_it(monkeypatch, tmp_path):
    monkeypatch.setattr(estimate, "_speeds", {})
    job = make_request(output=str(tmp_path), display=load_display("mini"), scale=2, samples=4, source="a.blend",
                       scene_name="Scene")
    assert estimate.sampling(job) is None
    estimate.learn_sampling(job, 10.0)
    assert estimate.sampling(job.sampled(samples=12)) == pytest.approx(30.0)
    # Four times the pixels, at a quarter of the samples.
    assert estimate.sampling(job.sampled(scale=1, samples=1)) == pytest.approx(10.0)
    auto = dataclasses.replace(job, scale=2, scales=(2, 1), rays=1.0)
    assert estimate.sampling(auto) == pytest.approx(10.0)
    assert estimate.sampling(dataclasses.replace(job, source="b.blend")) is None
