"""The probabilistic set-cover problem as one frozen value.

Candidates (columns; in the planner grasps) cover elements (rows; in the planner garments). Candidate i covers element j
with probability p_ij, independently of all other candidates, so that a plan S covers j with probability
1 - prod_{i in S} (1 - p_ij). A plan is feasible when that is at least q_j for every element and S holds at most one
candidate of every clique of conflicts.
"""

from __future__ import annotations

import hashlib
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.sparse import csc_array, issparse

from pscover.cliques import Cliques
from pscover.errors import InvalidInstance

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.int32]
INDEX_LIMIT = 2**31 - 1

TOLERANCE = 1e-9
"""A requirement counts as met when the coverage falls short of it by no more than this (a probability)."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Meta:
    """What the indices stand for; nothing here changes the problem or its digest.

    Parameters
    ----------
    name
        What to call the instance in tables.
    source
        Where it came from: a file, a generator with its seed, a paper.
    elements
        Names of the elements, one each, or empty.
    candidates
        Names of the candidates, one each, or empty.
    poses
        Grasp poses, shape (candidates, 3): x and y in pixels, theta in radians; None where candidates are no grasps.
    optimum
        The known optimal cost, if any.
    """

    name: str = ""
    source: str = ""
    elements: tuple[str, ...] = ()
    candidates: tuple[str, ...] = ()
    poses: FloatArray | None = None
    optimum: float | None = None

    def element(self, j: int) -> str:
        """The name of element j, or its number."""
        return self.elements[j] if self.elements else str(j)

    def candidate(self, i: int) -> str:
        """The name of candidate i, or its number."""
        return self.candidates[i] if self.candidates else str(i)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Instance:
    """One problem. Build it with `Instance.of`, which checks everything; every buffer is read-only.

    Parameters
    ----------
    probability
        p_ij, shape (elements, candidates), canonical CSC with 0 < p <= 1; what is not stored is 0.
    required
        q_j, shape (elements,), in [0, 1).
    cost
        c_i, shape (candidates,), positive.
    conflicts
        Cliques of candidates that exclude each other.
    meta
        Names, poses, source.
    """

    probability: csc_array
    required: FloatArray
    cost: FloatArray
    conflicts: Cliques
    meta: Meta = field(default_factory=Meta)

    @classmethod
    def of(
        cls,
        probability: Any,
        required: ArrayLike = 0.7,
        cost: ArrayLike = 1.0,
        conflicts: Iterable[Iterable[int]] | Cliques = (),
        meta: Meta | None = None,
    ) -> Instance:
        """Copy, check and freeze: the one door through which untrusted data become an instance.

        Parameters
        ----------
        probability
            p_ij, shape (elements, candidates): a dense array (zeros are absent entries) or any SciPy sparse array or
            matrix. Duplicate entries are an error, and so is an explicitly stored zero.
        required
            q_j in [0, 1): one number for all elements or one each. Default 0.7, the paper's.
        cost
            c_i > 0 and finite: one number for all or one each.
        conflicts
            Groups of candidate indices, at most one of each of which may be chosen; a pair is a group of two.
        meta
            Names, poses, source.

        Returns
        -------
        Instance

        Raises
        ------
        InvalidInstance
            With the place, what was expected and what was found.

        Examples
        --------
        >>> instance = Instance.of([[0.8, 0.0, 0.5], [0.0, 0.9, 0.5]], required=0.7, conflicts=[(0, 2)])
        >>> instance.elements, instance.candidates
        (2, 3)
        >>> instance.coverage([0, 1])
        array([0.8, 0.9])
        """
        matrix = _canonical(probability)
        elements, candidates = matrix.shape
        _check_probability(matrix)
        q = _vector("required", required, elements)
        _check_each("required", q, (q >= 0) & (q < 1), "a number in [0, 1)")
        c = _vector("cost", cost, candidates)
        _check_each("cost", c, (c > 0) & np.isfinite(c), "a positive finite number")
        cliques = conflicts if isinstance(conflicts, Cliques) else Cliques.of(conflicts)
        cliques.check(candidates)
        meta = Meta() if meta is None else meta
        if not isinstance(meta, Meta):
            raise InvalidInstance(f"meta: expected a Meta, got {type(meta).__name__}")
        for kind, names, size in (("element", meta.elements, elements), ("candidate", meta.candidates, candidates)):
            if names and len(names) != size:
                raise InvalidInstance(f"{kind} names: expected {size}, one each, got {len(names)}")
        if meta.poses is not None:
            poses = np.array(meta.poses, dtype=np.float64)
            if poses.shape != (candidates, 3) or not np.isfinite(poses).all():
                raise InvalidInstance(f"poses: expected finite numbers of shape ({candidates}, 3), got {poses.shape}")
            poses.setflags(write=False)
            meta = replace(meta, poses=poses)
        for buffer in (matrix.data, matrix.indices, matrix.indptr, q, c):
            buffer.setflags(write=False)
        return cls(probability=matrix, required=q, cost=c, conflicts=cliques, meta=meta)

    @property
    def elements(self) -> int:
        """The number of elements (rows)."""
        return int(self.probability.shape[0])

    @property
    def candidates(self) -> int:
        """The number of candidates (columns)."""
        return int(self.probability.shape[1])

    @property
    def digest(self) -> str:
        """SHA-256 of the problem's content (not of its names): equal exactly when two instances are the same problem."""
        content = hashlib.sha256(b"pscover.instance/1")
        p = self.probability
        content.update(np.array(p.shape, dtype="<i8").tobytes())
        for array, kind in (
            (p.indptr, "<i4"),
            (p.indices, "<i4"),
            (p.data, "<f8"),
            (self.required, "<f8"),
            (self.cost, "<f8"),
            (self.conflicts.starts, "<i4"),
            (self.conflicts.members, "<i4"),
        ):
            content.update(np.ascontiguousarray(array, dtype=kind).data)
        return content.hexdigest()

    def log_weights(self) -> csc_array:
        """a_ij = -log(1 - p_ij), same sparsity as `probability`; infinite where p_ij = 1 (paper, Eq. 2)."""
        p = self.probability
        with np.errstate(divide="ignore"):
            weights = -np.log1p(-p.data)
        return csc_array((weights, p.indices, p.indptr), shape=p.shape)

    def log_demand(self) -> FloatArray:
        """b_j = -log(1 - q_j), shape (elements,) (paper, Eq. 2)."""
        demand: FloatArray = -np.log1p(-self.required)
        return demand

    def truncated_weights(self) -> csc_array:
        """min(a_ij, b_j) / b_j, entries of rows with b_j = 0 dropped: rows of the form sum_i w_ij x_i >= 1.

        Exact for binary x, tighter in the relaxation, and finite where p_ij = 1 (coefficient tightening: Savelsbergh
        1994; knapsack cover with an empty set: Carr, Fleischer, Leung, Phillips 2000).
        """
        demand = self.log_demand()
        weights = self.log_weights()
        b = demand[weights.indices]
        scaled = np.divide(np.minimum(weights.data, b), b, out=np.zeros_like(b), where=b > 0)
        result = csc_array((scaled, weights.indices.copy(), weights.indptr.copy()), shape=weights.shape)
        result.eliminate_zeros()
        return result

    def coverage(self, chosen: Sequence[int] | NDArray[np.integer[Any]]) -> FloatArray:
        """The probability that each element is covered by the chosen candidates: the definition of feasible.

        Parameters
        ----------
        chosen
            Candidate indices.

        Returns
        -------
        FloatArray
            1 - prod_{i chosen} (1 - p_ij), shape (elements,).
        """
        p = self.probability[:, np.asarray(chosen, dtype=np.int64)]
        missed = np.ones(self.elements)
        np.multiply.at(missed, p.indices, 1.0 - p.data)
        covered: FloatArray = 1.0 - missed
        return covered

    def require(self, required: ArrayLike) -> Instance:
        """The same instance with other requirements."""
        return Instance.of(self.probability, required, self.cost, self.conflicts, self.meta)

    def with_margin(self, margin: float) -> Instance:
        """The same instance with every positive requirement raised by `margin`, kept below 1.

        Examples
        --------
        >>> Instance.of([[0.5], [0.5], [0.5]], required=[0.0, 0.7, 0.99]).with_margin(0.1).required.round(3)
        array([0.   , 0.8  , 0.995])
        """
        if margin == 0:
            return self
        raised = np.minimum(self.required + margin, (1 + self.required) / 2)
        return self.require(np.where(self.required > 0, raised, 0.0))


