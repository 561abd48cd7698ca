"""Averages over instances that a few hard ones do not decide alone, with their intervals."""

from __future__ import annotations

import math
from collections.abc import Sequence

from pscover.experiment.statistics import Interval, bootstrap

SHIFT = 0.1
"""Seconds: differences far below it count little."""
PENALTY = 2.0
"""An instance that was not solved counts as so many limits (PAR-2)."""


def shifted_mean(values: Sequence[float], shift: float = SHIFT) -> Interval:
    """The shifted geometric mean exp(mean(log(v + s))) - s, and its interval by the bootstrap over instances.

    Parameters
    ----------
    values
        At least 0, one an instance.
    shift
        s, positive; 0 for positive values gives the geometric mean.

    Examples
    --------
    >>> round(shifted_mean([0.0, 0.3], 0.1).mean, 3)
    0.1
    """
    logs = bootstrap([math.log(value + shift) for value in values])
    back = [math.exp(end) - shift for end in (logs.mean, logs.low, logs.high)]
    return Interval(mean=back[0], low=back[1], high=back[2])


def geometric_mean(values: Sequence[float]) -> Interval:
    """Of positive values, such as ratios, with its interval by the bootstrap over instances.

    Examples
    --------
    >>> geometric_mean([1.0, 4.0]).mean
    2.0
    """
    return shifted_mean(values, 0.0)


def penalised(seconds: float | None, *, solved: bool, limit: float) -> float:
    """The seconds of a solved instance; `PENALTY` limits for any other.

    Examples
    --------
    >>> penalised(1.5, solved=True, limit=10.0), penalised(10.0, solved=False, limit=10.0)
    (1.5, 20.0)
    """
    return seconds if solved and seconds is not None else PENALTY * limit
