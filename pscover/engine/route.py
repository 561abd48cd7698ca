"""The cliques of a problem in the order in which a sweep takes them, and what the rows cost before and after each."""

from __future__ import annotations

import heapq
from dataclasses import dataclass
from itertools import pairwise
from typing import Any

import numpy as np
from numpy.typing import NDArray

from .problem import FloatArray, IntArray, Problem
from .rowwise import Shares, laid
from .tables import SUMS, UNITS, fill

STARTS = 8
"""Rows from which an order is tried."""
BROAD = 3.0
"""By which factor one more row at the front makes a sweep dearer, about."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Stage:
    """A clique on the way, without its candidates that are out.

    Parameters
    ----------
    picks
        Its candidates; first -1 for none.
    cost
        What each costs.
    amount
        By how much each meets each of the clique's rows, shape (picks, rows).
    slots, fresh
        Where partial plans keep the needs of these rows, and whether none has come to the row before.
    before, after
        What these rows cost at least with and without the clique, by units; see `tables.fill`.
    sums, size
        What the entries of later cliques can add up to, and how many such sums there are.
    """

    picks: IntArray
    cost: FloatArray
    amount: FloatArray
    slots: IntArray
    fresh: NDArray[np.bool_]
    before: FloatArray
    after: FloatArray
    sums: FloatArray
    size: IntArray


def route(problem: Problem, priced: Shares, out: NDArray[np.bool_]) -> tuple[list[Stage], float]:
    """The stages, and what all rows cost at least at the best prices; candidates that are out are left out."""
    row, order = laid(problem)
    stays = ~out[priced.candidate]
    row, candidate = row[stays], priced.candidate[stays]
    amount, share = problem.lines["entry"][order][stays], priced.kept[stays]
    kinds, clique = np.unique(problem.homes[candidate], return_inverse=True)
    pairs = np.unique(np.stack([clique, row], axis=1), axis=0)
    ends = np.searchsorted(pairs[:, 0], np.arange(len(kinds) + 1)).tolist()
    every = pairs[:, 1].tolist()
    rows_of = [every[a:b] for a, b in pairwise(ends)]
    way = _order(rows_of, problem.rows)
    place = np.empty(len(kinds), dtype=np.int64)
    place[way] = np.arange(len(way))
    by_way = np.lexsort((row, place[clique]))
    row, candidate, amount, share = row[by_way], candidate[by_way], amount[by_way], share[by_way]
    return _stages(problem, [rows_of[g] for g in way], place[clique][by_way], row, candidate, amount, share)


def _stages(
    problem: Problem,
    rows_of: list[list[int]],
    stage: NDArray[Any],
    row: NDArray[Any],
    candidate: IntArray,
    amount: FloatArray,
    share: FloatArray,
) -> tuple[list[Stage], float]:
    """What each clique brings, from its entries in the order of the way, and where the needs of its rows are kept."""
    width = np.array([len(held) for held in rows_of], dtype=np.int64)
    begin = np.concatenate(([0], np.cumsum(width)))
    is_first = np.ones(len(row), dtype=np.bool_)
    is_first[1:] = (np.diff(stage) != 0) | (np.diff(row) != 0)
    pair = np.cumsum(is_first) - 1
    many = int(begin[-1])
    before, after, sums = np.empty((many, UNITS + 1)), np.empty((many, UNITS + 1)), np.empty((many, SUMS))
    size, full = np.empty(many, dtype=np.int32), np.empty(problem.rows)
    starts = np.concatenate((np.flatnonzero(is_first), [len(row)])).astype(np.int32)
    fill(row[is_first].astype(np.int32), starts, amount, share, before, after, sums, size, full)
    names, number = np.unique(stage * problem.candidates + candidate, return_inverse=True)
    members, owner = (names % problem.candidates).astype(np.int32), names // problem.candidates
    first = np.searchsorted(owner, np.arange(len(rows_of) + 1))
    # The picks of a stage, none first, by its rows; one stage after the other.
    areas = np.concatenate(([0], np.cumsum((np.diff(first) + 1) * width)))
    table = np.zeros(int(areas[-1]))
    table[areas[stage] + (number - first[stage] + 1) * width[stage] + pair - begin[stage]] = amount
    slots, fresh = _places(rows_of, problem.rows)
    cost = problem.cost[members]
    none, nothing = np.full(1, -1, dtype=np.int32), np.zeros(1)
    found = []
    for k, (a, b) in enumerate(pairwise(begin.tolist())):
        some = slice(int(first[k]), int(first[k + 1]))
        found.append(
            Stage(
                picks=np.concatenate((none, members[some])),
                cost=np.concatenate((nothing, cost[some])),
                amount=table[areas[k] : areas[k + 1]].reshape(-1, b - a),
                slots=slots[a:b],
                fresh=fresh[a:b],
                before=before[a:b],
                after=after[a:b],
                sums=sums[a:b],
                size=size[a:b],
            )
        )
    return found, float(full.sum())


def _places(rows_of: list[list[int]], rows: int) -> tuple[IntArray, NDArray[np.bool_]]:
    """Where the need of each clique's rows is kept, from their first clique to their last, and whether it is the first."""
    last = {j: k for k, held in enumerate(rows_of) for j in held}
    empty, slot = list(range(rows)), dict[int, int]()
    slots, fresh = list[int](), list[bool]()
    for k, held in enumerate(rows_of):
        for j in held:
            fresh.append(j not in slot)
            if j not in slot:
                slot[j] = heapq.heappop(empty)
            slots.append(slot[j])
        for j in held:
            if last[j] == k:
                heapq.heappush(empty, slot.pop(j))
    return np.array(slots, dtype=np.int32), np.array(fresh, dtype=np.bool_)


