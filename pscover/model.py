"""The mixed-integer linear model: where formulations and backends meet.

    minimise  c x   subject to  lo <= A x <= hi,  0 <= x <= ub,  x integer where marked.

This is SciPy's neutral form with all lower bounds 0. By convention **the first `candidates` variables are the instance's
candidates, in order**, so that a plan can be read off any model and handed to any model as a start.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_array, vstack

from pscover.errors import Refused

FloatArray = NDArray[np.float64]


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Model:
    """One model, in SciPy's neutral form.

    Parameters
    ----------
    c
        Objective to minimise, shape (variables,).
    A
        Constraint matrix, CSR, shape (rows, variables), all entries finite.
    lo, hi
        Row bounds, shape (rows,); infinite where absent.
    ub
        Upper bounds of the variables, shape (variables,); all lower bounds are 0.
    integer
        Which variables must be integer, shape (variables,).
    candidates
        How many leading variables are the instance's candidates.
    offset
        A constant added to the objective.
    then
        Further objectives, minimised in order among the optima of those before (lexicographic).
    """

    c: FloatArray
    A: csr_array
    lo: FloatArray
    hi: FloatArray
    ub: FloatArray
    integer: NDArray[np.bool_]
    candidates: int
    offset: float = 0.0
    then: tuple[FloatArray, ...] = ()

    @property
    def rows(self) -> int:
        """The number of constraints."""
        return int(self.A.shape[0])

    @property
    def variables(self) -> int:
        """The number of variables."""
        return int(self.A.shape[1])

    @property
    def nonzeros(self) -> int:
        """The number of stored entries of A."""
        return int(self.A.nnz)

    @property
    def is_integral_cost(self) -> bool:
        """Whether every feasible point has an integer objective, so that a bound may be rounded up."""
        priced = self.c != 0
        whole = self.c == np.round(self.c)
        return bool(whole.all() and self.integer[priced].all() and self.offset == round(self.offset))

    def with_rows(self, A: csr_array, lo: FloatArray, hi: FloatArray) -> Model:
        """The same model with more constraints."""
        stacked = csr_array(vstack([self.A, A], format="csr"))
        return replace(self, A=stacked, lo=np.concatenate([self.lo, lo]), hi=np.concatenate([self.hi, hi]))

    def with_objective(self, c: FloatArray) -> Model:
        """The same constraints under another single objective."""
        return replace(self, c=c, then=(), offset=0.0)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class CoverForm:
    """A model that is nothing but covering and packing over binaries: minimise c x, W x >= 1, P x <= 1.

    Parameters
    ----------
    c
        Costs, shape (variables,), non-negative.
    W
        Covering rows scaled to a right-hand side of 1 and truncated at 1, CSR.
    P
        Packing rows scaled to a right-hand side of 1, CSR, entries in (0, 1].
    allowed
        Variables that may be 1 (ub >= 1), shape (variables,).
    """

    c: FloatArray
    W: csr_array
    P: csr_array
    allowed: NDArray[np.bool_]

    def among(self, columns: NDArray[np.signedinteger[Any]]) -> CoverForm:
        """The form of some of its variables, which may all be 1, and of the packing rows that still exclude any.

        Examples
        --------
        >>> W, P = csr_array([[0.5, 1.0, 0.5]]), csr_array([[1.0, 1.0, 0.0], [0.0, 1.0, 1.0]])
        >>> form = CoverForm(c=np.ones(3), W=W, P=P, allowed=np.ones(3, dtype=np.bool_))
        >>> form.among(np.array([0, 1])).P.toarray().tolist()
        [[1.0, 1.0]]
        """
        P = csr_array(self.P[:, columns])
        return CoverForm(
            c=self.c[columns],
            W=csr_array(self.W[:, columns]),
            P=csr_array(P[np.diff(P.indptr) >= 2]),
            allowed=np.ones(len(columns), dtype=np.bool_),
        )


def as_cover(model: Model) -> CoverForm:
    """Read a model as covering and packing rows over binaries.

    Raises
    ------
    Refused
        With the one sentence why the model is not of that form.
    """
    if model.then:
        raise Refused("the model has several objectives in order of priority")
    if not model.integer.all() or (model.ub > 1).any():
        raise Refused("the model has variables that are not binary")
    if (model.c < 0).any():
        raise Refused("the model has negative costs")
    A = model.A
    row = np.repeat(np.arange(model.rows), np.diff(A.indptr))
    negative = np.zeros(model.rows, dtype=bool)
    positive = np.zeros(model.rows, dtype=bool)
    negative[row[A.data < 0]] = True
    positive[row[A.data > 0]] = True
    # An empty row that nothing can satisfy is a covering row that nothing covers.
    negative |= ~positive & (model.hi < 0)
    if (negative & positive).any():
        raise Refused("the model has rows with coefficients of both signs")
    sign = np.where(negative, -1.0, 1.0)
    lo = np.where(negative, -model.hi, model.lo)
    hi = np.where(negative, -model.lo, model.hi)
    covering, packing = lo > 0, np.isfinite(hi)
    if (covering & packing).any():
        raise Refused("the model has rows bounded on both sides")
    if (hi[packing] < 0).any():
        raise Refused("the model has packing rows of negative capacity")
    # A packing row of capacity 0 forbids its variables.
    allowed = model.ub >= 1
    allowed[A.indices[(packing & (hi == 0))[row]]] = False
    packing &= hi > 0
    scale = np.ones(model.rows)
    scale[covering] = sign[covering] / lo[covering]
    scale[packing] = sign[packing] / hi[packing]
    scaled = csr_array((A.data * scale[row], A.indices, A.indptr), shape=A.shape)
    W = csr_array(scaled[np.flatnonzero(covering)])
    W.data = np.minimum(W.data, 1.0)
    P = csr_array(scaled[np.flatnonzero(packing)])
    allowed[P.indices[P.data > 1 + 1e-12]] = False
    return CoverForm(c=model.c, W=W, P=P, allowed=allowed)


def model_of(form: CoverForm) -> Model:
    """A cover form as a model, all of whose variables may be 1.

    Examples
    --------
    >>> W, P = csr_array([[0.5, 1.0, 0.5]]), csr_array([[1.0, 1.0, 0.0]])
    >>> model_of(CoverForm(c=np.ones(3), W=W, P=P, allowed=np.ones(3, dtype=np.bool_))).hi.tolist()
    [inf, 1.0]
    """
    covering, packing = form.W.shape[0], form.P.shape[0]
    return Model(
        c=form.c,
        A=csr_array(vstack([form.W, form.P], format="csr")),
        lo=np.concatenate([np.ones(covering), np.full(packing, -np.inf)]),
        hi=np.concatenate([np.full(covering, np.inf), np.ones(packing)]),
        ub=np.ones(len(form.c)),
        integer=np.ones(len(form.c), dtype=np.bool_),
        candidates=len(form.c),
    )