def _canonical(probability: Any) -> csc_array:
    """A private, sorted, float64, int32-indexed CSC copy; duplicates are an error."""
    if issparse(probability):
        if probability.ndim != 2:
            raise InvalidInstance(f"probability: expected 2 dimensions, got {probability.ndim}")
        triplets = probability.tocoo()
        rows, columns, values, shape = triplets.row, triplets.col, triplets.data, triplets.shape
    else:
        if isinstance(probability, np.ma.MaskedArray) or getattr(getattr(probability, "dtype", None), "kind", "") == "c":
            # Converted, they would lose their mask and their imaginary part.
            raise InvalidInstance(f"probability: expected plain real numbers, got {type(probability).__name__}")
        try:
            dense = np.asarray(probability, dtype=np.float64)
        except (TypeError, ValueError, OverflowError) as error:
            raise InvalidInstance(f"probability: expected numbers of shape (elements, candidates), got {error}") from None
        if dense.ndim != 2:
            raise InvalidInstance(f"probability: expected shape (elements, candidates), got {dense.shape}")
        rows, columns = np.nonzero(dense)
        values, shape = dense[rows, columns], dense.shape
    if max(shape) > INDEX_LIMIT or len(values) > INDEX_LIMIT:
        raise InvalidInstance(f"probability: at most 2^31 - 1 rows, columns and entries, got {shape}")
    if np.iscomplexobj(values):
        raise InvalidInstance("probability: expected real numbers, got complex ones")
    order = np.argsort(columns.astype(np.int64) * shape[0] + rows, kind="stable")
    rows, columns = rows[order], columns[order]
    same = np.flatnonzero((rows[1:] == rows[:-1]) & (columns[1:] == columns[:-1]))
    if len(same):
        j, i = int(rows[same[0]]), int(columns[same[0]])
        raise InvalidInstance(f"probability: element {j}, candidate {i} is given twice; expected each pair once")
    starts = np.zeros(shape[1] + 1, dtype=np.int32)
    np.cumsum(np.bincount(columns, minlength=shape[1]), out=starts[1:])
    data = np.array(values[order], dtype=np.float64)
    matrix = csc_array((data, rows.astype(np.int32), starts), shape=shape)
    matrix.has_canonical_format = True
    return matrix


def _check_probability(matrix: csc_array) -> None:
    bad = np.flatnonzero(~((matrix.data > 0) & (matrix.data <= 1)))
    if len(bad):
        k = int(bad[0])
        i = int(np.searchsorted(matrix.indptr, k, side="right")) - 1
        place = f"element {int(matrix.indices[k])}, candidate {i}"
        raise InvalidInstance(f"probability: {place}: expected a number in (0, 1], got {float(matrix.data[k])!r}")


def _vector(name: str, given: ArrayLike, size: int) -> FloatArray:
    try:
        array = np.array(given, dtype=np.float64)
    except (TypeError, ValueError, OverflowError) as error:
        raise InvalidInstance(f"{name}: expected numbers, got {error}") from None
    if array.ndim == 0:
        return np.full(size, array)
    if array.shape != (size,):
        raise InvalidInstance(f"{name}: expected shape ({size},) or one number, got shape {array.shape}")
    return array


def _check_each(name: str, values: FloatArray, good: NDArray[np.bool_], expected: str) -> None:
    bad = np.flatnonzero(~good)
    if len(bad):
        raise InvalidInstance(f"{name}[{bad[0]}]: expected {expected}, got {float(values[bad[0]])!r}")
