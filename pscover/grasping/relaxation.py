"""Small linear programmes and their prices, within this process."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csc_array

if TYPE_CHECKING:
    import highspy

FloatArray = NDArray[np.float64]


@dataclass(frozen=True, slots=True, kw_only=True)
class Basis:
    """Where the simplex method ended: the engine's marks of columns and rows."""

    columns: list[Any]
    rows: list[Any]

    def without(self, rows: NDArray[np.intp]) -> Basis:
        """Of the programme without some of the rows."""
        gone = set(rows.tolist())
        return Basis(columns=self.columns, rows=[mark for row, mark in enumerate(self.rows) if row not in gone])


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Optimum:
    """An optimum of a linear programme: its value, the variables x, the prices y >= 0 of the rows, the basis if known."""

    value: float
    x: FloatArray
    prices: FloatArray
    basis: Basis | None


def minimise(cost: FloatArray, matrix: csc_array, right: FloatArray, basis: Basis | None = None) -> Optimum | None:
    """Minimise c x subject to A x <= b, x >= 0; None if there is no optimum.

    By HiGHS: through its own interface, or, where that cannot be loaded (OR-tools in the same process rules it out), through
    SciPy, which is slower to import and takes no basis.

    Parameters
    ----------
    cost, matrix, right
        c, A and b.
    basis
        To begin with: that of a programme which had the first of the columns and of the rows.

    Examples
    --------
    >>> found = minimise(np.array([1.0, 1.0]), csc_array([[-2.0, -1.0]]), np.array([-4.0]))
    >>> found.value, found.x.tolist(), found.prices.tolist()
    (2.0, [2.0, 0.0], [0.5])
    """
    try:
        import highspy
    except ImportError:
        return _by_scipy(cost, matrix, right)
    engine = highspy.Highs()
    engine.setOptionValue("output_flag", False)
    rows, columns = matrix.shape
    columnwise, sense = int(highspy.MatrixFormat.kColwise), int(highspy.ObjSense.kMinimize)
    engine.passModel(
        *(columns, rows, matrix.nnz, columnwise, sense, 0.0),
        *(cost, np.zeros(columns), np.full(columns, np.inf)),
        *(np.full(rows, -np.inf), right, matrix.indptr, matrix.indices, matrix.data, np.zeros(columns, dtype=np.int32)),
    )
    if basis is not None:
        engine.setBasis(_extended(basis, rows, columns))
    engine.run()
    if engine.getModelStatus() != highspy.HighsModelStatus.kOptimal:
        return None
    solution, reached = engine.getSolution(), engine.getBasis()
    return Optimum(
        value=float(engine.getInfo().objective_function_value),
        x=np.array(solution.col_value, dtype=np.float64),
        prices=np.maximum(-np.array(solution.row_dual, dtype=np.float64), 0.0),
        basis=Basis(columns=reached.col_status, rows=reached.row_status),
    )


def _extended(basis: Basis, rows: int, columns: int) -> highspy.HighsBasis:
    """New columns at zero, new rows free."""
    import highspy

    state, begun = highspy.HighsBasisStatus, highspy.HighsBasis()
    begun.col_status = basis.columns + [state.kLower] * (columns - len(basis.columns))
    begun.row_status = basis.rows + [state.kBasic] * (rows - len(basis.rows))
    return begun


def _by_scipy(cost: FloatArray, matrix: csc_array, right: FloatArray) -> Optimum | None:
    from scipy.optimize import linprog

    found = linprog(cost, A_ub=matrix, b_ub=right, method="highs-ds")
    if found.status != 0:
        return None
    prices = np.maximum(-found.ineqlin.marginals, 0.0)
    return Optimum(value=float(found.fun), x=found.x, prices=prices, basis=None)
