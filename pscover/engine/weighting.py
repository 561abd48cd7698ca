"""Local search under row weights: drop what is least missed, cover a random short row, let short rows weigh more."""

# ruff: noqa: SIM110
# Loops, since generators do not compile.
from __future__ import annotations

from .greedy import NOISE, prune
from .jit import inner, kernel, wide
from .problem import Problem
from .state import (
    BEST,
    BEST_AT,
    COST,
    FOUND,
    KEEPS,
    LIMIT,
    MOVES,
    SHORT,
    SIZE,
    STEP,
    WORK,
    State,
    draw,
    gain,
    penalty,
    put,
    refresh,
    take_out,
    weigh,
)

SAMPLE = 60
"""How many candidates of a short row a move compares at most."""
ADDITIONS = 2
"""How many candidates a move puts in at most: one more than it takes out, where the cost allows."""
INSIDE, OUTSIDE = wide(3), wide(4)
"""For less moves than one more than this a candidate stays in, and out, after it was put in or pushed out."""
REFRESH = 1 << 14
"""Moves after which rounding is cleared away."""


@kernel
def search(problem: Problem, state: State, work: int, moves: int) -> bool:
    """Search until so much work is done, so many moves are made, or a better plan is found; whether it was found.

    After Gao, Weise and Li (2015), with fractional entries, costs and cliques: a candidate may push out those that it
    conflicts with. `state.value[STEP]` is the least by which a better plan must be cheaper.
    """
    count, value = state.counts, state.value
    end = count[WORK] + work
    while count[WORK] < end and count[MOVES] < moves:
        if count[SHORT] == 0:
            refresh(problem, state)
        if count[SHORT] == 0:
            prune(problem, state)
            if value[COST] < value[BEST]:
                refresh(problem, state)
                value[BEST] = value[COST]
                value[LIMIT] = value[BEST] - value[STEP]
                for i in range(len(state.candidates)):
                    one = state.candidates[i]
                    one["best"] = one["taken"]
                count[BEST_AT] = count[MOVES]
                count[FOUND] += 1
                return True
        count[MOVES] += 1
        if count[MOVES] % REFRESH == 0:
            refresh(problem, state)
        # Down to the limit, and one more.
        is_above = value[LIMIT] < 1e300
        while is_above and count[SIZE] > 0:
            is_above = value[COST] > value[LIMIT]
            take_out(problem, state, _least_missed(problem, state))
        _cover(problem, state)
    return False


@inner
def _least_missed(problem: Problem, state: State) -> int:
    """The candidate of the plan of least loss per cost, the one that is there longest among equals."""
    candidates, now, size = state.candidates, state.counts[MOVES], state.counts[SIZE]
    best, best_score, best_moved = wide(-1), 0.0, now
    for s in range(size):
        i = wide(candidates[s]["plan"])
        one = candidates[i]
        if one["frozen"] >= now:
            continue
        cost = problem.cost[i]
        score = one["loss"] / (cost if cost > NOISE else NOISE)
        if best < 0 or score < best_score or (score == best_score and one["moved"] < best_moved):
            best, best_score, best_moved = i, score, one["moved"]
    state.counts[WORK] += size // 4 + 1
    if best < 0:
        best = wide(candidates[draw(state.random, size)]["plan"])
    return best


@inner
def _cover(problem: Problem, state: State) -> None:
    """Put in candidates for short rows as far as the cost allows."""
    count, value = state.counts, state.value
    now = count[MOVES]
    for _ in range(ADDITIONS):
        if count[SHORT] == 0:
            return
        j = state.rows[draw(state.random, count[SHORT])]["lacking"]
        i = _best_of_row(problem, state, j)
        if i >= 0:
            for t in range(problem.gptr[i], problem.gptr[i + 1]):
                out = wide(state.occupant[problem.gclq[t]])
                if out >= 0:
                    take_out(problem, state, out)
                    state.candidates[out]["frozen"] = now + 2 + draw(state.random, OUTSIDE)
            put(problem, state, i)
            state.candidates[i]["frozen"] = now + 1 + draw(state.random, INSIDE)
        short = count[SHORT]
        for s in range(short):
            weigh(problem, state, state.rows[s]["lacking"], 1.0)
        count[WORK] += short
        if i < 0 or value[LIMIT] > 1e300:
            return


