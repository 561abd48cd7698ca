"""Greedy choice with lazy evaluation, and reverse delete."""

from __future__ import annotations

import numpy as np

from .jit import inner, kernel, wide
from .problem import FloatArray, IntArray, Problem
from .state import SHORT, SIZE, State, gain, is_free, put, take_out

NOISE = 1e-12
"""Gains below this are what rounding leaves of zero."""


def choose(problem: Problem, state: State, price: FloatArray) -> bool:
    """Choose greedily from scratch; whether every row is met."""
    n = len(price)
    none = np.zeros(0, dtype=np.int32)
    return bool(start(problem, state, none, np.maximum(price, NOISE), np.empty(n), np.empty(n, dtype=np.int32)))


def adopt(problem: Problem, state: State, plan: IntArray) -> None:
    """Make a plan, free of conflicts, the one at hand."""
    none = np.zeros(0)
    start(problem, state, np.ascontiguousarray(plan, dtype=np.int32), none, none, np.zeros(0, dtype=np.int32))


@kernel
def start(problem: Problem, state: State, plan: IntArray, price: FloatArray, score: FloatArray, heap: IntArray) -> bool:
    """Make a plan the one at hand, and add the free candidate of most gain per price until every row is met; whether it is.

    Gains never grow while a plan grows, so that a candidate whose old score is not the highest need not be scored again
    (Minoux 1978). Without prices nothing is added. `score` and `heap` are room for as many numbers as there are prices.
    """
    while state.counts[SIZE] > 0:
        take_out(problem, state, wide(state.candidates[0]["plan"]))
    for k in range(len(plan)):
        i = wide(plan[k])
        if state.candidates[i]["taken"] == 0:
            put(problem, state, i)
    size = top = wide(0)
    for i in range(len(price)):
        if state.candidates[i]["taken"] == 0 and is_free(problem, state, i):
            worth = gain(problem, state, i) / price[i]
            if worth > 0.0:
                score[i] = worth
                heap[size] = i
                size += 1
    for s in range(size // 2 - 1, -1, -1):
        _sink(heap, score, size, s)
    while state.counts[SHORT] > 0 and size > 0:
        i = wide(heap[top])
        is_out = True
        if is_free(problem, state, i):
            now = gain(problem, state, i)
            worth = now / price[i]
            if now > NOISE:
                is_out = worth >= score[i]
                if is_out:
                    put(problem, state, i)
            score[i] = worth
        if is_out:
            size -= 1
            heap[top] = heap[size]
        _sink(heap, score, size, top)
    return bool(state.counts[SHORT] == 0)


@inner
def _sink(heap: IntArray, score: FloatArray, size: int, at: int) -> None:
    while True:
        child = 2 * at + 1
        if child >= size:
            return
        if child + 1 < size and score[heap[child + 1]] > score[heap[child]]:
            child += 1
        low, high = heap[at], heap[child]
        if score[high] <= score[low]:
            return
        heap[child] = low
        heap[at] = high
        at = child


@inner
def prune(problem: Problem, state: State) -> None:
    """Take out what is not needed: the most expensive first."""
    while True:
        worst, most = wide(-1), -1.0
        for s in range(state.counts[SIZE]):
            i = wide(state.candidates[s]["plan"])
            cost = problem.cost[i]
            if cost > most and state.candidates[i]["loss"] <= NOISE and _is_spare(problem, state, i):
                worst, most = i, cost
        if worst < 0:
            return
        take_out(problem, state, worst)


@inner
def _is_spare(problem: Problem, state: State, i: int) -> bool:
    for t in range(problem.cptr[i], problem.cptr[i + 1]):
        entry = problem.columns[t]
        if 1.0 - state.rows[entry["row"]]["supply"] + entry["entry"] > 1e-9:
            return False
    return True
