"""SCIP by way of PySCIPOpt: branch, cut and price with starts, a trace and limits."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import Any, ClassVar

from pscover.model import Model
from pscover.result import Answer, Observer, Settings, Status

from ._session import FEASIBILITY, Session, start_of, without_variables


def load(model: Model) -> tuple[Any, list[Any]]:
    """A silent `pyscipopt.Model` and its variables, in order."""
    import pyscipopt

    engine = pyscipopt.Model()
    engine.hideOutput()
    kinds = ("C", "I")
    columns = zip(model.integer.tolist(), _finite(model.ub), model.c.tolist(), strict=True)
    x = [engine.addVar(vtype=kinds[whole], lb=0.0, ub=ub, obj=cost) for whole, ub, cost in columns]
    entries = zip(model.A.indices.tolist(), model.A.data.tolist(), strict=True)
    lo, hi = _finite(model.lo), _finite(model.hi)
    for j, count in enumerate((model.A.indptr[1:] - model.A.indptr[:-1]).tolist()):
        # Filled coefficient by coefficient: building an expression first takes twice as long.
        row = engine.addCons(pyscipopt.scip.ExprCons(pyscipopt.Expr(), lhs=lo[j], rhs=hi[j]))
        for _ in range(count):
            i, value = next(entries)
            engine.addConsCoeff(row, x[i], value)
    engine.addObjoffset(float(model.offset))
    return engine, x


def _finite(bounds: Any) -> list[float | None]:
    return [bound if math.isfinite(bound) else None for bound in bounds.tolist()]


@dataclass(frozen=True, slots=True)
class Scip:
    """SCIP (Bolusani et al. 2024) called through PySCIPOpt (Maher et al. 2016). One thread, whatever is asked for."""

    name: ClassVar[str] = "scip"
    exact: ClassVar[bool] = True
    isolated: ClassVar[bool] = True
    requires: ClassVar[tuple[str, ...]] = ("pyscipopt",)
    extra: ClassVar[str] = "scip"

    def refuses(self, model: Model) -> str | None:
        """SCIP takes every model with one objective."""
        return None

    def solve(self, model: Model, settings: Settings, observe: Observer) -> Answer:
        """Solve by branch and bound, each incumbent and bound reported."""
        session = Session(model, settings, observe)
        trivial = without_variables(session)
        if trivial is not None:
            return trivial
        engine, x = load(model)
        _offer(engine, x, session)
        if session.start():
            return session.answer(Status.UNKNOWN)
        _configure(engine, session)
        _watch(engine, x, session)
        engine.optimize()
        return replace(_conclude(engine, x, session), nodes=int(engine.getNTotalNodes()))


def _configure(engine: Any, session: Session) -> None:
    settings = session.settings
    engine.setParams(
        {
            "limits/time": min(session.left, 1e20),
            "limits/gap": settings.gap,
            "limits/absgap": 0.0,
            "randomization/randomseedshift": settings.seed,
            "numerics/feastol": FEASIBILITY,
        }
    )


def _offer(engine: Any, x: list[Any], session: Session) -> None:
    """Hand over the start; what it does not say of the other variables SCIP works out."""
    start = start_of(session.model, session.settings)
    if start is None:
        return
    whole = session.model.variables == session.model.candidates
    solution = engine.createSol() if whole else engine.createPartialSol()
    for variable, value in zip(x, start.tolist(), strict=False):
        engine.setSolVal(solution, variable, value)
    engine.addSol(solution)


def _watch(engine: Any, x: list[Any], session: Session) -> None:
    """Report incumbents and bounds, and interrupt when the session is over."""
    from pyscipopt import SCIP_EVENTTYPE as EVENT
    from pyscipopt import Eventhdlr

    # SCIP before 10 has no event for the bound: it is read off whenever a node is done.
    bound = getattr(EVENT, "DUALBOUNDIMPROVED", EVENT.NODESOLVED)
    events = (EVENT.BESTSOLFOUND, bound, EVENT.LPSOLVED)

    class Watch(Eventhdlr):  # type: ignore[misc]
        def eventinit(self) -> None:
            for event in events:
                self.model.catchEvent(event, self)

        def eventexit(self) -> None:
            for event in events:
                self.model.dropEvent(event, self)

        def eventexec(self, event: Any) -> None:
            if event.getType() == EVENT.BESTSOLFOUND:
                best = self.model.getBestSol()
                session.point([self.model.getSolVal(best, variable) for variable in x])
            if session.bounded(_proven(self.model)):
                self.model.interruptSolve()

    engine.includeEventhdlr(Watch(), "trace", "reports incumbents and bounds")


def _proven(engine: Any) -> float:
    bound = float(engine.getDualbound())
    return bound if abs(bound) < engine.infinity() else -math.inf


def _conclude(engine: Any, x: list[Any], session: Session) -> Answer:
    status = str(engine.getStatus())
    if status == "userinterrupt" and not session.over():
        # SCIP catches Ctrl-C itself.
        raise KeyboardInterrupt
    if status == "infeasible":
        return session.answer(Status.INFEASIBLE)
    if engine.getNSols():
        best = engine.getBestSol()
        session.claimed([engine.getSolVal(best, variable) for variable in x])
    session.bounded(_proven(engine))
    if status in ("optimal", "gaplimit") and session.chosen is not None:
        return session.answer(Status.OPTIMAL)
    ended = status in ("timelimit", "userinterrupt")
    return session.answer(Status.UNKNOWN, "" if ended else status, timed_out=status == "timelimit")


backend = Scip
