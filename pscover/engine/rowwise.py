"""A bound from rows solved one by one: each row has its own copies of its candidates, which share the cost."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from .jit import copy, inner, kernel
from .problem import FloatArray, IntArray, Problem

UNITS = 120
"""Into how many units a row's demand is divided; entries are rounded up, so the bound stays valid; below 128."""
BOUND, LENGTH, TOP, STEPS = range(4)


class Shares(NamedTuple):
    """How candidates' costs are shared among their rows, and the rows as the dynamic programme reads them.

    Parameters
    ----------
    share, kept
        The share of each entry now and at the best bound, by row, shape (entries,); a candidate's shares sum to its cost.
    mean
        How often each entry was chosen lately, shape (entries,).
    starts
        Where each row's entries begin, shape (rows + 1,).
    candidate, group, units
        Of each entry: its candidate, its clique (numbered within the row, entries of a clique side by side) and its size.
    covers
        How many rows each candidate is in, shape (candidates,).
    chosen
        The entries of each row's last solution, as 0 and 1.
    penalty
        By how much the best bound rises at least when a candidate must be taken, shape (candidates,).
    value
        The best bound, the step length, the best bound when that was last reconsidered, and the steps taken.
    """

    share: FloatArray
    kept: FloatArray
    mean: FloatArray
    starts: IntArray
    candidate: IntArray
    group: IntArray
    units: IntArray
    covers: IntArray
    chosen: IntArray
    penalty: FloatArray
    value: FloatArray


def shares(problem: Problem, y: FloatArray) -> Shares:
    """Shares in proportion to what multipliers y of the rows let each row pay; the rest in equal parts."""
    n, entries = problem.candidates, len(problem.lines)
    row = np.repeat(np.arange(problem.rows), np.diff(problem.rptr))
    candidate = problem.lines["candidate"]
    home = problem.home[candidate].astype(np.int64)
    home = np.where(home < 0, int(problem.cliques[0]) + candidate, home)
    order = np.lexsort((home, row))
    row, home, candidate = row[order], home[order], np.ascontiguousarray(candidate[order])
    entry = problem.lines["entry"][order]
    pays = y[row] * entry
    total = np.bincount(candidate, pays, n)
    covers = np.bincount(candidate, minlength=n).astype(np.int32)
    factor = np.minimum(1.0, problem.cost / np.maximum(total, 1e-300))
    rest = (problem.cost - total * factor) / np.maximum(covers, 1)
    share = pays * factor[candidate] + rest[candidate]
    fresh = np.ones(entries, dtype=np.int64)
    fresh[1:] = (np.diff(home) != 0) | (np.diff(row) != 0)
    begin = np.cumsum(fresh) - 1
    group = (begin - begin[np.minimum(problem.rptr[row], entries - 1)]).astype(np.int32)
    return Shares(
        share=share,
        kept=share.copy(),
        mean=np.full(entries, -1.0),
        starts=problem.rptr,
        candidate=candidate,
        group=group,
        units=np.ceil(entry * UNITS - 1e-9).astype(np.int32),
        covers=covers,
        chosen=np.ones(entries, dtype=np.int32),
        penalty=np.zeros(n),
        value=np.array([-np.inf, 0.1, 0.0, 0.0]),
    )


