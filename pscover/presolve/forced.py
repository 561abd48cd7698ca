"""Columns without which a row falls short, and rows that fall short with everything.

**Proof.** Put every column into one of its cliques: the groups are disjoint, and a plan holds at most one column of
each. So a plan's supply of row j is at most s_j = sum over groups of the largest entry. If s_j < 1 - 1e-9, no plan meets
the row. If without column i (its group then offers its second largest entry) the sum is below 1 - 1e-9, every plan that
meets the row holds i: x_i = 1. Where cliques overlap every choice of groups gives true statements, and several are tried.

Entries are at most 1, so that only rows with s_j < 2 - 1e-9 need a closer look.

Source: fixing by activity bounds (Savelsbergh 1994), with generalised upper bounds (Wolsey 1990).
"""

from __future__ import annotations

import numpy as np

from ._view import View
from .change import SHORT, Change, Over


def forced(view: View, over: Over) -> Change:
    """Take forced columns; report a row that cannot be met."""
    take, because = [], []
    for everything in view.runs:
        supply = everything.supply()
        short = np.flatnonzero(supply < SHORT)
        if len(short):
            return Change(infeasible_row=int(short[0]))
        runs = everything.only(supply < SHORT + 1)
        best, most = runs.best(), runs.most()
        rest = runs.entry.copy()
        rest[best] = 0.0
        needed = supply[runs.row] - most + runs.most(rest) < SHORT
        take.append(runs.column[best[needed]])
        because.append(runs.row[needed])
        if over():
            break
    columns, first = np.unique(np.concatenate(take).astype(np.int64), return_index=True)
    return Change(take=columns, because=np.concatenate(because)[first])
