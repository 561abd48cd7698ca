"""A bound from rows solved one by one: each row has its own copies of its candidates, which share the cost."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from .jit import copy, inner, kernel
from .problem import FloatArray, IntArray, Problem

UNITS = 120
"""Into how many units a row's demand is divided; entries are rounded up, so the bound stays valid."""
SHORT = 0.02
"""Once steps are this short, they start anew, longer, and are shortened with more patience."""
BOUND, LENGTH, TOP, STEPS, PATIENT = range(5)


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
    low, high
        The least and the most entries that each row's choice may have; -1 for no most.
    chosen
        The entries of each row's last solution, as 0 and 1.
    penalty
        By how much the best bound rises at least when a candidate must be taken, shape (candidates,).
    value
        The best bound, the step length, the best bound when that was last reconsidered, the steps taken, and whether steps
        are shortened patiently.
    """

    share: FloatArray
    kept: FloatArray
    mean: FloatArray
    starts: IntArray
    candidate: IntArray
    group: IntArray
    units: IntArray
    covers: IntArray
    low: IntArray
    high: IntArray
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
        low=np.zeros(problem.rows, dtype=np.int32),
        high=np.full(problem.rows, -1, dtype=np.int32),
        chosen=np.ones(entries, dtype=np.int32),
        penalty=np.zeros(n),
        value=np.array([-np.inf, 0.1, 0.0, 0.0, 0.0]),
    )


def without(old: Shares, gone: NDArray[np.bool_]) -> Shares:
    """The best shares of the candidates that are not gone, which are numbered anew."""
    stays = ~gone[old.candidate]
    row = np.repeat(np.arange(len(old.low)), np.diff(old.starts))[stays]
    number = np.cumsum(~gone) - 1
    value = np.array([-np.inf, max(old.value[LENGTH], SHORT), 0.0, 0.0, old.value[PATIENT]])
    return old._replace(
        share=old.kept[stays],
        kept=old.kept[stays],
        mean=old.mean[stays],
        starts=np.searchsorted(row, np.arange(len(old.low) + 1)).astype(np.int32),
        candidate=number[old.candidate[stays]].astype(np.int32),
        group=old.group[stays],
        units=old.units[stays],
        covers=old.covers[~gone],
        chosen=np.ones(int(stays.sum()), dtype=np.int32),
        penalty=np.zeros(int((~gone).sum())),
        value=value,
    )


@kernel
def improve(problem: Problem, state: Shares, steps: int, goal: float) -> float:
    """Move shares towards rows that want a candidate from rows that do not; the best bound so far.

    Lagrangian decomposition (Guignard and Kim 1987) by rows: the sum over rows of the cheapest choice that meets the row
    with at most one candidate a clique, found by dynamic programming, is a bound for any shares. Plus infinity where a row
    cannot be met.
    """
    rows, n = len(state.starts) - 1, len(problem.cost)
    widest, levels = 0, 0
    for j in range(rows):
        first, last = state.starts[j], state.starts[j + 1]
        levels = max(levels, state.low[j], state.high[j])
        if last > first:
            widest = max(widest, state.group[last - 1] + 1)
    least = np.empty((levels + 1, UNITS + 1))
    before = np.empty((levels + 1, UNITS + 1))
    picks = np.empty((widest + 1, levels + 1, UNITS + 1), dtype=np.int32)
    penalty, mean = np.empty(n), np.empty(n)
    for _ in range(steps):
        total = 0.0
        penalty[:] = 0.0
        for j in range(rows):
            cheapest = _solve_row(state, j, least, before, picks)
            if cheapest >= NEVER:
                state.value[BOUND] = np.inf
                return np.inf
            total += cheapest
            if state.low[j] == 0 and state.high[j] < 0:
                for t in range(state.starts[j], state.starts[j + 1]):
                    more = state.share[t] + least[0, max(0, UNITS - state.units[t])] - cheapest
                    if more > 0.0:
                        penalty[state.candidate[t]] += more
        total *= 1.0 - 1e-11
        if total > state.value[BOUND]:
            state.value[BOUND] = total
            copy(state.kept, state.share)
            copy(state.penalty, penalty)
        _reconsider(state)
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


NEVER = 1e30
"""The price of what cannot be."""


@inner
def _reconsider(state: Shares) -> None:
    """Every tenth step: longer steps if the bound has risen, else shorter ones; at first boldly, from the best point."""
    state.value[STEPS] += 1
    if state.value[STEPS] % 10 != 0:
        return
    rise = state.value[BOUND] - state.value[TOP]
    if state.value[PATIENT] == 0.0:
        if rise > 1e-4 * abs(state.value[TOP]):
            state.value[LENGTH] = min(1.0, state.value[LENGTH] * 1.25)
        else:
            state.value[LENGTH] *= 0.5
            copy(state.share, state.kept)
        if state.value[LENGTH] < SHORT:
            state.value[PATIENT], state.value[LENGTH] = 1.0, RESTART
    else:
        longer = rise > 2e-5 * abs(state.value[TOP])
        state.value[LENGTH] = min(1.0, state.value[LENGTH] * (1.1 if longer else 0.8))
    state.value[TOP] = state.value[BOUND]


RESTART = 0.1
"""The length with which patient steps begin."""


@inner
def _solve_row(state: Shares, j: int, least: FloatArray, before: FloatArray, picks: IntArray) -> float:
    """The cheapest choice that meets row j; `least[e, d]` becomes the cheapest of e entries that gives at least d units.

    Where there is no most, the last e stands for as many or more.
    """
    first, last = state.starts[j], state.starts[j + 1]
    low, high = state.low[j], state.high[j]
    top = low if high < 0 else high
    upper = 0.0
    for t in range(first, last):
        if state.chosen[t] == 1:
            upper += state.share[t]
    upper += 1e-12
    for e in range(top + 1):
        for d in range(UNITS + 1):
            least[e, d] = NEVER
    least[0, 0] = 0.0
    height = 0
    t = first
    while t < last:
        group = state.group[t]
        begun = False
        while t < last and state.group[t] == group:
            # Dearer than a choice at hand: in no cheapest one.
            if state.share[t] <= upper:
                if not begun:
                    begun = True
                    for e in range(top + 1):
                        for d in range(UNITS + 1):
                            before[e, d] = least[e, d]
                            picks[height, e, d] = -1
                for e in range(1, top + 1):
                    _take(before[e - 1], least[e], picks[height, e], state.share[t], state.units[t], 2 * t)
                if high < 0:
                    _take(before[top], least[top], picks[height, top], state.share[t], state.units[t], 2 * t + 1)
            t += 1
        if begun:
            height += 1
    for t in range(first, last):
        state.chosen[t] = 0
    e = low
    for k in range(low, top + 1):
        if least[k, UNITS] < least[e, UNITS]:
            e = k
    cheapest = least[e, UNITS]
    if cheapest >= NEVER:
        return NEVER
    d = UNITS
    for h in range(height - 1, -1, -1):
        pick = picks[h, e, d]
        if pick >= 0:
            state.chosen[pick // 2] = 1
            d = max(0, d - state.units[pick // 2])
            if pick % 2 == 0:
                e -= 1
    return float(cheapest)


@inner
def _take(before: FloatArray, least: FloatArray, picks: IntArray, price: float, size: int, mark: int) -> None:
    """Lower the states that one more entry reaches."""
    base = before[0] + price
    for d in range(min(size, UNITS) + 1):
        if base < least[d]:
            least[d], picks[d] = base, mark
    for d in range(size + 1, UNITS + 1):
        more = before[d - size] + price
        if more < least[d]:
            least[d], picks[d] = more, mark
