"""Large neighbourhood search: a part of a plan is given up, or few candidates are let in, and HiGHS finds what is best."""

from __future__ import annotations

from collections import deque
from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csc_array, csr_array

from pscover import isolate, registry
from pscover.clock import Clock
from pscover.model import CoverForm, model_of
from pscover.result import Answer, Settings, Status

from ._cover import TOLERANCE
from ._kernels import feasible_start
from ._session import Session

IntArray = NDArray[np.int32]
BoolArray = NDArray[np.bool_]

SPARSE = 0.04
"""Most of the rows that a candidate may cover, on average: where each covers many, the rest of a plan leaves no choice."""
LARGE = 100_000
"""Entries above which a part is too much to be solved in passing."""
SECONDS, LONGER = 0.5, 1.4
"""What HiGHS gets for a part at first, and by what that grows where parts of that size bring nothing any more."""
FIRST, LEAST = 24, 4
"""Candidates given up at first, and at least."""
CORE, SMALLEST = 1.3, 1.1
"""Candidates of a core at first, and at least, times those of a plan."""
BLUR = 0.1
"""Noise on the reduced costs by which cores are chosen, relative to their mean among candidates as many as four plans."""
PLANS, FEWEST = 6, 3
"""Other plans whose candidates make a core, at first, and at least."""
MORE, FEWER = 1.2, 0.85
"""By what these numbers change after a part that was easy, and after one that was not finished."""
EASY = 0.4
"""A part is easy if it took no more than so much of its time."""
NEXT = 3
"""Rows of a candidate given up from which others are."""
FAVOURED = 5
"""Candidates a row, of least reduced cost, that may come in."""


