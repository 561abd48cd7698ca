"""Lagrangian heuristic: multipliers of the rows prove a bound, and price the candidates that greedy plans are made of."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from time import perf_counter
from typing import TYPE_CHECKING, ClassVar

import numpy as np
from numpy.typing import NDArray

from pscover.certificate import refutation
from pscover.model import CoverForm, Model, as_cover
from pscover.result import Answer, Observer, Settings, Status

from ._cover import dual_bound, hopeless_rows, refusal
from ._kernels import await_kernels, certifying, feasible_start, least_step, plain_plan, reserve
from ._session import Session

if TYPE_CHECKING:
    from pscover.engine.block import Block

STEPS = 5
"""Rounds of subgradient steps between two greedy plans."""
FLOOR = 1e-3
"""A candidate's price is at least this part of its cost."""


@dataclass(frozen=True, slots=True)
class Lagrangian:
    """Subgradient steps, a greedy plan at the reduced costs, reverse delete and a short search; again until both settle.

    The inner problem takes at most the best candidate of each clique, so conflicts lift the bound. Reduced costs leave out
    the candidates that no better plan contains (Beasley 1990; Caprara, Fischetti and Toth 1999). Models whose packing rows
    have room for several candidates get a greedy plan and a simple bound.

    Parameters
    ----------
    rounds
        Most rounds; 0 for until the bound has settled.
    moves
        Moves of local search from each greedy plan, at most.
    """

    name: ClassVar[str] = "lagrangian"
    exact: ClassVar[bool] = False
    isolated: ClassVar[bool] = False
    requires: ClassVar[tuple[str, ...]] = ("numba",)
    extra: ClassVar[str] = "engine"

    rounds: int = 0
    moves: int = 500

    def refuses(self, model: Model) -> str | None:
        """Anything but covering and packing rows over binaries with costs of at least 0."""
        return refusal(model)

    def warm_up(self) -> None:
        """Begin to load the kernels, or to compile them."""
        from pscover.engine.warm import warming

        warming()

    def solve(self, model: Model, settings: Settings, observe: Observer) -> Answer:
        """Plans and a bound, until they meet, neither moves, or the session is over."""
        from pscover.engine.problem import several
        from pscover.engine.warm import warming

        session = Session(model, settings, observe)
        form = as_cover(model)
        hopeless = hopeless_rows(form)
        if len(hopeless):
            return replace(session.answer(Status.INFEASIBLE), certificate=refutation(form.W, [hopeless[:1].tolist()]))
        session.bounded(model.offset + dual_bound(form))
        start = None if settings.start is None else feasible_start(form, settings.start)
        if start is None and (not warming().is_done or several(form) is not None):
            start = plain_plan(form, session)
        if start is not None:
            session.plan(start, float(form.c[start].sum()) + model.offset)
        is_ready = several(form) is None and not session.is_proven() and await_kernels(session)
        if is_ready:
            reserve(session, form)
        block = self._improve(form, session, start) if is_ready else None
        status = Status.OPTIMAL if session.is_proven() else Status.UNKNOWN
        answer = session.answer(Status.INFEASIBLE if block is not None and block.is_infeasible else status)
        if block is None:
            return answer
        from pscover.engine.certify import of_blocks
        from pscover.engine.unreduced import unreduced

        return replace(answer, certificate=of_blocks(form, unreduced(form), [block], certifying(session)))

    def _improve(self, form: CoverForm, session: Session, start: NDArray[np.int32] | None) -> Block:
        """Bounds and plans of the form as one block."""
        from pscover.engine.block import Block

        block = Block(form, np.arange(len(form.c), dtype=np.int32), session.settings.seed, least_step(form.c))
        if start is not None:
            block.offer(start)
        rounds, greedy = 0, 0.0
        while block.is_open and not session.over() and not session.is_proven():
            rounds += 1
            for _ in range(STEPS):
                if session.over() or not block.is_open:
                    break
                block.bind(session.left)
            session.bounded(session.model.offset + block.bound)
            # Greedy choice cannot be cut short: another one takes about as long as the last.
            if session.left > greedy:
                greedy = self._greedy(block, session)
            if block.is_settled or rounds == self.rounds:
                break
        return block

    def _greedy(self, block: Block, session: Session) -> float:
        """A plan made of what the multipliers favour; seconds until there was a first."""
        from pscover.engine.hunt import Hunt

        assert block.multipliers is not None
        cost = block.problem.cost
        price = np.maximum(block.multipliers.reduced, FLOOR * cost)
        hunt = Hunt(block.problem, session.settings.seed, block.step)
        began = perf_counter()
        hunt.begin(price)
        taken = perf_counter() - began
        if math.isfinite(block.cost):
            hunt.resume(None, limit=block.cost - max(block.step, 1e-9 * block.cost))
        while hunt.moves < self.moves and not session.over():
            if hunt.turn(self.moves) and block.offer(block.kept[hunt.plan]) and block.plan is not None:
                session.plan(block.plan, block.cost + session.model.offset)
        return taken


backend = Lagrangian
