"""How far two observers agree about which of some things are so: a table of two by two, kappa, and sets."""

from __future__ import annotations

import math
from collections.abc import Callable, Collection, Sequence
from dataclasses import dataclass

import numpy as np

from pscover.experiment.statistics import LEVEL, SAMPLES, Interval

NORMAL = 1.959963984540054
"""Standard deviations on each side of the mean between which `LEVEL` of a normal distribution lies."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Confusion:
    """How many things are so by both observers, by the first alone, by the second alone, and by neither."""

    both: int
    first: int
    second: int
    neither: int

    @classmethod
    def of(cls, first: Collection[int], second: Collection[int], among: Collection[int]) -> Confusion:
        """The things that either observer names, of those looked at.

        Examples
        --------
        >>> Confusion.of({1, 2}, {2, 3}, among=range(5))
        Confusion(both=1, first=1, second=1, neither=2)
        """
        one, other, all_ = set(first) & set(among), set(second) & set(among), set(among)
        return cls(both=len(one & other), first=len(one - other), second=len(other - one), neither=len(all_ - one - other))

    @classmethod
    def sum(cls, parts: Sequence[Confusion]) -> Confusion:
        """Of all things together."""
        return cls(
            both=sum(part.both for part in parts),
            first=sum(part.first for part in parts),
            second=sum(part.second for part in parts),
            neither=sum(part.neither for part in parts),
        )

    @property
    def total(self) -> int:
        """Things looked at."""
        return self.both + self.first + self.second + self.neither

    @property
    def agreed(self) -> int:
        """Things on which the two say the same."""
        return self.both + self.neither

    @property
    def kappa(self) -> float:
        """Agreement beyond chance; NaN where both say the same of everything, or there is nothing.

        Source: J. Cohen, "A coefficient of agreement for nominal scales", 1960.

        Examples
        --------
        >>> round(Confusion(both=20, first=5, second=10, neither=15).kappa, 3)
        0.4
        """
        n = self.total
        if n == 0:
            return math.nan
        one, other = self.both + self.first, self.both + self.second
        chance = (one * other + (n - one) * (n - other)) / n**2
        return math.nan if chance == 1.0 else (self.agreed / n - chance) / (1.0 - chance)


def jaccard(first: Collection[int], second: Collection[int]) -> float:
    """Part of two sets together that they share; 1 for two empty ones.

    Examples
    --------
    >>> jaccard({1, 2}, {2, 3, 4}), jaccard((), ())
    (0.25, 1.0)
    """
    union = set(first) | set(second)
    return len(set(first) & set(second)) / len(union) if union else 1.0


def wilson(successes: int, trials: int) -> Interval:
    """A share and its interval at 95 %; NaN without trials.

    Source: E. B. Wilson, "Probable inference, the law of succession, and statistical inference", 1927.

    Examples
    --------
    >>> interval = wilson(9, 10)
    >>> round(interval.mean, 3), round(interval.low, 3), round(interval.high, 3)
    (0.9, 0.596, 0.982)
    """
    if trials == 0:
        return Interval(mean=math.nan, low=math.nan, high=math.nan)
    share, z = successes / trials, NORMAL
    middle = (share + z * z / (2 * trials)) / (1 + z * z / trials)
    half = z / (1 + z * z / trials) * math.sqrt(share * (1 - share) / trials + z * z / (4 * trials * trials))
    return Interval(mean=share, low=max(0.0, middle - half), high=min(1.0, middle + half))


def over_groups(
    groups: Sequence[Sequence[Confusion]], measure: Callable[[Confusion], float], *, seed: int = 0, samples: int = SAMPLES
) -> Interval:
    """A measure of all things together, and its interval by the percentile bootstrap over groups of things.

    Parameters
    ----------
    groups
        Tables of things that depend on each other, such as all of one scene.
    measure
        Of a table.
    seed
        Of the drawing.
    samples
        How often groups are drawn; those whose measure does not exist are left out.

    Examples
    --------
    >>> groups = [[Confusion(both=3, first=0, second=0, neither=1)], [Confusion(both=1, first=1, second=0, neither=2)]]
    >>> over_groups(groups, lambda table: table.agreed / table.total)
    Interval(mean=0.875, low=0.75, high=1.0)
    """
    sums = [Confusion.sum(group) for group in groups]
    drawn = np.random.default_rng(seed).integers(0, len(sums), (samples, len(sums)))
    found = [measure(Confusion.sum([sums[k] for k in row])) for row in drawn.tolist()]
    known = [value for value in found if not math.isnan(value)]
    mean = measure(Confusion.sum(sums))
    if not known:
        return Interval(mean=mean, low=math.nan, high=math.nan)
    low, high = np.quantile(known, [(1 - LEVEL) / 2, (1 + LEVEL) / 2])
    return Interval(mean=mean, low=float(low), high=float(high))
