"""From measured differences to words: a claim holds only where its 95 % interval lies on its side."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Mapping, Sequence

from lfsr_core.metrics.intervals import student_95

FEWEST = 3  # values that show their own spread
SINGLE_RUN = 0.10  # fraction of a time taken once that is within its noise
WORDS = {1: "holds", -1: "the other way round", 0: "cannot be told"}


@dataclasses.dataclass(frozen=True)
class Difference:
    """A difference with its 95 % interval."""

    value: float  # the difference itself
    half: float = 0.0  # half-width of the interval, infinite where the spread is not known

    @property
    def sign(self) -> int:
        """1 above zero, -1 below, 0 where the interval holds zero."""
        return int(self.value - self.half > 0) - int(self.value + self.half < 0)

    def __str__(self) -> str:
        return f"{self.value:+.3g}" + (f" ± {self.half:.2g}" if 0 < self.half < math.inf else "")


Differences = Mapping[str, Difference]  # by the case's name


def paired(ours: Sequence[float], theirs: Sequence[float]) -> Difference:
    """Return the mean of ``ours`` - ``theirs``, pair by pair, with its interval of Student's t."""
    values = [a - b for a, b in zip(ours, theirs, strict=True)]
    count = len(values)
    mean = math.fsum(values) / count
    if count < FEWEST:
        return Difference(mean, math.inf)
    variance = math.fsum((value - mean) ** 2 for value in values) / (count - 1)
    return Difference(mean, student_95(count - 1) * math.sqrt(variance / count))


def single_runs(ours: float, theirs: float) -> Difference:
    """Return ``ours`` - ``theirs`` of two times that were each taken once."""
    return Difference(ours - theirs, SINGLE_RUN * max(ours, theirs))


def overall(*parts: Differences) -> str:
    """Return in bold what became of a claim whose ``parts`` must all be above zero."""
    signs = {difference.sign for part in parts for difference in part.values()}
    if not signs:
        return "**Not measured.**"
    if 1 in signs:
        words = "Holds" if signs == {1} else "Holds in part"
    else:
        words = "Does not hold" if -1 in signs else "Cannot be told"
    return f"**{words}.**" if all(parts) else f"**{words}; not all of it was measured.**"


def sentence(statement: str, differences: Differences, unit: str = "") -> str:
    """Return whether the statement that the differences are above zero holds, where, and by how much in ``unit``."""
    if not differences:
        return f"{statement}: not measured."
    return f"{statement}: {holds(differences)} ({span(differences)} {unit}".rstrip() + ")."


def holds(differences: Differences) -> str:
    """Return whether "above zero" holds: in all cases, or in which."""
    total, parts = len(differences), []
    for sign, words in WORDS.items():
        names = [name for name, difference in differences.items() if difference.sign == sign]
        if len(names) == total:
            return words + (f" (all {total} cases)" if total > 1 else "")
        if names:
            parts.append(f"{words} in {len(names)} of {total} ({', '.join(names)})")
    return "; ".join(parts)


def span(differences: Differences) -> str:
    """Return a single difference with its interval, several as a range."""
    found = sorted(differences.values(), key=lambda difference: difference.value)
    return str(found[0]) if len(found) == 1 else f"{found[0].value:+.3g} to {found[-1].value:+.3g}"
