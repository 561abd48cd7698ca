"""Members of cliques as dense blocks of coordinates, many cliques of about the same shape at a time.

A coordinate is a covering row, a packing row (negated) or the cost (negated): a column is over another when it is at
least that in all coordinates.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from ._sparse import FloatArray, IntArray, Mask, Rows, row_of, spread
from ._view import View

SMALL = 64
"""Cliques up to this size are compared all with all, larger ones with the best found so far."""
CELLS = 1 << 20
"""Comparisons at a time."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class _Table:
    """The coordinates of members, numbered from 0 within each clique, sorted by clique.

    `slot` is the entry of `cliques` that a value belongs to, `start` the first value of each clique, `width` how many
    coordinates each clique has.
    """

    slot: IntArray
    number: IntArray
    value: FloatArray
    start: IntArray
    width: IntArray


def blocks(view: View, cliques: Rows) -> Iterator[tuple[IntArray, FloatArray]]:
    """Members and values of cliques of at least two members.

    Yields
    ------
    members
        Columns, shape (cliques, size), rising along the second axis; -1 where a clique is smaller.
    values
        Coordinates, shape (cliques, width, size); -inf where a clique is smaller.
    """
    table = _table(view, cliques)
    sizes = np.diff(cliques.indptr).astype(np.int64)
    kind = _steps(sizes) * 64 + _steps(table.width)
    largest, widest = int(sizes.max(initial=0)), int(table.width.max(initial=0))
    if largest <= SMALL and len(sizes) * largest * largest * widest <= CELLS:
        kind[:] = 0
    order = np.lexsort((kind,))
    order = order[sizes[order] >= 2]
    edges = np.flatnonzero(np.diff(kind[order], prepend=-1, append=-1))
    for low, high in pairwise(edges.tolist()):
        size = int(sizes[order[low:high]].max())
        width = int(table.width[order[low:high]].max())
        many = max(1, CELLS // (size * max(width, min(size, SMALL))))
        for at in range(low, high, many):
            yield _block(cliques, table, order[at : min(at + many, high)], size, width)


def pareto(members: IntArray, values: FloatArray) -> tuple[IntArray, IntArray]:
    """The columns that another of their clique is over, and one that is; of equal columns the first is over the others."""
    if members.shape[1] > SMALL:
        return _skyline(members, values)
    size = members.shape[1]
    over = np.ones((len(members), size, size), dtype=np.bool_)
    for k in range(values.shape[1]):
        over &= values[:, k, :, None] >= values[:, k, None, :]
    over &= (members >= 0)[:, :, None] & (members >= 0)[:, None, :]
    strict = over & ~(over.transpose(0, 2, 1) & _not_before(size))
    block, gone = np.nonzero(strict.any(axis=1))
    winner = strict[block, :, gone].argmax(axis=1)
    return members[block, gone], members[block, winner]


def _not_before(size: int) -> Mask:
    """Where the first index is not before the second."""
    return np.tri(size, dtype=np.bool_)


def _skyline(members: IntArray, values: FloatArray) -> tuple[IntArray, IntArray]:
    """As `pareto`, for large cliques: by falling sum, each chunk against what is left of those before.

    What is over a column has no smaller sum, up to rounding: then the column stays, which does no harm.
    """
    found: list[tuple[IntArray, IntArray]] = []
    for own, own_values in zip(members, values, strict=True):
        real = own >= 0
        columns, points = own[real], own_values[:, real]
        order = np.lexsort((columns, -points.sum(axis=0)))
        columns, points = columns[order], points[:, order]
        best = np.zeros(0, dtype=np.int64)
        for at in range(0, len(columns), SMALL):
            chunk = np.arange(at, min(at + SMALL, len(columns)))
            gone, winner = _beaten(points[:, best], points[:, chunk])
            found.append((columns[chunk[gone]], columns[best[winner]]))
            chunk = np.delete(chunk, gone)
            if not len(chunk):
                continue
            # Members of a chunk are in order of falling sum, so that of equal ones the first column comes first.
            gone, winner = pareto(chunk[None, :], points[None, :, chunk])
            found.append((columns[gone], columns[winner]))
            best = np.concatenate((best, np.setdiff1d(chunk, gone)))
    return np.concatenate([gone for gone, _ in found]), np.concatenate([winner for _, winner in found])


def _beaten(best: FloatArray, points: FloatArray) -> tuple[IntArray, IntArray]:
    """Which points one of the best is at least, and which."""
    over = np.ones((best.shape[1], points.shape[1]), dtype=np.bool_)
    for mine, its in zip(best, points, strict=True):
        over &= mine[:, None] >= its[None, :]
    gone = np.flatnonzero(over.any(axis=0))
    return gone, over[:, gone].argmax(axis=0) if len(gone) else gone


def _table(view: View, cliques: Rows) -> _Table:
    m, p = view.W.shape[0], view.P.shape[0]
    keys, slots, values = [], [], []
    clique = row_of(cliques)
    for items, first, sign in ((view.columns, 0, 1.0), (view.packing, m, -1.0)):
        begin = items.starts[cliques.indices]
        spots, slot = spread(begin, items.starts[cliques.indices + 1] - begin)
        keys.append(clique[slot] * (m + p + 1) + first + items.coordinates[spots])
        slots.append(slot)
        values.append(sign * items.values[spots])
    if (view.c != view.c[0]).any():
        keys.append(clique * (m + p + 1) + m + p)
        slots.append(np.arange(cliques.nnz))
        values.append(-view.c[cliques.indices])
    key = np.concatenate(keys)
    order = np.argsort(key, kind="stable")
    key, slot, value = key[order], np.concatenate(slots)[order], np.concatenate(values)[order]
    new = np.diff(key, prepend=-1) > 0
    starts = np.flatnonzero(new)
    sizes = np.diff(cliques.indptr)
    of = key[starts] // (m + p + 1)
    # A coordinate in which all members agree decides nothing: the clique itself, for one.
    useful = np.diff(starts, append=len(key)) < sizes[of]
    if len(starts):
        useful |= np.minimum.reduceat(value, starts) < np.maximum.reduceat(value, starts)
    width = np.bincount(of[useful], minlength=len(sizes))
    number = np.cumsum(useful) - 1 - np.concatenate(([0], np.cumsum(width)))[of]
    which = np.cumsum(new) - 1
    inside = useful[which]
    start = np.searchsorted(of[which[inside]], np.arange(len(sizes) + 1))
    return _Table(slot=slot[inside], number=number[which[inside]], value=value[inside], start=start, width=width)


def _block(cliques: Rows, table: _Table, chosen: IntArray, size: int, width: int) -> tuple[IntArray, FloatArray]:
    begin = cliques.indptr[chosen]
    count = cliques.indptr[chosen + 1] - begin
    members = np.full((len(chosen), size), -1, dtype=np.int64)
    spots, row = spread(begin, count)
    members[row, spots - begin[row]] = cliques.indices[spots]
    values = np.where(members >= 0, 0.0, -np.inf)[:, None, :].repeat(width, axis=1)
    spots, row = spread(table.start[chosen], table.start[chosen + 1] - table.start[chosen])
    values[row, table.number[spots], table.slot[spots] - begin[row]] = table.value[spots]
    return members, values


def _steps(sizes: IntArray) -> IntArray:
    """Classes of sizes within a factor of the square root of 2."""
    steps: IntArray = np.ceil(2 * np.log2(np.maximum(sizes, 1))).astype(np.int64)
    return steps
