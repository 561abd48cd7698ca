"""The local searches of a block, one after the other: everywhere, among favoured candidates, or elsewhere in turn."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_array

from .favoured import blurred, favoured
from .hunt import FOREVER, Hunt
from .problem import IntArray, Problem

SIZES = ((12, 20), (7, 12), (4, 8))
"""Favoured candidates in all, by row, and of each row at least, where the search has looked everywhere."""
REMEMBERED = 12
"""Most plans of searches of their own that are kept."""


class Quest:
    """Where the search of a block is at, and what it has found there.

    Parameters
    ----------
    seed
        Of everything random.
    step
        By how much a plan must be cheaper to count as better; 0 for the least that can be told apart.

    Attributes
    ----------
    turns
        How often it has turned elsewhere.
    in_vain
        How often since the best plan was found.
    """

    def __init__(self, seed: int, step: float) -> None:
        self.turns = self.in_vain = 0
        self._seed, self._step = seed, step
        self._now: tuple[Hunt, IntArray] | None = None
        self._resting: tuple[Hunt, IntArray] | None = None
        self._since = 0
        self._found: list[tuple[float, IntArray]] = []

    @property
    def has_begun(self) -> bool:
        """Whether there is a search."""
        return self._now is not None

    @property
    def idle(self) -> int:
        """Moves without a better plan, where the search is now."""
        if self._now is None:
            return 0
        hunt = self._now[0]
        return min(hunt.idle, hunt.moves - self._since)

    @property
    def others(self) -> tuple[IntArray, ...]:
        """Plans of searches that have ended, the cheapest first."""
        return tuple(plan for _, plan in self._found)

    @property
    def sizes(self) -> tuple[int, int]:
        """How many candidates had better be favoured next where it has looked everywhere: fewer in turn."""
        return SIZES[self.in_vain // 2 % len(SIZES)]

    def begin(self, problem: Problem, kept: IntArray, plan: IntArray | None, enough: float) -> None:
        """Search these candidates, numbered `kept` in the block.

        From a plan if it is made of them, else for plans that cost no more than `enough`; without a plan for any.
        """
        self._remember()
        hunt = Hunt(problem, self._seed, self._step)
        self._now, self._since = (hunt, kept), 0
        if plan is not None and np.isin(plan, kept).all():
            hunt.resume(np.searchsorted(kept, plan).astype(np.int32))
            return
        hunt.begin()
        if plan is not None:
            hunt.resume(None, limit=enough)

    def turn(self, moves: int = FOREVER) -> IntArray | None:
        """A few moves; the plan that they found, if it is the best of this search."""
        assert self._now is not None
        hunt, kept = self._now
        return kept[hunt.plan] if hunt.turn(moves) else None

    def briefly(self, moves: int) -> list[IntArray]:
        """So many moves; the plans that they found."""
        assert self._now is not None
        hunt, found = self._now[0], []
        end = hunt.moves + moves
        while hunt.moves < end:
            plan = self.turn(end)
            found += [] if plan is None else [plan]
        return found

    def end(self) -> None:
        """Leave off: candidates have other numbers from now on."""
        self._remember()
        self._now = self._resting = None

    def returns(self, enough: float) -> bool:
        """Go back to the search that rests, which has learnt which rows are hard, for plans of no more cost; if one does."""
        if self._resting is None:
            return False
        self._remember()
        self._now, self._resting = self._resting, None
        self._now[0].resume(None, limit=enough)
        self._since = self._now[0].moves
        return True

    def turn_elsewhere(self) -> tuple[Hunt, IntArray] | None:
        """Let other candidates be favoured from now on; the search at hand."""
        self._seed += 1
        self.turns += 1
        self.in_vain += 1
        return self._now

    def let_rest(self, search: tuple[Hunt, IntArray] | None) -> None:
        """Keep a search, to return to it."""
        self._resting = search

    def favoured(self, W: csr_array, reduced: NDArray[np.float64], overall: int, each: int) -> NDArray[np.bool_]:
        """The candidates to look at, so many a row and at least so many of each: others after each turn elsewhere."""
        if self.turns:
            reduced = blurred(reduced, overall * W.shape[0], np.random.default_rng(self._seed))
        return favoured(W, reduced, overall, each)

    def _remember(self) -> None:
        """Keep the plan of a search that ends, if it found one: what it has in common with others is worth looking at."""
        if self._now is None or not math.isfinite(self._now[0].cost):
            return
        hunt, kept = self._now
        plan = kept[hunt.plan]
        if not any(np.array_equal(plan, other) for other in self.others):
            self._found = sorted([*self._found, (hunt.cost, plan)], key=lambda one: one[0])[:REMEMBERED]
