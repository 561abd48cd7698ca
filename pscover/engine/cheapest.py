"""One row on its own: the cheapest candidates that meet what it still needs, at most one a clique, by labels."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from .jit import inner
from .problem import TOLERANCE, FloatArray, IntArray

LABELS = 96
"""Most labels kept; of more, neighbours are joined to one that supplies what the larger does at the price of the smaller."""


class Labels(NamedTuple):
    """Partial choices none of which supplies at least as much as another for less, by falling supply.

    Parameters
    ----------
    supply, price, name
        Of the labels now (row 0), before the clique at hand (row 1), and as they are made (row 2); shape (3, most).
    parent, entry
        Of each label ever made for the row: the label that it extends and the entry that extends it.
    sizes
        How many labels there are now, and how many names were given.
    """

    supply: FloatArray
    price: FloatArray
    name: NDArray[np.int32]
    parent: IntArray
    entry: IntArray
    sizes: NDArray[np.int64]


def labels(longest: int) -> Labels:
    """Room for rows of at most so many entries."""
    most = 2 * LABELS + 2
    made = (longest + 1) * most + 1
    return Labels(
        supply=np.zeros((3, most)),
        price=np.zeros((3, most)),
        name=np.zeros((3, most), dtype=np.int32),
        parent=np.zeros(made, dtype=np.int32),
        entry=np.zeros(made, dtype=np.int32),
        sizes=np.zeros(2, dtype=np.int64),
    )


@inner
def cheapest(
    work: Labels,
    first: int,
    last: int,
    need: float,
    group: IntArray,
    amount: FloatArray,
    share: FloatArray,
    is_open: NDArray[np.bool_],
    chosen: NDArray[np.bool_],
    without: int,
) -> float:
    """The least price at which the entries from first to last meet a need; infinite if they cannot.

    Entries of a group stand side by side; the group `without` is left out. `chosen` holds the last choice and becomes the
    new one. Afterwards the labels are those below that price: what supplies less costs at least as much as the label next
    above it.
    """
    need -= TOLERANCE
    ceiling, supplied, best_parent, best_entry = 0.0, 0.0, -1, -1
    for t in range(first, last):
        if chosen[t]:
            if is_open[t] and group[t] != without:
                supplied += amount[t]
                ceiling += share[t]
            else:
                chosen[t] = False
    is_known = supplied >= need
    if not is_known:
        ceiling = np.inf
    work.supply[0, 0], work.price[0, 0], work.name[0, 0] = 0.0, 0.0, 0
    work.parent[0] = work.entry[0] = -1
    size, names = 1, 1
    t = first
    while t < last:
        g = group[t]
        before = 0
        while t < last and group[t] == g:
            price, more = share[t], amount[t]
            entry = t
            t += 1
            if not is_open[entry] or price >= ceiling or g == without:
                continue
            if before == 0:
                before = size
                for k in range(size):
                    work.supply[1, k] = work.supply[0, k]
                    work.price[1, k] = work.price[0, k]
                    work.name[1, k] = work.name[0, k]
            k = 0
            while k < before and work.price[1, k] + price >= ceiling:
                k += 1
            while k < before and work.supply[1, k] + more >= need:
                ceiling = work.price[1, k] + price
                best_parent, best_entry = work.name[1, k], entry
                k += 1
            s, made, least = 0, 0, ceiling
            while s < size or k < before:
                if k == before or (s < size and work.supply[0, s] >= work.supply[1, k] + more):
                    if work.price[0, s] < least:
                        least = work.price[0, s]
                        work.supply[2, made] = work.supply[0, s]
                        work.price[2, made] = least
                        work.name[2, made] = work.name[0, s]
                        made += 1
                    s += 1
                else:
                    if work.price[1, k] + price < least:
                        least = work.price[1, k] + price
                        work.supply[2, made] = work.supply[1, k] + more
                        work.price[2, made] = least
                        work.name[2, made] = names
                        work.parent[names] = work.name[1, k]
                        work.entry[names] = entry
                        names += 1
                        made += 1
                    k += 1
            size = made
            if made > LABELS:
                size = 0
                for s in range(0, made, 2):
                    low = min(s + 1, made - 1)
                    work.supply[0, size] = work.supply[2, s]
                    work.price[0, size] = work.price[2, low]
                    work.name[0, size] = work.name[2, low]
                    size += 1
            else:
                for s in range(made):
                    work.supply[0, s] = work.supply[2, s]
                    work.price[0, s] = work.price[2, s]
                    work.name[0, s] = work.name[2, s]
    work.sizes[0], work.sizes[1] = size, names
    if best_entry >= 0:
        for s in range(first, last):
            chosen[s] = False
        chosen[best_entry] = True
        while best_parent > 0:
            chosen[work.entry[best_parent]] = True
            best_parent = work.parent[best_parent]
    return float(ceiling)


@inner
def least_for(work: Labels, need: float, ceiling: float) -> float:
    """What supplying a part of the need costs at least, after `cheapest` said that all of it costs `ceiling`."""
    if need <= TOLERANCE:
        return 0.0
    found = ceiling
    # By falling supply and price: the last that supplies enough is the cheapest.
    low, high = 0, int(work.sizes[0])
    while low < high:
        middle = (low + high) // 2
        if work.supply[0, middle] >= need - 2 * TOLERANCE:
            low = middle + 1
        else:
            high = middle
    if low > 0:
        found = min(found, work.price[0, low - 1])
    return found
