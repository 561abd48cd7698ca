"""Independent parts of a form.

**Proof.** If the columns of a form fall into sets such that no covering or packing row has columns of two of them, plans
are exactly the unions of plans of the parts, and costs add up. The finest such sets are the connected components of the
graph that joins each row with its columns.
"""

from __future__ import annotations

import numpy as np
from scipy.sparse import csr_array

from pscover.model import CoverForm

from ._sparse import IntArray, row_of


def components(form: CoverForm) -> list[tuple[CoverForm, IntArray]]:
    """The independent blocks of a form, each with its columns in the form, in the order of their first covering rows.

    Columns that are in no block cover nothing and are 0 in an optimal plan. A covering row without columns is a block of
    its own, without columns: it is infeasible.

    Parameters
    ----------
    form
        Any form.

    Examples
    --------
    >>> W, P = csr_array(np.array([[1.0, 0.5, 0], [0, 0, 1.0]])), csr_array((0, 3))
    >>> form = CoverForm(c=np.ones(3), W=W, P=P, allowed=np.ones(3, dtype=bool))
    >>> [columns.tolist() for _, columns in components(form)]
    [[0, 1], [2]]
    """
    of_row, of_packing, of_column, count = _labels(form)
    rows, packing, columns = (_sorted(labels, count) for labels in (of_row, of_packing, of_column))
    position = np.empty(len(form.c), dtype=np.int64)
    position[columns[0]] = np.arange(len(columns[0]))
    W, P = (_arranged(A, order[0], position) for A, order in ((form.W, rows), (form.P, packing)))
    found = []
    for k in range(count):
        low, high = columns[1][k], columns[1][k + 1]
        part = columns[0][low:high]
        block = CoverForm(
            c=form.c[part],
            W=_cut(W, rows[1][k], rows[1][k + 1], low, high),
            P=_cut(P, packing[1][k], packing[1][k + 1], low, high),
            allowed=form.allowed[part],
        )
        found.append((block, part))
    return found


def _labels(form: CoverForm) -> tuple[IntArray, IntArray, IntArray, int]:
    """The block of each covering row, packing row and column; -1 without a covering row. Blocks are numbered by rows."""
    from scipy.sparse.csgraph import connected_components

    m, n, p = form.W.shape[0], len(form.c), form.P.shape[0]
    start = np.concatenate((row_of(form.W), row_of(form.P) + m))
    end = np.concatenate((form.W.indices, form.P.indices)) + m + p
    size = m + p + n
    graph = csr_array((np.ones(len(start), dtype=np.int8), (start, end)), shape=(size, size))
    _, label = connected_components(graph, directed=False)
    named, first = np.unique(label[:m], return_index=True)
    number = np.full(int(label.max(initial=-1)) + 1, -1, dtype=np.int64)
    number[named[np.argsort(first)]] = np.arange(len(named))
    block = number[label]
    return block[:m], block[m : m + p], block[m + p :], len(named)


def _sorted(labels: IntArray, count: int) -> tuple[IntArray, IntArray]:
    """Indices by label, and where each label begins; those without a label come first and are skipped."""
    order = np.argsort(labels, kind="stable")
    starts = np.searchsorted(labels[order], np.arange(count + 1))
    return order, starts


def _arranged(A: csr_array, rows: IntArray, position: IntArray) -> csr_array:
    """Rows in another order, columns renumbered."""
    B = csr_array(A[rows])
    return csr_array((B.data, position[B.indices], B.indptr), shape=A.shape)


def _cut(A: csr_array, first: int, last: int, low: int, high: int) -> csr_array:
    begin, end = A.indptr[first], A.indptr[last]
    indptr = A.indptr[first : last + 1] - begin
    part = csr_array((A.data[begin:end], A.indices[begin:end] - low, indptr), shape=(last - first, high - low))
    part.sort_indices()
    return part
