"""A form with what several steps want to know of it, worked out once."""

from __future__ import annotations

from functools import cached_property

import numpy as np
from scipy.sparse import csc_array

from ._groups import Runs, clique_rows, partitions
from ._sparse import FloatArray, Mask, Rows, row_of
from ._supersets import Items


class View:
    """A form whose columns are all allowed.

    Parameters
    ----------
    c
        Costs.
    W, P
        Covering and packing rows.
    """

    def __init__(self, c: FloatArray, W: Rows, P: Rows) -> None:
        self.c = c
        self.W = W
        self.P = P

    @cached_property
    def columns(self) -> Items:
        """The columns of the covering rows."""
        return _columns(self.W)

    @cached_property
    def packing(self) -> Items:
        """The columns of the packing rows."""
        return _columns(self.P)

    @cached_property
    def rows(self) -> Items:
        """The covering rows."""
        W = self.W
        return Items(starts=W.indptr, coordinates=W.indices, values=W.data, dimensions=W.shape[1])

    @cached_property
    def cliques(self) -> Rows:
        """The packing rows that are cliques."""
        return clique_rows(self.P)

    @cached_property
    def runs(self) -> list[Runs]:
        """The entries of covering rows by disjoint groups, in a few ways where cliques overlap."""
        return [Runs.of(self.W, group) for group in partitions(self.P)]

    @cached_property
    def unpacked(self) -> Mask:
        """The columns in no packing row of two or more."""
        P = self.P
        counts = np.bincount(P.indices[np.repeat(np.diff(P.indptr) > 1, np.diff(P.indptr))], minlength=len(self.c))
        free: Mask = counts == 0
        return free


def _columns(A: Rows) -> Items:
    if A.nnz <= SMALL:
        order = np.argsort(A.indices, kind="stable")
        starts = np.searchsorted(A.indices[order], np.arange(A.shape[1] + 1)).astype(np.int32)
        rows = row_of(A)[order].astype(np.int32)
        return Items(starts=starts, coordinates=rows, values=A.data[order], dimensions=A.shape[0])
    B = csc_array(A.csr())
    return Items(starts=B.indptr, coordinates=B.indices, values=B.data, dimensions=A.shape[0])


SMALL = 20_000
"""Up to this many entries sorting is quicker than SciPy's conversion."""
