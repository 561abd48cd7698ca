"""Local search under row weights, clique-aware and compiled: the best plans in the least time, without a proof."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from pscover.model import CoverForm, Model, as_cover
from pscover.result import Answer, Observer, Settings, Status

from ._cover import dual_bound, hopeless_rows, refusal
from ._kernels import await_kernels, feasible_start, least_step, plain_plan
from ._session import Session

PATIENCE = 5_000
"""Without a limit on time or moves the search ends after this many moves a row that brought nothing."""


@dataclass(frozen=True, slots=True)
class LocalSearch:
    """Greedy choice, reverse delete, then drop, swap and cover under row weights (Gao, Weise and Li 2015).

    Rows that stay short weigh ever more, so that the search leaves every dead end. A candidate may push out those that it
    conflicts with; fractional entries count for what they take off a row's deficit. While the kernels are loaded (or, the
    first time ever, compiled) a greedy plan is computed without them. Models whose packing rows have room for several
    candidates get that plan only.

    Parameters
    ----------
    moves
        Most moves, which make the answer depend on nothing but model, seed and start; 0 for as long as the time lasts.
    """

    name: ClassVar[str] = "local-search"
    exact: ClassVar[bool] = False
    isolated: ClassVar[bool] = False
    requires: ClassVar[tuple[str, ...]] = ("numba",)
    extra: ClassVar[str] = "engine"

    moves: int = 0

    def refuses(self, model: Model) -> str | None:
        """Anything but covering and packing rows over binaries with costs of at least 0."""
        return refusal(model)

    def warm_up(self) -> None:
        """Begin to load the kernels, or to compile them."""
        from pscover.engine.warm import warming

        warming()

    def solve(self, model: Model, settings: Settings, observe: Observer) -> Answer:
        """Search until the plan is proven by a simple bound, the moves are used up, or the session is over."""
        from pscover.engine.warm import warming

        session = Session(model, settings, observe)
        form = as_cover(model)
        if len(hopeless_rows(form)):
            return session.answer(Status.INFEASIBLE)
        session.bounded(model.offset + dual_bound(form))
        start = None if settings.start is None else feasible_start(form, settings.start)
        if start is not None:
            session.plan(start, float(form.c[start].sum()) + model.offset)
        if not session.is_proven() and not session.over():
            if not warming().is_done:
                self._plain(form, session)
            self._hunt(form, session, start)
        return session.answer(Status.OPTIMAL if session.is_proven() else Status.UNKNOWN)

    def _plain(self, form: CoverForm, session: Session) -> None:
        plan = plain_plan(form, session)
        if plan is not None:
            session.plan(plan, float(form.c[plan].sum()) + session.model.offset)

    def _hunt(self, form: CoverForm, session: Session, start: np.ndarray | None) -> None:
        from pscover.engine.problem import problem_of, several

        if several(form) is not None:
            if session.chosen is None:
                self._plain(form, session)
            return
        problem, columns = problem_of(form)
        if session.is_proven() or not await_kernels(session):
            return
        from pscover.engine.hunt import FOREVER, Hunt

        hunt = Hunt(problem, session.settings.seed, least_step(problem.cost))
        if start is None:
            hunt.begin()
        else:
            hunt.resume(np.searchsorted(columns, start).astype(np.int32))
        endless = self.moves == 0 and session.settings.time == float("inf")
        while not session.over() and not session.is_proven():
            if hunt.turn(self.moves or FOREVER):
                plan = columns[hunt.plan]
                session.plan(plan, float(form.c[plan].sum()) + session.model.offset)
            elif (self.moves and hunt.moves >= self.moves) or (endless and hunt.idle > PATIENCE * (problem.rows + 4)):
                return


backend = LocalSearch
