"""A small block to its end: by a sweep where no candidate is in two cliques, by a tree where that gives up."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from .problem import IntArray, Problem
from .rowwise import Shares
from .sweep import Sweep, worth
from .tree import Branching

TURN = 12_800
"""Entries that a turn of the tree looks at: a few milliseconds."""
SWIFT = 25
"""How many times as much a sweep looks at in that time."""
BETWEEN = 1_000_000
"""What a sweep looks at before a plan is searched anew, which spares it work."""


class Exact:
    """The search of everything that may be in a better plan.

    Parameters
    ----------
    problem
        The block.
    shares
        What its rows pay.
    hopeless
        Candidates that no better plan has.
    bound, cost, step
        What a plan costs at least, what the best one does (infinite if there is none), and the least by which two differ.
    """

    def __init__(
        self, problem: Problem, shares: Shares, hopeless: NDArray[np.bool_], bound: float, cost: float, step: float
    ) -> None:
        self._problem, self._shares, self._step = problem, shares, step
        # Without a plan, there are no targets to rise: all partial plans go on.
        rise = step if math.isfinite(cost) else 0.0
        self._sweep = Sweep(problem, shares, hopeless, bound, rise) if problem.is_split else None
        self._tree: Branching | None = None
        self._looked_at = 0

    @property
    def work(self) -> int:
        """What the tree has looked at, and the sweep in the same time."""
        tree = 0 if self._tree is None else self._tree.work
        return tree if self._sweep is None else tree + self._sweep.work // SWIFT

    @property
    def sweeps(self) -> bool:
        """Whether it is a sweep, so far."""
        return self._sweep is not None and not self._sweep.has_given_up

    @property
    def is_finished(self) -> bool:
        """Whether nothing is left."""
        if self._sweep is not None and self.sweeps:
            return self._sweep.is_finished
        return self._tree is not None and self._tree.is_finished

    @property
    def lower(self) -> float:
        """What every plan costs at least that is worth finding."""
        if self._sweep is not None and self.sweeps:
            return self._sweep.lower
        return 0.0 if self._tree is None else self._tree.lower

    def wants_a_search(self) -> bool:
        """Whether it has looked at so much that a search for a better plan is due, which then counts as made."""
        if self._sweep is None or not self.sweeps or self._sweep.work < self._looked_at + BETWEEN:
            return False
        self._looked_at = self._sweep.work
        return True

    def turn(self, cost: float) -> IntArray | None:
        """Go on for a few milliseconds; a plan cheaper than the best one, which costs so much."""
        if self._sweep is not None and self.sweeps:
            most = worth(cost, self._step) if math.isfinite(cost) else 2 * float(self._problem.cost.sum()) + 1
            return self._sweep.plan if self._sweep.turn(SWIFT * TURN, most) else None
        if self._tree is None:
            self._tree = Branching(self._problem, self._shares, cost, self._step)
        self._tree.know(cost)
        return self._tree.plan if self._tree.turn(TURN) else None
