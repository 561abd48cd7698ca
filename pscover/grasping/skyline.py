"""The points that no other point is at least equal to in every coordinate: what is worth choosing from a clique."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.intp]
CHUNK = 64
"""Points compared at a time: all with all, then the survivors with those that follow."""
MANY = 512
"""More points than this are first compared with a few of the highest, before they are sorted."""
NUDGE = 1e-3
"""How much of the sum decides between points that are highest in a coordinate."""


def skyline(points: FloatArray, tie: FloatArray | None = None) -> IntArray:
    """The Pareto-maximal points, one of each group of equal ones.

    Parameters
    ----------
    points
        One point a column, shape (coordinates, points).
    tie
        Of equal points the one with the largest of this is kept, shape (points,); else the first.

    Returns
    -------
    IntArray
        Their columns, by falling sum of coordinates.

    Notes
    -----
    Two coordinates take a sort; more take a comparison of each point with the survivors so far.

    Examples
    --------
    >>> skyline(np.array([[1.0, 2.0, 2.0, 0.0], [3.0, 1.0, 1.0, 3.0]]), tie=np.array([0.0, 0.0, 1.0, 9.0])).tolist()
    [0, 2]
    """
    if points.shape[1] > MANY:
        kept = np.flatnonzero(~_below_leaders(points))
        return kept[_skyline(points[:, kept], None if tie is None else tie[kept])]
    return _skyline(points, tie)


def _below_leaders(points: FloatArray) -> NDArray[np.bool_]:
    """Which points some of the highest ones, by sum and in each coordinate, are strictly over."""
    sums = points.sum(axis=0)
    leaders = np.unique([(row + NUDGE * sums).argmax() for row in (sums, *points)])
    below = np.zeros(points.shape[1], dtype=np.bool_)
    for leader in leaders:
        over = sums < sums[leader]
        for row in points:
            over &= row <= row[leader]
        below |= over
    return below


def _skyline(points: FloatArray, tie: FloatArray | None) -> IntArray:
    rank = np.zeros(points.shape[1]) if tie is None else -tie
    # Adding up rounds: the coordinates themselves decide between points of equal sum, so that what is over a point and
    # what equals it comes before it.
    order = np.lexsort((rank, *(-row for row in points), -points.sum(axis=0)))
    if len(points) <= 1:
        return order[:1]
    if len(points) == 2:
        return _staircase(points, rank)
    alive = order
    found: list[IntArray] = []
    while len(alive):
        head, rest = alive[:CHUNK], alive[CHUNK:]
        best = head[_unbeaten(points[:, head])]
        found.append(best)
        alive = rest[~_beaten(points[:, best], points[:, rest])]
    return np.concatenate([np.zeros(0, dtype=np.intp), *found])


def _staircase(points: FloatArray, rank: FloatArray) -> IntArray:
    """Two coordinates: by the first falling, those that are higher than all before in the second."""
    order = np.lexsort((rank, -points[1], -points[0]))
    second = points[1, order]
    before = np.maximum.accumulate(np.concatenate(([-np.inf], second[:-1])))
    kept = order[second > before]
    sorted_by_sum: IntArray = kept[np.argsort(-points[:, kept].sum(axis=0), kind="stable")]
    return sorted_by_sum


def _unbeaten(points: FloatArray) -> NDArray[np.bool_]:
    """Which points no earlier one is at least equal to; no later one may be over an earlier one."""
    over = np.tri(points.shape[1], k=-1, dtype=np.bool_)
    for row in points:
        np.logical_and(over, row[None, :] >= row[:, None], out=over)
    return np.logical_not(over.any(axis=1, keepdims=True)).ravel()


def _beaten(best: FloatArray, points: FloatArray) -> NDArray[np.bool_]:
    """Which points one of the best is at least equal to."""
    over = np.ones((best.shape[1], points.shape[1]), dtype=np.bool_)
    for mine, its in zip(best, points, strict=True):
        np.logical_and(over, mine[:, None] >= its[None, :], out=over)
    return over.any(axis=0, keepdims=True).ravel()
