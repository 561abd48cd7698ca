"""The course of one solve by the default engine: what is done to the independent blocks of a form, in which order."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from time import perf_counter
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csc_array

from pscover import isolate
from pscover.certificate import Certificate
from pscover.clock import Clock
from pscover.errors import EngineFailed
from pscover.model import CoverForm, Model
from pscover.presolve import components
from pscover.presolve.reduced import Outcome, Reduced
from pscover.result import Answer, Progress, Status

from ._beside import Beside
from ._kernels import PAUSE, await_kernels, certifying, feasible_start, least_step, plain_plan, reserve
from ._neighbourhoods import Neighbourhoods
from ._session import CLAIMED, Session

if TYPE_CHECKING:
    from pscover.engine.block import Block

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.int32]

BURST = 0.02
"""Seconds of search of one block before the next has its turn."""
BOUND = 0.06
"""Seconds of bounding after that, where the search has long found nothing."""
EVEN, FAR = 0.04, 0.03
"""Seconds of each instead where costs differ, as long as the gap, relative to the plan, is more than that."""
RATE, SLOW = 2e5, 4e3
"""Entries that HiGHS takes in a second before it brings anything, where they are full and where several work together."""
LESS = 0.6
"""The part of its share of the time that HiGHS gets where several candidates work together."""
PATIENCE = 1.6
"""How many times the time for searching and bounding a relaxation at work may take."""
CLOSE, MOST = 0.01, 0.9
"""A gap, relative to the plan, that HiGHS is likely to close, and the part of the time that it gets for that."""
TREE = 0.6
"""The part of the time that branch and bound of our own may take on small blocks."""
LAST, LATE = 0.5, 0.1
"""The part of what is left that it may take in the end, and where it does not promise much."""
FOREST = 60.0
"""Seconds that it may take where there is no limit."""
BRIEF = 6_400_000
"""Entries of a block that it looks at before it leaves the form to presolve, where it is tried at once."""
HASTY = 100_000
"""Entries of a block that it looks at where that does not promise much."""
AT_ONCE, HURRIED = 0.25, 0.04
"""The part of the time that this may take, in the two cases."""
PAUSED, EXCHANGED = 0.6, 1.0
"""Seconds of search between two looks at parts of plans, longer where they bring nothing, and of these."""
LONGER = 2.0
"""By what the former grow then."""
SHORTEST = 0.3
"""Seconds that must be left for branch and bound in a process of its own to be of use."""


@dataclass(slots=True)
class Parts:
    """When parts of a block's plan are looked at."""

    neighbourhoods: Neighbourhoods
    next: float
    pause: float = PAUSED


