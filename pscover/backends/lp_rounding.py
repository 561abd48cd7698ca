"""Randomised rounding of the linear relaxation, altered until it covers: plans with a proven bound, fast."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import partial
from typing import Any, ClassVar

import numpy as np
from numpy.typing import NDArray

from pscover.model import Model, as_cover
from pscover.result import Answer, Observer, Settings, Status

from ._cover import Search, hopeless_rows, refusal, repair
from ._session import Session
from .highs import configure, load

FloatArray = NDArray[np.float64]

INTERIOR = 20_000
"""With more non-zeros than this the relaxation is solved by the interior-point method, without crossover."""


@dataclass(frozen=True, slots=True)
class LpRounding:
    """Solve the relaxation, then round, repair and prune many times.

    A trial takes each candidate i with probability min(1, s x_i), x the relaxation's optimum and s a scale drawn between 0
    and 2, the first trial those with x_i >= 1/2; then greedy choices fill what is short and reverse delete drops what is not
    needed (rounding with alteration: Kolliopoulos and Young 2005; Chekuri and Quanrud 2019, whose guarantees need the
    knapsack-cover inequalities that are left out here). The bound is recomputed from the duals, so it holds despite the
    engine's tolerances (Neumaier and Shcherbina 2004).

    Parameters
    ----------
    trials
        How often to round.
    moves
        Most repair moves a trial, where conflicts block.
    """

    name: ClassVar[str] = "lp-rounding"
    exact: ClassVar[bool] = False
    isolated: ClassVar[bool] = True
    requires: ClassVar[tuple[str, ...]] = ("highspy",)
    extra: ClassVar[str] = ""

    trials: int = 50
    moves: int = 1000

    def refuses(self, model: Model) -> str | None:
        """Anything but covering and packing rows over binaries with costs of at least 0."""
        return refusal(model)

    def solve(self, model: Model, settings: Settings, observe: Observer) -> Answer:
        """Bound by the relaxation, plans by rounding it; each improvement is reported."""
        session = Session(model, settings, observe)
        form = as_cover(model)
        if len(hopeless_rows(form)):
            return session.answer(Status.INFEASIBLE)
        session.start()
        blank = Search(form)
        _plan(blank.copy(), None, session)
        relaxed = _relax(session)
        if relaxed is None:
            return session.answer(Status.INFEASIBLE)
        x, bound = relaxed
        session.bounded(bound)
        rng = np.random.default_rng(settings.seed)
        for trial in range(self.trials):
            if session.is_proven() or session.over():
                break
            search = blank.copy()
            search.take(_rounded(x, trial, rng))
            worth = search.worth * _favour(x, trial, rng)
            if not _plan(search, worth, session) and repair(search, rng, self.moves, session.over):
                _plan(search, worth, session)
        return session.answer(Status.OPTIMAL if session.is_proven() else Status.UNKNOWN)


def _plan(search: Search, worth: FloatArray | None, session: Session) -> bool:
    """Complete, prune and report; whether every row is met."""
    if not search.complete(session.over, worth):
        return False
    search.reverse_delete()
    session.plan(search.chosen, search.cost + session.model.offset)
    return True


def _favour(x: FloatArray, trial: int, rng: np.random.Generator) -> FloatArray:
    """What to multiply each candidate's worth with: half of the trials trust the relaxation, half shun some at random."""
    if trial % 2 == 0:
        return x + rng.uniform(0.02, 0.2)
    shunned = rng.random(len(x)) < rng.uniform(0.0, 0.4)
    return np.where(shunned, 1e-6, rng.uniform(0.8, 1.0, len(x)))


def _rounded(x: FloatArray, trial: int, rng: np.random.Generator) -> NDArray[np.intp]:
    """Candidates to take, in the order in which they may: likely ones tend to come first."""
    if trial == 0:
        likely = np.flatnonzero(x >= 0.5)
        return likely[np.argsort(-x[likely], kind="stable")]
    scale = rng.uniform(0.0, 2.0)
    drawn = np.flatnonzero(rng.uniform(size=len(x)) < scale * x)
    return drawn[np.argsort(rng.exponential(size=len(drawn)) / x[drawn])]


def _relax(session: Session) -> tuple[FloatArray, float] | None:
    """The relaxation's point and a proven bound; None if it is infeasible. Without time for it, zeros and a weak bound."""
    from highspy import HighsModelStatus as Outcome

    model = session.model
    if not model.variables:
        return np.zeros(0), model.offset
    engine = load(replace(model, integer=np.zeros_like(model.integer)))
    # Half of the time at most, so that some is left for rounding.
    configure(engine, session.settings, session.left / 2)
    engine.cbSimplexInterrupt += partial(_interrupt, session)
    engine.cbIpmInterrupt += partial(_interrupt, session)
    if model.nonzeros > INTERIOR:
        # Several times as fast as simplex there, and a point inside the optimal face rounds as well as a corner.
        engine.setOptionValue("solver", "ipm")
        engine.setOptionValue("run_crossover", "off")
    engine.run()
    if engine.getModelStatus() not in (Outcome.kOptimal, Outcome.kTimeLimit, Outcome.kInterrupt):
        engine.setOptionValue("solver", "simplex")
        engine.run()
    if engine.getModelStatus() == Outcome.kInfeasible:
        return None
    solution = engine.getSolution()
    x = np.asarray(solution.col_value) if solution.value_valid else np.zeros(model.variables)
    bound = _dual_value(model, np.asarray(solution.row_dual)) if solution.dual_valid else -np.inf
    return np.clip(x, 0.0, 1.0), bound


def _interrupt(session: Session, event: Any) -> None:
    if session.over():
        event.data_in.user_interrupt = True


def _dual_value(model: Model, y: FloatArray) -> float:
    """What multipliers of the rows prove, offset included: valid for any multipliers, since x is bounded."""
    y = np.where(((y > 0) & ~np.isfinite(model.lo)) | ((y < 0) & ~np.isfinite(model.hi)), 0.0, y)
    reduced = model.c - model.A.T @ y
    rows = np.where(y > 0, model.lo, model.hi)
    by_rows = float((y[y != 0] * rows[y != 0]).sum())
    by_columns = float((np.minimum(reduced, 0.0) * model.ub).sum())
    slack = 1e-12 * (abs(by_rows) + abs(by_columns))
    return by_rows + by_columns - slack + model.offset


backend = LpRounding
