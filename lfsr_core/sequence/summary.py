"""The table of outcomes after an animation."""

from __future__ import annotations

from collections.abc import Sequence

from lfsr_core.sequence.engine import FAILED, KEPT, MADE, Result, duration


def summary(results: Sequence[Result], seconds: float) -> str:
    """Return a line per frame and one for all; ``seconds`` is the time that has passed."""
    return f"{table(results)}\n{counts(results, seconds)}"


def table(results: Sequence[Result]) -> str:
    """Return a line per frame, below a line of titles."""
    return "\n".join([f"{'frame':>7}  {'state':6}  {'render':>9}  {'finish':>9}", *map(_line, results)])


def counts(results: Sequence[Result], seconds: float) -> str:
    """Return how many frames are in which state after ``seconds``."""
    found = [f"{sum(result.state == state for result in results)} {state}" for state in (MADE, KEPT, FAILED)]
    return f"{len(results)} frames: {', '.join(found)}, in {duration(seconds)}"


def _line(result: Result) -> str:
    start = f"{result.frame:7}  {result.state:6}"
    if result.state == FAILED:
        return f"{start}  {result.error}"
    return f"{start}  {result.render:7.1f} s  {result.finish:7.1f} s"
