"""Sparse rows as three arrays, and selections from them: SciPy's checks cost more than the work on small forms."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, TypeAlias

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_array

FloatArray: TypeAlias = NDArray[np.float64]
IntArray: TypeAlias = NDArray[np.int64]
Mask: TypeAlias = NDArray[np.bool_]


@dataclass(frozen=True, slots=True, eq=False)
class Rows:
    """A sparse matrix by rows, columns rising within each, without zeros; the names are those of SciPy's CSR."""

    data: FloatArray
    indices: NDArray[np.int32]
    indptr: NDArray[np.int32]
    shape: tuple[int, int]

    @classmethod
    def of(cls, A: Any) -> Rows:
        """A copy of any SciPy matrix."""
        B = csr_array(A, dtype=np.float64, copy=True)
        B.sum_duplicates()
        B.eliminate_zeros()
        return cls(B.data, B.indices.astype(np.int32), B.indptr.astype(np.int32), B.shape)

    @property
    def nnz(self) -> int:
        """The number of entries."""
        return len(self.data)

    def csr(self) -> csr_array:
        """As SciPy's matrix."""
        A = csr_array((self.data, self.indices, self.indptr), shape=self.shape)
        A.has_canonical_format = True
        return A

    def times(self, x: FloatArray) -> FloatArray:
        """The product with a vector."""
        product: FloatArray = np.bincount(row_of(self), self.data * x[self.indices], self.shape[0]).astype(np.float64)
        return product


def stacked(parts: list[Rows]) -> Rows:
    """Rows under each other."""
    ends = np.cumsum([0] + [part.nnz for part in parts])
    starts = [part.indptr[1:] + end for part, end in zip(parts, ends[:-1], strict=True)]
    return Rows(
        np.concatenate([part.data for part in parts]),
        np.concatenate([part.indices for part in parts]),
        np.concatenate([np.zeros(1, dtype=np.int32), *starts]).astype(np.int32),
        (sum(part.shape[0] for part in parts), parts[0].shape[1]),
    )


def row_of(A: Rows) -> IntArray:
    """The row of each entry (of a CSC matrix: the column)."""
    sizes = np.diff(A.indptr)
    return np.repeat(np.arange(len(sizes)), sizes)


def only_entries(A: Rows, keep: Mask) -> Rows:
    """The matrix without some entries; `keep` has one value an entry."""
    before = np.concatenate(([0], np.cumsum(keep)))
    return _of(A.data[keep], A.indices[keep], before[A.indptr], A.shape)


def only_columns(A: Rows, keep: Mask) -> Rows:
    """Some columns, in order."""
    entry = keep[A.indices]
    number = np.cumsum(keep) - 1
    before = np.concatenate(([0], np.cumsum(entry)))
    return _of(A.data[entry], number[A.indices[entry]], before[A.indptr], (A.shape[0], int(keep.sum())))


def only_rows(A: Rows, keep: Mask) -> Rows:
    """Some rows, in order."""
    entry = np.repeat(keep, np.diff(A.indptr))
    starts = np.concatenate(([0], np.cumsum(np.diff(A.indptr)[keep])))
    return _of(A.data[entry], A.indices[entry], starts, (int(keep.sum()), A.shape[1]))


def with_data(A: Rows, data: FloatArray) -> Rows:
    """The same pattern with other entries."""
    return _of(data, A.indices, A.indptr, A.shape)


def spread(starts: NDArray[Any], counts: NDArray[Any]) -> tuple[IntArray, IntArray]:
    """Positions starts[k], starts[k] + 1, ... (counts[k] of them) for all k, and the k of each position."""
    counts = counts.astype(np.int64)
    owner = np.repeat(np.arange(len(counts)), counts)
    first = np.cumsum(counts) - counts
    return np.arange(int(counts.sum())) + (starts.astype(np.int64) - first)[owner], owner


def _of(data: FloatArray, indices: NDArray[Any], indptr: NDArray[Any], shape: tuple[int, int]) -> Rows:
    return Rows(data, indices.astype(np.int32, copy=False), indptr.astype(np.int32), shape)
