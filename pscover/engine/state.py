"""A plan in the making as the kernels keep it: supplies, short rows, what each choice is worth; and the moves on it."""

# ruff: noqa: SIM110
# Loops, since generators do not compile.
from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from .jit import inner
from .problem import TOLERANCE, FloatArray, IntArray, Problem

Records = NDArray[Any]

# Places in State.count.
SIZE, SHORT, MOVES, WORK, BEST_AT, FOUND, KEEPS = range(7)
# Places in State.value.
COST, BEST, STEP, LIMIT = range(4)


CANDIDATE = np.dtype(
    [
        ("loss", np.float64),
        ("worth", np.float64),
        ("frozen", np.int64),
        ("moved", np.int64),
        ("plan", np.int32),
        ("place", np.int32),
        ("taken", np.int32),
        ("best", np.int32),
    ]
)
"""What is kept of each candidate.

`loss`: by how much the weighted penalty grows when it leaves the plan; `worth`: by how much it falls when it is put in, kept
up to date only where `counts[KEEPS]` is 1, which pays where candidates cover many rows; `frozen`: until which move it stays
as it is; `moved`: at which move it was last put in or taken out; `place`: where it stands in the plan; `taken`, `best`:
whether it is in the plan and in the best one. `plan` is the plan itself as a list.
"""
ROW = np.dtype(
    [
        ("supply", np.float64),
        ("weight", np.float64),
        ("touched", np.int64),
        ("filled", np.int32),
        ("spot", np.int32),
        ("lacking", np.int32),
        ("unused", np.int32),
    ]
)
"""What is kept of each row: what it gets, its weight, at which move it last changed, how many of the plan cover it,
and where it stands among the short rows, or -1. `lacking` are the short rows as a list."""
INSIDE = np.dtype([("inval", np.float64), ("inside", np.int32), ("unused", np.int32)])
"""Candidates of the plan that cover a row, and their entries: the first `filled` of the row's span in `Problem.lines`."""


class State(NamedTuple):
    """Everything that changes while a plan is searched; all of it, so that a search can be stopped and resumed.

    Parameters
    ----------
    candidates, rows, inner
        Records of `CANDIDATE`, `ROW` and `INSIDE`.
    occupant
        The candidate of the plan in each clique, or -1.
    counts, value
        Counters and amounts; see the names above.
    random
        State of the random numbers, shape (1,).
    """

    candidates: Records
    rows: Records
    inner: Records
    occupant: IntArray
    counts: NDArray[np.int64]
    value: FloatArray
    random: NDArray[np.uint64]


def empty(problem: Problem, seed: int) -> State:
    """The state without a plan."""
    n, m = problem.candidates, problem.rows
    state = State(
        candidates=np.zeros(n, dtype=CANDIDATE),
        rows=np.zeros(m, dtype=ROW),
        inner=np.zeros(len(problem.lines), dtype=INSIDE),
        occupant=np.full(int(problem.cliques[0]), -1, dtype=np.int32),
        counts=np.zeros(8, dtype=np.int64),
        value=np.array([0.0, np.inf, 0.0, np.inf]),
        random=np.array([(seed * 0x9E3779B97F4A7C15 + 0x2545F4914F6CDD1D) % 2**64], dtype=np.uint64),
    )
    state.candidates["place"] = -1
    state.candidates["moved"] = -1
    state.rows["weight"] = 1.0
    state.rows["lacking"] = state.rows["spot"] = np.arange(m)
    state.candidates["worth"] = np.bincount(problem.lines["candidate"], problem.lines["entry"], n)
    state.counts[SHORT] = m
    # Where candidates cover many rows, keeping all gains up to date is less work than computing those of a row afresh.
    state.counts[KEEPS] = len(problem.lines) > LONG * n
    return state


LONG = 6
"""Rows a candidate, on average, from which gains are kept up to date."""


@inner
def draw(random: NDArray[np.uint64], below: int) -> int:
    """A whole number from 0 to below - 1 (xorshift*, Marsaglia 2003; Vigna 2016)."""
    x = random[0]
    x ^= x >> np.uint64(12)
    x ^= x << np.uint64(25)
    x ^= x >> np.uint64(27)
    random[0] = x
    return int(np.int64((x * np.uint64(0x2545F4914F6CDD1D)) >> np.uint64(33)) % below)