def _order(rows_of: list[list[int]], rows: int) -> list[int]:
    """Cliques by the row that they come with: what lies at the front already first, what only this row has last."""
    of: list[list[int]] = [[] for _ in range(rows)]
    for g, held in enumerate(rows_of):
        for j in held:
            of[j].append(g)
    best = along(rows_of, rows)
    place = {j: k for k, j in enumerate(best)}
    order: dict[int, None] = {}
    for j in best:
        order.update(
            dict.fromkeys(sorted(of[j], key=lambda g: (len(rows_of[g]) == 1, max(place[i] for i in rows_of[g]), g)))
        )
    return list(order)


def along(rows_of: list[list[int]], rows: int) -> list[int]:
    """Rows in an order in which few of them are at the front at a time; those of each clique are given."""
    near = [0] * rows
    for held in rows_of:
        together = sum(1 << i for i in held)
        for j in held:
            near[j] |= together
    starts = sorted(range(rows), key=lambda j: near[j].bit_count())[:STARTS]
    least, best = np.inf, list(range(rows))
    for start in starts:
        score, found = _from(near, start, least)
        if score < least:
            least, best = score, found
    return best


def _from(near: list[int], start: int, most: float) -> tuple[float, list[int]]:
    """Rows from one on, always the one next that brings the fewest others to the front; how broad that becomes.

    It ends early once it is broader than the most.
    """
    front, score, order = 0, 0.0, [start]
    rest = [j for j in range(len(near)) if j != start]
    open_ = (1 << len(near)) - 1
    while True:
        j = order[-1]
        open_ &= ~(1 << j)
        front |= near[j]
        ready, new = front & open_, open_ & ~front
        score += BROAD ** ready.bit_count()
        if not rest or score >= most:
            return score, order

        def brings(i: int, ready: int = ready, new: int = new) -> tuple[int, bool, int]:
            return (near[i] & new).bit_count() - (near[i] & ready > 0), not ready >> i & 1, i

        i = min(rest, key=brings)
        order.append(i)
        rest.remove(i)
