"""The HiGHS inside SciPy, by way of `scipy.optimize.milp`: no start, no trace, but nothing to install."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import Any, ClassVar

from pscover.model import Model
from pscover.result import Answer, Observer, Settings, Status

from ._session import Session, without_variables


def load(model: Model) -> dict[str, Any]:
    """The model as the arguments of `scipy.optimize.milp`."""
    from scipy.optimize import Bounds, LinearConstraint
    from scipy.sparse import csc_array

    rows = [LinearConstraint(csc_array(model.A), model.lo, model.hi)] if model.rows else []
    return {"c": model.c, "constraints": rows, "bounds": Bounds(0, model.ub), "integrality": model.integer.astype(int)}


@dataclass(frozen=True, slots=True)
class Scipy:
    """`scipy.optimize.milp`: the solver of the paper (Adler et al. 2023). One thread, and the seed cannot be set."""

    name: ClassVar[str] = "scipy"
    exact: ClassVar[bool] = True
    isolated: ClassVar[bool] = True
    requires: ClassVar[tuple[str, ...]] = ()
    extra: ClassVar[str] = ""

    def refuses(self, model: Model) -> str | None:
        """`milp` takes every model with one objective."""
        return None

    def solve(self, model: Model, settings: Settings, observe: Observer) -> Answer:
        """Solve by branch and bound; only the end is reported."""
        session = Session(model, settings, observe)
        trivial = without_variables(session)
        if trivial is not None:
            return trivial
        from scipy.optimize import milp

        arguments = load(model)
        if session.start():
            return session.answer(Status.UNKNOWN)
        # `milp` empties the options it is given, so they are made for the call.
        limits = {"time_limit": session.left} if math.isfinite(session.left) else {}
        found = milp(**arguments, options={"mip_rel_gap": session.gap, **limits})
        nodes = getattr(found, "mip_node_count", None)
        return replace(_conclude(found, session), nodes=None if nodes is None else max(0, int(nodes)))


def _conclude(found: Any, session: Session) -> Answer:
    optimal, limit, infeasible = 0, 1, 2
    if found.status == infeasible:
        return session.answer(Status.INFEASIBLE)
    if found.x is not None:
        session.claimed(found.x)
    if found.mip_dual_bound is not None:
        session.bounded(found.mip_dual_bound + session.model.offset)
    if found.status == optimal and session.chosen is not None:
        if not session.model.integer.any():
            session.bounded(found.fun + session.model.offset)
        return session.answer(Status.OPTIMAL)
    message = "" if found.status == limit else str(found.message)
    return session.answer(Status.UNKNOWN, message, timed_out=found.status == limit)


backend = Scipy
