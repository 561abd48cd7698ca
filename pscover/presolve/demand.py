"""Demands raised to the smallest supply that can be reached at all.

**Proof.** Let F be the full columns of a row (entry 1) and S the set of sums that columns outside F can reach with at most
one column of each disjoint group (`forced`), S ⊇ what plans without F supply. Let t = min {s in S: s >= 1 - 1e-9}. A plan
without F meets the row exactly when it supplies at least t, as nothing lies between. Dividing the entries outside F by t
leaves the plans that meet the row as they are: with F by F, without F as s >= t becomes s / t >= 1. The relaxation gets
tighter as t > 1. If S holds nothing from 1 - 1e-9 on, only F can meet the row, and the other entries are 0.

Floats: t is used only where it exceeds 1 + 1e-6, so that sums below 1 - 1e-9 stay below t (1 - 1e-9) by a wide margin, and
the smallest sum itself, in whatever order it is added up, is above t (1 - 1e-9).

Rows with more than 4096 combinations are left alone. Source: Dietrich and Escudero 1990; Savelsbergh 1994.
"""

from __future__ import annotations

import numpy as np

from ._sparse import FloatArray, IntArray, Mask, Rows, only_entries, row_of, with_data
from ._view import View
from .change import TOLERANCE, Change, Over

COMBINATIONS = 4096
"""Most combinations of a row that are listed."""
GAIN = 1e-6
"""A smaller rise is not worth the rounding."""


def demand(view: View, over: Over) -> Change:
    """Raise the demands of short rows."""
    W = view.W
    group = view.runs[0].group
    partial = W.data < 1
    short = _short_rows(W, partial, group)
    data = W.data.copy()
    changed = False
    for count, j in enumerate(np.flatnonzero(short)):
        if count % 64 == 0 and over():
            break
        span = slice(W.indptr[j], W.indptr[j + 1])
        rest = np.flatnonzero(partial[span]) + span.start
        least = smallest_reachable(data[rest], group[W.indices[rest]])
        if least > 1 + GAIN:
            data[rest] = 0.0 if np.isinf(least) else data[rest] / least
            changed = True
    if not changed:
        return Change()
    return Change(W=only_entries(with_data(W, data), data > 0) if (data == 0).any() else with_data(W, data))


def smallest_reachable(entries: FloatArray, group: IntArray) -> np.float64:
    """The smallest sum of at most one entry a group that is at least 1 - 1e-9; infinite if there is none.

    Examples
    --------
    >>> smallest_reachable(np.array([0.6, 0.7, 0.8]), np.array([0, 1, 1])).round(3)
    np.float64(1.3)
    """
    sums, least = np.zeros(1), np.float64(np.inf)
    order = np.argsort(group, kind="stable")
    for options in np.split(entries[order], np.flatnonzero(np.diff(group[order])) + 1):
        more = np.unique((sums[:, None] + options).ravel())
        met = int(np.searchsorted(more, 1 - TOLERANCE))
        if met < len(more):
            least = min(least, more[met])
            if least <= 1 + GAIN:
                break
        sums = np.concatenate((sums, more[:met]))
    return least


def _short_rows(W: Rows, partial: Mask, group: IntArray) -> Mask:
    """Rows with entries below 1 and few combinations of them."""
    row = row_of(W)[partial]
    of = group[W.indices[partial]]
    pairs, counts = np.unique(row * (int(group.max(initial=0)) + 1) + of, return_counts=True)
    bits = np.bincount(pairs // (int(group.max(initial=0)) + 1), np.log2(counts + 1), W.shape[0])
    short: Mask = (bits > 0) & (bits <= np.log2(COMBINATIONS) + 1e-9)
    return short
