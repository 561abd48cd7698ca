"""Pieces that several formulations are made of."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_array

from pscover.errors import InvalidSettings
from pscover.instance import Instance


def covering_rows(instance: Instance) -> csr_array:
    """Truncated rows of the elements with a positive requirement: sum_i w_ij x_i >= 1, shape (those, candidates)."""
    return csr_array(csr_array(instance.truncated_weights())[required_elements(instance)])


def capped_rows(instance: Instance, elements: NDArray[np.intp], cap: float) -> csr_array:
    """Rows min(a_ij, cap) of some elements, shape (those, candidates): log weights that stay finite where p_ij = 1."""
    weights = csr_array(csr_array(instance.log_weights())[elements])
    return csr_array((np.minimum(weights.data, cap), weights.indices, weights.indptr), shape=weights.shape)


def required_elements(instance: Instance) -> NDArray[np.intp]:
    """The elements with q_j > 0."""
    return np.flatnonzero(instance.required > 0)


def conflict_rows(instance: Instance) -> csr_array:
    """One row a clique: sum_{i in Q} x_i <= 1, shape (cliques, candidates)."""
    return instance.conflicts.matrix(instance.candidates)


def bounds(*blocks: tuple[int, float]) -> NDArray[np.float64]:
    """Row bounds from (how many rows, which value) blocks."""
    return np.repeat([value for _, value in blocks], [count for count, _ in blocks]).astype(np.float64)


def binaries(count: int) -> NDArray[Any]:
    """An integer mask that is true everywhere."""
    return np.ones(count, dtype=np.bool_)


def leading(count: int, variables: int) -> NDArray[Any]:
    """An integer mask that is true for the first `count` of the variables."""
    return np.arange(variables) < count


def unchosen(instance: Instance, elements: Iterable[int], chosen: Sequence[int]) -> list[Sequence[int]]:
    """For each of some elements the candidates that cover it and are not chosen."""
    by_element = csr_array(instance.probability)
    taken = set(chosen)
    return [
        [int(i) for i in by_element.indices[by_element.indptr[j] : by_element.indptr[j + 1]] if int(i) not in taken]
        for j in elements
    ]


def expect(name: str, good: bool, expected: str, got: object) -> None:
    """Raise `InvalidSettings` unless a parameter is good."""
    if not good:
        raise InvalidSettings(f"{name}: expected {expected}, got {got!r}")
