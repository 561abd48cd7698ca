"""Inequalities that whole solutions of one covering row meet and the linear relaxation does not.

Let T be candidates of a row whose entries sum to less than 1, and y_i = 1 - x_i for them. The row is

    sum_{i not in T} w_i x_i - sum_{i in T} w_i y_i >= 1 - w(T),

and divided by d > 0, with (1 - w(T)) / d = k + f, k whole, 0 < f < 1, it has the mixed-integer rounding (Nemhauser and
Wolsey 1990; with complements, Marchand and Wolsey 2001)

    sum_{i not in T} F(w_i / d) x_i + sum_{i in T} F(-w_i / d) y_i >= k + 1,   F(a) = floor(a) + min(1, (a - floor(a)) / f).

With k = 0 it is the knapsack-cover inequality of T (Wolsey 1975; Carr, Fleischer, Leung and Phillips 2000).
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_array

FloatArray = NDArray[np.float64]
LongArray = NDArray[np.int64]

LEVELS = (np.inf, 0.999, 0.8, 0.65, 0.5, 0.35)
"""T are the candidates of which at least so much is taken, one after the other."""
PARTS = (0.95, 0.75, 0.5, 1 / 3, 0.2)
"""f that are tried with k up to `WHOLE`, besides the d that make an entry, or half of it, whole."""
WHOLE = 3
MOST = 24
"""Candidates of a row that are looked at: those of which most is taken."""
LEAST = 0.02
"""The least f: less of it makes large coefficients of small entries."""
MISSED = 1e-3
"""How far away, in the space of the candidates looked at, a point must be from an inequality."""
EACH = 2
"""Most inequalities of a row."""
SAFE = 2e-9
"""What is taken off a row's right side: plans may miss a row by nearly as much."""


class Rounded(NamedTuple):
    """An inequality of a row: by how much it is missed, the row, d, and the level that tells T."""

    missed: float
    row: int
    divisor: float
    level: float


def violated(W: csr_array, x: FloatArray) -> list[Rounded]:
    """Inequalities of rows W x >= 1 that a point misses: the most missed ones of each row, in the order of that.

    Examples
    --------
    Two and a half of four candidates of which it takes three, so that one of the last two is among them:

    >>> point = np.array([1.0, 1.0, 0.5, 0.0])
    >>> one = violated(csr_array([[0.4, 0.4, 0.4, 0.4]]), point)[0]
    >>> rounded(np.full(4, 0.4), point, one)
    (array([0., 0., 1., 1.]), 1.0)
    """
    rows = W.shape[0]
    row = np.repeat(np.arange(rows), np.diff(W.indptr))
    taken = x[W.indices]
    order = np.flatnonzero(taken > 1e-7)
    order = order[np.lexsort((-taken[order], row[order]))]
    row = row[order]
    rank = np.arange(len(row)) - np.searchsorted(row, np.arange(rows))[row]
    row, rank, order = (part[rank < MOST] for part in (row, rank, order))
    entry = np.zeros((rows, int(rank.max(initial=-1)) + 1))
    point = np.zeros_like(entry)
    entry[row, rank], point[row, rank] = W.data[order], taken[order]
    found = [one for level in LEVELS for one in _at_level(entry, point, level)]
    found.sort(key=lambda one: (-one.missed, one.row, one.divisor))
    kept: list[Rounded] = []
    count, seen = np.zeros(rows, dtype=np.int64), set[tuple[int, float]]()
    for one in found:
        # The same inequality comes about in several ways.
        mark = (one.row, round(one.missed, 9))
        if count[one.row] < EACH and mark not in seen:
            seen.add(mark)
            count[one.row] += 1
            kept.append(one)
    return kept


def rounded(entry: FloatArray, taken: FloatArray, one: Rounded) -> tuple[FloatArray, float] | None:
    """The inequality of a row with these entries: its coefficients, all >= 0, and its right side.

    None where T is not what it was looked for with, because more candidates than are looked at are in the point.

    Parameters
    ----------
    entry, taken
        w and x, of all candidates of the row; candidates that the point was not looked for among have x = 0.
    """
    is_flipped = taken >= one.level
    right = (1.0 - SAFE - float(entry[is_flipped].sum())) / one.divisor
    whole = np.floor(right + 1e-12)
    if whole < 0 or right - whole <= LEAST:
        return None
    coefficient = rounding(np.where(is_flipped, -entry, entry) / one.divisor, right - whole)
    return np.abs(coefficient), float(whole + 1.0 - coefficient[is_flipped].sum())


def rounding(a: FloatArray, part: FloatArray | float) -> FloatArray:
    """F of coefficients, for the part f that the right side has beyond a whole number.

    Examples
    --------
    >>> rounding(np.array([-0.25, 0.25, 0.5, 2.0]), 0.5).tolist()
    [0.0, 0.5, 1.0, 2.0]
    """
    floor = np.floor(a)
    found: FloatArray = floor + np.minimum(1.0, (a - floor) / part)
    return found


def _at_level(entry: FloatArray, point: FloatArray, level: float) -> list[Rounded]:
    """Of each row the inequality that is missed most, for one choice of T."""
    is_flipped = point >= level
    left = 1.0 - SAFE - (entry * is_flipped).sum(axis=1)
    open_ = np.flatnonzero((left > MISSED) & (is_flipped.any(axis=1) | np.isinf(level)))
    if not len(open_):
        return []
    entry, point, is_flipped, left = entry[open_], point[open_], is_flipped[open_], left[open_]
    whole = np.repeat(np.arange(WHOLE + 1), len(PARTS)) + np.tile(PARTS, WHOLE + 1)
    some = np.where(entry > 0, entry, 1.0)
    divisor = np.concatenate((some, some / 2, left[:, None] / whole), axis=1)
    right = left[:, None] / divisor
    k = np.floor(right + 1e-12)
    part = right - k
    is_usable = part > LEAST
    part = np.where(is_usable, part, 0.5)
    sign = np.where(is_flipped, -1.0, 1.0)
    coefficient = rounding((entry * sign)[:, None, :] / divisor[:, :, None], part[:, :, None])
    side = np.where(is_flipped, 1.0 - point, point)
    short = k + 1.0 - np.einsum("rds,rs->rd", coefficient, side)
    length = np.sqrt(np.einsum("rds,rds->rd", coefficient, coefficient)) + 1e-9
    missed = np.where(is_usable, short / length, 0.0)
    best = missed.argmax(axis=1)
    at = np.arange(len(open_))
    return [
        Rounded(missed=most, row=row, divisor=d, level=level)
        for most, row, d in zip(missed[at, best].tolist(), open_.tolist(), divisor[at, best].tolist(), strict=True)
        if most > MISSED
    ]