@inner
def penalty(deficit: float) -> float:
    """What a row that is short by `deficit` costs at weight 1."""
    return deficit if deficit > TOLERANCE else 0.0


@inner
def put(problem: Problem, state: State, i: int) -> None:
    """Put a candidate into the plan; its cliques must be free."""
    state.candidates[i]["taken"] = 1
    size = state.counts[SIZE]
    state.candidates[size]["plan"] = i
    state.candidates[i]["place"] = size
    state.counts[SIZE] = size + 1
    state.value[COST] += problem.cost[i]
    now = state.counts[MOVES]
    state.candidates[i]["moved"] = now
    for t in range(problem.gptr[i], problem.gptr[i + 1]):
        state.occupant[problem.gclq[t]] = i
    own = 0.0
    for t in range(problem.cptr[i], problem.cptr[i + 1]):
        j, w = int(problem.columns[t]["row"]), problem.columns[t]["entry"]
        y = state.rows[j]["weight"]
        old = 1.0 - state.rows[j]["supply"]
        new = old - w
        state.rows[j]["supply"] += w
        state.rows[j]["touched"] = now
        before, after = penalty(old), penalty(new)
        own += y * (before - after)
        begin, filled = problem.rptr[j], state.rows[j]["filled"]
        state.counts[WORK] += filled + 1
        for s in range(begin, begin + filled):
            k, v = state.inner[s]["inside"], state.inner[s]["inval"]
            state.candidates[k]["loss"] += y * (penalty(new + v) - after - penalty(old + v) + before)
        if state.counts[KEEPS] == 1 and old > TOLERANCE:
            _revalue(problem, state, j, y, old, new)
        state.inner[begin + filled]["inside"] = i
        state.inner[begin + filled]["inval"] = w
        state.rows[j]["filled"] = filled + 1
        if old > TOLERANCE and new <= TOLERANCE:
            _met(state, j)
    state.candidates[i]["loss"] = own


@inner
def take_out(problem: Problem, state: State, i: int) -> None:
    """Take a candidate out of the plan."""
    state.candidates[i]["taken"] = 0
    last = state.counts[SIZE] - 1
    other, at = state.candidates[last]["plan"], state.candidates[i]["place"]
    state.candidates[at]["plan"] = other
    state.candidates[other]["place"] = at
    state.candidates[i]["place"] = -1
    state.counts[SIZE] = last
    state.value[COST] -= problem.cost[i]
    now = state.counts[MOVES]
    state.candidates[i]["moved"] = now
    for t in range(problem.gptr[i], problem.gptr[i + 1]):
        state.occupant[problem.gclq[t]] = -1
    for t in range(problem.cptr[i], problem.cptr[i + 1]):
        j, w = int(problem.columns[t]["row"]), problem.columns[t]["entry"]
        y = state.rows[j]["weight"]
        old = 1.0 - state.rows[j]["supply"]
        new = old + w
        state.rows[j]["supply"] -= w
        state.rows[j]["touched"] = now
        before, after = penalty(old), penalty(new)
        begin, filled = problem.rptr[j], state.rows[j]["filled"] - 1
        state.counts[WORK] += filled + 1
        for s in range(begin, begin + filled + 1):
            if state.inner[s]["inside"] == i:
                state.inner[s]["inside"] = state.inner[begin + filled]["inside"]
                state.inner[s]["inval"] = state.inner[begin + filled]["inval"]
                break
        state.rows[j]["filled"] = filled
        for s in range(begin, begin + filled):
            k, v = state.inner[s]["inside"], state.inner[s]["inval"]
            state.candidates[k]["loss"] += y * (penalty(new + v) - after - penalty(old + v) + before)
        if state.counts[KEEPS] == 1 and new > TOLERANCE:
            _revalue(problem, state, j, y, old, new)
        if old <= TOLERANCE and new > TOLERANCE:
            state.rows[j]["spot"] = state.counts[SHORT]
            state.rows[state.counts[SHORT]]["lacking"] = j
            state.counts[SHORT] += 1


