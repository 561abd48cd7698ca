"""Columns that others do without any conflict: the safe part of column dominance.

Column k is *over* i when w_kj >= w_ij in all covering rows, c_k <= c_i, and k is in no packing row. (Of equal columns only
the earlier is over the later.) It is not true that i can go as soon as one column is over it: both may be needed.

**Proof of what is true.** Let K be columns over i with sum_{k in K} w_kj >= 1 in every row j of i. Take an optimal plan
with i. If some k in K is not in the plan, put k in the place of i: no supply falls, packing rows are used less, the cost
does not rise. If all of K is in the plan, K meets every row of i alone, so i can be left out as c_i >= 0. One column
whose entries are full in every row of i is such a K (the classical rule of unweighted set cover, Beasley 1987).
"Over" is a strict order; going through the columns from its lower end, each is dropped while all of its K is there, so
that all can be dropped together.

Where k is in packing rows, conflicts decide: see `clique_dominance`.
"""

from __future__ import annotations

import numpy as np

from ._sparse import IntArray
from ._supersets import Effort, Items, Lookup, first_of_each, likely_pairs
from ._view import View
from .change import TOLERANCE, Change, Over

MOST = 8
"""Most columns taken together against one."""
SAFE = 1e-10
"""Taken off the tolerance for the rounding of a sum of entries."""


def cover_dominance(view: View, over: Over) -> Change:
    """Drop columns that a few others make superfluous."""
    c, free, items = view.c, view.unpacked, view.columns
    if not free.any():
        return Change()
    search, effort = _Search(items), Effort()
    for i, k in likely_pairs(items, free, search.keep, c, effort, over):
        strict = (search.sums[k] > search.sums[i]) | (c[k] < c[i]) | ~free[i] | (k < i)
        search.look(i[strict], k[strict])
        effort.found = int((~search.keep).sum())
    return Change(columns=search.keep, stand_in=search.stand_in)


class _Search:
    def __init__(self, items: Items) -> None:
        self.items = items
        self.exact = items.exact
        self.lookup = Lookup(items)
        self.sums = items.sums
        self.keep = np.ones(len(items), dtype=np.bool_)
        self.stand_in = np.arange(len(items))

    def look(self, i: IntArray, k: IntArray) -> None:
        """Drop what the columns k make superfluous; the pairs of an i are together, the likeliest k first."""
        if self.exact:
            self._drop(i, k)
            return
        several = first_of_each(i, MOST)
        i, k = i[several], k[several]
        good = self.lookup.confirm(i, k)
        i, k = i[good], k[good]
        _, spots, values = self.lookup.entries(i, k)
        covered = np.bincount(spots, values, len(self.items.values))
        short = np.zeros(len(self.keep), dtype=np.bool_)
        short[self.items.owner[covered < 1 - TOLERANCE + SAFE]] = True
        self._drop(i[~short[i]], k[~short[i]])

    def _drop(self, i: IntArray, k: IntArray) -> None:
        self.keep[i] = False
        self.stand_in[i[::-1]] = k[::-1]
