"""Columns that another column of the same clique replaces: all but the Pareto-best candidates of a partition.

**Proof.** Let i and k be in a common clique, w_kj >= w_ij in all covering rows, c_k <= c_i, and the entries of k at most
those of i in all packing rows (so that k is in no clique without i). A plan with i does not hold k. Put k in the place of
i: no supply falls, no packing row is used more, the cost does not rise. So some optimal plan does without i. (Of equal
columns the first stays.) The relation is a strict order; dropping columns from its lower end, each while the column over
it is there, all can be dropped together.

Without the common clique the exchange fails where the plan holds both: that is why column dominance as in plain set cover
is wrong here. In the pairwise formulation a clique is a pair until `cliques` has merged them.

Cliques over few covering rows, as those of a partition, are compared as dense blocks (`_blocks`), others pair by pair.
"""

from __future__ import annotations

from collections.abc import Iterator
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from ._blocks import blocks, pareto
from ._sparse import IntArray, Mask, Rows, only_rows, row_of, spread
from ._supersets import CHUNK, LISTED, Effort, Items, Lookup
from ._view import View
from .change import Change, Over

NARROW = 64
"""A clique whose members cover at most this many rows in all is compared as a dense block."""


def clique_dominance(view: View, over: Over) -> Change:
    """Drop columns that a column of the same clique replaces."""
    cliques = view.cliques
    if not cliques.shape[0]:
        return Change()
    keep, stand_in = np.ones(len(view.c), dtype=np.bool_), np.arange(len(view.c))
    bits = view.columns.signatures
    narrow = _rows_touched(bits, cliques) <= NARROW
    for members, values in blocks(view, only_rows(cliques, narrow)):
        if over():
            break
        gone, winner = pareto(members, values)
        keep[gone], stand_in[gone] = False, winner
    if not narrow.all():
        search, effort = _Pairs(view, bits), Effort()
        for a, b in _pairs(only_rows(cliques, ~narrow), view.columns, effort, over):
            gone, winner = search.replaced(a, b)
            keep[gone], stand_in[gone] = False, winner
            effort.found += len(gone)
    return Change(columns=keep, stand_in=stand_in)


def _rows_touched(bits: NDArray[np.uint64], cliques: Rows) -> IntArray:
    """How many covering rows the members of each clique have (for more than 1024 rows: at least)."""
    count = np.zeros(cliques.shape[0], dtype=np.int64)
    for word in bits[min(1, len(bits) - 1) :]:
        joined = np.bitwise_or.reduceat(word[cliques.indices], cliques.indptr[:-1])
        count += np.unpackbits(joined.view(np.uint8).reshape(-1, 8), axis=1).sum(axis=1, dtype=np.int64)
    return count


def _pairs(cliques: Rows, items: Items, effort: Effort, over: Over) -> Iterator[tuple[IntArray, IntArray]]:
    """Chunks of pairs (a, b) of a common clique, the sum of b at least that of a; per a the largest b only."""
    clique, sums = row_of(cliques), items.sums[cliques.indices]
    order = np.lexsort((-sums, clique))
    members, sums = cliques.indices[order].astype(np.int64), sums[order]
    # Members of equal sum follow each other: each is compared with all up to the last of its equals.
    new = (np.diff(clique, prepend=-1) > 0) | (np.diff(sums, prepend=-1.0) != 0)
    last = np.append(np.flatnonzero(new)[1:], len(members))[np.cumsum(new) - 1]
    begin = cliques.indptr[clique].astype(np.int64)
    size = np.minimum(last - begin, LISTED)
    edges = np.searchsorted(np.cumsum(size), np.arange(0, size.sum(), CHUNK))
    for low, high in pairwise(np.unique(np.append(edges, len(members))).tolist()):
        if over() or effort.is_wasted():
            return
        spots, at = spread(begin[low:high], size[low:high])
        effort.looked += len(at)
        a, b = members[low:high][at], members[spots]
        different = a != b
        yield a[different], b[different]


class _Pairs:
    """Compares pairs of columns one by one."""

    def __init__(self, view: View, bits: NDArray[np.uint64]) -> None:
        self.c = view.c
        self.bits = bits
        self.cover, self.pack = Lookup(view.columns), Lookup(view.packing)

    def replaced(self, a: IntArray, b: IntArray) -> tuple[IntArray, IntArray]:
        """The pairs in which b replaces a."""
        for word in self.bits:
            good = (word[a] & ~word[b]) == 0
            a, b = a[good], b[good]
        good = self._is_over(a, b)
        a, b = a[good], b[good]
        first = (a > b) | ~self._is_over(b, a)
        return a[first], b[first]

    def _is_over(self, a: IntArray, b: IntArray) -> Mask:
        """Whether b is at least a, equal columns included."""
        good: Mask = self.cover.confirm(a, b) & self.pack.confirm(b, a) & (self.c[b] <= self.c[a])
        return good
