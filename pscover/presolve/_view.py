"""A form with what several steps want to know of it, worked out once."""

from __future__ import annotations

from functools import cached_property

import numpy as np
from scipy.sparse import csc_array, csr_array

from pscover.model import CoverForm

from ._groups import Runs, clique_rows, partitions
from ._supersets import Items
from .change import FloatArray, Mask


class View:
    """A form whose columns are all allowed and whose matrices are canonical without zeros.

    Parameters
    ----------
    form
        The form; it is not changed.
    """

    def __init__(self, form: CoverForm) -> None:
        self.form = form
        self.c: FloatArray = form.c
        self.W: csr_array = form.W
        self.P: csr_array = form.P

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
    def cliques(self) -> csr_array:
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


def _columns(A: csr_array) -> Items:
    B = csc_array(A)
    B.sort_indices()
    return Items(starts=B.indptr, coordinates=B.indices, values=B.data, dimensions=A.shape[0])
