"""The default engine: presolve, independent blocks, small ones exact, large ones by search and bound side by side."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, replace
from time import perf_counter
from typing import TYPE_CHECKING, ClassVar

import numpy as np
from numpy.typing import NDArray

from pscover import isolate
from pscover.clock import Clock
from pscover.model import CoverForm, Model, as_cover
from pscover.presolve import components, presolve
from pscover.presolve.reduced import Outcome, Reduced
from pscover.result import Answer, Observer, Progress, Settings, Status

from ._cover import Search, hopeless_rows, refusal
from ._kernels import await_kernels, feasible_start, least_step, plain_plan
from ._session import CLAIMED, Session

if TYPE_CHECKING:
    from pscover.engine.block import Block

IntArray = NDArray[np.int32]

BURST = 0.02
"""Seconds of search of one block before the next has its turn."""
RATE = 2e5
"""Entries that branch and bound takes in a second before it brings anything."""
LARGE = 10_000
"""Entries of a form from which on a greedy plan is reported before presolve."""
PRESOLVE = 0.1
"""The part of the time that presolve may take."""
SHORTEST = 0.3
"""Seconds that must be left for branch and bound in a process of its own to be of use."""


@dataclass(frozen=True, slots=True)
class Auto:
    """Presolve; split; enumerate small blocks; search, bound and fix the others in turn; prove what is left by HiGHS.

    Local search under row weights finds plans, a subgradient method raises the bound, reduced costs leave candidates out,
    and once neither moves, HiGHS gets what is left, with the best plan as its start and part of the time; afterwards the
    search goes on. Models that are not covering and packing rows over binaries go to HiGHS as they are, and so do those
    whose packing rows have room for several candidates, with a greedy start.

    Parameters
    ----------
    share
        The part of the time that is left, once search and bound have settled, that branch and bound may take.
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

    def solve(self, model: Model, settings: Settings, observe: Observer) -> Answer:
        """Solve to proven optimality, or as far as the time allows."""
        session = Session(model, settings, observe)
        session.start()
        if refusal(model) is not None:
            return _by_highs(session, settings.start)
        form = as_cover(model)
        if len(hopeless_rows(form)):
            return session.answer(Status.INFEASIBLE)
        _early_plan(form, session)
        reduced = presolve(form, over=_for_at_most(PRESOLVE * session.left, session))
        if reduced.status is Outcome.INFEASIBLE:
            return session.answer(Status.INFEASIBLE)
        from pscover.engine.problem import several

        if several(reduced.form) is not None:
            plan = plain_plan(form, session)
            if plan is not None:
                session.plan(plan, float(form.c[plan].sum()) + model.offset)
            return _by_highs(session, settings.start if session.chosen is None else tuple(session.chosen.tolist()))
        return _Run(form, reduced, session, self.share).answer()


def _early_plan(form: CoverForm, session: Session) -> None:
    """A greedy plan before anything that may take long."""
    if session.chosen is not None or form.W.nnz <= LARGE:
        return
    search = Search(form)
    if search.complete(session.over):
        search.reverse_delete()
        session.plan(search.chosen, search.cost + session.model.offset)


def _for_at_most(seconds: float, session: Session) -> Callable[[], bool]:
    end = perf_counter() + seconds
    return lambda: session.over() or perf_counter() > end


