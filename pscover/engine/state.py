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
    one, size = state.candidates[i], state.counts[SIZE]
    one["taken"] = 1
    one["place"] = size
    one["moved"] = state.counts[MOVES]
    state.candidates[size]["plan"] = i
    state.counts[SIZE] = size + 1
    state.value[COST] += problem.cost[i]
    for t in range(problem.gptr[i], problem.gptr[i + 1]):
        state.occupant[problem.gclq[t]] = i
    own = 0.0
    for t in range(problem.cptr[i], problem.cptr[i + 1]):
        entry = problem.columns[t]
        j, w = entry["row"], entry["entry"]
        row = state.rows[j]
        filled = row["filled"]
        own += _supply(problem, state, j, w)
        member = state.inner[problem.rptr[j] + filled]
        member["inside"] = i
        member["inval"] = w
        row["filled"] = filled + 1
    one["loss"] = own


@inner
def take_out(problem: Problem, state: State, i: int) -> None:
    """Take a candidate out of the plan."""
    one, last = state.candidates[i], state.counts[SIZE] - 1
    other, at = state.candidates[last]["plan"], one["place"]
    state.candidates[at]["plan"] = other
    state.candidates[other]["place"] = at
    one["taken"] = 0
    one["place"] = -1
    one["moved"] = state.counts[MOVES]
    state.counts[SIZE] = last
    state.value[COST] -= problem.cost[i]
    for t in range(problem.gptr[i], problem.gptr[i + 1]):
        state.occupant[problem.gclq[t]] = -1
    for t in range(problem.cptr[i], problem.cptr[i + 1]):
        entry = problem.columns[t]
        j = entry["row"]
        row = state.rows[j]
        filled = row["filled"] - 1
        begin = problem.rptr[j]
        moved = state.inner[begin + filled]
        for s in range(begin, begin + filled):
            member = state.inner[s]
            if member["inside"] == i:
                member["inside"] = moved["inside"]
                member["inval"] = moved["inval"]
                break
        row["filled"] = filled
        _supply(problem, state, j, -entry["entry"])


@inner
def _supply(problem: Problem, state: State, j: int, more: float) -> float:
    """Give a row more, or less, and bring all up to date that depends on it; by how much its weighted penalty falls."""
    row, counts = state.rows[j], state.counts
    y: float = row["weight"]
    old = 1.0 - row["supply"]
    new = old - more
    row["supply"] += more
    row["touched"] = counts[MOVES]
    before, after = penalty(old), penalty(new)
    begin, filled = problem.rptr[j], row["filled"]
    work = filled + 1
    for s in range(begin, begin + filled):
        member = state.inner[s]
        v = member["inval"]
        state.candidates[member["inside"]]["loss"] += y * (penalty(new + v) - after - penalty(old + v) + before)
    was_short, is_short = old > TOLERANCE, new > TOLERANCE
    if counts[KEEPS] == 1 and (was_short or is_short):
        end = problem.rptr[j + 1]
        for s in range(begin, end):
            line = problem.lines[s]
            w = line["entry"]
            state.candidates[line["candidate"]]["worth"] += y * (after - penalty(new - w) - before + penalty(old - w))
        work += end - begin
    counts[WORK] += work
    short = counts[SHORT]
    if was_short and not is_short:
        short -= 1
        other, at = state.rows[short]["lacking"], row["spot"]
        state.rows[at]["lacking"] = other
        state.rows[other]["spot"] = at
        row["spot"] = -1
    elif is_short and not was_short:
        row["spot"] = short
        state.rows[short]["lacking"] = j
        short += 1
    counts[SHORT] = short
    return y * (before - after)


@inner
def weigh(problem: Problem, state: State, j: int, more: float) -> None:
    """Add to the weight of a row."""
    row = state.rows[j]
    row["weight"] += more
    deficit = 1.0 - row["supply"]
    now = penalty(deficit)
    begin = problem.rptr[j]
    for s in range(begin, begin + row["filled"]):
        member = state.inner[s]
        state.candidates[member["inside"]]["loss"] += more * (penalty(deficit + member["inval"]) - now)
    if state.counts[KEEPS] == 1 and deficit > TOLERANCE:
        end = problem.rptr[j + 1]
        for s in range(begin, end):
            line = problem.lines[s]
            state.candidates[line["candidate"]]["worth"] += more * (now - penalty(deficit - line["entry"]))
        state.counts[WORK] += end - begin


@inner
def gain(problem: Problem, state: State, i: int) -> float:
    """By how much the weighted penalty falls when a candidate is put in."""
    total = 0.0
    begin, end = problem.cptr[i], problem.cptr[i + 1]
    for t in range(begin, end):
        entry = problem.columns[t]
        row = state.rows[entry["row"]]
        deficit = 1.0 - row["supply"]
        if deficit > TOLERANCE:
            total += row["weight"] * (penalty(deficit) - penalty(deficit - entry["entry"]))
    state.counts[WORK] += end - begin
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
    rows, candidates = state.rows, state.candidates
    for j in range(len(rows)):
        rows[j]["supply"] = 0.0
    cost = 0.0
    size = state.counts[SIZE]
    for s in range(size):
        i = candidates[s]["plan"]
        cost += problem.cost[i]
        for t in range(problem.cptr[i], problem.cptr[i + 1]):
            entry = problem.columns[t]
            rows[entry["row"]]["supply"] += entry["entry"]
    state.value[COST] = cost
    short = 0
    for j in range(len(rows)):
        row = rows[j]
        row["spot"] = -1
        if 1.0 - row["supply"] > TOLERANCE:
            row["spot"] = short
            rows[short]["lacking"] = j
            short += 1
    state.counts[SHORT] = short
    for s in range(size):
        i = candidates[s]["plan"]
        own = 0.0
        for t in range(problem.cptr[i], problem.cptr[i + 1]):
            entry = problem.columns[t]
            row = rows[entry["row"]]
            deficit = 1.0 - row["supply"]
            own += row["weight"] * (penalty(deficit + entry["entry"]) - penalty(deficit))
        candidates[i]["loss"] = own
    if state.counts[KEEPS] == 1:
        for i in range(len(problem.cost)):
            candidates[i]["worth"] = gain(problem, state, i)
