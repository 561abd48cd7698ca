"""Rounded sums of covering rows: inequalities that every plan meets and the linear relaxation does not.

Let S be garments, r_j the least that a plan brings to row j of them, and u > 0. Every plan x has

    sum_i a_i x_i >= b   with   a_i = u sum_{j in S} w_ij,   b = u sum_{j in S} r_j = k + f,   k whole, 0 < f <= 1,

and as x is whole, also (mixed-integer rounding: Nemhauser and Wolsey 1990; Marchand and Wolsey 2001)

    sum_i [floor(a_i) + min(1, (a_i - floor(a_i)) / f)] x_i >= k + 1.

With three garments of which no pose removes all three, that says: two grasps at least, where the relaxation takes half of
three grasps for two garments each. What a pose counts is a continuous function of its worth, so that errors of rounding stay
small, and it rises with it, so that a pose that another one replaces needs no look.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from pscover.engine.rounding import rounding
from pscover.grasping.all_poses import AllPoses, IntArray

FloatArray = NDArray[np.float64]
PARTS = np.array([0.75, 0.5, 1 / 3, 0.2, 0.1, 0.02])
"""The f that are tried."""
LARGEST = 5
"""Most rows that are summed, and the largest k."""
NEAREST = 8
"""How many rows are tried to go with a sum: those that the relaxation covers by the same poses."""
VIOLATED = 1e-3
"""By which part of its right side an inequality must be missed to be of use."""
MOST = 16
"""Most inequalities that are returned."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Cut:
    """An inequality over poses, scaled so that its right side is 1.

    Parameters
    ----------
    rows
        S, rising.
    scale
        u.
    part
        f.
    least
        k + 1.
    """

    rows: tuple[int, ...]
    scale: float
    part: float
    least: int


def with_cuts(poses: AllPoses, cuts: tuple[Cut, ...]) -> AllPoses:
    """Every pose, with a row more for each inequality, in their order."""
    member = np.zeros((len(cuts), poses.rows))
    for number, cut in enumerate(cuts):
        member[number, list(cut.rows)] = 1.0
    scale, part, least = (np.array([[getattr(cut, name)] for cut in cuts]) for name in ("scale", "part", "least"))
    garments, worth = [], []
    for listed, entries in zip(poses.garments, poses.worth, strict=True):
        own = member[:, listed]
        held = np.flatnonzero(own.any(axis=1))
        more = rounding(scale[held] * (own[held] @ entries), part[held]) / least[held]
        garments.append(np.concatenate((listed, poses.rows + held)))
        worth.append(np.vstack((entries, more)))
    needed = np.append(poses.needed, np.ones(len(cuts)))
    return replace(poses, garments=tuple(garments), worth=tuple(worth), needed=needed)


def violated(worth: FloatArray, x: FloatArray, needed: FloatArray) -> list[Cut]:
    """Inequalities that a solution of the relaxation violates, those first that it violates most.

    From each row that it just meets on, the row joins whose sum with them is missed most, again and again.

    Parameters
    ----------
    worth
        What the poses taken are worth to the garments, shape (rows, poses).
    x
        How much of each is taken.
    needed
        r_j.

    Examples
    --------
    Half of each of three grasps for two garments each:

    >>> pairs = np.array([[1.0, 1.0, 0.0], [1.0, 0.0, 1.0], [0.0, 1.0, 1.0]])
    >>> cut = violated(pairs, np.full(3, 0.5), np.ones(3))[0]
    >>> cut.rows, cut.least
    ((0, 1, 2), 2)
    """
    supply = worth @ x
    tight = np.flatnonzero((supply > 0) & (supply < 1.0 + 1e-6))
    together = (worth * x) @ (worth > 0).T.astype(np.float64)
    together[:, np.setdiff1d(np.arange(len(worth)), tight)] = 0.0
    sets, found = tight[:, None], dict[tuple[int, ...], tuple[float, Cut]]()
    while len(sets):
        missed, cuts = _missed(sets, worth, x, needed)
        for miss, cut in zip(missed.tolist(), cuts, strict=True):
            if miss > max(VIOLATED, found[cut.rows][0] if cut.rows in found else 0.0):
                found[cut.rows] = (miss, cut)
        if sets.shape[1] == LARGEST:
            break
        sets = _grown(sets, worth, x, needed, together)
    ranked = sorted(found.values(), key=lambda one: (-one[0], one[1].rows))
    return [cut for _, cut in ranked[:MOST]]


def _grown(sets: IntArray, worth: FloatArray, x: FloatArray, needed: FloatArray, together: FloatArray) -> IntArray:
    """Each set with the one of the rows near to it that makes an inequality missed most; equal sets once."""
    near = together[sets].sum(axis=1)
    np.put_along_axis(near, sets, 0.0, axis=1)
    tried = np.argsort(-near, axis=1, kind="stable")[:, :NEAREST]
    which, rank = np.nonzero(np.take_along_axis(near, tried, axis=1) > 0)
    larger = np.column_stack((sets[which], tried[which, rank]))
    if not len(larger):
        return larger
    missed, _ = _missed(larger, worth, x, needed)
    order = np.lexsort((-missed, which))
    first = order[np.diff(which[order], prepend=-1) != 0]
    return np.unique(np.sort(larger[first], axis=1), axis=0)


def _missed(sets: IntArray, worth: FloatArray, x: FloatArray, needed: FloatArray) -> tuple[FloatArray, list[Cut]]:
    """By how much of its right side the best inequality of each set is missed, and the inequalities."""
    amount, asked = worth[sets].sum(axis=1), needed[sets].sum(axis=1)
    whole = np.arange(1, LARGEST + 1)
    k, part = np.repeat(whole, len(PARTS)), np.tile(PARTS, len(whole))
    scale = (k + part) / asked[:, None]
    counted = rounding(scale[:, :, None] * amount[:, None, :], part[None, :, None]) @ x
    miss = 1.0 - counted / (k + 1)
    best = miss.argmax(axis=1)
    at = np.arange(len(sets))
    cuts = [
        Cut(rows=tuple(sorted(rows)), scale=float(u), part=float(PARTS[c % len(PARTS)]), least=int(k[c]) + 1)
        for rows, u, c in zip(sets.tolist(), scale[at, best], best.tolist(), strict=True)
    ]
    return miss[at, best], cuts
