"""Lagrangian bound: rows priced by multipliers, at most the best candidate of each clique taken."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from .jit import copy, inner, kernel
from .problem import FloatArray, IntArray, Problem

PERIOD = 20
"""Steps after which the length of a step is reconsidered."""
# Places in Multipliers.value.
BOUND, LENGTH, LOW, HIGH, STEPS, LAST = range(6)


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
        The best bound, the step length, lowest and highest bound of the period, the number of steps, and the best bound when
        the period began.
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
    return begun(problem, y, 0.5)


def carried(problem: Problem, old: Multipliers) -> Multipliers:
    """The best multipliers for a problem with the same rows and fewer candidates."""
    return begun(problem, old.kept, max(0.02, float(old.value[LENGTH])))


def begun(problem: Problem, y: FloatArray, length: float) -> Multipliers:
    """The method at multipliers y, before its first step, which is of such a length."""
    n, m = problem.candidates, len(y)
    value = np.array([-np.inf, length, np.inf, -np.inf, 0.0, 0.0])
    return Multipliers(y.copy(), y.copy(), problem.cost.copy(), np.zeros(m), np.zeros(n), value)


def ascend(problem: Problem, state: Multipliers, steps: int, goal: float) -> float:
    """Take steps towards the best multipliers; the best bound so far (Held, Wolfe, Crowder 1974; Caprara et al. 1999).

    The bound is sum_j y_j + sum over cliques of min(0, least reduced cost) + the negative reduced costs outside cliques:
    valid because a candidate's other cliques are left out. `goal` is the cost of a plan, which the steps aim at.
    """
    n, cliques = problem.candidates, int(problem.cliques[0])
    whole = np.empty(n + cliques, dtype=np.int32)
    climb(problem, state, steps, goal, np.empty(problem.rows), np.empty(n), np.empty(cliques), whole[:n], whole[n:])
    return float(state.value[BOUND])


@kernel
def climb(
    problem: Problem,
    state: Multipliers,
    steps: int,
    goal: float,
    slack: FloatArray,
    reduced: FloatArray,
    least: FloatArray,
    picked: IntArray,
    which: IntArray,
) -> None:
    """Take steps, with room for a number of each row, two of each candidate and two of each clique."""
    n, m = len(reduced), len(slack)
    y, value, chosen, columns, cptr = state.y, state.value, state.chosen, problem.columns, problem.cptr
    for _ in range(steps):
        for h in range(len(least)):
            least[h] = 0.0
            which[h] = -1
        total = 0.0
        for j in range(m):
            total += y[j]
            slack[j] = 1.0
        size = total
        count = 0
        for i in range(n):
            r = problem.cost[i]
            for t in range(cptr[i], cptr[i + 1]):
                entry = columns[t]
                r -= y[entry["row"]] * entry["entry"]
            reduced[i] = r
            chosen[i] *= 0.95
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
        for s in range(count):
            i = picked[s]
            total += reduced[i]
            size -= reduced[i]
            chosen[i] += 0.05
            for t in range(cptr[i], cptr[i + 1]):
                entry = columns[t]
                slack[entry["row"]] -= entry["entry"]
        total -= 1e-12 * size
        if total > value[BOUND]:
            value[BOUND] = total
            copy(state.kept, y)
            copy(state.reduced, reduced)
        _reconsider(value, total, y, state.kept)
        norm = 0.0
        for j in range(m):
            d = slack[j]
            if d < 0.0 and y[j] <= 0.0:
                d = 0.0
            d = 0.7 * d + 0.3 * state.direction[j]
            state.direction[j] = d
            norm += d * d
        if norm <= 1e-18 or goal <= total:
            break
        step = value[LENGTH] * (goal - total) / norm
        for j in range(m):
            more = y[j] + step * state.direction[j]
            y[j] = more if more > 0.0 else 0.0


@inner
def _reconsider(value: FloatArray, total: float, y: FloatArray, kept: FloatArray) -> None:
    """At the end of a period: steady progress asks for longer steps, none for shorter ones from the best point."""
    if total < value[LOW]:
        value[LOW] = total
    if total > value[HIGH]:
        value[HIGH] = total
    value[STEPS] += 1
    if value[STEPS] % PERIOD != 0:
        return
    length, high, last = value[LENGTH], value[HIGH], value[LAST]
    if high > last + 1e-4 * abs(last):
        length *= 1.3
        value[LENGTH] = length if length < 2.0 else 2.0
    elif high <= last:
        length *= 0.6
        value[LENGTH] = length if length > 1e-4 else 1e-4
        copy(y, kept)
    value[LAST] = value[BOUND]
    value[LOW], value[HIGH] = np.inf, -np.inf
