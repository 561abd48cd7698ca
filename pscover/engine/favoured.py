"""The candidates that prices favour: those of least reduced cost, overall and of each row."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_array

FloatArray = NDArray[np.float64]

NOISE = 0.2
"""By how much reduced costs are blurred, relative to the spread of those favoured."""


def favoured(W: csr_array, reduced: FloatArray, overall: int, each: int) -> NDArray[np.bool_]:
    """For each row so many overall, and of each row so many.

    Examples
    --------
    >>> W = csr_array([[1.0, 1.0, 1.0, 0.0], [0.0, 0.0, 0.0, 1.0]])
    >>> favoured(W, np.array([2.0, 0.0, 1.0, 9.0]), 1, 1).tolist()
    [False, True, True, True]
    """
    chosen = np.zeros(len(reduced), dtype=np.bool_)
    chosen[_least(reduced, overall * W.shape[0])] = True
    for j in range(W.shape[0]):
        members = W.indices[W.indptr[j] : W.indptr[j + 1]]
        chosen[members[_least(reduced[members], each)]] = True
    return chosen


def blurred(reduced: FloatArray, count: int, random: np.random.Generator) -> FloatArray:
    """Reduced costs with noise, so that others are among so many favoured; infinite ones stay so."""
    known = reduced[np.isfinite(reduced)]
    last = min(count, len(known) - 1)
    spread = float(np.partition(known, last)[last] - known.min())
    return reduced + random.exponential(NOISE * max(spread, 1e-9), len(reduced))


def _least(values: FloatArray, count: int) -> NDArray[np.intp]:
    return np.arange(len(values)) if count >= len(values) else np.argpartition(values, count)[:count]
