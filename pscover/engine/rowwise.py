"""A bound from rows solved one by one: each row has its own copies of its candidates, which share the cost."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from .jit import copy, inner, kernel, wide
from .problem import FloatArray, IntArray, Problem

FINEST, COARSEST, WORK = 480, 120, 60_000_000
"""Into how many units a row's demand is divided at most, and at least, and how many of them all entries have to look at."""
SHORT = 0.02
"""Once steps are this short, they start anew, longer, and are shortened with more patience."""
NEAR = 0.005
"""Steps from good shares on are so short at first."""
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
    full
        Into how many units a row's demand is divided; entries are rounded up, so that the bound stays valid.
    least
        What each row costs at least at the best shares, shape (rows,).
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
    full: int
    least: FloatArray
    low: IntArray
    high: IntArray
    chosen: IntArray
    penalty: FloatArray
    value: FloatArray


def shares(problem: Problem, y: FloatArray, full: int = COARSEST) -> Shares:
    """Shares in proportion to what multipliers y of the rows let each row pay; the rest in equal parts."""
    row = np.repeat(np.arange(problem.rows), np.diff(problem.rptr))
    return shares_of(problem, y[row] * problem.lines["entry"], full)


def resolution(problem: Problem) -> int:
    """Into how many units demands are divided where they had better be told apart well: fewer for more entries."""
    full = FINEST
    while full > COARSEST and full * len(problem.lines) > WORK:
        full //= 2
    return full


def shares_of(problem: Problem, paid: FloatArray, full: int = COARSEST) -> Shares:
    """Shares in proportion to what rows pay, in the order of the problem's lines; the rest of the costs in equal parts."""
    n, entries = problem.candidates, len(problem.lines)
    row, order = laid(problem)
    candidate, entry = np.ascontiguousarray(problem.lines["candidate"][order]), problem.lines["entry"][order]
    home = problem.homes[candidate]
    pays = paid[order]
    total = np.bincount(candidate, pays, n)
    covers = np.bincount(candidate, minlength=n).astype(np.int32)
    factor = np.minimum(1.0, problem.cost / np.maximum(total, 1e-300))
    # Never negative, not even by rounding: prices fall with a row's need, or its choice cannot be traced back.
    rest = np.maximum(problem.cost - total * factor, 0.0) / np.maximum(covers, 1)
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
        units=np.ceil(entry * full - 1e-9).astype(np.int32),
        covers=covers,
        full=full,
        least=np.zeros(problem.rows),
        low=np.zeros(problem.rows, dtype=np.int32),
        high=np.full(problem.rows, -1, dtype=np.int32),
        chosen=np.ones(entries, dtype=np.int32),
        penalty=np.zeros(n),
        value=np.array([-np.inf, 0.1, 0.0, 0.0, 0.0]),
    )


def known(state: Shares, paid: FloatArray, least: FloatArray, steps: int) -> None:
    """Begin with what is known of rows that pay so much, by row and clique, which is more than their shares by rounding.

    From there on steps are short, as if so many had been taken.
    """
    row = np.repeat(np.arange(len(state.low)), np.diff(state.starts))
    state.least[:] = np.maximum(least - np.bincount(row, np.maximum(paid - state.share, 0.0), len(state.low)), 0.0)
    bound = float(state.least.sum()) * (1.0 - 1e-11)
    state.value[:] = bound, NEAR, bound, steps, 1.0


def tolls(problem: Problem, y: FloatArray) -> FloatArray:
    """What to add to the costs, the same in a clique, so that rows that pay y a unit pay no more than that.

    As a plan takes one candidate of a clique at most, all plans then cost more by what `tolled` sums up, or less than that.
    Candidates in no clique need none: that each is taken once at most, rows know by themselves.
    """
    row = np.repeat(np.arange(problem.rows), np.diff(problem.rptr))
    paid = np.bincount(problem.lines["candidate"], y[row] * problem.lines["entry"], problem.candidates)
    return _most(problem, np.where(problem.home < 0, 0.0, np.maximum(paid - problem.cost, 0.0)))[problem.homes]


def tolled(problem: Problem, toll: FloatArray) -> tuple[Problem, float]:
    """The problem with a toll on its costs, and how much dearer that makes plans at most."""
    return problem._replace(cost=problem.cost + toll), float(_most(problem, toll).sum()) * (1 + 1e-12)


def _most(problem: Problem, toll: FloatArray) -> FloatArray:
    most = np.zeros(int(problem.cliques[0]) + problem.candidates)
    np.maximum.at(most, problem.homes, toll)
    return most


