"""Performance profiles (Dolan and Moré 2002): how often somebody is at most so many times slower than the fastest."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

RESOLUTION = 0.01
"""Seconds: shorter times are taken for this one, for ratios of milliseconds are noise."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Profile:
    """A staircase: at `at[k]` the share rises to `share[k]`, and stays there to the right.

    Parameters
    ----------
    at
        Rising: ratios to the fastest, or seconds.
    share
        Of all instances, in [0, 1].
    """

    at: tuple[float, ...]
    share: tuple[float, ...]

    def value(self, x: float) -> float:
        """The share at x."""
        return max((share for place, share in zip(self.at, self.share, strict=True) if place <= x), default=0.0)


def performance(times: Mapping[str, Sequence[float]]) -> dict[str, Profile]:
    """How often each is within a factor of the fastest.

    Parameters
    ----------
    times
        Seconds of each, one an instance, in the same order for all; infinite where it was not solved. Instances that nobody
        solved count for nobody.

    Examples
    --------
    >>> found = performance({"a": [1.0, 2.0], "b": [3.0, math.inf]})
    >>> found["a"], found["b"].value(3.0)
    (Profile(at=(1.0,), share=(1.0,)), 0.5)
    """
    floored = {name: [max(RESOLUTION, seconds) for seconds in own] for name, own in times.items()}
    best = [min(column) for column in zip(*floored.values(), strict=True)]
    return {
        name: _staircase([own / least if own < math.inf else math.inf for own, least in zip(listed, best, strict=True)])
        for name, listed in floored.items()
    }


def within(times: Mapping[str, Sequence[float]]) -> dict[str, Profile]:
    """How much of the instances each solved within some seconds; parameters as of `performance`.

    Examples
    --------
    >>> within({"a": [1.0, 2.0, math.inf]})["a"].share
    (0.3333333333333333, 0.6666666666666666)
    """
    return {name: _staircase([max(RESOLUTION, seconds) for seconds in own]) for name, own in times.items()}


def _staircase(values: Sequence[float]) -> Profile:
    known = sorted(value for value in values if value < math.inf)
    at = tuple(dict.fromkeys(known))
    return Profile(at=at, share=tuple(sum(value <= place for value in known) / len(values) for place in at))