@kernel
def improve(problem: Problem, state: Shares, steps: int, goal: float) -> float:
    """Move shares towards rows that want a candidate from rows that do not; the best bound so far.

    Lagrangian decomposition (Guignard and Kim 1987) by rows: the sum over rows of the cheapest choice that meets the row
    with at most one candidate a clique, found by dynamic programming, is a bound for any shares.
    """
    rows, n = len(state.starts) - 1, len(problem.cost)
    widest, longest = 0, 0
    for j in range(rows):
        first, last = state.starts[j], state.starts[j + 1]
        longest = max(longest, last - first)
        if last > first:
            widest = max(widest, state.group[last - 1] + 1)
    least = np.empty(UNITS + 1)
    before = np.empty(UNITS + 1)
    picks = np.empty((widest + 1, UNITS + 1), dtype=np.int32)
    penalty, mean = np.empty(n), np.empty(n)
    for _ in range(steps):
        total = 0.0
        penalty[:] = 0.0
        for j in range(rows):
            cheapest = _solve_row(state, j, least, before, picks)
            total += cheapest
            for t in range(state.starts[j], state.starts[j + 1]):
                more = state.share[t] + least[max(0, UNITS - state.units[t])] - cheapest
                if more > 0.0:
                    penalty[state.candidate[t]] += more
        total *= 1.0 - 1e-11
        if total > state.value[BOUND]:
            state.value[BOUND] = total
            copy(state.kept, state.share)
            copy(state.penalty, penalty)
        state.value[STEPS] += 1
        if state.value[STEPS] % 10 == 0:
            if state.value[BOUND] > state.value[TOP] + 1e-4 * abs(state.value[TOP]):
                state.value[LENGTH] = min(1.0, state.value[LENGTH] * 1.25)
            else:
                state.value[LENGTH] *= 0.5
                copy(state.share, state.kept)
            state.value[TOP] = state.value[BOUND]
        if goal <= total:
            break
        mean[:] = 0.0
        for t in range(len(state.share)):
            old = state.mean[t]
            state.mean[t] = state.chosen[t] if old < 0.0 else 0.8 * old + 0.2 * state.chosen[t]
            mean[state.candidate[t]] += state.mean[t]
        norm = 0.0
        for t in range(len(state.share)):
            i = state.candidate[t]
            d = state.mean[t] - mean[i] / state.covers[i]
            norm += d * d
        if norm <= 1e-18:
            break
        length = state.value[LENGTH] * (goal - total) / norm
        penalty[:] = 0.0
        for t in range(len(state.share)):
            i = state.candidate[t]
            state.share[t] = max(0.0, state.share[t] + length * (state.mean[t] - mean[i] / state.covers[i]))
            penalty[i] += state.share[t]
        for t in range(len(state.share)):
            i = state.candidate[t]
            if penalty[i] > 0.0:
                # Rounding must not let shares sum to more than the cost.
                state.share[t] *= problem.cost[i] / penalty[i] * (1.0 - 1e-14)
    return float(state.value[BOUND])


@inner
def _solve_row(state: Shares, j: int, least: FloatArray, before: FloatArray, picks: IntArray) -> float:
    """The cheapest choice that meets row j; `least[d]` becomes the cheapest that gives at least d units."""
    first, last = state.starts[j], state.starts[j + 1]
    upper = 0.0
    for t in range(first, last):
        if state.chosen[t] == 1:
            upper += state.share[t]
    upper += 1e-12
    least[0] = 0.0
    for d in range(1, UNITS + 1):
        least[d] = np.inf
    height = 0
    t = first
    while t < last:
        group = state.group[t]
        begun = False
        while t < last and state.group[t] == group:
            price, size = state.share[t], state.units[t]
            # Dearer than a choice at hand: in no cheapest one.
            if price <= upper:
                if not begun:
                    begun = True
                    copy(before, least)
                    for d in range(UNITS + 1):
                        picks[height, d] = -1
                for d in range(UNITS + 1):
                    e = min(UNITS, d + size)
                    if before[d] + price < least[e]:
                        least[e] = before[d] + price
                        picks[height, e] = t * 128 + d
            t += 1
        if begun:
            height += 1
    for t in range(first, last):
        state.chosen[t] = 0
    d = UNITS
    for h in range(height - 1, -1, -1):
        pick = picks[h, d]
        if pick >= 0:
            state.chosen[pick // 128] = 1
            d = pick % 128
    for d in range(UNITS - 1, -1, -1):
        least[d] = min(least[d], least[d + 1])
    return float(least[UNITS])
