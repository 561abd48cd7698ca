"""Covering rows that follow from another row.

**Proof.** If w_ji <= w_li for all columns i, then sum_i w_li x_i >= sum_i w_ji x_i >= 1 - 1e-9 for every plan that meets
row j: row l is implied. Of equal rows the first stays. The relation "j implies l, or both are equal and j comes first" is
a strict order, so rows can be dropped together: drop them from the end of the order, each while what implies it is there.
"""

from __future__ import annotations

import numpy as np

from ._supersets import Effort, Lookup, likely_pairs
from ._view import View
from .change import Change, Over


def row_dominance(view: View, over: Over) -> Change:
    """Drop implied rows."""
    items, effort = view.rows, Effort()
    lookup, sums, exact = Lookup(items), items.sums, items.exact
    keep, everything = np.ones(len(items), dtype=np.bool_), np.ones(len(items), dtype=np.bool_)
    for small, large in likely_pairs(items, everything, everything, np.zeros(len(items)), effort, over):
        # Rows of the same sum that imply each other are equal: the first stays.
        later = keep[large] & ((sums[large] > sums[small]) | (large > small))
        small, large = small[later], large[later]
        keep[large if exact else large[lookup.confirm(small, large)]] = False
        effort.found = int((~keep).sum())
    return Change(rows=keep)
