"""Entries that meet a row alone become 1, and rows without an entry prove that there is no plan.

**Proof.** Covering rows come scaled to a demand of 1 and truncated at 1 (`pscover.model.CoverForm`). A column with
w_ij >= 1 - 1e-9 meets row j by itself within the tolerance, so that with w_ij = 1 the same plans meet the row: those
that hold the column, and among the others the same as before. The linear relaxation only loses points that use the
tolerance. It matters because full entries are what other steps look for.

A row without entries has supply 0 in every plan.
"""

from __future__ import annotations

import numpy as np

from ._sparse import with_data
from ._view import View
from .change import TOLERANCE, Change, Over


def scaling(view: View, over: Over) -> Change:
    """Round full entries up to 1."""
    empty = np.flatnonzero(np.diff(view.W.indptr) == 0)
    if len(empty):
        return Change(infeasible_row=int(empty[0]))
    full = (view.W.data >= 1 - TOLERANCE) & (view.W.data != 1)
    if not full.any():
        return Change()
    return Change(W=with_data(view.W, np.where(full, 1.0, view.W.data)))
