"""Parts of long renders, and how much time is left of them."""

import dataclasses
import json
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from lfsr_core.base.messages import Progress
from lfsr_core.base.system import staging_folder
from lfsr_core.frames.folder import FrameFolder
from lfsr_core.images.image_files import write_layers
from lfsr_core.pipeline import parts as part_files
from lfsr_core.pipeline.make import LEAST_LEFT, TimeLeft
from lfsr_core.pipeline.parts import ImageParts, Pace, Part, gaps, has_parts, is_worth_storing, remove_others

INPUTS = {"settings": "abc", "scene file": "def"}


@pytest.fixture
def parts(tmp_path):
    return ImageParts(FrameFolder(tmp_path / "frame").parts, "lr_eia", INPUTS)


def put(parts, first, last, seconds=1.5):
    """Store rows ``first`` to ``last``."""
    written = parts.folder.with_name("band.exr")
    write_layers(written, {"color": np.full((last - first, 4, 4), float(first), np.float32)})
    return parts.store(written, Part(first, last, seconds))


@given(st.lists(st.tuples(st.integers(0, 40), st.integers(1, 9))), st.integers(1, 50))
def test_parts_and_gaps_are_the_image(ranges, count):
    kept = [Part(first, min(first + size, count)) for first, size in ranges if first < count]
    covered = {row for part in kept for row in range(part.first, part.last)}
    missing = [row for part in gaps(count, kept) for row in range(part.first, part.last)]
    assert missing == sorted(set(range(count)) - covered)


def test_stored_parts_come_back_with_their_seconds_and_those_of_another_image_or_inputs_do_not(parts):
    paths = [put(parts, 7, 9), put(parts, 0, 4, 0.25)]
    assert parts.stored(9) == [(Part(0, 4, 0.25), paths[1]), (Part(7, 9, 1.5), paths[0])]
    assert not parts.folder.with_name("band.exr").exists()
    put(parts, 4, 12)
    assert len(parts.stored(9)) == 2, "a part beyond the image is of another"
    assert dataclasses.replace(parts, name="reference_a").stored(9) == []
    assert dataclasses.replace(parts, inputs=INPUTS | {"settings": "x"}).stored(9) == []


def test_a_damaged_part_goes_and_other_inputs_remove_the_old_ones(parts):
    whole, damaged = put(parts, 0, 4), put(parts, 4, 9)
    damaged.write_bytes(damaged.read_bytes()[:-20])
    assert [path for _, path in parts.stored(9)] == [whole] and not damaged.exists()
    put(parts, 0, 4)
    assert remove_others(parts.folder, INPUTS) == "" and len(parts.stored(9)) == 1
    assert remove_others(parts.folder, INPUTS | {"scene file": "new"}) == "scene file" and not parts.folder.exists()
    assert remove_others(parts.folder, INPUTS) == ""
    for content in ["", "[1]", "{\"settings\": [[]]}"]:
        put(parts, 0, 4)
        (parts.folder / "inputs.json").write_text(content)
        assert remove_others(parts.folder, INPUTS) == "settings" and not parts.folder.exists()


def test_it_is_told_where_parts_are_until_the_render_is_published(parts, tmp_path):
    assert not has_parts(parts.folder)
    put(parts, 0, 4)
    assert has_parts(parts.folder)
    with staging_folder(tmp_path / "frame") as staged:
        assert parts.folder.exists(), "a dead run's staging folder goes, parts stay"
        (staged / "frame").mkdir()
        FrameFolder(tmp_path / "frame").publish(staged / "frame")
    assert [path.name for path in tmp_path.iterdir()] == ["frame"]


images = st.builds(Pace, width=st.integers(4, 16384), rows=st.integers(4, 16384), samples=st.integers(1, 10**5),
                   seconds=st.just(60.0))


@given(images)
def test_the_trial_is_a_small_share_inside_the_image(pace):
    trial = pace.trial
    assert 0 <= trial.first < trial.last <= pace.rows and trial.size <= max(1, pace.rows / 64)


@given(images, st.floats(1e-6, 1e4))
def test_bands_end_in_time_where_every_row_costs_the_same(pace, row_seconds):
    band = pace.trial
    for _ in range(12):
        size = pace.after(dataclasses.replace(band, seconds=band.size * row_seconds))
        assert 1 <= size <= pace.most
        assert size == 1 or size * row_seconds <= pace.seconds * 1.001
        band = Part(0, size)
    assert size == min(pace.most, max(1, int(pace.seconds / row_seconds + 1e-6))) or size * row_seconds > 50


