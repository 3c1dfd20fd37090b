"""The table that ends the rendering of a shot."""

from __future__ import annotations

from collections.abc import Sequence

from lfsr_core.sequence.engine import FAILED, KEPT, Result, duration


def summary(results: Sequence[Result], seconds: float) -> str:
    """A line per frame, and one of all; ``seconds`` passed."""
    lines = [f"{'frame':>7}  {'state':6}  {'render':>9}  {'finish':>9}"]
    lines += [_line(result) for result in results]
    counts = [f"{sum(result.state == state for result in results)} {state}" for state in ("made", KEPT, FAILED)]
    return "\n".join([*lines, f"{len(results)} frames: {', '.join(counts)}, in {duration(seconds)}"])


def _line(result: Result) -> str:
    start = f"{result.frame:7}  {result.state:6}"
    if result.state == FAILED:
        return f"{start}  {result.error}"
    return f"{start}  {result.render:7.1f} s  {result.finish:7.1f} s"
