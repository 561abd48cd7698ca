"""Greedy completion with lazy evaluation, and reverse delete."""

from __future__ import annotations

import numpy as np

from .jit import inner, kernel
from .problem import FloatArray, IntArray, Problem
from .state import SHORT, SIZE, State, gain, is_free, put, take_out

NOISE = 1e-12
"""Gains below this are what rounding leaves of zero."""


@kernel
def complete(problem: Problem, state: State, price: FloatArray) -> bool:
    """Add the free candidate of most gain per price until every row is met; whether that was reached.

    Gains never grow while a plan grows, so that a candidate whose old score is not the highest need not be scored again
    (Minoux 1978).
    """
    n = len(price)
    score = np.empty(n)
    heap = np.empty(n, dtype=np.int32)
    size = 0
    for i in range(n):
        if state.candidates[i]["taken"] == 0 and is_free(problem, state, i):
            score[i] = gain(problem, state, i) / max(price[i], NOISE)
            if score[i] > 0.0:
                heap[size] = i
                size += 1
    for s in range(size // 2 - 1, -1, -1):
        _sink(heap, score, size, s)
    while state.counts[SHORT] > 0 and size > 0:
        i = int(heap[0])
        if not is_free(problem, state, i):
            size -= 1
            heap[0] = heap[size]
            _sink(heap, score, size, 0)
            continue
        now = gain(problem, state, i)
        fresh = now / max(price[i], NOISE)
        if now <= NOISE or fresh < score[i]:
            score[i] = fresh
            if now <= NOISE:
                size -= 1
                heap[0] = heap[size]
            _sink(heap, score, size, 0)
            continue
        put(problem, state, i)
        size -= 1
        heap[0] = heap[size]
        _sink(heap, score, size, 0)
    return bool(state.counts[SHORT] == 0)


@inner
def _sink(heap: IntArray, score: FloatArray, size: int, at: int) -> None:
    while True:
        child = 2 * at + 1
        if child >= size:
            return
        if child + 1 < size and score[heap[child + 1]] > score[heap[child]]:
            child += 1
        if score[heap[child]] <= score[heap[at]]:
            return
        heap[child], heap[at] = heap[at], heap[child]
        at = child


@inner
def prune(problem: Problem, state: State) -> None:
    """Take out what is not needed: the most expensive first."""
    while True:
        worst = -1
        for s in range(state.counts[SIZE]):
            i = int(state.candidates[s]["plan"])
            if (
                state.candidates[i]["loss"] <= NOISE
                and (worst < 0 or problem.cost[i] > problem.cost[worst])
                and _is_spare(problem, state, i)
            ):
                worst = i
        if worst < 0:
            return
        take_out(problem, state, worst)


@inner
def _is_spare(problem: Problem, state: State, i: int) -> bool:
    for t in range(problem.cptr[i], problem.cptr[i + 1]):
        if 1.0 - state.rows[problem.columns[t]["row"]]["supply"] + problem.columns[t]["entry"] > 1e-9:
            return False
    return True
