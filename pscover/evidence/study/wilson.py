"""The interval of a share that was counted: Wilson's (1927), which stays within 0 and 1 and holds for shares near them."""

from __future__ import annotations

from math import sqrt

from scipy.special import ndtri

from pscover.experiment.statistics import Interval


def share_interval(hits: int, trials: int, level: float = 0.95) -> Interval:
    """The share of hits and its interval.

    Parameters
    ----------
    hits, trials
        What was counted; at least one trial.
    level
        Probability with which such intervals hold the true share, about.

    Examples
    --------
    >>> interval = share_interval(8, 10)
    >>> round(interval.low, 3), interval.mean, round(interval.high, 3)
    (0.49, 0.8, 0.943)
    """
    z = float(ndtri(0.5 + level / 2))
    share = hits / trials
    middle = (share + z * z / (2 * trials)) / (1 + z * z / trials)
    half = z / (1 + z * z / trials) * sqrt(share * (1 - share) / trials + z * z / (4 * trials * trials))
    return Interval(mean=share, low=max(0.0, middle - half), high=min(1.0, middle + half))