@inner
def _best_of_row(problem: Problem, state: State, j: int) -> int:
    """The candidate that takes most penalty off for its cost, net of what it pushes out; -1 if none may be put in."""
    count, limit = state.counts, state.value[LIMIT]
    begin, end = problem.rptr[j], problem.rptr[j + 1]
    length = end - begin
    best, best_score, now = wide(-1), 0.0, count[MOVES]
    best_moved = now
    at = begin
    if count[KEEPS] == 0 and length > SAMPLE:
        at += draw(state.random, length)
        length = SAMPLE
    count[WORK] += length
    for _ in range(length):
        i = wide(problem.lines[at]["candidate"])
        at += 1
        if at == end:
            at = begin
        one = state.candidates[i]
        if one["taken"] == 1 or one["frozen"] >= now or not _has_changed(problem, state, i):
            continue
        cost = problem.cost[i]
        net, freed = _net(problem, state, i)
        if state.value[COST] + cost - freed > limit:
            continue
        # While any plan will do, a move may make things worse: weights lead on. Later it would undo what was put in.
        if net <= 0.0 and limit < 1e300:
            continue
        score = net / (cost if cost > NOISE else NOISE)
        if best < 0 or score > best_score or (score == best_score and one["moved"] < best_moved):
            best, best_score, best_moved = i, score, one["moved"]
    return best


@inner
def _has_changed(problem: Problem, state: State, i: int) -> bool:
    """Whether a row of the candidate has changed since it was taken out (configuration checking: Cai and Su 2013)."""
    moved = state.candidates[i]["moved"]
    if moved < 0:
        return True
    for t in range(problem.cptr[i], problem.cptr[i + 1]):
        if state.rows[problem.columns[t]["row"]]["touched"] > moved:
            return True
    return False


@inner
def _net(problem: Problem, state: State, i: int) -> tuple[float, float]:
    """Gain of putting a candidate in after what it excludes is taken out, and the cost that this frees."""
    lost, freed = 0.0, 0.0
    first, last = problem.gptr[i], problem.gptr[i + 1]
    blocked = False
    for t in range(first, last):
        out = state.occupant[problem.gclq[t]]
        if out >= 0 and not _was_seen(problem, state, first, t, out):
            blocked = True
            freed += problem.cost[out]
            lost += _shift(problem, state, out, -1.0)
    if not blocked and state.counts[KEEPS] == 1:
        return state.candidates[i]["worth"], freed
    net = gain(problem, state, i) - lost
    if blocked:
        for t in range(first, last):
            out = state.occupant[problem.gclq[t]]
            if out >= 0 and not _was_seen(problem, state, first, t, out):
                _shift(problem, state, out, 1.0)
    return net, freed


@inner
def _was_seen(problem: Problem, state: State, begin: int, end: int, out: int) -> bool:
    for t in range(begin, end):
        if state.occupant[problem.gclq[t]] == out:
            return True
    return False


@inner
def _shift(problem: Problem, state: State, out: int, sign: float) -> float:
    """Change supplies as if a candidate came or went, nothing else; the growth of the penalty."""
    begin, end = problem.cptr[out], problem.cptr[out + 1]
    grown = 0.0
    for t in range(begin, end):
        entry = problem.columns[t]
        row = state.rows[entry["row"]]
        more = sign * entry["entry"]
        deficit = 1.0 - row["supply"]
        row["supply"] += more
        grown += row["weight"] * (penalty(deficit - more) - penalty(deficit))
    state.counts[WORK] += end - begin
    return grown
