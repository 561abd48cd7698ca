"""Small problems to proven optimality: branch and bound, each node bounded by its rows solved one by one.

A candidate's cost is shared out over its rows; each row is met at the least price of its own (`cheapest`), and the prices
add up to a bound (Lagrangian decomposition, Guignard and Kim 1987). Shares move towards rows that want a candidate from
rows that do not (`nodes`); they stay valid below a node, so that every node begins where its parent ended. What taking a
candidate would at least cost is known from the same labels, so that most are left out at once. A level branches on a clique:
one of its candidates after the other, then none of them (`choice`).
"""

from __future__ import annotations

import math

import numpy as np

from .choice import most_telling, thin
from .jit import kernel
from .nodes import bound, limit
from .problem import IntArray, Problem
from .tree import DEEPEST, DEPTH, ENOUGH, FOREVER, FRESH, NODES, UPPER, WORK, Tree, advance, enter, tree, undo
from .trial import is_plan

MORE, DONE, BETTER, TOO_DEEP = range(4)
RATE = 5e5
"""Labels and entries that a slow machine looks at in a second."""


@kernel
def explore(problem: Problem, tree: Tree, work: int) -> int:
    """Go on for so much work, until a better plan is found, or to the end; what happened."""
    end = tree.counts[WORK] + work
    while tree.counts[WORK] < end:
        if tree.counts[FRESH] == 0:
            while tree.counts[DEPTH] > 0 and tree.lower[tree.counts[DEPTH] - 1] > limit(tree):
                undo(tree)
                tree.counts[DEPTH] -= 1
            if tree.counts[DEPTH] == 0:
                return DONE
            advance(problem, tree)
        tree.counts[FRESH] = 0
        tree.counts[NODES] += 1
        thin(problem, tree)
        lower = bound(problem, tree)
        if lower > limit(tree):
            continue
        is_better = is_plan(problem, tree)
        if lower <= limit(tree):
            pick = most_telling(tree, lower)
            if pick >= 0:
                if tree.counts[DEPTH] >= DEEPEST:
                    return TOO_DEEP
                enter(tree, pick, lower)
        if is_better:
            return BETTER
    return MORE


class Branching:
    """The search as Python drives it: in short turns; its nodes depend on the problem and the plans it knows only.

    Parameters
    ----------
    problem
        The rows and cliques.
    upper
        The cost of a plan at hand.
    step
        By how much a plan must at least be cheaper to count; 0 for the least that can be told apart.
    """

    def __init__(self, problem: Problem, upper: float = np.inf, step: float = 0.0) -> None:
        self.problem = problem
        self.tree = tree(problem, upper, step)
        self.is_finished = False
        self.has_given_up = False

    @property
    def nodes(self) -> int:
        """Nodes looked at."""
        return int(self.tree.counts[NODES])

    @property
    def is_open(self) -> bool:
        """Whether nodes are left."""
        return bool(self.tree.counts[DEPTH] > 0)

    @property
    def work(self) -> int:
        """Labels and entries looked at."""
        return int(self.tree.counts[WORK])

    @property
    def plan(self) -> IntArray:
        """The best plan found, sorted; empty if none was."""
        return np.flatnonzero(self.tree.best).astype(np.int32)

    @property
    def lower(self) -> float:
        """What every plan costs at least that is still to be found."""
        return float(self.tree.lower[0]) if self.tree.counts[DEPTH] > 0 else 0.0

    def turn(self, work: int, seconds: float = math.inf) -> bool:
        """Go on for so much work or until a better plan is found; whether it was.

        A node takes fewer steps where they would take longer than the seconds that are left.
        """
        self.tree.counts[ENOUGH] = FOREVER if math.isinf(seconds) else self.work + int(RATE * seconds)
        happened = int(explore(self.problem, self.tree, work))
        self.is_finished = happened == DONE
        self.has_given_up = happened == TOO_DEEP
        return happened == BETTER

    def know(self, upper: float) -> None:
        """A plan of that cost is at hand."""
        self.tree.value[UPPER] = min(upper, self.tree.value[UPPER])