def laid(problem: Problem) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """The row of each entry, and in which order shares have the problem's entries: by row and clique."""
    row = np.repeat(np.arange(problem.rows), np.diff(problem.rptr))
    return row, np.lexsort((problem.homes[problem.lines["candidate"]], row))


def without(old: Shares, gone: NDArray[np.bool_]) -> Shares:
    """The best shares of the candidates that are not gone, which are numbered anew."""
    stays = ~gone[old.candidate]
    row = np.repeat(np.arange(len(old.low)), np.diff(old.starts))[stays]
    number = np.cumsum(~gone) - 1
    # Rows cost no less, and what they do cost is found anew.
    value = np.array([old.value[BOUND] * (1 - 1e-9), max(old.value[LENGTH], SHORT), 0.0, 0.0, old.value[PATIENT]])
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


def improve(problem: Problem, state: Shares, steps: int, goal: float) -> float:
    """Move shares towards rows that want a candidate from rows that do not; the best bound so far.

    Lagrangian decomposition (Guignard and Kim 1987) by rows: the sum over rows of the cheapest choice that meets the row
    with at most one candidate a clique, found by dynamic programming, is a bound for any shares. Plus infinity where a row
    cannot be met.
    """
    n = problem.candidates
    widest = int(state.group.max(initial=-1)) + 1
    levels = max(int(state.low.max(initial=0)), int(state.high.max(initial=0)))
    table, begins = np.empty((widest + 1) * (levels + 1) * (2 * state.full + 1)), np.empty(widest + 1, dtype=np.int32)
    move(problem.cost, state, steps, goal, table, begins, np.empty(problem.rows), np.empty(n), np.empty(n))
    return float(state.value[BOUND])


@kernel
def move(
    cost: FloatArray,
    state: Shares,
    steps: int,
    goal: float,
    table: FloatArray,
    begins: IntArray,
    least: FloatArray,
    penalty: FloatArray,
    mean: FloatArray,
) -> None:
    """Move shares, with room for the prices and beginnings of a row's cliques, for a number a row and two a candidate."""
    share, value, n, full = state.share, state.value, len(cost), state.full
    for _ in range(steps):
        total = 0.0
        for i in range(n):
            penalty[i] = mean[i] = 0.0
        for j in range(len(state.low)):
            cheapest, final = _solve_row(state, j, table, begins)
            if cheapest >= NEVER:
                value[BOUND] = np.inf
                return
            least[j] = cheapest
            total += cheapest
            if state.low[j] == 0 and state.high[j] < 0:
                for t in range(state.starts[j], state.starts[j + 1]):
                    more = share[t] + table[final + 2 * full - state.units[t]] - cheapest
                    if more > 0.0:
                        penalty[state.candidate[t]] += more
        total *= 1.0 - 1e-11
        if total > value[BOUND]:
            value[BOUND] = total
            copy(state.kept, share)
            copy(state.penalty, penalty)
            copy(state.least, least)
        _reconsider(value, share, state.kept)
        if goal <= total:
            return
        for t in range(len(share)):
            old, new = state.mean[t], state.chosen[t]
            new = new if old < 0.0 else 0.8 * old + 0.2 * new
            state.mean[t] = new
            mean[state.candidate[t]] += new
        for i in range(n):
            penalty[i] = 0.0
            if state.covers[i] > 0:
                mean[i] /= state.covers[i]
        norm = 0.0
        for t in range(len(share)):
            d = state.mean[t] - mean[state.candidate[t]]
            norm += d * d
        if norm <= 1e-18:
            return
        length = value[LENGTH] * (goal - total) / norm
        for t in range(len(share)):
            i = state.candidate[t]
            more = share[t] + length * (state.mean[t] - mean[i])
            share[t] = more if more > 0.0 else 0.0
            penalty[i] += share[t]
        for t in range(len(share)):
            i = state.candidate[t]
            if penalty[i] > 0.0:
                # Rounding must not let shares sum to more than the cost.
                share[t] *= cost[i] / penalty[i] * (1.0 - 1e-14)


NEVER = 1e30
"""The price of what cannot be."""


