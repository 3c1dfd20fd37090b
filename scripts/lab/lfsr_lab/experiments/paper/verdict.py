"""From measured differences to words: a claim holds only where its 95 % interval lies on its side."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Mapping, Sequence

from lfsr_core.metrics.intervals import student_95

FEWEST = 3  # values that show their own spread
SINGLE_RUN = 0.10  # share of a time taken once that is within its noise


@dataclasses.dataclass(frozen=True)
class Difference:
    """A difference with its 95 % interval."""

    value: float  # the difference itself
    half: float  # half-width of the interval, infinite where the spread is not known

    @property
    def sign(self) -> int:
        """1 above zero, -1 below, 0 where the interval holds zero."""
        return int(self.value - self.half > 0) - int(self.value + self.half < 0)

    def __str__(self) -> str:
        return f"{self.value:+.4f}" + (f" ± {self.half:.4f}" if 0 < self.half < math.inf else "")


def mean_interval(values: Sequence[float]) -> Difference:
    """Mean of independent values with its interval of Student's t."""
    count = len(values)
    mean = math.fsum(values) / count
    if count < FEWEST:
        return Difference(mean, math.inf)
    variance = math.fsum((value - mean) ** 2 for value in values) / (count - 1)
    return Difference(mean, student_95(count - 1) * math.sqrt(variance / count))


def paired(ours: Sequence[float], theirs: Sequence[float]) -> Difference:
    """Mean of ``ours`` - ``theirs``, pair by pair: what both share cancels."""
    return mean_interval([a - b for a, b in zip(ours, theirs, strict=True)])


def single_runs(ours: float, theirs: float) -> Difference:
    """``ours`` - ``theirs`` of two times that were each taken once."""
    return Difference(ours - theirs, SINGLE_RUN * max(ours, theirs))


def overall(*parts: Mapping[str, Difference]) -> str:
    """What became of a claim whose ``parts`` must all be above zero, in a few words."""
    signs = {difference.sign for part in parts for difference in part.values()}
    if not signs:
        return "**Not measured.**"
    if signs == {1}:
        words = "Holds"
    elif 1 in signs:
        words = "Holds in part"
    else:
        words = "Does not hold" if signs == {-1} else "Does not hold where it can be told"
        words = words if -1 in signs else "Cannot be told"
    return f"**{words}.**" if all(parts) else f"**{words}; not all of it was measured.**"


def sentence(statement: str, differences: Mapping[str, Difference], unit: str = "", factor: float = 1.0) -> str:
    """Whether a statement holds, and by how much.

    Parameters
    ----------
    statement: what holds where the differences are above zero.
    differences: by the case's name.
    unit: of what is written.
    factor: that the differences are multiplied with for that.
    """
    if not differences:
        return f"{statement}: not measured."
    scaled = {name: Difference(factor * d.value, factor * d.half) for name, d in differences.items()}
    return f"{statement}: {holds(differences)} ({span(scaled)}{' ' if unit else ''}{unit})."


def holds(differences: Mapping[str, Difference]) -> str:
    """Whether "above zero" holds: in all cases, in none, or in which; ``differences`` by the case's name."""
    groups = {sign: [name for name, difference in differences.items() if difference.sign == sign]
              for sign in (1, -1, 0)}
    words = {1: "holds", -1: "the other way round", 0: "cannot be told from these numbers"}
    everywhere = next((sign for sign, names in groups.items() if len(names) == len(differences)), None)
    if everywhere is not None:
        return words[everywhere] + (f" (all {len(differences)} cases)" if len(differences) > 1 else "")
    parts = [f"{words[sign]} in {len(names)} of {len(differences)} ({', '.join(names)})"
             for sign, names in groups.items() if names]
    return "; ".join(parts)


def span(differences: Mapping[str, Difference]) -> str:
    """The differences' values in one phrase: one with its interval, several as a range."""
    found = list(differences.values())
    if len(found) == 1:
        return str(found[0])
    return f"{min(d.value for d in found):+.4f} to {max(d.value for d in found):+.4f}" if found else "–"
