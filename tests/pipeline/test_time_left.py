"""How much time is left: right on recorded renders, exact where work is even, and never a surprise where it is not."""

import json
from pathlib import Path

import pytest

from lfsr_core.base.notices import Progress
from lfsr_core.pipeline.make import LEAST_LEFT, TimeLeft

# Each: times, fractions, CPU seconds and whether it was repeated, as renders on two busy cores have told them.
RECORDED = json.loads(Path(__file__).with_name("recorded_renders.json").read_text(encoding="utf-8"))
SECONDS_BETWEEN_LOOKS = 0.1


def looks(heard: list[list[float]]) -> list[bool]:
    """Whether each look from 20 % of the time on is right within a third, or 2 s."""
    (begin, *_), (end, *_) = heard[0], heard[-1]
    clock, waiting, right = TimeLeft(is_image=True), list(heard), []
    for look in range(int((end - begin) / SECONDS_BETWEEN_LOOKS)):
        now = begin + look * SECONDS_BETWEEN_LOOKS
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


def test_silence_never_ends_at_nothing_left():
    clock = TimeLeft()
    clock.hear(Progress("render", 0.0), 0.0)
    clock.hear(Progress("render", 0.5), 1.0)
    left = [clock.left(second) for second in range(1, 60)]
    assert min(left) >= LEAST_LEFT and left[0] == pytest.approx(1.0) and left[-1] > 5


def test_fewer_cores_of_late_make_the_rest_longer():
    """Ten seconds for a tenth at full speed, then a process that gets a quarter of it."""
    clock = TimeLeft()
    clock.hear(Progress("render", 0.0, cpu=0.0), 0.0)
    clock.hear(Progress("render", 0.1, cpu=10.0), 10.0)
    for second in range(11, 41):
        clock.hear(Progress("render", 0.1, cpu=10.0 + (second - 10) / 4, repeated=True), second)
    assert 90.0 < clock.left(10.0) + 30 < 360.0


def test_another_process_goes_on_counting():
    clock = TimeLeft()
    for second, cpu in enumerate([0.0, 1.0, 2.0, 0.5, 1.5, 2.5]):
        clock.hear(Progress("render", second / 10, cpu=cpu), float(second))
    assert clock.left(5.0) == pytest.approx(5.0, rel=0.1)
