"""Columns in disjoint groups of which a plan holds at most one each, and what a row can get from each group."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ._sparse import FloatArray, IntArray, Mask, Rows, only_rows, row_of
from .change import TOLERANCE

ORDERS = 3
"""Partitions tried where cliques overlap: the largest clique first, the smallest first, the last first."""


def is_clique(P: Rows) -> Mask:
    """Packing rows of at least two columns any two of which exceed the capacity: the two smallest do."""
    sizes = np.diff(P.indptr)
    good = np.zeros(len(sizes), dtype=np.bool_)
    several = np.flatnonzero(sizes >= 2)
    if len(several):
        sub = only_rows(P, sizes >= 2)
        least = np.minimum.reduceat(sub.data, sub.indptr[:-1])
        owner = row_of(sub)
        at_least = np.flatnonzero(sub.data == least[owner])
        first = at_least[np.concatenate(([True], np.diff(owner[at_least]) > 0))]
        rest = sub.data.copy()
        rest[first] = np.inf
        good[several] = least + np.minimum.reduceat(rest, sub.indptr[:-1]) > 1 + TOLERANCE
    return good


def clique_rows(P: Rows) -> Rows:
    """The packing rows that are cliques."""
    good = is_clique(P)
    return P if good.all() else only_rows(P, good)


def partitions(P: Rows) -> Iterator[IntArray]:
    """Ways to put each column into one of its cliques: group numbers, shape (columns,).

    One way where no column is in two cliques. A column in no clique is a group of its own; numbers are below
    rows + columns.
    """
    cliques = clique_rows(P)
    sizes = np.diff(cliques.indptr)
    overlap = bool((np.bincount(cliques.indices, minlength=cliques.shape[1]) > 1).any())
    last = np.arange(len(sizes))
    orders = [np.argsort(sizes, kind="stable"), np.argsort(-sizes, kind="stable"), last]
    for order in orders[: ORDERS if overlap else 1]:
        rank = np.empty(len(order), dtype=np.int64)
        rank[order] = np.arange(len(order))
        group = np.arange(len(sizes), len(sizes) + P.shape[1])
        chosen = np.full(P.shape[1], -1, dtype=np.int64)
        np.maximum.at(chosen, cliques.indices, rank[row_of(cliques)])
        inside = chosen >= 0
        group[inside] = order[chosen[inside]]
        yield group


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Runs:
    """The entries of covering rows, those of one row and group next to each other: a run is one row and group.

    Parameters
    ----------
    group
        Group of each column.
    column, entry
        Of each entry.
    start
        Where each run begins in the entries.
    row
        The row of each run, rising.
    rows
        How many rows there are.
    """

    group: IntArray
    column: NDArray[np.integer[Any]]
    entry: FloatArray
    start: IntArray
    row: IntArray
    rows: int

    @classmethod
    def of(cls, W: Rows, group: IntArray) -> Runs:
        """Sort the entries of W by row and group."""
        row, column, entry = row_of(W), W.indices, W.data
        if not (np.diff(group[column]) >= 0)[np.diff(row) == 0].all():
            order = np.argsort(row * (int(group.max(initial=0)) + 1) + group[column], kind="stable")
            row, column, entry = row[order], column[order], entry[order]
        of = group[column]
        new = (np.diff(row, prepend=-1) > 0) | (np.diff(of, prepend=-1) != 0)
        start = np.flatnonzero(new)
        return cls(group=group, column=column, entry=entry, start=start, row=row[start], rows=W.shape[0])

    def most(self, entry: FloatArray | None = None) -> FloatArray:
        """The largest entry of each run."""
        values = self.entry if entry is None else entry
        return np.maximum.reduceat(values, self.start) if len(values) else np.zeros(0)

    def supply(self, entry: FloatArray | None = None) -> FloatArray:
        """For each row the most that a plan can supply: the sum over its groups of the largest entry."""
        supply: FloatArray = np.bincount(self.row, self.most(entry), self.rows).astype(np.float64)
        return supply

    def run(self) -> IntArray:
        """The run of each entry."""
        return np.repeat(np.arange(len(self.start)), np.diff(self.start, append=len(self.entry)))

    def best(self) -> IntArray:
        """For each run the first entry that is largest."""
        run = self.run()
        largest = np.flatnonzero(self.entry == self.most()[run])
        first: IntArray = largest[np.diff(run[largest], prepend=-1) > 0]
        return first

    def only(self, rows: Mask) -> Runs:
        """The runs of some rows, which keep their numbers."""
        runs = rows[self.row]
        sizes = np.diff(self.start, append=len(self.entry))
        entries = np.repeat(runs, sizes)
        start = np.cumsum(sizes[runs]) - sizes[runs]
        return Runs(
            group=self.group,
            column=self.column[entries],
            entry=self.entry[entries],
            start=start,
            row=self.row[runs],
            rows=self.rows,
        )
