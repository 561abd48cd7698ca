"""Which candidates another of their clique replaces: it gives every row at least as much, for no more."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from .jit import inner, kernel
from .problem import FloatArray, IntArray, Problem


def stand_ins(problem: Problem) -> IntArray:
    """The candidate that replaces each one and is replaced by none, or itself, shape (candidates,).

    The same as the presolve step `clique_dominance` for candidates of one clique each, without its overhead.
    """
    home = problem.home
    members = np.argsort(home, kind="stable").astype(np.int32)
    members = members[home[members] >= 0]
    start = np.searchsorted(home[members], np.arange(int(problem.cliques[0]) + 1)).astype(np.int32)
    found = np.arange(problem.candidates, dtype=np.int32)
    thin(problem.cost, problem.cptr, problem.columns, problem.gptr, start, members, found)
    while (found[found] != found).any():
        found = found[found]
    return found


@kernel
def thin(
    cost: FloatArray,
    cptr: IntArray,
    columns: NDArray[Any],
    gptr: IntArray,
    start: IntArray,
    members: IntArray,
    found: IntArray,
) -> None:
    """Note for each candidate what replaces it, clique by clique."""
    for g in range(len(start) - 1):
        for s in range(start[g], start[g + 1]):
            a = members[s]
            for u in range(start[g], start[g + 1]):
                b = members[u]
                # What is in one clique only excludes no more than the other does.
                if (
                    a != b
                    and found[b] == b
                    and gptr[b + 1] - gptr[b] == 1
                    and cost[b] <= cost[a]
                    and _is_over(cost, cptr, columns, a, b)
                ):
                    found[a] = b
                    break


@inner
def _is_over(cost: FloatArray, cptr: IntArray, columns: NDArray[Any], a: int, b: int) -> bool:
    """Whether b gives every row at least what a does; of two that give the same, the first is over the second."""
    s, end = cptr[b], cptr[b + 1]
    if end - s < cptr[a + 1] - cptr[a]:
        return False
    is_more = cost[b] < cost[a] or end - s > cptr[a + 1] - cptr[a]
    for t in range(cptr[a], cptr[a + 1]):
        j = columns[t]["row"]
        while s < end and columns[s]["row"] < j:
            s += 1
        if s == end or columns[s]["row"] > j or columns[s]["entry"] < columns[t]["entry"]:
            return False
        is_more = is_more or columns[s]["entry"] > columns[t]["entry"]
        s += 1
    return is_more or b < a
