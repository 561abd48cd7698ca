"""Selections from canonical CSR matrices that stay canonical, without SciPy's detours."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_array

from .change import IntArray, Mask


def canonical(A: Any) -> csr_array:
    """A sorted float64 CSR copy without duplicates and zeros."""
    result = csr_array(A, dtype=np.float64, copy=True)
    result.sum_duplicates()
    result.eliminate_zeros()
    return result


def row_of(A: csr_array) -> IntArray:
    """The row of each entry (of a CSC matrix: the column)."""
    sizes = np.diff(A.indptr)
    return np.repeat(np.arange(len(sizes)), sizes)


def only_entries(A: csr_array, keep: Mask) -> csr_array:
    """The matrix without some entries; `keep` has one value an entry."""
    before = np.concatenate(([0], np.cumsum(keep)))
    return _of(A.data[keep], A.indices[keep], before[A.indptr], A.shape)


def only_columns(A: csr_array, keep: Mask) -> csr_array:
    """Some columns, in order."""
    entry = keep[A.indices]
    number = np.cumsum(keep) - 1
    before = np.concatenate(([0], np.cumsum(entry)))
    return _of(A.data[entry], number[A.indices[entry]], before[A.indptr], (A.shape[0], int(keep.sum())))


def only_rows(A: csr_array, keep: Mask) -> csr_array:
    """Some rows, in order."""
    entry = np.repeat(keep, np.diff(A.indptr))
    starts = np.concatenate(([0], np.cumsum(np.diff(A.indptr)[keep])))
    return _of(A.data[entry], A.indices[entry], starts, (int(keep.sum()), A.shape[1]))


def with_data(A: csr_array, data: NDArray[np.float64]) -> csr_array:
    """The same pattern with other entries."""
    return _of(data, A.indices, A.indptr, A.shape)


def spread(starts: NDArray[Any], counts: NDArray[Any]) -> tuple[IntArray, IntArray]:
    """Positions starts[k], starts[k] + 1, ... (counts[k] of them) for all k, and the k of each position."""
    counts = counts.astype(np.int64)
    owner = np.repeat(np.arange(len(counts)), counts)
    first = np.cumsum(counts) - counts
    return np.arange(int(counts.sum())) + (starts.astype(np.int64) - first)[owner], owner


def _of(data: NDArray[np.float64], indices: NDArray[Any], indptr: NDArray[Any], shape: tuple[int, int]) -> csr_array:
    result = csr_array((data, indices.astype(np.int32), indptr.astype(np.int32)), shape=shape)
    result.has_canonical_format = True
    return result
