"""Columns whose choice would leave a row short, because it shuts out the rest of their clique.

**Proof.** With the disjoint groups of `forced`, let m be the largest entry of row j in group Q and s_j the most a plan can
supply. If x_i = 1 for some i in Q, nothing else of Q is chosen, so the supply of row j is at most s_j - m + w_ij (w_ij = 0
where i does not cover j). If that is below 1 - 1e-9, no plan holds i: x_i = 0.

Only groups without which a row falls short can do this, so it is enough to look at those (row, group) pairs, and to count
for each column in how many of its group's pairs it offers enough.

Source: probing on clique rows (Savelsbergh 1994; Atamtürk, Nemhauser, Savelsbergh 2000).
"""

from __future__ import annotations

import numpy as np

from ._view import View
from .change import SHORT, Change, Over


def probing(view: View, over: Over) -> Change:
    """Drop columns that no plan can hold."""
    n = len(view.c)
    keep = np.ones(n, dtype=np.bool_)
    for everything in view.runs:
        supply = everything.supply()
        runs = everything.only(supply < SHORT + 1)
        most, run, group = runs.most(), runs.run(), runs.group
        least = most - (supply[runs.row] - SHORT)
        critical = least > 0
        asked = np.bincount(group[runs.column[runs.start[critical]]], minlength=int(group.max(initial=0)) + 1)
        enough = critical[run] & (runs.entry >= least[run])
        offered = np.bincount(runs.column[enough], minlength=n)
        keep &= offered >= asked[group]
        if over():
            break
    return Change(columns=keep)
