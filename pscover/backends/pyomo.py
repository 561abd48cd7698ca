"""Pyomo in linear-expression form, solved by HiGHS: what the modelling layer adds."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np

from pscover.model import Model
from pscover.result import Answer, Observer, Settings, Status

from ._session import Session, without_variables
from .highs import options, release_threads


def load(model: Model) -> Any:
    """The model as a `pyomo.environ.ConcreteModel` with variables `x`, constraints `rows` and an objective `cost`."""
    import pyomo.environ as pyo
    from pyomo.common.gc_manager import PauseGC
    from pyomo.core.expr import LinearExpression

    A = model.A
    kinds = (pyo.Reals, pyo.Integers)
    lo, hi, ub = (_finite(bounds) for bounds in (model.lo, model.hi, model.ub))
    # Hundreds of thousands of small objects make the garbage collector the slowest part of the build.
    with PauseGC():
        built = pyo.ConcreteModel()
        built.x = pyo.Var(
            range(model.variables),
            domain=lambda _, i: kinds[bool(model.integer[i])],
            bounds=lambda _, i: (0.0, ub[i]),
        )
        x = np.empty(model.variables, dtype=object)
        x[:] = list(built.x.values())
        terms, entries, spans = x[A.indices].tolist(), A.data.tolist(), A.indptr.tolist()

        def row(_: Any, j: int) -> Any:
            span = slice(spans[j], spans[j + 1])
            if span.start == span.stop:
                return _empty_row(pyo, lo[j], hi[j])
            body = LinearExpression(constant=0.0, linear_coefs=entries[span], linear_vars=terms[span])
            return (lo[j], body, hi[j])

        built.rows = pyo.Constraint(range(model.rows), rule=row)
        cost = LinearExpression(constant=float(model.offset), linear_coefs=model.c.tolist(), linear_vars=x.tolist())
        built.cost = pyo.Objective(expr=cost)
    return built


def _empty_row(pyo: Any, lo: float | None, hi: float | None) -> Any:
    held = (lo is None or lo <= 0) and (hi is None or hi >= 0)
    return pyo.Constraint.Feasible if held else pyo.Constraint.Infeasible


def _finite(bounds: Any) -> list[float | None]:
    return [float(bound) if math.isfinite(bound) else None for bound in bounds]


@dataclass(frozen=True, slots=True)
class Pyomo:
    """Pyomo (Hart, Watson and Woodruff 2011) with HiGHS underneath: no start, and only the end is reported."""

    name: ClassVar[str] = "pyomo"
    exact: ClassVar[bool] = True
    isolated: ClassVar[bool] = True
    requires: ClassVar[tuple[str, ...]] = ("pyomo",)
    extra: ClassVar[str] = "pyomo"

    def refuses(self, model: Model) -> str | None:
        """Pyomo with HiGHS takes every model with one objective."""
        return None

    def solve(self, model: Model, settings: Settings, observe: Observer) -> Answer:
        """Build, solve by branch and bound; only the end is reported."""
        session = Session(model, settings, observe)
        trivial = without_variables(session)
        if trivial is not None:
            return trivial
        from pyomo.contrib.solver.solvers.highs import Highs

        try:
            built = load(model)
        except ValueError:
            # Pyomo raises on a row that is infeasible by itself, before any engine sees it.
            if not _has_impossible_row(model):
                raise
            return session.answer(Status.INFEASIBLE)
        if session.start():
            return session.answer(Status.UNKNOWN)
        release_threads()
        asked = options(settings, session.left)
        engine = Highs()
        found = engine.solve(built, solver_options=asked, load_solutions=False, raise_exception_on_nonoptimal_result=False)
        return _conclude(built, found, session)


def _has_impossible_row(model: Model) -> bool:
    empty = np.diff(model.A.indptr) == 0
    return bool((empty & ((model.lo > 0) | (model.hi < 0))).any())


def _conclude(built: Any, found: Any, session: Session) -> Answer:
    from pyomo.contrib.solver.common.results import SolutionStatus, TerminationCondition

    ended = found.termination_condition
    if ended == TerminationCondition.provenInfeasible:
        return session.answer(Status.INFEASIBLE)
    if found.solution_status in (SolutionStatus.optimal, SolutionStatus.feasible):
        found.solution_loader.load_vars()
        # Variables in no row and without a cost never reach the engine.
        session.claimed([variable.value or 0.0 for variable in built.x.values()])
    unbounded = (TerminationCondition.unbounded, TerminationCondition.infeasibleOrUnbounded)
    if found.objective_bound is not None and ended not in unbounded:
        session.bounded(found.objective_bound)
    if found.solution_status == SolutionStatus.optimal and session.chosen is not None:
        return session.answer(Status.OPTIMAL)
    limit = ended == TerminationCondition.maxTimeLimit
    return session.answer(Status.UNKNOWN, "" if limit else str(ended), timed_out=limit)


backend = Pyomo
