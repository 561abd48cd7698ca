"""The greedy cover: most gain per cost, then what is not needed is dropped. No engine but numpy."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from pscover.model import CoverForm, Model, as_cover
from pscover.result import Answer, Observer, Settings, Status

from ._cover import Search, dual_bound, hopeless_rows, refusal, repair
from ._session import Session


@dataclass(frozen=True, slots=True)
class Greedy:
    """Gain per cost with truncated gains, reverse delete, and a search for a way out where conflicts block.

    Without conflicts the cost is within a logarithmic factor of the best (Wolsey 1982; Dobson 1982). With conflicts even
    feasibility is NP-hard: after `moves` repair moves the answer is "unknown". A bound comes from a dual found in one pass.

    Parameters
    ----------
    moves
        Most repair moves after the greedy choice is stuck.

    Examples
    --------
    >>> from pscover import Instance, registry
    >>> from pscover.result import ignore
    >>> model = registry.formulation("clique").build(Instance.of([[0.8, 0.0, 0.75], [0.0, 0.9, 0.75]]))
    >>> answer = Greedy().solve(model, Settings(), ignore)
    >>> answer.chosen.tolist(), answer.bound, str(answer.status)
    ([2], 1.0, 'optimal')
    """

    name: ClassVar[str] = "greedy"
    exact: ClassVar[bool] = False
    isolated: ClassVar[bool] = False
    requires: ClassVar[tuple[str, ...]] = ()
    extra: ClassVar[str] = ""

    moves: int = 5000

    def refuses(self, model: Model) -> str | None:
        """Anything but covering and packing rows over binaries with costs of at least 0."""
        return refusal(model)

    def solve(self, model: Model, settings: Settings, observe: Observer) -> Answer:
        """Greedy choice, repair where stuck, reverse delete; the start, if feasible, is improved by reverse delete."""
        session = Session(model, settings, observe)
        form = as_cover(model)
        if len(hopeless_rows(form)):
            return session.answer(Status.INFEASIBLE)
        if settings.start is not None:
            _improve_start(form, settings.start, session)
        if not session.over():
            session.bounded(model.offset + dual_bound(form))
        if not session.over():
            search = Search(form)
            rng = np.random.default_rng(settings.seed)
            if search.complete(session.over) or repair(search, rng, self.moves, session.over):
                search.reverse_delete()
                session.plan(search.chosen, search.cost + model.offset)
        return session.answer(Status.OPTIMAL if session.is_proven() else Status.UNKNOWN)


def _improve_start(form: CoverForm, start: tuple[int, ...], session: Session) -> None:
    search = Search(form)
    search.take(sorted(start))
    if search.is_feasible():
        search.reverse_delete()
        session.plan(search.chosen, search.cost + session.model.offset)


backend = Greedy
