"""The problem as the kernels read it: covering rows by column and by row, and the cliques of each candidate."""

from __future__ import annotations

import math
from itertools import pairwise
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csc_array, csr_array

from pscover.errors import Refused
from pscover.model import CoverForm

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.int32]

TOLERANCE = 1e-9
"""A row scaled to 1 counts as met when it is missed by no more than this."""


COLUMN = np.dtype([("entry", np.float64), ("row", np.int32), ("unused", np.int32)])
LINE = np.dtype([("entry", np.float64), ("candidate", np.int32), ("unused", np.int32)])


class Problem(NamedTuple):
    """Minimise cost x, W x >= 1, at most one candidate a clique.

    Parameters
    ----------
    cost
        Shape (candidates,), non-negative.
    cptr, columns
        W by column: records of entry and row.
    rptr, lines
        W by row: records of entry and candidate, each row's by falling entry per cost.
    gptr, gclq
        The cliques of each candidate.
    home
        The largest of them, -1 for none, shape (candidates,).
    cliques
        How many cliques, shape (1,).
    """

    cost: FloatArray
    cptr: IntArray
    columns: NDArray[Any]
    rptr: IntArray
    lines: NDArray[Any]
    gptr: IntArray
    gclq: IntArray
    home: IntArray
    cliques: IntArray

    @property
    def candidates(self) -> int:
        """The number of candidates."""
        return len(self.cost)

    @property
    def rows(self) -> int:
        """The number of covering rows."""
        return len(self.rptr) - 1

    @property
    def homes(self) -> NDArray[np.int64]:
        """The largest clique of each candidate; those in none have one each of their own, numbered after the others."""
        return np.where(self.home < 0, int(self.cliques[0]) + np.arange(self.candidates), self.home)

    @property
    def is_split(self) -> bool:
        """Whether no candidate is in two cliques."""
        return bool((np.diff(self.gptr) <= 1).all())


def problem_of(form: CoverForm) -> tuple[Problem, IntArray]:
    """The problem over the candidates that may be chosen and cover something, and which candidates those are.

    Raises
    ------
    Refused
        If a packing row has room for several candidates.

    Examples
    --------
    >>> from scipy.sparse import csr_array
    >>> W = csr_array([[0.5, 1.0, 0.0, 0.6]])
    >>> form = CoverForm(c=np.ones(4), W=W, P=csr_array((0, 4)), allowed=np.array([True, True, True, False]))
    >>> problem, columns = problem_of(form)
    >>> columns.tolist(), problem.rows, problem.lines["candidate"].tolist()
    ([0, 1], 1, [1, 0])
    """
    reason = several(form)
    if reason is not None:
        raise Refused(reason)
    useful = np.bincount(form.W.indices, minlength=len(form.c)) > 0
    columns = np.flatnonzero(form.allowed & useful).astype(np.int32)
    lying = csr_array(form.W) if len(columns) == len(form.c) else csr_array(form.W)[:, columns]
    W = csc_array(lying)
    W.sort_indices()
    cost = np.ascontiguousarray(form.c[columns], dtype=np.float64)
    P = csr_array(form.P)[:, columns]
    P = csr_array(P[np.diff(P.indptr) >= 2])
    sizes = np.diff(P.indptr)
    G = csc_array(P)
    home = np.full(len(columns), -1, dtype=np.int32)
    owner = np.repeat(np.arange(P.shape[0], dtype=np.int32), sizes)
    order = np.argsort(sizes[owner], kind="stable")
    home[P.indices[order]] = owner[order]
    gptr, gclq = _int32(G.indptr, G.indices)
    rptr, lines = _by_row(csr_array(W) if not lying.has_canonical_format else lying, cost)
    entries = np.zeros(W.nnz, dtype=COLUMN)
    entries["entry"], entries["row"] = W.data, W.indices
    problem = Problem(
        cost,
        _int32(W.indptr)[0],
        entries,
        rptr,
        lines,
        gptr,
        gclq,
        home,
        np.array([P.shape[0]], dtype=np.int32),
    )
    return problem, columns


def least_step(cost: FloatArray) -> float:
    """The least by which two plans of different cost can differ: the greatest common divisor of whole costs, else 0.

    Examples
    --------
    >>> least_step(np.array([4.0, 6.0])), least_step(np.array([1.0, 0.5]))
    (2.0, 0.0)
    """
    if not len(cost) or (cost != np.round(cost)).any() or cost.max() > 2**52:
        return 0.0
    return float(math.gcd(*(int(c) for c in np.unique(cost))))


def several(form: CoverForm) -> str | None:
    """Why packing rows are not cliques, in a sentence, or None."""
    P = form.P
    if not P.nnz:
        return None
    # Two smallest entries that do not fit together: then no two do.
    row = np.repeat(np.arange(P.shape[0]), np.diff(P.indptr))
    order = np.lexsort((P.data, row))
    starts = P.indptr[:-1][np.diff(P.indptr) >= 2]
    data = P.data[order]
    if (data[starts] + data[starts + 1] <= 1 + TOLERANCE).any():
        return "the model has packing rows with room for several candidates"
    return None


def _by_row(W: csr_array, cost: FloatArray) -> tuple[IntArray, NDArray[Any]]:
    """Where rows begin, and their entries by falling worth, equal ones by candidate: W has its entries in that order."""
    worth = W.data / np.maximum(cost[W.indices], 1e-12)
    order = np.empty(W.nnz, dtype=np.int64)
    for first, last in pairwise(W.indptr.tolist()):
        order[first:last] = first + np.argsort(-worth[first:last], kind="stable")
    lines = np.zeros(W.nnz, dtype=LINE)
    lines["entry"], lines["candidate"] = W.data[order], W.indices[order]
    return np.ascontiguousarray(W.indptr, dtype=np.int32), lines


def _int32(*arrays: NDArray[Any]) -> tuple[IntArray, ...]:
    return tuple(np.ascontiguousarray(array, dtype=np.int32) for array in arrays)
