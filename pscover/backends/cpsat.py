"""CP-SAT by way of OR-tools: strong on plans, weak on bounds.

OR-tools and highspy cannot be loaded into one process: this module must not import highspy, not even indirectly.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np
from numpy.typing import NDArray

from pscover.model import Model
from pscover.result import Answer, Observer, Settings, Status

from ._session import Session, start_of, without_variables

IntegerArray = NDArray[np.int64]

SCALE = 20
"""Coefficients are kept to 2^-SCALE of the unit. With 2^30 and 2^40, OR-tools 9.15 called 4 and 7 of 400 small plans optimal
that were up to 65 % too dear, though the optimum satisfies the integer rows; with 2^24 and less, none."""
ROOM = 36
"""No row may add up to more than 2^ROOM, for the same reason."""
COST_SCALE = 40
"""Costs are kept to 2^-COST_SCALE of the unit: there large numbers do no harm."""
COST_ROOM = 52
"""Costs may not add up to more than 2^COST_ROOM."""


@dataclass(frozen=True, slots=True, eq=False)
class Scaled:
    """A model in integers that every feasible point of the real one satisfies, with an objective that is never higher.

    Parameters
    ----------
    coefficients
        In the order of the model's entries, once for lower bounds (rounded up) and once for upper bounds (rounded down).
    lo, hi
        Row bounds, rounded outwards.
    cost
        Rounded down.
    unit
        By which the cost was multiplied.
    """

    coefficients: tuple[IntegerArray, IntegerArray]
    lo: IntegerArray
    hi: IntegerArray
    cost: IntegerArray
    unit: float


LOWEST, HIGHEST = -(2**62), 2**62


def scaled(model: Model) -> Scaled:
    """The model in integers: a relaxation, so that bounds and infeasibility carry over.

    Each row is multiplied by a power of two of at most 2^20, smaller where it would add up to more than 2^36; rows of whole
    numbers stay as they are. What rounding lets in misses a row scaled to 1 by at most 2^-20 for each chosen candidate;
    `solve` cuts it off.
    """
    A = model.A
    row = np.repeat(np.arange(model.rows), np.diff(A.indptr))
    total = np.bincount(row, np.abs(A.data) * model.ub[A.indices], model.rows).astype(np.float64)
    for bound in (model.lo, model.hi):
        total = np.maximum(total, np.where(np.isfinite(bound), np.abs(bound), 0.0))
    whole = np.bincount(row, A.data != np.round(A.data), model.rows) == 0
    factor = np.where(whole & (total < 2.0**ROOM), 1.0, _power(total, ROOM, SCALE))
    lo = np.where(np.isfinite(model.lo), np.floor(model.lo * factor), LOWEST)
    hi = np.where(np.isfinite(model.hi), np.ceil(model.hi * factor), HIGHEST)
    lo = np.where(whole & np.isfinite(model.lo), np.ceil(model.lo * factor - 1e-9), lo)
    hi = np.where(whole & np.isfinite(model.hi), np.floor(model.hi * factor + 1e-9), hi)
    entries = A.data * factor[row]
    spent = float(np.abs(model.c) @ model.ub)
    unit = 1.0 if (model.c == np.round(model.c)).all() and spent < 2.0**COST_ROOM else _cost_unit(spent)
    return Scaled(
        coefficients=(np.ceil(entries).astype(np.int64), np.floor(entries).astype(np.int64)),
        lo=lo.astype(np.int64),
        hi=hi.astype(np.int64),
        cost=np.floor(model.c * unit).astype(np.int64),
        unit=unit,
    )


def _cost_unit(spent: float) -> float:
    return float(_power(np.array([spent]), COST_ROOM, COST_SCALE)[0])


def _power(total: NDArray[np.float64], room: int, scale: int) -> NDArray[np.float64]:
    """The power of two, at most 2^scale, to multiply something with that adds up to `total` and may to 2^room."""
    exponent = np.floor(room - np.log2(np.maximum(total, 1e-300)))
    power: NDArray[np.float64] = np.exp2(np.minimum(exponent, scale))
    return power


def load(model: Model) -> tuple[Any, float]:
    """The model as a `CpModel`, and the unit by which its objective is multiplied."""
    from ortools.sat.python import cp_model

    built, whole = cp_model.CpModel(), scaled(model)
    # Filling the message itself takes a fifth of the time of building expressions.
    proto = built.proto
    for ub in np.floor(model.ub).astype(np.int64).tolist():
        proto.variables.add().domain.extend((0, ub))
    columns, spans = model.A.indices.tolist(), model.A.indptr.tolist()
    upward, downward = whole.coefficients[0].tolist(), whole.coefficients[1].tolist()
    for j, (lo, hi) in enumerate(zip(whole.lo.tolist(), whole.hi.tolist(), strict=True)):
        span = slice(spans[j], spans[j + 1])
        exact = upward[span] == downward[span]
        if exact:
            _row(proto, columns[span], upward[span], lo, hi)
            continue
        if lo > LOWEST:
            _row(proto, columns[span], upward[span], lo, HIGHEST)
        if hi < HIGHEST:
            _row(proto, columns[span], downward[span], LOWEST, hi)
    proto.objective.vars.extend(range(model.variables))
    proto.objective.coeffs.extend(whole.cost.tolist())
    return built, whole.unit


def _row(proto: Any, columns: list[int], coefficients: list[int], lo: int, hi: int) -> None:
    linear = proto.constraints.add().linear
    linear.vars.extend(columns)
    linear.coeffs.extend(coefficients)
    linear.domain.extend((lo, hi))


@dataclass(frozen=True, slots=True)
class Cpsat:
    """CP-SAT (Perron, Didier and Gay 2023) of OR-tools, on the model scaled to integers.

    Costs that are no whole numbers are rounded down to multiples of 2^-40 (coarser where they add up to more than 4096),
    so the bound holds for the real costs, and the plan may be worse than the best by that rounding.
    """

    name: ClassVar[str] = "cpsat"
    exact: ClassVar[bool] = True
    isolated: ClassVar[bool] = True
    requires: ClassVar[tuple[str, ...]] = ("ortools",)
    extra: ClassVar[str] = "cpsat"

    def refuses(self, model: Model) -> str | None:
        """Variables that are continuous or unbounded."""
        continuous = int((~model.integer).sum())
        if continuous:
            return f"CP-SAT takes integer variables only, and the model has {continuous} continuous ones"
        if (model.ub > 2.0**31).any():
            return "CP-SAT takes bounded variables only, and the model has unbounded ones"
        return None

    def solve(self, model: Model, settings: Settings, observe: Observer) -> Answer:
        """Solve by lazy clause generation, each plan and bound reported."""
        session = Session(model, settings, observe)
        trivial = without_variables(session)
        if trivial is not None:
            return trivial
        from ortools.sat.python import cp_model

        built, unit = load(model)
        _offer(built, model, settings)
        if session.start():
            return session.answer(Status.UNKNOWN)
        engine = cp_model.CpSolver()
        _configure(engine.parameters, session)

        class Trace(cp_model.CpSolverSolutionCallback):  # type: ignore[misc]
            def on_solution_callback(self) -> None:
                if session.point(list(self.response_proto.solution)):
                    engine.stop_search()

        def bounded(value: float) -> None:
            if session.bounded(value / unit + model.offset):
                engine.stop_search()

        engine.best_bound_callback = bounded
        status = engine.solve(built, Trace())
        return _conclude(engine, engine.status_name(status), unit, session)


def _offer(built: Any, model: Model, settings: Settings) -> None:
    start = start_of(model, settings)
    if start is not None:
        built.proto.solution_hint.vars.extend(range(model.candidates))
        built.proto.solution_hint.values.extend(start.astype(np.int64).tolist())


def _configure(parameters: Any, session: Session) -> None:
    settings = session.settings
    if math.isfinite(session.left):
        parameters.max_time_in_seconds = session.left
    parameters.num_workers = settings.threads
    parameters.random_seed = settings.seed
    parameters.relative_gap_limit = session.gap
    parameters.absolute_gap_limit = 0.0
    parameters.log_search_progress = False
    # Ctrl-C stays Python's.
    parameters.catch_sigint_signal = False


def _conclude(engine: Any, status: str, unit: float, session: Session) -> Answer:
    if status == "INFEASIBLE":
        return session.answer(Status.INFEASIBLE)
    if status in ("OPTIMAL", "FEASIBLE"):
        session.claimed(list(engine.response_proto.solution))
    if status in ("OPTIMAL", "FEASIBLE", "UNKNOWN"):
        session.bounded(engine.best_objective_bound / unit + session.model.offset)
    if status == "OPTIMAL" and session.chosen is not None:
        return session.answer(Status.OPTIMAL)
    limit = status in ("FEASIBLE", "UNKNOWN")
    return session.answer(Status.UNKNOWN, "" if limit else f"CP-SAT: {status}", timed_out=limit)


backend = Cpsat
