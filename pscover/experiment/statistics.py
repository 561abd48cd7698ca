"""Means over episodes and their 95 % intervals, by the bootstrap over scenes."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from pscover.experiment.trial import Outcome

SAMPLES = 10_000
LEVEL = 0.95
BASELINE = "random"


@dataclass(frozen=True, slots=True, kw_only=True)
class Interval:
    """A mean and the ends of its 95 % interval; NaN where there is nothing to take a mean of."""

    mean: float
    low: float
    high: float


@dataclass(frozen=True, slots=True, kw_only=True)
class Row:
    """A policy over its episodes.

    Parameters
    ----------
    policy
        Its name.
    episodes, cleared
        How many, and how many ended with a table without cloth.
    opt, opt_without_empty
        Objects per transport, averaged over episodes, with all trips and without those with nothing.
    gain
        Its ratio to that of the policy `random` over the scenes that both have; NaN without such scenes.
    pph
        Garments removed an hour of the robot's clock, without computing.
    trips, empty, stand_ins, places, fallen, left
        Averages an episode; empty and stand_ins are parts of trips (see `Outcome`), and places are rearrangements.
    """

    policy: str
    episodes: int
    cleared: int
    opt: Interval
    opt_without_empty: Interval
    gain: Interval
    pph: Interval
    trips: float
    empty: float
    stand_ins: float
    places: float
    fallen: float
    left: float


def bootstrap(values: Sequence[float], seed: int = 0) -> Interval:
    """The mean of values, one a scene, and its interval by the percentile bootstrap; NaNs are left out.

    Examples
    --------
    >>> interval = bootstrap([1.0, 2.0, 3.0, 2.0])
    >>> interval.mean, interval.low, interval.high
    (2.0, 1.25, 2.75)
    """
    known = np.array([value for value in values if not math.isnan(value)])
    if len(known) == 0:
        return Interval(mean=math.nan, low=math.nan, high=math.nan)
    means = known[_resampled(len(known), seed)].mean(axis=1)
    return _interval(float(known.mean()), means)


def ratio(values: Sequence[float], base: Sequence[float], seed: int = 0) -> Interval:
    """The ratio of two means over the same scenes, which are drawn together.

    Examples
    --------
    >>> interval = ratio([2.0, 4.0], [1.0, 2.0])
    >>> interval.mean, interval.low, interval.high
    (2.0, 2.0, 2.0)
    """
    pairs = np.array([pair for pair in zip(values, base, strict=True) if not any(map(math.isnan, pair))]).reshape(-1, 2)
    if len(pairs) == 0 or pairs[:, 1].min() <= 0:
        return Interval(mean=math.nan, low=math.nan, high=math.nan)
    means = pairs[_resampled(len(pairs), seed)].mean(axis=1)
    whole = pairs.mean(axis=0)
    return _interval(float(whole[0] / whole[1]), means[:, 0] / means[:, 1])


def _resampled(count: int, seed: int) -> NDArray[np.int64]:
    return np.random.default_rng(seed).integers(0, count, (SAMPLES, count))


def _interval(mean: float, drawn: NDArray[np.float64]) -> Interval:
    low, high = np.quantile(drawn, [(1 - LEVEL) / 2, (1 + LEVEL) / 2])
    return Interval(mean=mean, low=float(low), high=float(high))


def rows(outcomes: Sequence[Outcome]) -> list[Row]:
    """One row a policy, in the order in which the policies come."""
    by_policy: dict[str, dict[int, Outcome]] = {}
    for outcome in outcomes:
        by_policy.setdefault(outcome.policy, {})[outcome.seed] = outcome
    base = by_policy.get(BASELINE, {})
    return [_row(policy, own, base) for policy, own in by_policy.items()]


def _row(policy: str, own: dict[int, Outcome], base: dict[int, Outcome]) -> Row:
    runs = [own[seed] for seed in sorted(own)]
    shared = sorted(own.keys() & base.keys())

    def average(values: list[int]) -> float:
        return float(np.mean(values))

    return Row(
        policy=policy,
        episodes=len(runs),
        cleared=sum(run.reason == "clear" for run in runs),
        opt=bootstrap([run.opt for run in runs]),
        opt_without_empty=bootstrap([run.opt_without_empty for run in runs]),
        gain=ratio([own[seed].opt for seed in shared], [base[seed].opt for seed in shared]),
        pph=bootstrap([run.pph for run in runs]),
        trips=average([run.trips for run in runs]),
        empty=average([run.empty for run in runs]),
        stand_ins=average([run.stand_ins for run in runs]),
        places=average([run.places for run in runs]),
        fallen=average([run.fallen for run in runs]),
        left=average([run.left for run in runs]),
    )
