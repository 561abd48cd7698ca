"""CVXPY in matrix form, solved by HiGHS: what the modelling layer adds."""

from __future__ import annotations

import warnings
from dataclasses import dataclass, replace
from typing import Any, ClassVar

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csc_array

from pscover.model import Model
from pscover.result import Answer, Observer, Settings, Status

from ._session import Session, without_variables
from .highs import options, release_threads

FloatArray = NDArray[np.float64]


def load(model: Model) -> Any:
    """The model as a `cvxpy.Problem` with a vector of integer and one of continuous variables, as far as there are any."""
    import cvxpy

    whole, split = np.flatnonzero(model.integer), np.flatnonzero(~model.integer)
    parts = []
    if len(whole):
        parts.append((cvxpy.Variable(len(whole), name="integer", integer=True, bounds=[0, model.ub[whole]]), whole))
    if len(split):
        parts.append((cvxpy.Variable(len(split), name="continuous", bounds=[0, model.ub[split]]), split))
    equal = model.lo == model.hi
    below, above = np.isfinite(model.lo) & ~equal, np.isfinite(model.hi) & ~equal
    rows = []
    if equal.any():
        rows.append(_times(model, equal, parts) == model.lo[equal])
    if below.any():
        rows.append(_times(model, below, parts) >= model.lo[below])
    if above.any():
        rows.append(_times(model, above, parts) <= model.hi[above])
    return cvxpy.Problem(cvxpy.Minimize(sum(model.c[columns] @ part for part, columns in parts)), rows)


def _times(model: Model, rows: NDArray[np.bool_], parts: list[tuple[Any, NDArray[np.intp]]]) -> Any:
    A = model.A[np.flatnonzero(rows)]
    if len(parts) == 1:
        return A @ parts[0][0]
    by_column = csc_array(A)
    return sum(by_column[:, columns] @ part for part, columns in parts)


def _point(problem: Any, model: Model) -> FloatArray | None:
    """The values of all variables in the model's order, or None if CVXPY has none."""
    x = np.zeros(model.variables)
    for variable in problem.variables():
        if variable.value is None:
            return None
        x[model.integer if variable.name() == "integer" else ~model.integer] = variable.value
    return x


@dataclass(frozen=True, slots=True)
class Cvxpy:
    """CVXPY (Diamond and Boyd 2016) with HiGHS underneath: no start, and only the end is reported."""

    name: ClassVar[str] = "cvxpy"
    exact: ClassVar[bool] = True
    isolated: ClassVar[bool] = True
    requires: ClassVar[tuple[str, ...]] = ("cvxpy",)
    extra: ClassVar[str] = "cvxpy"

    def refuses(self, model: Model) -> str | None:
        """CVXPY with HiGHS takes every model with one objective."""
        return None

    def solve(self, model: Model, settings: Settings, observe: Observer) -> Answer:
        """Compile, solve by branch and bound; only the end is reported."""
        session = Session(model, settings, observe)
        trivial = without_variables(session)
        if trivial is not None:
            return trivial
        import cvxpy

        problem = load(model)
        if session.start():
            return session.answer(Status.UNKNOWN)
        release_threads()
        asked = options(replace(settings, gap=session.gap), session.left)
        try:
            with warnings.catch_warnings():
                # A limit on time makes CVXPY warn that the solution may be inaccurate; the status says the same.
                warnings.simplefilter("ignore", UserWarning)
                problem.solve(solver=cvxpy.HIGHS, verbose=False, ignore_dpp=True, **asked)
        except cvxpy.SolverError as error:
            return session.answer(Status.UNKNOWN, str(error))
        return _conclude(problem, session)


def _conclude(problem: Any, session: Session) -> Answer:
    import cvxpy

    status = problem.status
    if status == cvxpy.INFEASIBLE:
        return session.answer(Status.INFEASIBLE)
    x = _point(problem, session.model)
    if x is not None:
        # At a limit without a plan HiGHS' zeros arrive here as if they were one.
        session.claimed(x)
    discrete = session.model.integer.any()
    bound = getattr(problem.solver_stats.extra_stats, "mip_dual_bound", -np.inf) if problem.solver_stats else -np.inf
    if discrete:
        session.bounded(bound + session.model.offset)
    if status == cvxpy.OPTIMAL and session.chosen is not None:
        if not discrete:
            session.bounded(problem.value + session.model.offset)
        return session.answer(Status.OPTIMAL)
    limit = status == cvxpy.settings.USER_LIMIT
    return session.answer(Status.UNKNOWN, "" if limit else str(status), timed_out=limit)


backend = Cvxpy
