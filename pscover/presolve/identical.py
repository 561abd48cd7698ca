"""Copies of a column beyond those that can be useful together.

**Proof.** Let columns have the same entries in all covering and packing rows, least entry w in covering rows, and
t = ceil((1 - 1e-9) / w); t = 1 if two of them exceed the capacity of a packing row. Keep the t cheapest (the first among
equals) and let i be another. Take an optimal plan with i. If one of those kept is not in it, put it in the place of i: all
rows stay as they are and the cost is not higher. Otherwise the t copies (t = 1 by capacity cannot occur: the plan would
hold two) supply at least t w >= 1 - 1e-9 to each row of i, which are met without i.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ._sparse import IntArray, Mask, spread
from ._supersets import Items
from ._view import View
from .change import TOLERANCE, Change, Over

SAFE = 1e-10
"""Taken off the tolerance for the rounding of a supply of many copies."""


def identical(view: View, over: Over) -> Change:
    """Keep of each kind of column as many as can be useful."""
    n, W, P = len(view.c), view.columns, view.packing
    code = _hash(W, 1) ^ _hash(P, 2)
    if len(np.unique(code)) == n:
        return Change()
    order = np.lexsort((np.arange(n), view.c, code))
    head = _heads(code, order)
    same = _equal(W, head, order) & _equal(P, head, order)
    # A column with the hash of another kind stands for itself: it is kept.
    head = np.where(same, head, order)
    place = _place(head, same)
    useful = _useful(W, P, head)
    keep = np.ones(n, dtype=np.bool_)
    keep[order] = (place < useful) | ~same
    stand_in = np.arange(n)
    stand_in[order] = np.where(keep[order], order, head)
    return Change(columns=keep, stand_in=stand_in)


def _hash(A: Items, salt: int) -> NDArray[np.uint64]:
    """A hash of each column's rows and entries."""
    with np.errstate(over="ignore"):
        mixed = A.coordinates.astype(np.uint64) * np.uint64(0x9E3779B97F4A7C15) + np.uint64(salt)
        mixed ^= mixed >> np.uint64(29)
        mixed = (mixed ^ A.values.view(np.uint64)) * np.uint64(0xBF58476D1CE4E5B9)
        mixed = (mixed ^ mixed >> np.uint64(32)) * np.uint64(0x94D049BB133111EB)
        total = np.concatenate((np.zeros(1, dtype=np.uint64), np.cumsum(mixed, dtype=np.uint64)))
        return total[A.starts[1:]] - total[A.starts[:-1]]


def _heads(code: NDArray[np.uint64], order: IntArray) -> IntArray:
    """For each place of the order the first column with the same hash."""
    sorted_code = code[order]
    new = np.ones(len(order), dtype=np.bool_)
    new[1:] = sorted_code[1:] != sorted_code[:-1]
    first = np.maximum.accumulate(np.where(new, np.arange(len(order)), 0)) if len(order) else np.zeros(0, dtype=np.int64)
    heads: IntArray = order[first]
    return heads


def _equal(A: Items, one: IntArray, other: IntArray) -> Mask:
    """Whether columns are equal, pair by pair."""
    sizes = np.diff(A.starts)
    equal = sizes[one] == sizes[other]
    looked = np.flatnonzero(equal & (one != other))
    a, pair = spread(A.starts[one[looked]], sizes[one[looked]])
    b, _ = spread(A.starts[other[looked]], sizes[other[looked]])
    differs = (A.coordinates[a] != A.coordinates[b]) | (A.values[a] != A.values[b])
    equal[looked[pair[differs]]] = False
    good: Mask = equal
    return good


def _place(head: IntArray, same: Mask) -> IntArray:
    """How many columns of the same kind come before, in the order."""
    counted = np.cumsum(same)
    new = np.ones(len(head), dtype=np.bool_)
    new[1:] = head[1:] != head[:-1]
    before = np.maximum.accumulate(np.where(new, counted - same, 0)) if len(head) else counted
    place: IntArray = counted - 1 - before
    return place


def _useful(W: Items, P: Items, column: IntArray) -> IntArray:
    """How many copies of each column can be useful together."""
    least, most = _extreme(W, np.minimum, np.inf), _extreme(P, np.maximum, 0.0)
    copies = np.ceil((1 - TOLERANCE + SAFE) / least).clip(1)
    copies[2 * most > 1 + TOLERANCE] = 1
    return copies[column].astype(np.int64)


def _extreme(A: Items, of: np.ufunc, empty: float) -> NDArray[np.float64]:
    result = np.full(len(A), empty)
    some = np.diff(A.starts) > 0
    if some.any():
        result[some] = of.reduceat(A.values, A.starts[:-1][some])
    return result
