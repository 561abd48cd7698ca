"""Local search under row weights: drop what is least missed, cover a random short row, let short rows weigh more."""

# ruff: noqa: SIM110
# Loops, since generators do not compile.
from __future__ import annotations

from .greedy import prune
from .jit import inner, kernel
from .problem import IntArray, Problem
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
                    state.candidates[i]["best"] = state.candidates[i]["taken"]
                count[BEST_AT] = count[MOVES]
                count[FOUND] += 1
                return True
        count[MOVES] += 1
        if count[MOVES] % REFRESH == 0:
            refresh(problem, state)
        if value[LIMIT] < 1e300:
            while value[COST] > value[LIMIT] and count[SIZE] > 0:
                take_out(problem, state, _least_missed(problem, state))
            if count[SIZE] > 0:
                take_out(problem, state, _least_missed(problem, state))
        _cover(problem, state)
    return False


@kernel
def adopt(problem: Problem, state: State, plan: IntArray) -> None:
    """Make a plan, free of conflicts, the one that is searched from."""
    while state.counts[SIZE] > 0:
        take_out(problem, state, int(state.candidates[0]["plan"]))
    for i in plan:
        if state.candidates[i]["taken"] == 0:
            put(problem, state, int(i))


@inner
def _least_missed(problem: Problem, state: State) -> int:
    """The candidate of the plan of least loss per cost, the one that is there longest among equals."""
    best, best_score, now = -1, 0.0, state.counts[MOVES]
    size = state.counts[SIZE]
    for s in range(size):
        i = int(state.candidates[s]["plan"])
        if state.candidates[i]["frozen"] >= now:
            continue
        score = state.candidates[i]["loss"] / max(problem.cost[i], 1e-12)
        if (
            best < 0
            or score < best_score
            or (score == best_score and state.candidates[i]["moved"] < state.candidates[best]["moved"])
        ):
            best, best_score = i, score
    state.counts[WORK] += size // 4 + 1
    if best < 0:
        best = int(state.candidates[draw(state.random, size)]["plan"])
    return best


@inner
def _cover(problem: Problem, state: State) -> None:
    """Put in candidates for short rows as far as the cost allows."""
    count, value = state.counts, state.value
    now = count[MOVES]
    for _ in range(ADDITIONS):
        if count[SHORT] == 0:
            return
        j = int(state.rows[draw(state.random, count[SHORT])]["lacking"])
        i = _best_of_row(problem, state, j)
        if i >= 0:
            for t in range(problem.gptr[i], problem.gptr[i + 1]):
                out = int(state.occupant[problem.gclq[t]])
                if out >= 0:
                    take_out(problem, state, out)
                    state.candidates[out]["frozen"] = now + 2 + draw(state.random, 4)
            put(problem, state, i)
            state.candidates[i]["frozen"] = now + 1 + draw(state.random, 3)
        for s in range(count[SHORT]):
            weigh(problem, state, int(state.rows[s]["lacking"]), 1.0)
        count[WORK] += count[SHORT]
        if i < 0 or value[LIMIT] > 1e300:
            return


@inner
def _best_of_row(problem: Problem, state: State, j: int) -> int:
    """The candidate that takes most penalty off for its cost, net of what it pushes out; -1 if none may be put in."""
    count, value = state.counts, state.value
    begin, end = problem.rptr[j], problem.rptr[j + 1]
    length = end - begin
    best, best_score, now = -1, 0.0, count[MOVES]
    at = 0
    if count[KEEPS] == 0 and length > SAMPLE:
        at = draw(state.random, length)
        length = SAMPLE
    count[WORK] += length
    for _ in range(length):
        i = int(problem.lines[begin + at]["candidate"])
        at += 1
        if begin + at == end:
            at = 0
        if state.candidates[i]["taken"] == 1 or state.candidates[i]["frozen"] >= now or not _has_changed(problem, state, i):
            continue
        cost = problem.cost[i]
        net, freed = _net(problem, state, i)
        if value[COST] + cost - freed > value[LIMIT]:
            continue
        score = net / max(cost, 1e-12)
        # While any plan will do, a move may make things worse: weights lead on. Later it would undo what was put in.
        if net <= 0.0 and value[LIMIT] < 1e300:
            continue
        if (
            best < 0
            or score > best_score
            or (score == best_score and state.candidates[i]["moved"] < state.candidates[best]["moved"])
        ):
            best, best_score = i, score
    return best


@inner
def _has_changed(problem: Problem, state: State, i: int) -> bool:
    """Whether a row of the candidate has changed since it was taken out (configuration checking: Cai and Su 2013)."""
    if state.candidates[i]["moved"] < 0:
        return True
    for t in range(problem.cptr[i], problem.cptr[i + 1]):
        if state.rows[problem.columns[t]["row"]]["touched"] > state.candidates[i]["moved"]:
            return True
    return False


@inner
def _net(problem: Problem, state: State, i: int) -> tuple[float, float]:
    """Gain of putting a candidate in after what it excludes is taken out, and the cost that this frees."""
    lost, freed = 0.0, 0.0
    first, last = problem.gptr[i], problem.gptr[i + 1]
    blocked = False
    for t in range(first, last):
        out = int(state.occupant[problem.gclq[t]])
        if out >= 0 and not _was_seen(problem, state, i, t, out):
            blocked = True
            freed += problem.cost[out]
            lost += _shift(problem, state, out, -1.0)
    net = (gain(problem, state, i) if blocked or state.counts[KEEPS] == 0 else state.candidates[i]["worth"]) - lost
    if blocked:
        for t in range(first, last):
            out = int(state.occupant[problem.gclq[t]])
            if out >= 0 and not _was_seen(problem, state, i, t, out):
                _shift(problem, state, out, 1.0)
    return net, freed


@inner
def _was_seen(problem: Problem, state: State, i: int, before: int, out: int) -> bool:
    for t in range(problem.gptr[i], before):
        if state.occupant[problem.gclq[t]] == out:
            return True
    return False


@inner
def _shift(problem: Problem, state: State, out: int, sign: float) -> float:
    """Change supplies as if a candidate came or went, nothing else; the growth of the penalty."""
    from_, to = problem.cptr[out], problem.cptr[out + 1]
    grown = 0.0
    for t in range(from_, to):
        j, w = problem.columns[t]["row"], problem.columns[t]["entry"]
        deficit = 1.0 - state.rows[j]["supply"]
        state.rows[j]["supply"] += sign * w
        after = deficit - sign * w
        grown += state.rows[j]["weight"] * (penalty(after) - penalty(deficit))
    state.counts[WORK] += to - from_
    return grown
