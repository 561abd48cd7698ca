"""A linear programme that is solved again and again, as rows and columns join it and rows leave it."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csc_array, csr_array

FloatArray = NDArray[np.float64]
LongArray = NDArray[np.int64]


class Programme:
    """Minimise c x subject to A x >= b, 0 <= x <= 1, by the dual simplex method of HiGHS, in this process.

    Each run begins where the last one ended.

    Parameters
    ----------
    cost, matrix, right
        c, A and b.

    Raises
    ------
    ImportError
        If the engine cannot be loaded: it is missing, or a library in this process rules it out.

    Examples
    --------
    >>> programme = Programme(np.ones(2), csr_array([[1.0, 0.5]]), np.ones(1))
    >>> programme.run(100, 1.0), programme.x.tolist(), programme.prices.tolist()
    (True, [1.0, 0.0], [1.0])
    >>> programme.join(csr_array([[0.0, 1.0]]), np.ones(1))
    >>> programme.run(100, 1.0), programme.x.tolist()
    (True, [0.5, 1.0])
    """

    def __init__(self, cost: FloatArray, matrix: csr_array, right: FloatArray) -> None:
        import highspy

        self._engine = highspy.Highs()
        for name, value in (("output_flag", False), ("presolve", "off"), ("solver", "simplex")):
            self._engine.setOptionValue(name, value)
        rows, columns = matrix.shape
        rowwise, sense = int(highspy.MatrixFormat.kRowwise), int(highspy.ObjSense.kMinimize)
        self._engine.passModel(
            *(columns, rows, matrix.nnz, rowwise, sense, 0.0, cost, np.zeros(columns), np.ones(columns), right),
            *(np.full(rows, np.inf), matrix.indptr, matrix.indices, matrix.data, np.zeros(columns, dtype=np.int32)),
        )
        self.has_failed = False

    def run(self, steps: int, seconds: float) -> bool:
        """Go on for so many steps, or so long; whether there is an optimum now. If none is to be found, it has failed."""
        import highspy

        self._engine.setOptionValue("simplex_iteration_limit", steps)
        self._engine.setOptionValue("time_limit", self._engine.getRunTime() + seconds)
        self._engine.run()
        status, known = self._engine.getModelStatus(), highspy.HighsModelStatus
        self.has_failed = status not in (known.kOptimal, known.kIterationLimit, known.kTimeLimit)
        return bool(status == known.kOptimal)

    @property
    def x(self) -> FloatArray:
        """The optimum, shape (columns,)."""
        return np.array(self._engine.getSolution().col_value, dtype=np.float64)

    @property
    def prices(self) -> FloatArray:
        """What the rows' right sides are worth, never negative, shape (rows,)."""
        return np.maximum(np.array(self._engine.getSolution().row_dual, dtype=np.float64), 0.0)

    @property
    def slack(self) -> LongArray:
        """The rows that could leave without a change."""
        import highspy

        basic = highspy.HighsBasisStatus.kBasic
        marks = self._engine.getBasis().row_status
        return np.array([row for row, mark in enumerate(marks) if mark == basic], dtype=np.int64)

    def join(self, matrix: csr_array, right: FloatArray) -> None:
        """Add rows A x >= b."""
        rows = matrix.shape[0]
        begin = matrix.indptr[:-1].astype(np.int32)
        self._engine.addRows(
            rows, right, np.full(rows, np.inf), matrix.nnz, begin, matrix.indices.astype(np.int32), matrix.data
        )

    def widen(self, cost: FloatArray, matrix: csc_array) -> None:
        """Add columns."""
        columns = matrix.shape[1]
        begin = matrix.indptr[:-1].astype(np.int32)
        bounds = (np.zeros(columns), np.ones(columns))
        self._engine.addCols(columns, cost, *bounds, matrix.nnz, begin, matrix.indices.astype(np.int32), matrix.data)

    def leave(self, rows: LongArray) -> None:
        """Take rows out."""
        self._engine.deleteRows(len(rows), rows.astype(np.int32))
