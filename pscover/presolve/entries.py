"""Entries of a row that never make the difference.

**Proof.** Call a column *full* in row j when its entry is 1. A plan meets the row if it holds a full column; otherwise only
by columns that are not full, of which it holds at most one of each of the disjoint groups of `forced`. Let s be the sum
over groups of the largest entry that is not full, m the largest in the group of i. If s - m + w_ij < 1 - 1e-9, a plan with
i meets row j only if it holds a full column, whatever w_ij is. So w_ij = 0 leaves the same plans: those with a full column
meet the row before and after, and those without one that meet it do not hold i.

Rows that only full columns can meet become rows of a plain set cover. Fewer entries make dominance easier.
"""

from __future__ import annotations

import numpy as np

from ._sparse import IntArray, only_entries, row_of
from ._view import View
from .change import SHORT, Change, Over, nothing


def entries(view: View, over: Over) -> Change:
    """Drop entries that are of no use."""
    W = view.W
    n = W.shape[1]
    idle = nothing()
    for everything in view.runs:
        partial = np.where(everything.entry < 1, everything.entry, 0.0)
        supply = everything.supply(partial)
        runs = everything.only(supply < SHORT + 1)
        partial = np.where(runs.entry < 1, runs.entry, 0.0)
        run = runs.run()
        reach = (supply[runs.row] - runs.most(partial))[run] + partial
        found = (reach < SHORT) & (runs.entry < 1)
        # Entries dropped for one choice of groups make the sums of another too large, which is safe.
        idle = np.union1d(idle, runs.row[run[found]] * n + runs.column[found])
        if over():
            break
    if not len(idle):
        return Change()
    return Change(W=only_entries(W, ~_among(row_of(W) * n + W.indices, idle)))


def _among(keys: IntArray, some: IntArray) -> np.ndarray[tuple[int], np.dtype[np.bool_]]:
    """Which of the sorted keys are among some, all of which occur."""
    found = np.zeros(len(keys), dtype=np.bool_)
    found[np.searchsorted(keys, some)] = True
    return found
