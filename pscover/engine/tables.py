"""What a row's need costs at least when cliques to come meet it, and which needs are alike."""

from __future__ import annotations

import math

import numpy as np

from .jit import inner, kernel, wide
from .problem import FloatArray, IntArray

UNITS = 240
"""Into how many units a demand is divided where prices are looked up; entries are rounded up, so that prices bound."""
SUMS = 192
"""Most sums that entries can have; with more of them, needs are told apart as they are."""
BELOW = 1e-6
"""What a need in units may lose to rounding before the price of a whole unit less is taken."""


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
    units = np.minimum(UNITS, np.ceil(amount * UNITS - 1e-9)).astype(np.int32)
    now = np.full((rows, UNITS + 1), np.inf)
    now[:, 0] = 0.0
    reach, reached, room = np.zeros((rows, SUMS)), np.zeros(rows, dtype=np.int32), np.zeros((2, SUMS + 1))
    go_back(row, start, amount, units, share, before, after, sums, size, now, reach, reached, room)
    full[:] = now[:, UNITS]


@kernel
def go_back(
    row: IntArray,
    start: IntArray,
    amount: FloatArray,
    units: IntArray,
    share: FloatArray,
    before: FloatArray,
    after: FloatArray,
    sums: FloatArray,
    size: IntArray,
    now: FloatArray,
    reach: FloatArray,
    reached: IntArray,
    room: FloatArray,
) -> None:
    """Fill the tables; `now` are the prices, and the first `reached` of `reach` the sums, of each row from here on."""
    for p in range(len(row) - 1, -1, -1):
        j, first, last = row[p], start[p], start[p + 1]
        for d in range(UNITS + 1):
            after[p, d] = before[p, d] = now[j, d]
        many = reached[j]
        size[p] = 0 if many < 0 else many
        for k in range(many):
            sums[p, k] = reach[j, k]
        for t in range(first, last):
            price, mine = share[t], units[t]
            for d in range(1, UNITS + 1):
                more = price + (after[p, d - mine] if d > mine else 0.0)
                if more < before[p, d]:
                    before[p, d] = more
        for d in range(UNITS + 1):
            now[j, d] = before[p, d]
        if many >= 0:
            reached[j] = _with_clique(reach, j, many, amount, first, last, room)


@inner
def _with_clique(reach: FloatArray, j: int, size: int, amount: FloatArray, first: int, last: int, room: FloatArray) -> int:
    """Add the sums of row j that one entry more makes; how many there are then, -1 if too many."""
    many = wide(size)
    for k in range(size):
        room[0, k] = reach[j, k]
    for t in range(first, last):
        i, k, made = 0, -1, 0
        highest = -1.0
        while i < many or k < size:
            theirs = 2.0
            if k < size:
                theirs = amount[t] + (reach[j, k] if k >= 0 else 0.0)
                if theirs > 1.0:
                    theirs = 1.0
            mine = room[0, i] if i < many else 2.0
            least = theirs if theirs < mine else mine
            if least > highest:
                if made == SUMS:
                    return -1
                room[1, made] = highest = least
                made += 1
            if mine <= theirs:
                i += 1
            else:
                k += 1
        many = made
        for i in range(many):
            room[0, i] = room[1, i]
    for k in range(many):
        reach[j, k] = room[0, k]
    return many


@inner
def units_of(need: float) -> int:
    """The units that entries, each rounded up, have together if they meet a need."""
    units = math.ceil(need * UNITS - BELOW)
    return 0 if units < 0 else UNITS if units > UNITS else units