class Course:
    """One solve of a form whose packing rows are cliques."""

    def __init__(self, form: CoverForm, reduced: Reduced, session: Session, share: float) -> None:
        from pscover.engine.block import Block

        self.form, self.reduced, self.session, self.share = form, reduced, session, share
        self.blocks: list[Block] = []
        self.beside: Beside | None = None
        self._parts: dict[int, Parts] = {}
        self._is_late = False
        if reduced.status is not Outcome.SOLVED:
            step = least_step(reduced.form.c)
            for part, columns in components(reduced.form):
                self.blocks.append(Block(part, columns.astype(np.int32), session.settings.seed, step))

    @property
    def falls_apart(self) -> bool:
        """Whether no block has most of the entries."""
        sizes = [len(block.problem.lines) for block in self.blocks]
        return max(sizes, default=0) <= sum(sizes) / 2

    def adopt_multipliers(self, multipliers: FloatArray) -> None:
        """Let the bounds of the blocks begin with multipliers of the form's rows."""
        from pscover.engine.subgradient import multipliers as plain

        W = csc_array(self.reduced.form.W)
        for block in self.blocks:
            rows = np.unique(W[:, block.columns].indices)
            block.multipliers = plain(block.problem)
            known = multipliers[self.reduced.rows[rows]]
            block.multipliers.y[:] = block.multipliers.kept[:] = known

    def answer(self) -> Answer:
        """Go through the stages until nothing is open or the session is over."""
        session = self.session
        reserve(session, self.form)
        self._adopt_start()
        self._tell()
        try:
            if self._open() and not session.over():
                self._search_and_prove()
        finally:
            if self.beside is not None:
                self.beside.dismiss()
        return self._certified()

    def _certified(self) -> Answer:
        """The answer, with what proves it as far as a certificate can."""
        session = self.session
        status = Status.OPTIMAL if session.is_proven() else Status.UNKNOWN
        answer = session.answer(Status.INFEASIBLE if any(block.is_infeasible for block in self.blocks) else status)
        return replace(answer, certificate=self.certificate())

    @property
    def bound(self) -> float:
        """Proven of all plans by what is known of the blocks."""
        return self.reduced.lower_bound(sum(block.bound for block in self.blocks))

    def certificate(self) -> Certificate | None:
        """Of what is known of the blocks."""
        from pscover.engine.certify import of_blocks

        return of_blocks(self.form, self.reduced, self.blocks, certifying(self.session))

    def at_once(self) -> Answer | None:
        """The proven answer if branch and bound finds it after little work, else None."""
        session = self.session
        began, left = session.seconds, session.left
        self._adopt_start()
        self._look_round()
        for block in self.blocks:
            while block.is_open and block.is_small and not session.over() and not session.is_proven():
                if block.explore():
                    self._tell()
                most, part = (BRIEF, AT_ONCE) if block.is_promising else (HASTY, HURRIED)
                if block.work > most or session.seconds - began > part * left:
                    return None
            if block.is_infeasible:
                break
            if block.is_open and not session.over():
                return None
        return self._certified()

    def _open(self) -> list[Block]:
        return [] if self.session.is_proven() else [block for block in self.blocks if block.is_open]

    def _adopt_start(self) -> None:
        start = self.session.settings.start if self.session.chosen is None else self.session.chosen
        if start is None or not self.blocks:
            return
        inner = feasible_start(self.reduced.form, self.reduced.project(list(start)).tolist())
        self._offer(inner)

    def _offer(self, plan: IntArray | None) -> None:
        """Take a plan of what presolve left, if there is one."""
        for block in self.blocks if plan is not None else ():
            assert plan is not None
            block.offer(np.flatnonzero(np.isin(block.columns, plan)).astype(np.int32))

    def _tell(self) -> None:
        """Report the plan and the bound of the whole."""
        offset = self.session.model.offset
        self.session.bounded(offset + self.bound * (1 - 1e-12))
        plans = [block.columns[block.plan] for block in self.blocks if block.plan is not None]
        if len(plans) == len(self.blocks):
            chosen = self.reduced.lift(np.concatenate(plans) if plans else np.zeros(0, dtype=np.int64)).astype(np.int32)
            self.session.plan(chosen, float(self.form.c[chosen].sum()) + offset)

    def _search_and_prove(self) -> None:
        from pscover.engine.warm import warming

        session = self.session
        if not warming().is_done:
            for block in self._open():
                plan = plain_plan(block.form, session)
                if plan is not None and block.offer(plan):
                    self._tell()
        if not self._get_ready():
            return
        self._look_round()
        self._explore(TREE * session.left if math.isfinite(session.left) else FOREST, HASTY)
        if not self._open() or session.over():
            return
        if session.left > 2 * SHORTEST:
            isolate.warm_up("highs")
        self._settle(0.3 * session.left if math.isfinite(session.left) else 1e9)
        for block in self._open():
            rate = SLOW if block.is_fractional else RATE
            if not session.over() and self._share_of(block) * session.left > SHORTEST + block.problem.lines.size / rate:
                self._branch(block)
        if math.isfinite(session.left):
            self._explore(LAST * session.left, 0.0)
            self._explore(LATE * session.left, math.inf)
            self._finish()

    def _look_round(self) -> None:
        """A short search of each block, so that there is a plan of the whole before one of them takes long."""
        for block in self._open() if len(self.blocks) > 1 else ():
            if block.plan is None and not self.session.over():
                block.explore()
        self._tell()

    def _get_ready(self) -> bool:
        """Wait for the kernels, with HiGHS at work where they are compiled; whether the session goes on with them."""
        from pscover.engine.warm import is_on_disk, warming

        if not warming().is_done and not is_on_disk() and self.session.left > SHORTEST:
            model, _ = self._whole().model()
            settings = replace(self.session.settings, time=self.session.left, start=None, gap=0.0)
            self.beside = Beside(model, settings)
            while not warming().wait(10 * PAUSE) and not self.session.over() and not self.session.is_proven():
                self._hear()
                if self.beside.is_done:
                    break
        return not self.session.is_proven() and await_kernels(self.session)

    def _whole(self) -> Block:
        from pscover.engine.block import Block

        form = self.reduced.form
        return Block(form, np.arange(len(form.c), dtype=np.int32), 0, 0.0)

    def _hear(self) -> None:
        """Take what the engine beside has found."""
        beside, offset = self.beside, self.session.model.offset
        if beside is None:
            return
        kept = self._whole().kept
        for progress in beside.news():
            self.session.bounded(offset + self.reduced.lower_bound(progress.bound) * (1 - 1e-12))
            if progress.chosen is not None:
                inner = feasible_start(self.reduced.form, kept[progress.chosen].tolist())
                self._offer(inner)
                self._tell()

    def _explore(self, seconds: float, most: float) -> None:
        """Branch and bound of our own on the small blocks in turn, for so long; so much work where it promises little."""
        end = perf_counter() + seconds
        while perf_counter() < end and not self.session.over():
            blocks = [block for block in self._open() if block.is_small and (block.is_promising or block.work <= most)]
            if not blocks:
                return
            for block in blocks:
                if block.explore():
                    self._tell()
                if self.session.over():
                    return
            self._hear()

    def _settle(self, seconds: float) -> None:
        """Search and bound the open blocks in turn until neither moves, or for so long."""
        session, began = self.session, perf_counter()
        last = began
        forever = math.isfinite(seconds) and seconds >= session.left
        while (blocks := self._open()) and not session.over():
            self._hear()
            moved = False
            for number, block in enumerate(self.blocks):
                if block.is_open:
                    moved |= self._attend(block) or self._look_at_parts(number)
                if session.over():
                    return
            now = perf_counter()
            last = now if moved else last
            still = now - last > 0.3 + 0.5 * (last - began)
            settled = all(block.is_settled and (still or block.is_idle or _is_close(block)) for block in blocks)
            # What HiGHS gets next is worth more with the inequalities.
            most = PATIENCE * seconds if any(block.cutting is not None for block in blocks) else seconds
            if now - began > most or (settled and not forever):
                return

    def _finish(self) -> None:
        """Search until the time is up."""
        self._is_late = True
        while self._open() and not self.session.over():
            for block in self._open():
                block.refocus()
            self._settle(self.session.left)

    def _look_at_parts(self, number: int) -> bool:
        """Exchange parts of a block's plan now and then, once its search is quiet; whether it became cheaper.

        Unless plans are many and far from proven, everything else comes first.
        """
        block = self.blocks[number]
        is_ready = self._is_late or (block.is_quiet and _is_far(block))
        if not (is_ready and block.is_open and block.has_core and Neighbourhoods.suit(block.form)):
            return False
        if number not in self._parts:
            neighbourhoods = Neighbourhoods(block.form, block.reduced, self.session.settings.seed)
            self._parts[number] = Parts(neighbourhoods, perf_counter() + PAUSED)
        parts = self._parts[number]
        if perf_counter() < parts.next:
            return False
        parts.neighbourhoods.know(block.form, block.reduced)
        helped = self._exchange(block, parts.neighbourhoods)
        parts.pause = PAUSED if helped else LONGER * parts.pause
        parts.next = perf_counter() + parts.pause
        return helped

    def _exchange(self, block: Block, neighbourhoods: Neighbourhoods) -> bool:
        """Exchange parts of a block's plan for a while; whether it became cheaper."""
        end, cost = perf_counter() + EXCHANGED, block.cost
        try:
            while block.plan is not None and perf_counter() < end and not self.session.over():
                if block.offer(neighbourhoods.turn(block.plan, self.session, block.quest.others)):
                    self._tell()
        except EngineFailed:
            # It only helps: the plan at hand stays.
            return False
        if block.cost < cost:
            return True
        neighbourhoods.widen()
        return False

    def _attend(self, block: Block) -> bool:
        """Give one block a burst of search and, until it has settled, of bounding; whether something got better."""
        session, moved = self.session, False
        if block.has_core:
            block.refocus()
        search, bound = (BURST, BOUND) if block.is_quiet else (BURST, BURST / 2)
        if block.is_quiet and _is_far(block):
            search = bound = EVEN
        end = perf_counter() + (search if block.is_focused else 0.0)
        while perf_counter() < end and block.is_open and not session.over():
            if block.search():
                moved = True
                self._tell()
        if block.is_open and not block.is_settled and not session.over():
            risen, end = False, perf_counter() + bound
            while perf_counter() < end and block.is_open and not block.is_settled and not session.over():
                risen |= block.bind(session.left)
            if risen or not block.is_open:
                moved = True
                self._tell()
        return moved

    def _share_of(self, block: Block) -> float:
        if _is_close(block):
            return MOST
        if _is_far(block) and Neighbourhoods.suit(block.form):
            # Parts and cores of it bring more.
            return 0.0
        return LESS * self.share if block.is_fractional else self.share

    def _branch(self, block: Block) -> None:
        """Hand a block to branch and bound, with its plan as the start."""
        from pscover import registry

        session = self.session
        model, kept = block.model()
        if len(kept) == 0:
            block.is_exhausted, block.bound = True, block.cost
            self._tell()
            return
        start = None
        if block.plan is not None and np.isin(block.plan, kept).all():
            start = tuple(np.searchsorted(kept, block.plan).tolist())
        seconds = session.left if math.isinf(session.left) else max(SHORTEST, self._share_of(block) * session.left)
        settings = replace(session.settings, time=seconds, start=start, gap=0.0)

        def seen(progress: Progress) -> bool:
            if progress.chosen is not None and _misses(model, progress.chosen) <= CLAIMED:
                block.offer(kept[progress.chosen])
            block.prove(min(progress.bound, block.cost))
            self._tell()
            return session.over() or session.is_proven()

        try:
            answer = isolate.run(registry.backend("highs"), model, settings, seen, Clock(seconds))
        except EngineFailed:
            # It only helps: what it cannot do is left to the search.
            return
        if answer.chosen is not None and _misses(model, answer.chosen) <= CLAIMED:
            block.offer(kept[answer.chosen])
        if answer.status is Status.INFEASIBLE:
            block.is_infeasible, block.is_exhausted = block.plan is None, True
            block.bound = block.cost
        else:
            block.prove(min(answer.bound, block.cost))
            if answer.status is Status.OPTIMAL and answer.chosen is not None:
                block.is_exhausted, block.bound = True, block.cost
        self._tell()


def _is_close(block: Block) -> bool:
    return block.is_fractional and block.cost - block.bound < CLOSE * block.cost


def _is_far(block: Block) -> bool:
    """Whether its costs differ, so that there are many plans, and better ones are likely."""
    return block.is_varied and block.cost - block.bound > FAR * block.cost


def _misses(model: Model, chosen: IntArray) -> float:
    """By how much a plan misses a row at most."""
    x = np.zeros(model.variables)
    x[chosen] = 1.0
    activity = model.A @ x
    return float(max(np.max(model.lo - activity, initial=0.0), np.max(activity - model.hi, initial=0.0)))
