"""What a row's need costs at least when cliques to come meet it, and which needs are alike."""

from __future__ import annotations

import math

import numpy as np

from .jit import inner, kernel
from .problem import FloatArray, IntArray

UNITS = 240
"""Into how many units a demand is divided where prices are looked up; entries are rounded up, so that prices bound."""
SUMS = 192
"""Most sums that entries can have; with more of them, needs are told apart as they are."""
BELOW = 1e-6
"""What a need in units may lose to rounding before the price of a whole unit less is taken."""


@kernel
def fill(
    row: IntArray,
    start: IntArray,
    amount: FloatArray,
    share: FloatArray,
    before: FloatArray,
    after: FloatArray,
    sums: FloatArray,
    size: IntArray,
    full: FloatArray,
) -> None:
    """Go back along the way from its end: of each clique and row on it, what the row costs with the clique and without.

    Parameters
    ----------
    row, start
        Of each pair of a clique and a row, in the order of the way, and where its entries begin.
    amount, share
        Of each entry: by how much it meets the row, and its price.
    before, after
        Become the least prices of each number of units with the clique and those that come after, and with the latter
        alone, shape (pairs, UNITS + 1).
    sums, size
        Become the sums that the latter can have, rising, shape (pairs, SUMS), and their number; 0 also if they are too many.
    full
        Becomes the least price of all of each row.
    """
    rows = len(full)
    now = np.full((rows, UNITS + 1), np.inf)
    reach = np.zeros((rows, SUMS))
    reached = np.zeros(rows, dtype=np.int32)
    room = np.zeros((2, SUMS + 1))
    for j in range(rows):
        now[j, 0] = 0.0
    for p in range(len(row) - 1, -1, -1):
        j = row[p]
        for d in range(UNITS + 1):
            after[p, d] = before[p, d] = now[j, d]
        size[p] = max(0, reached[j])
        for k in range(size[p]):
            sums[p, k] = reach[j, k]
        for t in range(start[p], start[p + 1]):
            units = min(UNITS, math.ceil(amount[t] * UNITS - 1e-9))
            for d in range(1, UNITS + 1):
                more = share[t] + (after[p, d - units] if d > units else 0.0)
                if more < before[p, d]:
                    before[p, d] = more
        for d in range(UNITS + 1):
            now[j, d] = before[p, d]
        if reached[j] >= 0:
            reached[j] = _with_clique(reach[j], reached[j], amount[start[p] : start[p + 1]], room)
    for j in range(rows):
        full[j] = now[j, UNITS]


@inner
def _with_clique(sums: FloatArray, size: int, amount: FloatArray, room: FloatArray) -> int:
    """Add the sums that one entry more makes; how many there are then, -1 if too many."""
    many = size
    for k in range(size):
        room[0, k] = sums[k]
    for a in amount:
        i, k, made = 0, -1, 0
        while i < many or k < size:
            theirs = min(1.0, a + (sums[k] if k >= 0 else 0.0)) if k < size else 2.0
            mine = room[0, i] if i < many else 2.0
            if made == SUMS and min(mine, theirs) > room[1, made - 1]:
                return -1
            if made == 0 or min(mine, theirs) > room[1, made - 1]:
                room[1, made] = min(mine, theirs)
                made += 1
            if mine <= theirs:
                i += 1
            else:
                k += 1
        many = made
        for i in range(many):
            room[0, i] = room[1, i]
    for k in range(many):
        sums[k] = room[0, k]
    return many


@inner
def units_of(need: float) -> int:
    """The units that entries, each rounded up, have together if they meet a need."""
    return max(0, min(UNITS, math.ceil(need * UNITS - BELOW)))