@inner
def _revalue(problem: Problem, state: State, j: int, y: float, old: float, new: float) -> None:
    """Bring the worth of a row's candidates up to date after its deficit changed."""
    before, after = penalty(old), penalty(new)
    for s in range(problem.rptr[j], problem.rptr[j + 1]):
        w = problem.lines[s]["entry"]
        state.candidates[problem.lines[s]["candidate"]]["worth"] += y * (
            after - penalty(new - w) - before + penalty(old - w)
        )
    state.counts[WORK] += problem.rptr[j + 1] - problem.rptr[j]


@inner
def _met(state: State, j: int) -> None:
    last = state.counts[SHORT] - 1
    other, at = state.rows[last]["lacking"], state.rows[j]["spot"]
    state.rows[at]["lacking"] = other
    state.rows[other]["spot"] = at
    state.rows[j]["spot"] = -1
    state.counts[SHORT] = last


@inner
def weigh(problem: Problem, state: State, j: int, more: float) -> None:
    """Add to the weight of a row."""
    state.rows[j]["weight"] += more
    deficit = 1.0 - state.rows[j]["supply"]
    now = penalty(deficit)
    begin = problem.rptr[j]
    for s in range(begin, begin + state.rows[j]["filled"]):
        state.candidates[state.inner[s]["inside"]]["loss"] += more * (penalty(deficit + state.inner[s]["inval"]) - now)
    if state.counts[KEEPS] == 1 and deficit > TOLERANCE:
        for s in range(begin, problem.rptr[j + 1]):
            state.candidates[problem.lines[s]["candidate"]]["worth"] += more * (
                now - penalty(deficit - problem.lines[s]["entry"])
            )
        state.counts[WORK] += problem.rptr[j + 1] - begin


@inner
def gain(problem: Problem, state: State, i: int) -> float:
    """By how much the weighted penalty falls when a candidate is put in."""
    total = 0.0
    for t in range(problem.cptr[i], problem.cptr[i + 1]):
        j = int(problem.columns[t]["row"])
        deficit = 1.0 - state.rows[j]["supply"]
        if deficit > TOLERANCE:
            total += state.rows[j]["weight"] * (penalty(deficit) - penalty(deficit - problem.columns[t]["entry"]))
    state.counts[WORK] += problem.cptr[i + 1] - problem.cptr[i]
    return total


@inner
def is_free(problem: Problem, state: State, i: int) -> bool:
    """Whether no candidate of the plan excludes this one."""
    for t in range(problem.gptr[i], problem.gptr[i + 1]):
        if state.occupant[problem.gclq[t]] >= 0:
            return False
    return True


@inner
def refresh(problem: Problem, state: State) -> None:
    """Compute supplies and losses afresh, so that rounding does not add up."""
    for j in range(len(state.rows)):
        state.rows[j]["supply"] = 0.0
    cost = 0.0
    for s in range(state.counts[SIZE]):
        i = int(state.candidates[s]["plan"])
        cost += problem.cost[i]
        for t in range(problem.cptr[i], problem.cptr[i + 1]):
            state.rows[problem.columns[t]["row"]]["supply"] += problem.columns[t]["entry"]
    state.value[COST] = cost
    state.counts[SHORT] = 0
    for j in range(len(state.rows)):
        state.rows[j]["spot"] = -1
        if 1.0 - state.rows[j]["supply"] > TOLERANCE:
            state.rows[j]["spot"] = state.counts[SHORT]
            state.rows[state.counts[SHORT]]["lacking"] = j
            state.counts[SHORT] += 1
    for s in range(state.counts[SIZE]):
        i = int(state.candidates[s]["plan"])
        own = 0.0
        for t in range(problem.cptr[i], problem.cptr[i + 1]):
            j = int(problem.columns[t]["row"])
            deficit = 1.0 - state.rows[j]["supply"]
            own += state.rows[j]["weight"] * (penalty(deficit + problem.columns[t]["entry"]) - penalty(deficit))
        state.candidates[i]["loss"] = own
    if state.counts[KEEPS] == 1:
        for i in range(len(problem.cost)):
            state.candidates[i]["worth"] = gain(problem, state, i)
