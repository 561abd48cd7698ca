"""Columns that cover nothing, free gifts, and packing rows without effect.

**Column that covers nothing.** Take it out of a plan: all covering rows have the supply they had, packing rows have no
more use than before, the cost is not higher as c >= 0.

**Free gift.** A column of cost 0 in no packing row can be added to any plan: supplies do not fall, the cost stays.

**Packing row without effect.** If all its entries together are at most 1 + 1e-9 (the tolerance), every 0-1 point
satisfies it.
"""

from __future__ import annotations

import numpy as np

from ._sparse import Mask, Rows, only_rows, row_of
from ._view import View
from .change import TOLERANCE, Change, Over

SAFE = 1e-12
"""What rounding may add to a sum of entries."""


def useless(view: View, over: Over) -> Change:
    """Drop columns that cover nothing and packing rows that hold anyway; take columns that cost nothing."""
    covers = np.bincount(view.W.indices, minlength=len(view.c)) > 0
    packed = np.bincount(view.P.indices, minlength=len(view.c)) > 0
    gifts = np.flatnonzero(covers & ~packed & (view.c == 0))
    effective = _effective(view.P)
    return Change(
        columns=covers,
        take=gifts,
        because=np.full(len(gifts), -1),
        P=None if effective.all() else only_rows(view.P, effective),
        loosened=True,
    )


def _effective(P: Rows) -> Mask:
    """Which packing rows can be broken."""
    total = np.bincount(row_of(P), P.data, P.shape[0])
    can: Mask = (total > 1 + TOLERANCE - SAFE) & (np.diff(P.indptr) > 1)
    return can
