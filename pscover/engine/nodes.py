"""What every plan below a node costs at least: its rows, each on its own, and shares moved between them."""

from __future__ import annotations

import numpy as np

from .cheapest import cheapest, least_for
from .jit import inner
from .problem import TOLERANCE, Problem
from .tree import ENOUGH, FREE, LENGTH, NODES, SPENT, STEP, UPPER, WORK, Tree, exclude

PERIOD, PAUSE = 10, 4
"""Steps after which their length is reconsidered, at the root and below it."""
WORTH = 3
"""How many times the gain of the last steps must reach the goal for more of them to be worth it, below the root."""
MOST = 150
"""Most steps of a node."""
SHORTEST = 0.01
"""Steps shorter than this, relative to what would reach the goal, bring nothing."""


@inner
def limit(tree: Tree) -> float:
    """The most that a plan worth finding may cost."""
    upper = tree.value[UPPER]
    if upper > 1e300:
        return 1e300
    return float(upper - tree.value[STEP] + (1e-6 if tree.value[STEP] > 0.0 else -1e-9) * max(1.0, abs(upper)))


@inner
def bound(problem: Problem, tree: Tree) -> float:
    """The best bound of the node found by a few steps; candidates that no cheaper plan holds are left out on the way."""
    most = limit(tree)
    is_root = tree.counts[NODES] == 1
    period = PERIOD if is_root else PAUSE
    best, last = -np.inf, -np.inf
    length = 0.1 if is_root else tree.value[LENGTH]
    for step in range(1, MOST + 1):
        total = _solve_rows(problem, tree)
        if total > most:
            return total
        if total > best:
            best = total
            for t in range(len(tree.share)):
                tree.kept[t] = tree.share[t]
        for i in range(len(tree.state)):
            if tree.state[i] == FREE and total + tree.penalty[i] > most:
                exclude(tree, i)
        if tree.counts[WORK] > tree.counts[ENOUGH]:
            # No time is left for more steps; the bound holds as it is.
            break
        if step % period == 0:
            gained = best - last
            if not is_root and best + WORTH * gained < most:
                break
            if gained > 1e-4 * abs(best):
                length = min(1.0, 1.25 * length)
            else:
                length *= 0.5
                for t in range(len(tree.share)):
                    tree.share[t] = tree.kept[t]
            if length < SHORTEST:
                break
            last = best
        goal = most + tree.value[STEP] if most < 1e299 else 1.2 * best
        _move(problem, tree, length * (goal - total))
    for t in range(len(tree.share)):
        tree.share[t] = tree.kept[t]
    if is_root:
        tree.value[LENGTH] = max(0.05, length)
    return best


@inner
def _solve_rows(problem: Problem, tree: Tree) -> float:
    """What the rows cost at least, each on its own, with all that is in; penalties and means come with it."""
    total = tree.value[SPENT]
    share, mean, chosen = tree.share, tree.mean, tree.chosen
    for i in range(len(tree.state)):
        tree.penalty[i] = 0.0
    for j in range(len(tree.need)):
        if tree.need[j] <= TOLERANCE:
            continue
        first, end = tree.start[j], tree.start[j + 1]
        least = cheapest(tree.labels, first, end, tree.need[j], tree.group, tree.amount, share, tree.is_open, chosen, -1)
        tree.counts[WORK] += tree.labels.sizes[1] + end - first
        tree.least[j] = least
        if least == np.inf:
            return np.inf
        total += least
        for t in range(first, end):
            if tree.is_open[t]:
                more = share[t] + least_for(tree.labels, tree.need[j] - tree.amount[t], least) - least
                if more > 0.0:
                    tree.penalty[tree.candidate[t]] += more
                now = 1.0 if chosen[t] else 0.0
                mean[t] = now if mean[t] < 0.0 else 0.75 * mean[t] + 0.25 * now
    return float(total - 1e-11 * abs(total))


@inner
def _move(problem: Problem, tree: Tree, length: float) -> None:
    """Move shares by so much over the squared length of the subgradient."""
    share, mean = tree.share, tree.mean
    norm = 0.0
    for i in range(len(tree.state)):
        tree.sum[i] = 0.0
        if tree.state[i] != FREE:
            continue
        wanted, rows = 0.0, 0
        for s in range(tree.ptr[i], tree.ptr[i + 1]):
            t = tree.where[s]
            if tree.is_open[t]:
                wanted += mean[t]
                rows += 1
        if rows > 0:
            wanted /= rows
            for s in range(tree.ptr[i], tree.ptr[i + 1]):
                t = tree.where[s]
                if tree.is_open[t]:
                    norm += (mean[t] - wanted) ** 2
        tree.sum[i] = wanted
    factor = length / norm if norm > 1e-18 else 0.0
    for i in range(len(tree.state)):
        if tree.state[i] != FREE:
            continue
        paid, rows = 0.0, 0
        for s in range(tree.ptr[i], tree.ptr[i + 1]):
            t = tree.where[s]
            if tree.is_open[t]:
                share[t] = max(0.0, share[t] + factor * (mean[t] - tree.sum[i]))
                paid += share[t]
                rows += 1
        for s in range(tree.ptr[i], tree.ptr[i + 1]):
            t = tree.where[s]
            if tree.is_open[t]:
                # Rounding must not let shares sum to more than the cost.
                share[t] = (share[t] / paid if paid > 0.0 else 1.0 / rows) * problem.cost[i] * (1.0 - 1e-14)
