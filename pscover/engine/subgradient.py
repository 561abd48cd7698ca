"""Lagrangian bound: rows priced by multipliers, at most the best candidate of each clique taken."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from .jit import copy, kernel
from .problem import FloatArray, Problem

PERIOD = 20
"""Steps after which the length of a step is reconsidered."""
# Places in Multipliers.value.
BOUND, LENGTH, LOW, HIGH, STEPS = range(5)


class Multipliers(NamedTuple):
    """Row multipliers as a subgradient method moves them.

    Parameters
    ----------
    y, kept
        The current and the best multipliers, shape (rows,).
    reduced
        Reduced costs c - y W at the best bound, shape (candidates,).
    direction
        The smoothed subgradient, shape (rows,).
    chosen
        Shape (candidates,): what the inner problem chose last, averaged over steps: near a point of the relaxation.
    value
        The best bound, the step length, lowest and highest bound of the period, and the number of steps.
    """

    y: FloatArray
    kept: FloatArray
    reduced: FloatArray
    direction: FloatArray
    chosen: FloatArray
    value: FloatArray


def multipliers(problem: Problem) -> Multipliers:
    """Where the method starts: each row pays what its cheapest candidate asks, shared over that candidate's entries."""
    n = problem.candidates
    total = np.bincount(problem.lines["candidate"], problem.lines["entry"], n)
    each = problem.cost / np.maximum(total, 1e-12)
    y = np.zeros(problem.rows)
    filled = np.diff(problem.rptr) > 0
    if filled.any():
        y[filled] = np.minimum.reduceat(each[problem.lines["candidate"]], problem.rptr[:-1][filled])
    value = np.array([-np.inf, 0.5, np.inf, -np.inf, 0.0, 0.0])
    return Multipliers(y, y.copy(), problem.cost.copy(), np.zeros(problem.rows), np.zeros(n), value)


def carried(problem: Problem, old: Multipliers) -> Multipliers:
    """The best multipliers for a problem with the same rows and fewer candidates."""
    n = problem.candidates
    value = np.array([-np.inf, max(0.02, old.value[LENGTH]), np.inf, -np.inf, 0.0, 0.0])
    return Multipliers(old.kept.copy(), old.kept.copy(), problem.cost.copy(), np.zeros(problem.rows), np.zeros(n), value)


@kernel
def ascend(problem: Problem, state: Multipliers, steps: int, goal: float) -> float:
    """Take steps towards the best multipliers; the best bound so far (Held, Wolfe, Crowder 1974; Caprara et al. 1999).

    The bound is sum_j y_j + sum over cliques of min(0, least reduced cost) + the negative reduced costs outside cliques:
    valid because a candidate's other cliques are left out. `goal` is the cost of a plan, which the steps aim at.
    """
    n, m = len(problem.cost), len(state.y)
    least = np.zeros(problem.cliques[0])
    which = np.zeros(problem.cliques[0], dtype=np.int32)
    slack = np.empty(m)
    reduced = np.empty(n)
    picked = np.empty(n, dtype=np.int32)
    for _ in range(steps):
        least[:] = 0.0
        which[:] = -1
        total, size = 0.0, 0.0
        for j in range(m):
            total += state.y[j]
            slack[j] = 1.0
        size = total
        count = 0
        for i in range(n):
            r = problem.cost[i]
            for t in range(problem.cptr[i], problem.cptr[i + 1]):
                r -= state.y[problem.columns[t]["row"]] * problem.columns[t]["entry"]
            reduced[i] = r
            if r < 0.0:
                h = problem.home[i]
                if h < 0:
                    picked[count] = i
                    count += 1
                elif r < least[h]:
                    least[h] = r
                    which[h] = i
        for h in range(len(which)):
            if which[h] >= 0:
                picked[count] = which[h]
                count += 1
        for i in range(n):
            state.chosen[i] *= 0.95
        for s in range(count):
            i = picked[s]
            total += reduced[i]
            size -= reduced[i]
            state.chosen[i] += 0.05
            for t in range(problem.cptr[i], problem.cptr[i + 1]):
                slack[problem.columns[t]["row"]] -= problem.columns[t]["entry"]
        total -= 1e-12 * size
        if total > state.value[0]:
            state.value[0] = total
            copy(state.kept, state.y)
            copy(state.reduced, reduced)
        state.value[2] = min(state.value[2], total)
        state.value[3] = max(state.value[3], total)
        state.value[4] += 1
        if state.value[4] % PERIOD == 0:
            # Steady progress asks for longer steps, none for shorter ones from the best point.
            if state.value[3] > state.value[5] + 1e-4 * abs(state.value[5]):
                state.value[1] = min(2.0, state.value[1] * 1.3)
            elif state.value[3] <= state.value[5]:
                state.value[1] = max(1e-4, state.value[1] * 0.6)
                copy(state.y, state.kept)
            state.value[5] = state.value[0]
            state.value[2], state.value[3] = np.inf, -np.inf
        norm = 0.0
        for j in range(m):
            if state.y[j] <= 0.0 and slack[j] < 0.0:
                slack[j] = 0.0
            d = 0.7 * slack[j] + 0.3 * state.direction[j]
            state.direction[j] = d
            norm += d * d
        if norm <= 1e-18 or goal <= total:
            break
        step = state.value[1] * (goal - total) / norm
        for j in range(m):
            state.y[j] = max(0.0, state.y[j] + step * state.direction[j])
    return float(state.value[0])
