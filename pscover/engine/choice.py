"""Which candidates a node need not look at, and on which group it branches."""

# ruff: noqa: SIM110
# Loops, since generators do not compile.
from __future__ import annotations

import numpy as np

from .cheapest import cheapest
from .jit import inner
from .nodes import limit
from .problem import TOLERANCE, Problem
from .tree import FREE, WORK, Tree, exclude


@inner
def thin(problem: Problem, tree: Tree) -> None:
    """Leave out what another of its clique replaces, now that rows need less than they did."""
    for g in range(len(tree.gain)):
        for s in range(tree.gptr[g], tree.gptr[g + 1]):
            a = tree.grouped[s]
            if tree.state[a] != FREE:
                continue
            for u in range(tree.gptr[g], tree.gptr[g + 1]):
                b = tree.grouped[u]
                # What is in one clique only excludes no more than the other does.
                is_other = tree.state[b] == FREE and a != b and problem.gptr[b + 1] - problem.gptr[b] == 1
                if is_other and problem.cost[b] <= problem.cost[a] and _is_over(problem, tree, a, b):
                    exclude(tree, a)
                    break


@inner
def _is_over(problem: Problem, tree: Tree, a: int, b: int) -> bool:
    """Whether b gives every row at least what a does; of two that give the same, the first is over the second."""
    s, end = tree.ptr[b], tree.ptr[b + 1]
    is_more = problem.cost[b] < problem.cost[a]
    for t in range(tree.ptr[a], tree.ptr[a + 1]):
        j = problem.columns[t]["row"]
        if tree.need[j] <= TOLERANCE:
            continue
        while s < end and problem.columns[s]["row"] < j:
            is_more = is_more or tree.need[problem.columns[s]["row"]] > TOLERANCE
            s += 1
        if s == end or problem.columns[s]["row"] > j:
            return False
        mine, its = problem.columns[t]["entry"], problem.columns[s]["entry"]
        if its < mine and its < tree.need[j]:
            return False
        is_more = is_more or (its > mine and mine < tree.need[j])
        s += 1
    while s < end:
        is_more = is_more or tree.need[problem.columns[s]["row"]] > TOLERANCE
        s += 1
    return is_more or b < a


@inner
def most_telling(tree: Tree, lower: float) -> int:
    """The group for which the bound rises most both with and without it; -1 if no candidate is left."""
    slack = limit(tree) - lower + 1e-3
    gain, touched = tree.gain, tree.touched
    for g in range(len(gain)):
        gain[g] = 0.0
        touched[g] = False
    for j in range(len(tree.need)):
        if tree.need[j] <= TOLERANCE:
            continue
        first, end = tree.start[j], tree.start[j + 1]
        for t in range(first, end):
            tree.tried[t] = tree.is_open[t] and tree.mean[t] > 0.1
        for t in range(first, end):
            g = tree.group[t]
            if tree.tried[t] and (t == first or tree.group[t - 1] != g or not tree.tried[t - 1]):
                if touched[g] and gain[g] > slack:
                    continue
                if t > first and _had(tree, first, t, g):
                    continue
                touched[g] = True
                least = cheapest(
                    tree.labels, first, end, tree.need[j], tree.group, tree.amount, tree.share, tree.is_open, tree.idle, g
                )
                tree.counts[WORK] += tree.labels.sizes[1] + end - first
                gain[g] += max(0.0, min(1e6, least - tree.least[j]))
    best, best_score = -1, -1.0
    for g in range(len(gain)):
        least, many = np.inf, 0
        for s in range(tree.gptr[g], tree.gptr[g + 1]):
            i = tree.grouped[s]
            if tree.state[i] == FREE and _is_useful(tree, i):
                least = min(least, tree.penalty[i])
                many += 1
        if many == 0:
            continue
        score = (min(slack, gain[g]) + 1e-2 * slack) * (min(slack, least) + 1e-2 * slack) / np.sqrt(float(many))
        if score > best_score:
            best, best_score = g, score
    return best


@inner
def _had(tree: Tree, first: int, t: int, g: int) -> bool:
    """Whether an entry of the same group before this one was tried."""
    s = t - 1
    while s >= first and tree.group[s] == g:
        if tree.tried[s]:
            return True
        s -= 1
    return False


@inner
def _is_useful(tree: Tree, i: int) -> bool:
    for s in range(tree.ptr[i], tree.ptr[i + 1]):
        if tree.is_open[tree.where[s]]:
            return True
    return False
