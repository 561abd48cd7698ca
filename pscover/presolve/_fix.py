"""Fixing columns to 1: what the rows still ask for, and what no longer fits."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ._sparse import IntArray, Mask, Rows, only_entries, only_rows, row_of, with_data
from ._view import View
from .change import TOLERANCE


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Residual:
    """A form after columns were taken; nothing is renumbered but the packing rows.

    Parameters
    ----------
    W, P
        Rescaled rows.
    met
        Covering rows that the taken columns meet.
    free
        Columns that can still be chosen: not taken and not blocked.
    broken
        A taken column that does not fit beside the others, or -1.
    """

    W: Rows
    P: Rows
    met: Mask
    free: Mask
    broken: int


def take(view: View, chosen: IntArray) -> Residual:
    """What is left when some columns are 1.

    A row of residual demand r = 1 - supply is met by a rest that supplies at least r - 1e-9, so it is divided by
    (r - 1e-9) / (1 - 1e-9), not by r: then "at least 1 - 1e-9" means the same before and after. Packing rows likewise: a
    rest that uses at most room + 1e-9 is divided by (room + 1e-9) / (1 + 1e-9).
    """
    x = np.zeros(len(view.c))
    x[chosen] = 1.0
    free = x == 0
    supply, use = view.W.times(x), view.P.times(x)
    broken = -1
    over = np.flatnonzero(use > 1 + TOLERANCE)
    if len(over):
        members = view.P.indices[view.P.indptr[over[0]] : view.P.indptr[over[0] + 1]]
        broken = int(members[x[members] > 0].max())
    need = 1 - supply
    met = need <= TOLERANCE
    scale = np.where(met, 1.0, (need - TOLERANCE) / (1 - TOLERANCE))
    scale[supply == 0] = 1.0
    W = with_data(view.W, np.minimum(view.W.data / scale[row_of(view.W)], 1.0))
    room = (1 - use + TOLERANCE) / (1 + TOLERANCE)
    room[use == 0] = 1.0
    owner = row_of(view.P)
    fits = view.P.data <= room[owner] * (1 + TOLERANCE)
    free[view.P.indices[~fits]] = False
    P = only_entries(view.P, fits)
    P = with_data(P, P.data / room[row_of(P)])
    return Residual(W=W, P=only_rows(P, np.diff(P.indptr) > 0), met=met, free=free, broken=broken)