@inner
def _reconsider(value: FloatArray, share: FloatArray, kept: FloatArray) -> None:
    """Every tenth step: longer steps if the bound has risen, else shorter ones; at first boldly, from the best point."""
    value[STEPS] += 1
    if value[STEPS] % 10 != 0:
        return
    top, length = value[TOP], value[LENGTH]
    rise = value[BOUND] - top
    value[TOP] = value[BOUND]
    if value[PATIENT] != 0.0:
        length *= 1.1 if rise > 2e-5 * abs(top) else 0.8
    elif rise > 1e-4 * abs(top):
        length *= 1.25
    else:
        length *= 0.5
        copy(share, kept)
    if length > 1.0:
        length = 1.0
    if value[PATIENT] == 0.0 and length < SHORT:
        value[PATIENT] = 1.0
        length = RESTART
    value[LENGTH] = length


RESTART = 0.1
"""The length with which patient steps begin."""


@inner
def _solve_row(state: Shares, j: int, table: FloatArray, begins: IntArray) -> tuple[float, int]:
    """The cheapest choice that meets row j, and where the prices begin that count all its cliques.

    After each clique, the table holds a span of prices for each number e of entries: that of at least d units, of `full` in
    all, at full + d, and below those what less than none costs. Where there is no most, the last e stands for as many or
    more.
    """
    share, chosen, units, groups = state.share, state.chosen, state.units, state.group
    first, last = state.starts[j], state.starts[j + 1]
    low, high, full = state.low[j], state.high[j], state.full
    top = low if high < 0 else high
    span = 2 * full + 1
    size = (top + 1) * span
    upper = 0.0
    for t in range(first, last):
        if chosen[t] == 1:
            upper += share[t]
        chosen[t] = 0
    upper += 1e-12
    for d in range(size):
        table[d] = 0.0 if d <= full else NEVER
    now, height, group = wide(0), 0, -1
    for t in range(first, last):
        price = share[t]
        # Dearer than a choice at hand: in no cheapest one.
        if price > upper:
            continue
        if groups[t] != group:
            group = groups[t]
            begins[height] = t
            height += 1
            _copy_on(table, now, size)
            now += size
        if top == 0 and high < 0:
            _lower(table, now - span + full - units[t], now + full, price, full)
        else:
            _take(table, now, top, high < 0, price, units[t], full)
    at = low * span + 2 * full
    for e in range(low + 1, top + 1):
        if table[now + e * span + 2 * full] < table[now + at]:
            at = e * span + 2 * full
    cheapest = table[now + at]
    if cheapest < NEVER:
        for h in range(height - 1, -1, -1):
            before = h * size
            if table[before + at] > table[before + size + at]:
                t, at = _entry_at(share, units, begins[h], table, before, size, at, top if high < 0 else -1, full)
                chosen[t] = 1
    return cheapest, now


@inner
def _entry_at(
    share: FloatArray, units: IntArray, begin: int, table: FloatArray, before: int, size: int, at: int, stays: int, full: int
) -> tuple[int, int]:
    """The entry, from one on, to which a price is due, and where the price is that those before it have to make up.

    `stays` is the number of entries that stands for more as well.
    """
    due = table[before + size + at]
    span = 2 * full + 1
    e, d = at // span, at % span - full
    t = wide(begin)
    while True:
        rest = at - (units[t] if units[t] < d else d)
        if e > 0 and table[before + rest - span] + share[t] == due:
            return t, rest - span
        if e == stays and table[before + rest] + share[t] == due:
            return t, rest
        t += 1


@inner
def _take(table: FloatArray, now: int, top: int, has_no_most: bool, price: float, units: int, full: int) -> None:
    """Lower the prices of all numbers of entries that one more brings."""
    span = 2 * full + 1
    source, target = now - (top + 1) * span + full - units, now + full
    for e in range(top + 1 if has_no_most else top):
        to = target + (e + 1 if e < top else top) * span
        _lower(table, source + e * span, to, price, full)
    for e in range(1, top + 1):
        to = target + e * span
        for d in range(to - full, to):
            table[d] = table[to]


@inner
def _copy_on(table: FloatArray, begin: int, size: int) -> None:
    """Begin a clique where the last one ended; with indices that never wrap it is vector code."""
    a, b = np.uintp(begin), np.uintp(begin + size)
    for d in range(np.uintp(size)):
        table[b + d] = table[a + d]


@inner
def _lower(table: FloatArray, source: int, target: int, price: float, full: int) -> None:
    """Lower full + 1 prices to those at the source and so much more, in vector code as well."""
    a, b = np.uintp(source), np.uintp(target)
    for d in range(np.uintp(full + 1)):
        more, old = table[a + d] + price, table[b + d]
        table[b + d] = more if more < old else old