class Neighbourhoods:
    """Parts of one form, of a size that HiGHS can just solve.

    In turn, neighbours of a plan are given up (Shaw 1998; Pisinger and Ropke 2010) and all of it is, for the sake of a core:
    the plan and the candidates of least reduced cost, or those of other good plans (as tours are merged: Cook and Seymour
    2003). Neighbours cover a random row, or rows of each other; what the others leave short is a problem of the same kind,
    with few rows.

    Parameters
    ----------
    form
        Rows and cliques.
    reduced
        Reduced costs of the candidates.
    seed
        Of everything random.
    """

    def __init__(self, form: CoverForm, reduced: NDArray[np.float64], seed: int) -> None:
        self.form = form
        self._rows, self._columns = csr_array(form.W), csc_array(form.W)
        self.know(form, reduced)
        self._random = np.random.default_rng(seed)
        self._size, self._core, self._plans, self._seconds = float(FIRST), CORE, float(PLANS), SECONDS
        self._turns, self._has_grown = 0, True

    @staticmethod
    def suit(form: CoverForm) -> bool:
        """Whether parts of plans of this form are worth solving."""
        entries, (rows, candidates) = form.W.nnz, form.W.shape
        return bool(0 < entries <= min(LARGE, SPARSE * rows * candidates))

    def know(self, form: CoverForm, reduced: NDArray[np.float64]) -> None:
        """Go on with the same rows and cliques, fewer candidates, or other reduced costs."""
        self.form = form
        self._reduced = np.where(form.allowed, reduced, np.inf)
        self._favoured = form.allowed & _least(self._reduced, FAVOURED * form.W.shape[0])

    def turn(self, plan: IntArray, session: Session, others: Sequence[IntArray] = ()) -> IntArray:
        """Solve a part with what is left of a plan: a plan that costs no more. Other plans come cheapest first."""
        kinds = [self._neighbours, self._core_of_prices, self._core_of_plans][: 2 + (len(others) >= FEWEST)]
        self._turns += 1
        return kinds[(self._turns - 1) % len(kinds)](plan, session, others)

    def _neighbours(self, plan: IntArray, session: Session, _: Sequence[IntArray]) -> IntArray:
        found, change = self._solved(plan, self._freed(plan), self._favoured, session)
        self._size = max(LEAST, change * self._size)
        return found

    def _core_of_prices(self, plan: IntArray, session: Session, _: Sequence[IntArray]) -> IntArray:
        found, change = self._solved(plan, plan, self._few(plan), session)
        self._core, self._has_grown = max(SMALLEST, change * self._core), change > 1.0
        return found

    def _core_of_plans(self, plan: IntArray, session: Session, others: Sequence[IntArray]) -> IntArray:
        inside = np.zeros(len(self.form.c), dtype=np.bool_)
        inside[np.concatenate(others[: round(self._plans)])] = True
        found, change = self._solved(plan, plan, inside & self.form.allowed, session)
        self._plans = max(FEWEST, change * self._plans)
        return found

    def _solved(self, plan: IntArray, freed: IntArray, others: BoolArray, session: Session) -> tuple[IntArray, float]:
        """A plan that costs no more where a part of it is freed and others may come in; how the next part had better be."""
        fixed = np.setdiff1d(plan, freed)
        left = 1.0 - np.asarray(self.form.W[:, fixed].sum(axis=1)).ravel()
        rows = np.flatnonzero(left > TOLERANCE)
        if not len(rows):
            return fixed.astype(np.int32), 1.0
        part, columns = self._part(rows, left[rows], fixed, freed, others)
        seconds = min(self._seconds, session.left)
        start = tuple(np.flatnonzero(np.isin(columns, freed)).tolist())
        settings = Settings(time=seconds, seed=session.settings.seed, threads=1, gap=0.0, start=start)
        clock = Clock(seconds)
        answer = isolate.run(registry.backend("highs"), model_of(part), settings, lambda _: session.over(), clock)
        change = self._change(answer, clock.left / seconds)
        better = (
            None if answer.chosen is None else feasible_start(self.form, [*fixed.tolist(), *columns[answer.chosen].tolist()])
        )
        return plan if better is None else better, change

    def widen(self) -> None:
        """Go on with larger parts, for which there is more time."""
        self._seconds *= LONGER

    def _few(self, plan: IntArray) -> BoolArray:
        """The candidates of least reduced cost, as many as a core has; of nearly the least where it has not grown."""
        reduced, size = self._reduced, len(plan)
        if not self._has_grown:
            known = reduced[_least(reduced, 4 * size) & self.form.allowed]
            reduced = reduced + self._random.exponential(BLUR * max(float(known.mean() - known.min()), 1e-9), len(reduced))
        return self.form.allowed & _least(reduced, round(self._core * size))

    def _freed(self, plan: IntArray) -> IntArray:
        """Neighbours of the plan, as many as a part has."""
        wanted = min(round(self._size), len(plan))
        is_taken = np.zeros(len(self.form.c), dtype=np.bool_)
        is_taken[plan] = True
        found: dict[int, None] = {}
        near: deque[int] = deque()
        seen: set[int] = set()
        for row in self._random.permutation(self.form.W.shape[0]).tolist():
            near.append(row)
            while near and len(found) < wanted:
                inside = _of(self._rows, near.popleft())
                for i in self._random.permutation(inside[is_taken[inside]]).tolist():
                    if i not in found:
                        found[i] = None
                        its = self._random.permutation(_of(self._columns, i)).tolist()[:NEXT]
                        near += [j for j in its if j not in seen]
                        seen.update(its)
        return np.array(list(found)[:wanted], dtype=np.int32)

    def _part(
        self, rows: NDArray[np.int64], left: NDArray[np.float64], fixed: IntArray, freed: IntArray, others: BoolArray
    ) -> tuple[CoverForm, NDArray[np.int64]]:
        """What is left short, in the units of what is left, and who may come in: those freed, and others that are of use."""
        W, P = csr_array(self.form.W[rows]), self.form.P
        may = np.zeros(len(self.form.c), dtype=np.bool_)
        may[W.indices] = True
        may &= others
        taken = np.flatnonzero(np.asarray(P[:, fixed].sum(axis=1)).ravel() > 0.5)
        may[P[taken].indices] = False
        may[freed] = True
        columns = np.flatnonzero(may)
        W.data = np.minimum(W.data / np.repeat(left, np.diff(W.indptr)), 1.0)
        return replace(self.form, W=W).among(columns), columns

    @staticmethod
    def _change(answer: Answer, left: float) -> float:
        if answer.status is not Status.OPTIMAL:
            return FEWER
        return MORE if left >= 1.0 - EASY else 1.0


def _of(matrix: csr_array | csc_array, k: int) -> IntArray:
    """Where a row, or a column, has its entries."""
    return np.asarray(matrix.indices[matrix.indptr[k] : matrix.indptr[k + 1]])


def _least(values: NDArray[np.float64], count: int) -> BoolArray:
    """Which values are among so many least."""
    at = min(count, len(values)) - 1
    return np.asarray(values <= np.partition(values, at)[at])
