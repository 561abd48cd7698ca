"""The cliques of a problem in the order in which a sweep takes them, and what the rows cost before and after each."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from .problem import TOLERANCE, FloatArray, IntArray, Problem
from .tables import NOTHING, Table
from .tree import FREE, Tree

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
        What the rows cost at least with and without the clique.
    """

    picks: IntArray
    cost: FloatArray
    amount: FloatArray
    slots: IntArray
    fresh: NDArray[np.bool_]
    before: Table
    after: Table


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Entries:
    """The entries of candidates that are free, by clique and row.

    Parameters
    ----------
    rows
        The rows of each clique that has a free candidate, rising.
    at
        The entries of each clique and row.
    """

    rows: dict[int, list[int]]
    at: dict[tuple[int, int], list[int]]


def route(problem: Problem, tree: Tree) -> tuple[list[Stage], float]:
    """The stages, and what all rows cost at least, from a search that has looked at its root."""
    row = np.repeat(np.arange(problem.rows), np.diff(tree.start)).tolist()
    at: dict[tuple[int, int], list[int]] = {}
    for t in np.flatnonzero(tree.state[tree.candidate] == FREE).tolist():
        at.setdefault((int(tree.group[t]), row[t]), []).append(t)
    rows: dict[int, list[int]] = {}
    for g, j in sorted(at):
        rows.setdefault(g, []).append(j)
    entries = Entries(rows=rows, at=at)
    order = _order(rows, problem.rows)
    latest = [NOTHING] * problem.rows
    ends: list[tuple[Table, Table]] = []
    for g in reversed(order):
        after = [latest[j] for j in rows[g]]
        for j in rows[g]:
            ts = at[g, j]
            latest[j] = latest[j].with_group(tree.amount[ts], tree.prices[0][ts])
        ends.append((Table.joined([latest[j] for j in rows[g]]), Table.joined(after)))
    return _stages(problem, tree, entries, order, ends[::-1]), sum(table.price_of(1.0 - TOLERANCE) for table in latest)


def _stages(
    problem: Problem, tree: Tree, entries: Entries, order: list[int], ends: list[tuple[Table, Table]]
) -> list[Stage]:
    """What each clique brings, and where the needs of its rows are kept: from their first clique to their last."""
    last = {j: k for k, g in enumerate(order) for j in entries.rows[g]}
    slot: dict[int, int] = {}
    found: list[Stage] = []
    for k, (g, (before, after)) in enumerate(zip(order, ends, strict=True)):
        rows = entries.rows[g]
        fresh = np.array([j not in slot for j in rows])
        for j in rows:
            if j not in slot:
                slot[j] = min(set(range(problem.rows)) - set(slot.values()))
        parts = [entries.at[g, j] for j in rows]
        members = np.unique(tree.candidate[[t for part in parts for t in part]])
        amount = np.zeros((len(members) + 1, len(rows)))
        for r, part in enumerate(parts):
            amount[np.searchsorted(members, tree.candidate[part]) + 1, r] = tree.amount[part]
        found.append(
            Stage(
                picks=np.concatenate(([-1], members)).astype(np.int32),
                cost=np.concatenate(([0.0], problem.cost[members])),
                amount=amount,
                slots=np.array([slot[j] for j in rows], dtype=np.int32),
                fresh=fresh,
                before=before,
                after=after,
            )
        )
        for j in rows:
            if last[j] == k:
                del slot[j]
    return found


def _order(rows_of: dict[int, list[int]], rows: int) -> list[int]:
    """Cliques by the row that they come with: what lies at the front already first, what only this row has last."""
    of: list[list[int]] = [[] for _ in range(rows)]
    near = [0] * rows
    for g, held in rows_of.items():
        together = sum(1 << i for i in held)
        for j in held:
            of[j].append(g)
            near[j] |= together
    starts = sorted(range(rows), key=lambda j: near[j].bit_count())[:STARTS]
    _, best = min((_from(near, start) for start in starts), key=lambda found: found[0])
    place = {j: k for k, j in enumerate(best)}
    order: dict[int, None] = {}
    for j in best:
        order.update(
            dict.fromkeys(sorted(of[j], key=lambda g: (len(rows_of[g]) == 1, max(place[i] for i in rows_of[g]), g)))
        )
    return list(order)


def _from(near: list[int], start: int) -> tuple[float, list[int]]:
    """Rows from one on, always the one next that brings the fewest others to the front; how broad that becomes."""
    front, score, order = 0, 0.0, [start]
    rest = set(range(len(near))) - {start}
    open_ = (1 << len(near)) - 1
    while True:
        j = order[-1]
        open_ &= ~(1 << j)
        front |= near[j]
        score += BROAD ** (front & open_).bit_count()
        if not rest:
            return score, order

        def brings(i: int, ready: int = front & open_, new: int = open_ & ~front) -> tuple[int, bool, int]:
            return (near[i] & new).bit_count() - (near[i] & ready > 0), not ready >> i & 1, i

        order.append(min(rest, key=brings))
        rest.remove(order[-1])
