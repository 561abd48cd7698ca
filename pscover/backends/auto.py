"""The default engine: presolve, independent blocks, small ones exact, large ones by search and bound side by side."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from time import perf_counter
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_array

from pscover import isolate
from pscover.certificate import Certificate, refutation
from pscover.clock import Clock
from pscover.errors import Refused
from pscover.model import CoverForm, Model, as_cover
from pscover.presolve import presolve
from pscover.presolve.reduced import Outcome
from pscover.result import Answer, Observer, Progress, Settings, Status

from ._course import Course
from ._cover import Search, hopeless_rows
from ._kernels import are_loaded_within, plain_plan
from ._opening import SMALL, Opening
from ._session import Session

IntArray = NDArray[np.int32]

LARGE = 2_000
"""Entries of a form from which on plans are looked for before presolve."""
LOADING = 0.3
"""The part of the time that loading kernels from disk may take before a greedy plan is made without them."""
AFFORDED = 1.2e-5
"""Seconds an entry that must be left for a large form to be taken apart at once: some three times what small parts take."""
PRESOLVE = 0.1
"""The part of the time that presolve may take."""


@dataclass(frozen=True, slots=True)
class Auto:
    """Presolve; split; enumerate small blocks; search, bound and fix the others in turn; prove what is left by HiGHS.

    Large forms begin with an opening: multipliers from pricing, and searches among the candidates that they favour; with
    little time there is nothing else. Then local search under row weights finds plans, a subgradient method raises the
    bound, reduced costs leave candidates out, and once neither moves, HiGHS gets what is left, with the best plan as its
    start and part of the time; afterwards the search goes on, and HiGHS solves parts of its plans. Models that are not
    covering and packing rows over binaries go to HiGHS as they are, and so do those whose packing rows have room for
    several candidates, with a greedy start.

    Parameters
    ----------
    share
        The part of the time that is left, once search and bound have settled, that branch and bound may take; less where
        several candidates must work together.
    """

    name: ClassVar[str] = "auto"
    exact: ClassVar[bool] = True
    isolated: ClassVar[bool] = False
    requires: ClassVar[tuple[str, ...]] = ("numba",)
    extra: ClassVar[str] = "engine"

    share: float = 0.5

    def refuses(self, model: Model) -> str | None:
        """Every model with one objective is taken."""
        return None

    def warm_up(self) -> None:
        """Begin to load the kernels, or to compile them."""
        from pscover.engine.warm import warming

        warming()

    def solve(self, model: Model, settings: Settings, observe: Observer) -> Answer:
        """Solve to proven optimality, or as far as the time allows."""
        session = Session(model, settings, observe)
        session.start()
        try:
            form = as_cover(model)
        except Refused:
            return _by_highs(session, settings.start)
        hopeless = hopeless_rows(form)
        if len(hopeless):
            return replace(session.answer(Status.INFEASIBLE), certificate=refutation(form.W, [hopeless[:1].tolist()]))
        answer, tried = self._at_once(form, session)
        if answer is not None:
            return answer
        opening = _opening(form, session)
        if opening is not None and (session.over() or session.is_proven() or not opening.follows):
            answer = session.answer(Status.OPTIMAL if session.is_proven() else Status.UNKNOWN)
            best = opening if tried is None or opening.pricing.bound >= tried.bound else tried
            return replace(answer, certificate=best.certificate())
        reduced = presolve(form, over=_for_at_most(PRESOLVE * session.left, session))
        if reduced.status is Outcome.INFEASIBLE:
            return replace(session.answer(Status.INFEASIBLE), certificate=_refuted(form, reduced.infeasible_row))
        from pscover.engine.problem import several

        if several(reduced.form) is not None:
            plan = plain_plan(form, session)
            if plan is not None:
                session.plan(plan, float(form.c[plan].sum()) + model.offset)
            return _by_highs(session, settings.start if session.chosen is None else tuple(session.chosen.tolist()))
        course = Course(form, reduced, session, self.share)
        if opening is not None:
            course.adopt_multipliers(opening.pricing.multipliers)
        answer = course.answer()
        if tried is None or answer.status is Status.INFEASIBLE or course.bound >= tried.bound:
            return answer
        return replace(answer, certificate=tried.certificate())

    def _at_once(self, form: CoverForm, session: Session) -> tuple[Answer | None, Course | None]:
        """The answer to a form so small, or that falls into parts so small, that presolve would take longer than proofs.

        Where there is none, what was found on the way.
        """
        from pscover.engine.problem import several
        from pscover.engine.unreduced import without_replaced
        from pscover.engine.warm import warming

        is_large = form.W.nnz > SMALL
        if not warming().is_done or several(form) is not None or (is_large and session.left < AFFORDED * form.W.nnz):
            return None, None
        course = Course(form, without_replaced(form), session, self.share)
        if not is_large:
            return course.at_once(), course
        return (course.answer(), course) if course.falls_apart else (None, None)


def _refuted(form: CoverForm, row: int | None) -> Certificate | None:
    """A certificate that a row cannot be met together with those that it shares cliques with, or with all others."""
    from pscover.engine.certify import refuted

    if row is None:
        return None
    W = csr_array(form.W)
    mine = np.zeros(len(form.c))
    mine[W.indices[W.indptr[row] : W.indptr[row + 1]]] = 1.0
    near = np.flatnonzero(W @ (mine + form.P.T @ (form.P @ mine)))
    return refuted(form, np.array([row, *near[near != row]], dtype=np.int64))


def _opening(form: CoverForm, session: Session) -> Opening | None:
    """Plans of a large form before anything that may take long; by numpy alone where kernels cannot be used."""
    from pscover.engine.problem import several
    from pscover.engine.warm import is_on_disk, warming

    if form.W.nnz <= LARGE:
        return None
    if several(form) is None and (warming().is_done or is_on_disk()) and are_loaded_within(LOADING * session.left, session):
        opening = Opening(form, session)
        opening.run()
        return opening
    if session.chosen is None:
        search = Search(form)
        if search.complete(session.over):
            search.reverse_delete()
            session.plan(search.chosen, search.cost + session.model.offset)
    return None


def _for_at_most(seconds: float, session: Session) -> Callable[[], bool]:
    end = perf_counter() + seconds
    return lambda: session.over() or perf_counter() > end


def _by_highs(session: Session, start: tuple[int, ...] | None) -> Answer:
    """The whole model by HiGHS in a process of its own."""
    from pscover import registry

    if session.over():
        return session.answer(Status.UNKNOWN)
    seconds = session.left
    known = Progress(seconds=0.0, objective=session.objective, bound=session.bound)

    def seen(progress: Progress) -> bool:
        if progress.chosen is not None:
            session.plan(progress.chosen, progress.objective)
        return session.bounded(progress.bound)

    settings = replace(session.settings, time=seconds, start=start)
    answer = isolate.run(registry.backend("highs"), session.model, settings, seen, Clock(seconds))
    if session.failure is not None:
        raise session.failure
    if answer.chosen is None and session.chosen is not None and answer.status is not Status.INFEASIBLE:
        return replace(answer, status=Status.FEASIBLE, chosen=session.chosen, bound=max(answer.bound, known.bound))
    return answer


backend = Auto
