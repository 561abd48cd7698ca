"""Packing rows as few, large cliques.

**Clique rows.** A packing row any two of whose columns exceed the capacity holds for the same plans with all entries 1.

**Contained rows.** A clique row whose columns are all in another clique row is implied by it.

**Merging.** Rows that are cliques say which pairs of columns exclude each other, and nothing else. So they can be replaced
by any cliques that contain exactly those pairs (`pscover.cliques.merge_edges`): the same plans, a tighter relaxation.
Rows of three and more columns are kept beside the merged ones unless contained in one, so that the relaxation never gets
weaker.

Source: Padberg 1973; Atamtürk, Nemhauser, Savelsbergh 2000; Brito and Santos 2021.
"""

from __future__ import annotations

import numpy as np
from scipy.sparse import csr_array

from pscover.cliques import Cliques, merge_edges

from ._groups import is_clique
from ._sparse import IntArray, Rows, only_rows, stacked, with_data
from ._supersets import Effort, Items, Lookup, likely_pairs
from ._view import View
from .change import Change, Over

PAIRS = 200_000
"""Rows are merged only if they hold at most this many pairs, not counting those that merge completely."""
PAIRS_AT_ONCE = 20_000_000
"""The conflict graph is built only if it has at most about this many pairs."""


def cliques(view: View, over: Over) -> Change:
    """Merge cliques and drop those contained in others."""
    P = view.P
    good = is_clique(P)
    if not good.any():
        return Change()
    old = only_rows(P, good)
    overlap = bool((np.bincount(old.indices, minlength=P.shape[1]) > 1).any())
    new = _merged(_ones(old), over) if overlap else _ones(old)
    if _same(old, new):
        return Change()
    return Change(P=stacked([new, only_rows(P, ~good)]))


def _merged(rows: Rows, over: Over) -> Rows:
    """The same conflicts in maximal cliques, as far as time and size allow."""
    whole, rest = _whole(rows)
    if 0 < Cliques.flat(rest.indptr, rest.indices).pair_count() <= PAIRS and not over():
        larger = only_rows(rest, np.diff(rest.indptr) > 2)
        merged = merge_edges(Cliques.flat(rest.indptr, rest.indices).pairs()).matrix(rows.shape[1])
        rest = stacked([Rows.of(merged), larger])
    return stacked([whole, _uncontained(rest, over)])


def _whole(rows: Rows) -> tuple[Rows, Rows]:
    """Parts of the conflict graph all of whose columns exclude each other, as one clique each, and the rows of the rest."""
    if int((np.diff(rows.indptr).astype(np.int64) ** 2).sum()) > PAIRS_AT_ONCE:
        return only_rows(rows, np.zeros(rows.shape[0], dtype=np.bool_)), rows
    from scipy.sparse.csgraph import connected_components

    A = rows.csr()
    graph = csr_array(A.T @ A)
    count, label = connected_components(graph, directed=False)
    size = np.bincount(label, minlength=count)
    degree: IntArray = np.diff(graph.indptr)
    complete = np.bincount(label, degree, count) == size * size
    complete &= size > 1
    member = np.flatnonzero(complete[label])
    number = np.cumsum(complete) - 1
    pattern = (np.ones(len(member)), (number[label[member]], member))
    whole = Rows.of(csr_array(pattern, shape=(int(complete.sum()), rows.shape[1])))
    first = rows.indices[rows.indptr[:-1]]
    return whole, only_rows(rows, ~complete[label[first]])


def _uncontained(rows: Rows, over: Over) -> Rows:
    items = Items(starts=rows.indptr, coordinates=rows.indices, values=rows.data, dimensions=rows.shape[1])
    sizes = np.diff(rows.indptr)
    lookup, effort = Lookup(items), Effort()
    keep = np.ones(len(items), dtype=np.bool_)
    for inner, outer in likely_pairs(items, keep.copy(), keep, np.zeros(len(items)), effort, over):
        later = (sizes[outer] > sizes[inner]) | (outer < inner)
        inner, outer = inner[later], outer[later]
        keep[inner[lookup.confirm(inner, outer)]] = False
        effort.found = int((~keep).sum())
    return only_rows(rows, keep)


def _ones(rows: Rows) -> Rows:
    return with_data(rows, np.ones(rows.nnz))


def _same(old: Rows, new: Rows) -> bool:
    """Whether two lists of rows are equal as sets."""
    if old.shape[0] != new.shape[0] or old.nnz != new.nnz or not (old.data == 1).all():
        return False
    mine, its = (_listed(rows) for rows in (old, new))
    return mine == its


def _listed(rows: Rows) -> set[bytes]:
    indices = rows.indices.astype(np.int64)
    return {indices[a:b].tobytes() for a, b in zip(rows.indptr[:-1], rows.indptr[1:], strict=True)}
