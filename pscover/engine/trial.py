"""A plan made of what the rows of a node chose."""

# ruff: noqa: SIM110
# Loops, since generators do not compile.
from __future__ import annotations

from .jit import inner
from .nodes import limit
from .problem import TOLERANCE, Problem
from .tree import FOUND, FREE, IN, UPPER, Tree


@inner
def is_plan(problem: Problem, tree: Tree) -> bool:
    """Whether what all rows chose, as far as it fits together and is needed, is a better plan; then it is kept."""
    n, m = len(tree.state), len(tree.need)
    for j in range(m):
        tree.supply[j] = 0.0
    for g in range(len(tree.held)):
        tree.held[g] = 0
    cost = 0.0
    for turn in range(2):
        for i in range(n):
            if turn == 0:
                tree.flag[i] = tree.state[i] == IN
            elif tree.state[i] == FREE:
                tree.flag[i] = _is_chosen(tree, i) and _fits(problem, tree, i)
            if tree.flag[i] and (tree.state[i] == IN) == (turn == 0):
                cost += _try(problem, tree, i, 1.0)
    for j in range(m):
        if tree.supply[j] < 1.0 - TOLERANCE:
            return False
    for i in range(n):
        if tree.flag[i] and _is_spare(problem, tree, i):
            tree.flag[i] = False
            cost += _try(problem, tree, i, -1.0)
    if cost > limit(tree):
        return False
    tree.value[UPPER] = cost
    tree.counts[FOUND] += 1
    for i in range(n):
        tree.best[i] = tree.flag[i]
    return True


@inner
def _is_chosen(tree: Tree, i: int) -> bool:
    for s in range(tree.ptr[i], tree.ptr[i + 1]):
        if tree.is_open[tree.where[s]] and tree.chosen[tree.where[s]]:
            return True
    return False


@inner
def _fits(problem: Problem, tree: Tree, i: int) -> bool:
    for s in range(problem.gptr[i], problem.gptr[i + 1]):
        if tree.held[problem.gclq[s]] > 0:
            return False
    return True


@inner
def _is_spare(problem: Problem, tree: Tree, i: int) -> bool:
    for s in range(problem.cptr[i], problem.cptr[i + 1]):
        if tree.supply[problem.columns[s]["row"]] - problem.columns[s]["entry"] < 1.0 - TOLERANCE:
            return False
    return True


@inner
def _try(problem: Problem, tree: Tree, i: int, sign: float) -> float:
    """Put a candidate into the plan on trial or take it out; by how much its cost grows."""
    for s in range(problem.cptr[i], problem.cptr[i + 1]):
        tree.supply[problem.columns[s]["row"]] += sign * problem.columns[s]["entry"]
    for s in range(problem.gptr[i], problem.gptr[i + 1]):
        tree.held[problem.gclq[s]] += 1 if sign > 0.0 else -1
    return float(sign * problem.cost[i])
