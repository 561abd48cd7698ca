"""Fixing columns to 1: what the rows still ask for, and what no longer fits."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.sparse import csr_array

from pscover.model import CoverForm

from ._sparse import only_entries, only_rows, row_of, with_data
from .change import TOLERANCE, IntArray, Mask


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

    W: csr_array
    P: csr_array
    met: Mask
    free: Mask
    broken: int


def take(form: CoverForm, chosen: IntArray) -> Residual:
    """What is left when some columns are 1.

    A row of residual demand r = 1 - supply is met by a rest that supplies at least r - 1e-9, so it is divided by
    (r - 1e-9) / (1 - 1e-9), not by r: then "at least 1 - 1e-9" means the same before and after. Packing rows likewise: a
    rest that uses at most room + 1e-9 is divided by (room + 1e-9) / (1 + 1e-9).
    """
    x = np.zeros(len(form.c))
    x[chosen] = 1.0
    free = x == 0
    supply, use = form.W @ x, form.P @ x
    broken = -1
    over = np.flatnonzero(use > 1 + TOLERANCE)
    if len(over):
        members = form.P.indices[form.P.indptr[over[0]] : form.P.indptr[over[0] + 1]]
        broken = int(members[x[members] > 0].max())
    need = 1 - supply
    met = need <= TOLERANCE
    scale = np.where(met, 1.0, (need - TOLERANCE) / (1 - TOLERANCE))
    scale[supply == 0] = 1.0
    W = with_data(form.W, np.minimum(form.W.data / scale[row_of(form.W)], 1.0))
    room = (1 - use + TOLERANCE) / (1 + TOLERANCE)
    room[use == 0] = 1.0
    owner = row_of(form.P)
    fits = form.P.data <= room[owner] * (1 + TOLERANCE)
    free[form.P.indices[~fits]] = False
    P = only_entries(form.P, fits)
    P = with_data(P, P.data / room[row_of(P)])
    return Residual(W=W, P=only_rows(P, np.diff(P.indptr) > 0), met=met, free=free, broken=broken)
