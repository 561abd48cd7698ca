"""Lines around a convex falling function: tangents stay below it, secants above, both within a stated error."""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_array, eye_array, kron

FloatArray = NDArray[np.float64]


@dataclass(frozen=True, slots=True, eq=False)
class Convex:
    """A convex, falling, positive function and the point at which it has a given (negative) slope."""

    value: Callable[[float], float]
    where: Callable[[float], float]


EXPONENTIAL = Convex(value=lambda s: math.exp(-s), where=lambda slope: -math.log(-slope))
"""exp(-s): the probability of a miss."""


def _loss(s: float) -> float:
    # Each form keeps its digits where the other rounds to 0 or to 1.
    return -math.log1p(-math.exp(-s)) if s > 1.0 else -math.log(-math.expm1(-s))


LOSS = Convex(value=_loss, where=lambda slope: math.log1p(-1.0 / slope))
"""-log(1 - exp(-s)): minus the logarithm of the probability of no miss. It is its own inverse."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Lines:
    """v >= intercept_k - fall_k s for every k and 0 <= s <= cap: the upper envelope of K falling lines.

    Parameters
    ----------
    intercept, fall
        Of the lines, shape (K,); all positive.
    cap
        Where s ends: larger arguments are treated as this one.
    """

    intercept: FloatArray
    fall: FloatArray
    cap: float

    def __len__(self) -> int:
        return len(self.fall)

    def rows(self, count: int, unit: float = 1.0) -> tuple[csr_array, csr_array, FloatArray]:
        """The rows of `count` pairs (s, v) with v measured in `unit`: blocks on s and on v, right-hand sides."""
        identity = eye_array(count, format="csr")
        on_s = csr_array(kron(identity, csr_array(self.fall[:, None] / unit), format="csr"))
        on_v = csr_array(kron(identity, csr_array(np.ones((len(self), 1))), format="csr"))
        return on_s, on_v, np.tile(self.intercept / unit, count)


def tangents(function: Convex, start: float, stop: float, error: float) -> Lines:
    """Lines below the function, by at most `error` on [start, stop]; at the cap they have fallen to 0.

    Each chord of the breakpoints is at most `error` above the function; the tangent parallel to it lies lower by exactly
    that much, so that function - tangent <= chord - tangent <= error between the two breakpoints.
    """
    falls, intercepts = [], []
    points = _breakpoints(function, start, stop, error)
    for a, b in itertools.pairwise(points):
        slope = _slope(function, a, b)
        touch = function.where(slope)
        falls.append(-slope)
        intercepts.append(function.value(touch) - slope * touch)
    return Lines(intercept=np.array(intercepts), fall=np.array(falls), cap=intercepts[-1] / falls[-1])


def secants(function: Convex, start: float, stop: float, error: float) -> Lines:
    """Lines above the function on [start, stop], by at most `error`; beyond `stop`, the cap, its value there is kept."""
    points = _breakpoints(function, start, stop, error)
    fall = np.array([-_slope(function, a, b) for a, b in itertools.pairwise(points)])
    intercept = np.array([function.value(a) for a in points[:-1]]) + fall * np.array(points[:-1])
    return Lines(intercept=intercept, fall=fall, cap=stop)


def _slope(function: Convex, a: float, b: float) -> float:
    return (function.value(b) - function.value(a)) / (b - a)


def _gap(function: Convex, a: float, b: float) -> float:
    """How far the chord from a to b rises above the function."""
    slope = _slope(function, a, b)
    touch = min(max(function.where(slope), a), b)
    return function.value(a) + slope * (touch - a) - function.value(touch)


def _breakpoints(function: Convex, start: float, stop: float, error: float) -> list[float]:
    """As few points as possible from start to stop such that no chord rises above the function by more than error."""
    points = [start]
    while points[-1] < stop:
        good, bad = points[-1], stop
        if _gap(function, good, stop) <= error:
            good = stop
        while bad - good > 1e-9 * bad:
            middle = 0.5 * (good + bad)
            if _gap(function, points[-1], middle) <= error:
                good = middle
            else:
                bad = middle
        points.append(max(good, math.nextafter(points[-1], math.inf)))
    return points
