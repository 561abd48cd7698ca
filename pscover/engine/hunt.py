"""The local search as Python drives it: in short turns, one better plan at a time."""

from __future__ import annotations

import math
from time import perf_counter

import numpy as np

from .greedy import adopt, choose
from .problem import FloatArray, IntArray, Problem
from .state import BEST, BEST_AT, COST, LIMIT, MOVES, SHORT, STEP, WORK, empty
from .weighting import search

TURN = 2e-3
"""Seconds that a turn aims at, so that clock and observer are looked at often."""
FOREVER = 1 << 62
KICK = 20
"""Moves a row without a better plan, times a number of Luby's, after which a search begins anew near its best one, where
costs differ:"""
LOST = 0.1
"""without that part of it, and with"""
REMEMBERED = 0.5
"""that part of what rows weigh more than at first."""


class Hunt:
    """A search for ever cheaper plans of one problem; its moves depend on problem, seed and start only.

    Parameters
    ----------
    problem
        The rows and cliques.
    seed
        Of everything random.
    step
        By how much a plan must be cheaper to count as better; 0 for the least that can be told apart.
    """

    def __init__(self, problem: Problem, seed: int, step: float = 0.0) -> None:
        self.problem = problem
        self.state = empty(problem, seed)
        scale = float(problem.cost.max(initial=0.0))
        self.state.value[STEP] = max(step, 1e-9 * scale)
        self._work = 20_000
        self._kicks = np.random.default_rng(seed) if problem.cost.min(initial=scale) < scale else None
        self._kicked = 0
        self._kick_at = KICK * problem.rows

    @property
    def cost(self) -> float:
        """Of the best plan; infinite without one."""
        return float(self.state.value[BEST])

    @property
    def plan(self) -> IntArray:
        """The best plan, sorted."""
        return np.flatnonzero(self.state.candidates["best"]).astype(np.int32)

    @property
    def moves(self) -> int:
        """Moves made."""
        return int(self.state.counts[MOVES])

    @property
    def idle(self) -> int:
        """Moves made since the best plan was found."""
        return int(self.state.counts[MOVES] - self.state.counts[BEST_AT])

    def begin(self, price: FloatArray | None = None) -> bool:
        """Choose greedily from scratch; `price` stands for the costs."""
        return choose(self.problem, self.state, self.problem.cost if price is None else price)

    def resume(self, plan: IntArray | None, limit: float | None = None) -> None:
        """Go on from a plan free of conflicts (None: from where it is), looking for plans not above `limit`."""
        if plan is not None:
            adopt(self.problem, self.state, np.asarray(plan, dtype=np.int32))
        if limit is not None:
            self.state.value[LIMIT] = min(limit, self.state.value[LIMIT])

    def turn(self, moves: int = FOREVER) -> bool:
        """Search for about `TURN` seconds, until that many moves are made in all, or until a better plan is found."""
        if self._kicks is not None:
            if self.moves >= self._kick_at:
                self._kick(self._kicks)
            moves = min(moves, self._kick_at)
        began, worked = perf_counter(), self.state.counts[WORK]
        found = bool(search(self.problem, self.state, self._work, moves))
        taken = perf_counter() - began
        if found:
            self._kick_at = self.moves + self._patience()
        elif self.state.counts[WORK] - worked >= self._work:
            self._work = int(np.clip(self._work * TURN / max(taken, 1e-5), self._work / 2, self._work * 2))
            self._work = max(self._work, 500)
        return found

    def _kick(self, random: np.random.Generator) -> None:
        """Go back to the best plan, lose some of it, and forget much of what rows weigh (iterated local search).

        Weights alone lead a search far away from plans whose costs are low.
        """
        problem, rows, candidates = self.problem, self.state.rows, self.state.candidates
        self._kicked += 1
        self._kick_at = self.moves + self._patience()
        plan = self.plan if math.isfinite(self.cost) else np.flatnonzero(candidates["taken"]).astype(np.int32)
        adopt(problem, self.state, np.zeros(0, dtype=np.int32))
        rows["weight"] = 1.0 + REMEMBERED * (rows["weight"] - 1.0)
        each = np.repeat(rows["weight"], np.diff(problem.rptr))
        candidates["worth"] = np.bincount(problem.lines["candidate"], each * problem.lines["entry"], problem.candidates)
        adopt(problem, self.state, plan[random.random(len(plan)) >= LOST])

    def _patience(self) -> int:
        return KICK * luby(self._kicked + 1) * self.problem.rows

    @property
    def is_short(self) -> bool:
        """Whether the plan as it stands leaves rows short."""
        return bool(self.state.counts[SHORT])

    @property
    def lacking(self) -> IntArray:
        """The rows that the plan as it stands leaves short."""
        return np.sort(self.state.rows["lacking"][: self.state.counts[SHORT]])

    @property
    def spent(self) -> float:
        """The cost of the plan as it stands."""
        return float(self.state.value[COST])


def luby(k: int) -> int:
    """The k-th number of 1, 1, 2, 1, 1, 2, 4, ...: how long until the k-th restart (Luby, Sinclair, Zuckerman 1993).

    Examples
    --------
    >>> [luby(k) for k in range(1, 16)]
    [1, 1, 2, 1, 1, 2, 4, 1, 1, 2, 1, 1, 2, 4, 8]
    """
    while (k + 1) & k:
        k -= (1 << (k.bit_length() - 1)) - 1
    return (k + 1) >> 1
