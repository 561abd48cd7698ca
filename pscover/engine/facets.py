"""The inequalities of a covering row that a point misses most: facets among the candidates in the point, lifted to all.

Over few candidates S, a facet a x >= 1 of what whole solutions of the row can be is found exactly: a minimises a x at the
point x, such that a is at least 1 on every choice from S that meets the row and no smaller one does. Facets are whole when
scaled by a small number, a x >= b, and other candidates join one by one, each with the least coefficient that keeps the
inequality valid (sequential lifting; Padberg 1975, Zemel 1989): b - v, where v is the least that the others' coefficients
can sum up to while they meet what the new candidate leaves of the row.
"""

from __future__ import annotations

from functools import cache

import numpy as np
from scipy.sparse import csr_array

from .jit import kernel
from .problem import FloatArray, IntArray
from .programme import Programme
from .rounding import SAFE

MOST = 12
"""Most candidates that a facet is looked for among: those of which the point has most."""
SCALE = 12
"""A facet is scaled by no more than this."""
MISSED = 1e-4
"""By which part of its right side an inequality must be missed."""
STEPS, SECONDS = 2_000, 1.0
"""What the small programme of a facet may take at most."""


def missed_facet(entry: FloatArray, taken: FloatArray, dear: FloatArray) -> tuple[FloatArray, float] | None:
    """The coefficients and the right side of an inequality that the point misses; None if none is found.

    Parameters
    ----------
    entry, taken
        Of the row's candidates: w and x.
    dear
        Candidates in which the point has no part join in the order of this: the first have the smallest coefficients.

    Examples
    --------
    Half of each of three candidates of which it takes two:

    >>> missed_facet(np.array([0.5, 0.6, 0.7, 1.0]), np.array([0.6, 0.6, 0.5, 0.0]), np.zeros(4))
    (array([1., 1., 1., 2.]), 2.0)
    """
    inside = np.flatnonzero(taken > 1e-7)
    if len(inside) > MOST:
        inside = inside[np.argsort(-taken[inside], kind="stable")[:MOST]]
    if not len(inside):
        return None
    choices = _choices(len(inside))
    total = choices @ entry[inside]
    smallest = np.where(choices > 0, entry[inside], np.inf).min(axis=1)
    covers = choices[(total >= 1.0 - SAFE) & (total - smallest < 1.0 - SAFE)]
    if not len(covers):
        return None
    held, ends = np.nonzero(covers)[1], np.cumsum(covers.sum(axis=1)).astype(np.int64)
    rows = csr_array((np.ones(len(held)), held, np.append(0, ends)), shape=covers.shape)
    programme = Programme(taken[inside], rows, np.ones(len(covers)))
    if not programme.run(STEPS, SECONDS):
        return None
    facet = programme.x
    if float(facet @ taken[inside]) > 1.0 - MISSED:
        return None
    right = _scale(facet)
    if right is None:
        return None
    coefficient = np.full(len(entry), -1, dtype=np.int32)
    coefficient[inside] = np.round(facet * right)
    others = np.flatnonzero(coefficient < 0)
    order = np.concatenate((inside, others[np.argsort(dear[others], kind="stable")])).astype(np.int32)
    best = np.zeros(right)
    lift(entry, coefficient, order, best, 1.0 - SAFE)
    found = coefficient.astype(np.float64)
    # What did not fit among the candidates looked at may make up for what was missed, and rounding must not count.
    if best[-1] >= 1.0 - SAFE or float(found @ taken) > right * (1.0 - MISSED):
        return None
    return found, float(right)


@cache
def _choices(count: int) -> FloatArray:
    """Every choice from so many candidates but none, as rows of 0 and 1."""
    return ((np.arange(1, 1 << count)[:, None] >> np.arange(count)) & 1).astype(np.float64)


def _scale(facet: FloatArray) -> int | None:
    """The number by which coefficients become whole."""
    for scale in range(1, SCALE + 1):
        if float(np.abs(facet * scale - np.round(facet * scale)).max()) < 1e-6:
            return scale
    return None


@kernel
def lift(entry: FloatArray, coefficient: IntArray, order: IntArray, best: FloatArray, enough: float) -> None:
    """Let candidates join in an order, with their coefficients, or, where these are below 0, the least that is valid.

    `best` becomes the most that candidates cover whose coefficients sum up to 0, 1, ..., right side - 1.
    """
    right = len(best)
    for i in order:
        if coefficient[i] < 0:
            least = 0
            while least < right and best[least] < enough - entry[i]:
                least += 1
            coefficient[i] = right - least
        mine = coefficient[i]
        for v in range(right - 1, mine - 1, -1):
            more = best[v - mine] + entry[i]
            if mine == 0 or more > best[v]:
                best[v] = more