class _Run:
    """One solve of a form whose packing rows are cliques."""

    def __init__(self, form: CoverForm, reduced: Reduced, session: Session, share: float) -> None:
        from pscover.engine.block import Block

        self.form, self.reduced, self.session, self.share = form, reduced, session, share
        self.blocks: list[Block] = []
        if reduced.status is not Outcome.SOLVED:
            step = least_step(reduced.form.c)
            for part, columns in components(reduced.form):
                self.blocks.append(Block(part, columns.astype(np.int32), session.settings.seed, step))

    def answer(self) -> Answer:
        """Go through the stages until nothing is open or the session is over."""
        session = self.session
        self._adopt_start()
        for block in self.blocks:
            if block.is_open and not session.over():
                block.enumerate()
                if block.is_infeasible:
                    return session.answer(Status.INFEASIBLE)
        self._tell()
        if self._open() and not session.over():
            self._search_and_prove()
        if any(block.is_infeasible for block in self.blocks):
            return session.answer(Status.INFEASIBLE)
        return session.answer(Status.OPTIMAL if session.is_proven() else Status.UNKNOWN)

    def _open(self) -> list[Block]:
        return [] if self.session.is_proven() else [block for block in self.blocks if block.is_open]

    def _adopt_start(self) -> None:
        start = self.session.settings.start
        if start is None or not self.blocks:
            return
        inner = feasible_start(self.reduced.form, self.reduced.project(list(start)).tolist())
        if inner is not None:
            for block in self.blocks:
                block.offer(np.flatnonzero(np.isin(block.columns, inner)).astype(np.int32))

    def _tell(self) -> None:
        """Report the plan and the bound of the whole."""
        offset = self.session.model.offset
        self.session.bounded(offset + self.reduced.lower_bound(sum(block.bound for block in self.blocks)) * (1 - 1e-12))
        plans = [block.columns[block.plan] for block in self.blocks if block.plan is not None]
        if len(plans) == len(self.blocks):
            chosen = self.reduced.lift(np.concatenate(plans) if plans else np.zeros(0, dtype=np.int64)).astype(np.int32)
            self.session.plan(chosen, float(self.form.c[chosen].sum()) + offset)

    def _search_and_prove(self) -> None:
        from pscover.engine.warm import warming

        session = self.session
        if session.left > 2 * SHORTEST:
            isolate.warm_up()
        if not warming().is_done:
            for block in self._open():
                plan = plain_plan(block.form, session)
                if plan is not None and block.offer(plan):
                    self._tell()
        if not await_kernels(session):
            return
        self._settle(0.3 * session.left if math.isfinite(session.left) else 1e9)
        for block in self._open():
            if not session.over() and self.share * session.left > SHORTEST + block.problem.lines.size / RATE:
                self._branch(block)
        while math.isfinite(session.left) and self._open() and not session.over():
            for block in self._open():
                block.refocus()
            self._settle(session.left)

    def _settle(self, seconds: float) -> None:
        """Search and bound the open blocks in turn until neither moves, or for so long."""
        session, began = self.session, perf_counter()
        last = began
        forever = math.isfinite(seconds) and seconds >= session.left
        while (blocks := self._open()) and not session.over():
            moved = False
            for block in blocks:
                moved |= self._attend(block)
                if session.over():
                    return
            now = perf_counter()
            last = now if moved else last
            still = now - last > 0.3 + 0.5 * (last - began)
            settled = all(block.is_settled and (still or block.is_idle) for block in blocks)
            if now - began > seconds or (settled and not forever):
                return

    def _attend(self, block: Block) -> bool:
        """Give one block a burst of search and, until it has settled, of bounding; whether something got better."""
        session, moved = self.session, False
        end = perf_counter() + (BURST if block.is_focused else 0.0)
        while perf_counter() < end and block.is_open and not session.over():
            if block.search():
                moved = True
                self._tell()
        if block.is_open and not block.is_settled and not session.over():
            risen, end = False, perf_counter() + BURST / 2
            while perf_counter() < end and block.is_open and not block.is_settled and not session.over():
                risen |= block.bind()
            if risen or not block.is_open:
                moved = True
                self._tell()
        return moved

    def _branch(self, block: Block) -> None:
        """Hand a block to branch and bound, with its plan as the start."""
        from pscover import registry

        session = self.session
        model, kept = block.model()
        if len(kept) == 0:
            block.is_exhausted, block.bound = True, block.cost
            return self._tell()
        start = None
        if block.plan is not None and np.isin(block.plan, kept).all():
            start = tuple(np.searchsorted(kept, block.plan).tolist())
        seconds = session.left if math.isinf(session.left) else max(SHORTEST, self.share * session.left)
        settings = replace(session.settings, time=seconds, start=start, gap=0.0)

        def seen(progress: Progress) -> bool:
            if progress.chosen is not None and _misses(model, progress.chosen) <= CLAIMED:
                block.offer(kept[progress.chosen])
            block.prove(min(progress.bound, block.cost))
            self._tell()
            return session.over() or session.is_proven()

        answer = isolate.run(registry.backend("highs"), model, settings, seen, Clock(seconds))
        if answer.chosen is not None and _misses(model, answer.chosen) <= CLAIMED:
            block.offer(kept[answer.chosen])
        if answer.status is Status.INFEASIBLE:
            block.is_infeasible, block.is_exhausted = block.plan is None, True
            block.bound = block.cost
        else:
            block.prove(min(answer.bound, block.cost))
            if answer.status is Status.OPTIMAL and answer.chosen is not None:
                block.is_exhausted, block.bound = True, block.cost
        return self._tell()


def _misses(model: Model, chosen: IntArray) -> float:
    """By how much a plan misses a row at most."""
    x = np.zeros(model.variables)
    x[chosen] = 1.0
    activity = model.A @ x
    return float(max(np.max(model.lo - activity, initial=0.0), np.max(activity - model.hi, initial=0.0)))


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