@given(images, st.integers(1, 16384))
def test_a_band_that_takes_too_long_is_followed_by_a_smaller_one(pace, size):
    assert 1 <= pace.after_timeout(Part(0, size)) <= max(1, size / 16)


def test_default_renders_stay_one_where_a_minute_will_do():
    assert Pace(480, 270, 16, 60.0).is_short
    usual = Pace(1920, 1080, 16, 60.0)
    assert not usual.is_short and usual.takes_one(dataclasses.replace(usual.trial, seconds=23 / 64))
    assert not usual.takes_one(dataclasses.replace(usual.trial, seconds=3.0))
    assert not Pace(7680, 4320, 1, 60.0).takes_one(Part(0, 1, 0.0)), "it would not fit into one tile"


@pytest.mark.parametrize(("value", "seconds"), [("0.5", 0.5), ("-1", 0.01), ("soon", 60.0), ("inf", 86400.0)])
def test_the_environment_may_say_how_long_a_part_takes(monkeypatch, value, seconds):
    monkeypatch.setenv("LFSR_SECONDS_PER_PART", value)
    assert part_files.seconds_per_part() == seconds
    assert is_worth_storing(seconds) and not is_worth_storing(seconds / 100)


# Each: times, fractions, CPU seconds and whether it was repeated, as renders on two busy cores have told them.
RECORDED = json.loads(Path(__file__).with_name("recorded_renders.json").read_text(encoding="utf-8"))
SECONDS_BETWEEN_LOOKS = 0.1


def looks(heard: list[list[float]]) -> list[bool]:
    """Whether each look from 20 % of the time on is right within a third, or 2 s."""
    (begin, *_), (end, *_) = heard[0], heard[-1]
    clock, waiting, right = TimeLeft(is_image=True), list(heard), []
    for number in range(int((end - begin) / SECONDS_BETWEEN_LOOKS)):
        now = begin + number * SECONDS_BETWEEN_LOOKS
        while waiting and waiting[0][0] <= now:
            time, fraction, cpu, repeated = waiting.pop(0)
            clock.hear(Progress("render", fraction, cpu=cpu, repeated=bool(repeated)), time)
        if now > begin + 0.2 * (end - begin):
            left = clock.left(now)
            right.append(left is not None and abs(left - (end - now)) <= max((end - now) / 3, 2.0))
    return right


def test_recorded_renders_are_told_within_a_third():
    right = [answer for render in RECORDED for answer in looks(render["heard"])]
    share = sum(right) / len(right)
    print(f"{sum(right)} of {len(right)} looks at {len(RECORDED)} renders are right, {share:.1%}")
    assert share >= 0.8


@pytest.mark.parametrize("kept", [0.0, 0.4])
def test_even_work_is_told_exactly_whatever_came_before_it(kept):
    """``kept``: fraction that an earlier run has left."""
    clock = TimeLeft(after=3.0)
    clock.hear(Progress("render", kept), 10.0)
    clock.hear(Progress("render", kept), 30.0)
    assert clock.left(30.0) is None
    for second in range(1, 20):
        clock.hear(Progress("render", kept + (1 - kept) * second / 20), 30.0 + second)
        assert clock.left(30.0 + second) == pytest.approx(23 - second)
        assert clock.left(30.5 + second) == pytest.approx(22.5 - second), "it counts down between reports"
    clock.hear(Progress("render", 1.0), 50.0)
    assert clock.left(51.0) == pytest.approx(2.0), "only what follows is left"


def test_silence_never_ends_at_nothing_left_and_fewer_cores_of_late_make_the_rest_longer():
    clock = TimeLeft()
    clock.hear(Progress("render", 0.0), 0.0)
    clock.hear(Progress("render", 0.5), 1.0)
    left = [clock.left(second) for second in range(1, 60)]
    assert min(left) >= LEAST_LEFT and left[0] == pytest.approx(1.0) and left[-1] > 5
    clock = TimeLeft()
    for second, cpu in enumerate([0.0, 1.0, 2.0, 0.5, 1.5, 2.5]):
        clock.hear(Progress("render", second / 10, cpu=cpu), float(second))
    assert clock.left(5.0) == pytest.approx(5.0, rel=0.1)
    clock = TimeLeft()
    clock.hear(Progress("render", 0.0, cpu=0.0), 0.0)
    clock.hear(Progress("render", 0.1, cpu=10.0), 10.0)
    for second in range(11, 41):
        clock.hear(Progress("render", 0.1, cpu=10.0 + (second - 10) / 4, repeated=True), second)
    assert 90.0 < clock.left(10.0) + 30 < 360.0
