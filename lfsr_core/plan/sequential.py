"""What a plan renders next, until its choice is certain: which candidates, on how many lenses.

The candidates of one scale and sample count share their renders, and their lenses come in looks (``sample.looks``).
After each look the bounds of a candidate are compared with the target, which gives it several chances to reach it by
luck. So each look has bounds of ``certainty(looks)``: the chance that any of them is wrong stays below WRONG
(Bonferroni; the looks overlap, so it is smaller still).
"""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Mapping, Sequence
from statistics import NormalDist

from lfsr_core.plan.candidates import BETWEEN, Rated, chain, choose

WRONG = 0.05  # largest chance that a bound of a candidate is wrong at any look
WORTH = 1.2  # times as much must the chosen candidate cost, so that more lenses are looked at for a cheaper one
Group = tuple[int, int]  # scale and samples per pixel


def certainty(looks: int) -> float:
    """Normal quantile of one-sided bounds that hold at all of ``looks`` with 95 %."""
    return NormalDist().inv_cdf(1 - WRONG / looks)


@dataclasses.dataclass(frozen=True)
class Known:
    """What a plan knows of its candidates."""

    rated: Sequence[Rated]
    looks: Mapping[Group, int]  # taken of the candidates of each group; 0 where they were not measured
    narrowing: Callable[[int], float]  # of bounds from so many lenses, as a factor, with all lenses of the last look
    target: float
    limit: float  # longest time of a frame in seconds
    affords: Callable[[Group], bool]  # whether another look at a group is possible

    def next_group(self) -> Group | None:
        """Return the group to look at next, None where the choice is certain or nothing more can be learned.

        First come groups that were not measured, the largest scale and the fewest samples first, if they cost less
        than the cheapest candidate that seems to reach the target; then further looks at that candidate, at those that
        cost less and may still reach it, and at those that could refute it. Where one is proved to reach it, only those
        count that cost much less.
        """
        chosen, hopeful = choose(self.rated, self.target, self.limit).chosen, self._hopeful()
        confirming = self._next_samples(chosen) if chosen else None
        for group in sorted(self.looks, key=lambda group: (-group[0], group[1])):
            seconds = min(row.seconds for row in self.rated if (row.scale, row.spp) == group)
            is_cheap = hopeful is None or seconds < hopeful.seconds
            if (not self.looks[group] and seconds <= self.limit and (is_cheap or group == confirming)
                    and self.affords(group)):
                return group
        rows = [row for row in self.rated if self._is_open(row)
                and (chosen is None or WORTH * row.seconds < chosen.seconds)
                and (hopeful is None or row.seconds <= hopeful.seconds or self._refutes(row, hopeful))]
        least = min(rows, key=lambda row: (self._looks(row), row.seconds), default=None)
        return self._group(least) if least else None

    def _hopeful(self) -> Rated | None:
        """Return the cheapest candidate whose mean reaches the target, and which more lenses may prove to reach it."""
        def may_pass(row: Rated) -> bool:
            return row.low >= self.target or self._is_open(row)

        rows = [row for row in self.rated if row.estimate is not None and row.estimate.mean >= self.target
                and row.seconds <= self.limit
                and all(may_pass(other) for other in (row, *chain(row, self.rated)) if other.spp >= row.spp)]
        return min(rows, key=lambda row: row.seconds, default=None)

    def _refutes(self, row: Rated, other: Rated) -> bool:
        """Return whether ``row`` must reach the target for ``other`` to be chosen."""
        return (row.scale, row.method) == (other.scale, other.method) and row.spp > other.spp

    def _is_open(self, row: Rated) -> bool:
        """Return whether a candidate that was not proved to reach the target can be, with all lenses that there are.

        Its bound must then rise above the target, while it narrows.
        """
        found = row.estimate
        if found is None or row.low >= self.target or row.seconds > self.limit:
            return False
        narrowed = (found.mean - found.low) * self.narrowing(found.lenses)
        return found.high >= self.target + narrowed and self.affords(self._group(row))

    def _group(self, row: Rated) -> Group:
        """Return the group of a candidate; of one between two that were measured, the one with fewer looks."""
        if row.note != BETWEEN:
            return row.scale, row.spp
        spps = [other.spp for other in chain(row, self.rated) if other.note != BETWEEN]
        beside = max(spp for spp in spps if spp < row.spp), min(spp for spp in spps if spp > row.spp)
        return min(((row.scale, spp) for spp in beside), key=lambda group: self.looks[group])

    def _looks(self, row: Rated) -> int:
        return self.looks[self._group(row)]

    def _next_samples(self, row: Rated) -> Group | None:
        """Return the group with the next more samples at the scale of a candidate."""
        return min((group for group in self.looks if group[0] == row.scale and group[1] > row.spp), default=None)
