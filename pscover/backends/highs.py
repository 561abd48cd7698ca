"""HiGHS by way of highspy: branch and bound, with starts, a trace and a limit on time."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any, ClassVar

import numpy as np
from numpy.typing import NDArray

from pscover.model import Model
from pscover.result import Answer, Observer, Settings, Status

from ._session import FEASIBILITY, Session, start_of, violation, without_variables


def load(model: Model) -> Any:
    """A silent `highspy.Highs` that holds the model, passed in one call."""
    import highspy

    engine = highspy.Highs()
    engine.setOptionValue("output_flag", False)
    zeros = np.zeros(model.variables)
    rowwise, minimise = int(highspy.MatrixFormat.kRowwise), int(highspy.ObjSense.kMinimize)
    shape = (model.variables, model.rows, model.nonzeros, rowwise, minimise, float(model.offset))
    columns = (model.c, zeros, model.ub)
    rows = (model.lo, model.hi, model.A.indptr, model.A.indices, model.A.data)
    engine.passModel(*shape, *columns, *rows, model.integer.astype(np.int32))
    return engine


def options(settings: Settings, left: float) -> dict[str, Any]:
    """The settings as HiGHS names them; `left` are the seconds left."""
    return {
        "threads": settings.threads,
        "random_seed": settings.seed,
        "mip_rel_gap": settings.gap,
        "mip_abs_gap": 0.0,
        "mip_feasibility_tolerance": FEASIBILITY,
        "primal_feasibility_tolerance": FEASIBILITY,
        "time_limit": left,
    }


def release_threads() -> None:
    """Forget HiGHS' pool of threads, one a process: it refuses to run with another number of them than it has."""
    import highspy

    highspy.Highs.resetGlobalScheduler(True)


def configure(engine: Any, settings: Settings, left: float) -> None:
    """Hand over what the settings ask for; `left` are the seconds left."""
    release_threads()
    for name, value in options(settings, left).items():
        engine.setOptionValue(name, value)


@dataclass(frozen=True, slots=True)
class Highs:
    """HiGHS (Huangfu and Hall 2018; https://highs.dev) called through its own Python interface."""

    name: ClassVar[str] = "highs"
    exact: ClassVar[bool] = True
    isolated: ClassVar[bool] = True
    requires: ClassVar[tuple[str, ...]] = ("highspy",)
    extra: ClassVar[str] = ""

    def refuses(self, model: Model) -> str | None:
        """HiGHS takes every model with one objective."""
        return None

    def solve(self, model: Model, settings: Settings, observe: Observer) -> Answer:
        """Solve by branch and bound, each incumbent and bound reported."""
        session = Session(model, settings, observe)
        trivial = without_variables(session)
        if trivial is not None:
            return trivial
        engine = load(model)
        start = _complete(session)
        configure(engine, settings, session.left)
        if start is not None:
            session.point(start)
            _offer(engine, start)
        if session.over():
            return session.answer(Status.UNKNOWN)
        _watch(engine, session)
        engine.run()
        return replace(_conclude(engine, session), nodes=max(0, int(engine.getInfo().mip_node_count)))


def _complete(session: Session) -> NDArray[np.float64] | None:
    """The start with the best values of the other variables, or None if it is no point of the model.

    HiGHS would complete a start by itself, but reports the bounds of that smaller problem as if they were the model's.
    """
    model, settings = session.model, session.settings
    chosen = start_of(model, settings)
    if chosen is None:
        return None
    if model.variables > model.candidates:
        engine = load(model)
        configure(engine, replace(settings, gap=0.0, start=None), session.left / 10)
        first = np.arange(model.candidates, dtype=np.int32)
        engine.changeColsBounds(model.candidates, first, chosen, chosen)
        engine.run()
        if not engine.getSolution().value_valid:
            return None
        chosen = np.asarray(engine.getSolution().col_value)
    return chosen if violation(model, chosen) <= FEASIBILITY else None


def _offer(engine: Any, point: NDArray[np.float64]) -> None:
    import highspy

    solution = highspy.HighsSolution()
    solution.col_value = point.tolist()
    engine.setSolution(solution)


def _watch(engine: Any, session: Session) -> None:
    """Report incumbents and bounds, and interrupt when the session is over."""

    def improved(event: Any) -> None:
        if session.point(event.data_out.mip_solution):
            event.data_in.user_interrupt = True

    def polled(event: Any) -> None:
        if session.bounded(event.data_out.mip_dual_bound):
            event.data_in.user_interrupt = True

    def ticked(event: Any) -> None:
        if session.over():
            event.data_in.user_interrupt = True

    engine.cbMipImprovingSolution += improved
    engine.cbMipInterrupt += polled
    engine.cbSimplexInterrupt += ticked
    engine.cbIpmInterrupt += ticked


def _conclude(engine: Any, session: Session) -> Answer:
    from highspy import HighsModelStatus as Outcome

    outcome = engine.getModelStatus()
    if outcome == Outcome.kUnboundedOrInfeasible:
        # Presolve cannot tell which; the solver itself can.
        engine.setOptionValue("presolve", "off")
        engine.setOptionValue("time_limit", session.left)
        engine.run()
        outcome = engine.getModelStatus()
    ended = ("kTimeLimit", "kInterrupt", "kHighsInterrupt")
    message = "" if outcome.name in ended else str(engine.modelStatusToString(outcome))
    if outcome == Outcome.kInfeasible:
        return session.answer(Status.INFEASIBLE)
    info, solution = engine.getInfo(), engine.getSolution()
    if solution.value_valid:
        session.claimed(solution.col_value)
    if outcome == Outcome.kOptimal and session.chosen is not None:
        discrete = bool(session.model.integer.any())
        session.bounded(info.mip_dual_bound if discrete else info.objective_function_value)
        return session.answer(Status.OPTIMAL)
    if session.model.integer.any():
        session.bounded(info.mip_dual_bound)
    return session.answer(Status.UNKNOWN, message, timed_out=outcome == Outcome.kTimeLimit)


backend = Highs
