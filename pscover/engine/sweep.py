"""Small problems to proven optimality by a sweep over the cliques, where rows that interact form a long and narrow network.

Clique after clique one of its candidates or none is taken. All that the rest asks of what came before is what the rows at
the front still need, so that of two partial plans one is dropped if it costs no less and leaves no row nearer to being met
(dynamic programming over a path decomposition; Pareto labels as in resource-constrained shortest paths). Prices of rows
(`rowwise`) bound what the rest costs at least: partial plans that cannot end within a target are dropped as well. Targets
rise from the bound by the least step of costs until a plan is found, so that the first one found is the best.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import Any

import numpy as np
from numpy.typing import NDArray

from .jit import inner, kernel, wide
from .problem import TOLERANCE, FloatArray, IntArray, Problem
from .route import Stage, route
from .rowwise import Shares
from .tables import units_of

MOST = 100_000
"""Most partial plans at a time; a sweep that would need more gives up."""
COMPARED = 400
"""With how many partial plans each is compared, the most promising ones."""
CROWD = 20
"""How many times that may be made of them in one go."""
PORTION = 4096
"""How many are looked at in one go."""
LANE, LANES = 9, 7
"""Bits for a need of a row, rounded down to 8 bits, and how many such needs fit a number."""
GUARDS = sum(1 << LANE * s + LANE - 1 for s in range(LANES))
"""Their topmost bits: what is set in the minuend stays set in the difference where no need is larger."""
ROUND = 1e-12
"""What sums of entries may lose to rounding."""


@kernel
def expand(
    needs: FloatArray,
    least: FloatArray,
    price: FloatArray,
    begin: int,
    cost: FloatArray,
    amount: FloatArray,
    slots: IntArray,
    fresh: NDArray[np.bool_],
    before: FloatArray,
    after: FloatArray,
    sums: FloatArray,
    size: IntArray,
    target: float,
    new_needs: FloatArray,
    new_least: FloatArray,
    new_price: FloatArray,
    parent: IntArray,
    pick: IntArray,
    room: FloatArray,
) -> tuple[int, int]:
    """Extend partial plans from one on until all are or there is no more room; the next to extend and how many were made.

    `room` is for two numbers of each row.
    """
    rows, many, width, count = len(slots), len(cost), needs.shape[1], 0
    for k in range(begin, len(least)):
        if count + many > len(new_least):
            return k, count
        base = least[k]
        for r in range(rows):
            need = 1.0 - TOLERANCE if fresh[r] else needs[k, slots[r]]
            room[0, r] = need
            base -= before[r, units_of(need)]
        for c in range(many):
            bound = base + cost[c]
            for r in range(rows):
                need = room[0, r] - amount[c, r]
                if need > ROUND:
                    need = _equivalent(sums, size[r], r, need)
                    bound += after[r, units_of(need)]
                    if bound > target:
                        break
                else:
                    need = 0.0
                room[1, r] = need
            if bound > target:
                continue
            for s in range(width):
                new_needs[count, s] = needs[k, s]
            for r in range(rows):
                new_needs[count, slots[r]] = room[1, r]
            new_least[count] = bound
            new_price[count] = price[k] + cost[c]
            parent[count] = k
            pick[count] = c
            count += 1
    return len(least), count


@inner
def _equivalent(sums: FloatArray, size: int, r: int, need: float) -> float:
    """The largest need that is met whenever this one is."""
    low, high = wide(0), wide(size)
    while low < high:
        middle = (low + high) // 2
        if sums[r, middle] >= need - ROUND:
            high = middle
        else:
            low = middle + 1
    return sums[r, low] if low < size else need


@kernel
def undominated(
    needs: FloatArray,
    price: FloatArray,
    order: NDArray[np.int64],
    count: int,
    kept: NDArray[np.int64],
    packed: NDArray[np.int64],
    table: NDArray[np.int32],
) -> int:
    """How many partial plans stay with those in an order, most promising first, after so many; `kept` gets which.

    `packed` holds the needs of those that stay, roughly and side by side in one number, so that most comparisons take one
    subtraction. `table` finds partial plans that stay by their needs; -1 where there is none.
    """
    width, size = needs.shape[1], len(table)
    for o in range(len(order)):
        i = order[o]
        cost = price[i]
        key = mine = wide(0)
        for s in range(width):
            need = needs[i, s]
            key = (key * 1000003 + int(need * 1e12)) & 0xFFFFFFFFFFFF
            if s < LANES:
                mine = (mine << LANE) + int(need * 255.0)
        at = key % size
        is_out = False
        while table[at] >= 0 and not is_out:
            k = table[at]
            is_out = price[k] <= cost
            for s in range(width):
                if needs[k, s] != needs[i, s]:
                    is_out = False
                    break
            at = (at + 1) % size
        if is_out:
            continue
        guarded = mine | GUARDS
        for p in range(count if count < COMPARED else COMPARED):
            if (guarded - packed[p]) & GUARDS != GUARDS:
                continue
            q = kept[p]
            if price[q] > cost:
                continue
            is_out = True
            for s in range(width):
                if needs[q, s] > needs[i, s]:
                    is_out = False
                    break
            if is_out:
                break
        if is_out:
            continue
        while table[at] >= 0:
            at = (at + 1) % size
        table[at] = i
        kept[count] = i
        packed[count] = mine
        count += 1
    return count


def worth(cost: float, step: float) -> float:
    """The most that a plan may cost that is better than one at hand.

    Examples
    --------
    >>> round(worth(35.0, 1.0)), worth(math.inf, 1.0)
    (34, inf)
    """
    return cost - step + (1e-6 if step > 0 else -1e-9) * max(1.0, abs(cost)) if math.isfinite(cost) else cost


class Sweep:
    """A sweep as Python drives it, a few cliques a turn.

    Parameters
    ----------
    problem
        The rows and cliques; each candidate in one clique at most.
    priced
        Prices of the rows' entries.
    out
        Candidates that no plan worth finding has, shape (candidates,).
    lower
        What every plan costs at least.
    step
        By how much a plan must at least be cheaper to count; 0 for the least that can be told apart.
    """

    def __init__(self, problem: Problem, priced: Shares, out: NDArray[np.bool_], lower: float, step: float) -> None:
        self.stages, self._first = route(problem, priced, out)
        self.step = step
        self.target = math.ceil(lower / step - 1e-6) * step if step > 0 else math.inf
        self.is_finished = False
        self.has_given_up = False
        self.plan: IntArray | None = None
        self.cost = math.inf
        self.work = 0
        self._width = 1 + max((int(stage.slots.max()) for stage in self.stages), default=0)
        self._limit = math.inf
        self._restart()
        self._course = self._go()

    def _restart(self) -> None:
        self._needs = np.zeros((1, self._width))
        self._least, self._price = np.array([self._first]), np.zeros(1)
        self._past: list[tuple[IntArray, IntArray]] = []

    @property
    def lower(self) -> float:
        """What every plan costs at least that is worth finding: lower targets are refuted."""
        return self.target if self.step > 0 else 0.0

    def turn(self, work: int, limit: float) -> bool:
        """Go on for so much work or to the end; whether a plan of at most the limit was found, which is the best then."""
        end = self.work + work
        self._limit = limit
        while self.work < end and not (self.is_finished or self.has_given_up):
            next(self._course, None)
        return self.plan is not None

    def _go(self) -> Iterator[None]:
        """One target after the other, with pauses."""
        while math.isfinite(self._first) and (
            self.step <= 0 or self.target <= self._limit + 1e-6 * max(1.0, abs(self._limit))
        ):
            self._restart()
            for stage in self.stages:
                yield from self._advance(stage)
                if self.has_given_up:
                    return
                if not len(self._least):
                    break
            else:
                self.plan, self.cost = self._way(), float(self._price.min())
            if self.step <= 0 or self.plan is not None:
                break
            self.target += self.step
        self.is_finished = True

    def _advance(self, stage: Stage) -> Iterator[None]:
        """Take a clique, with pauses."""
        parts: list[list[NDArray[Any]]] = []
        begin, total = 0, 0
        while begin < len(self._least):
            begin, made = self._expand(stage, begin)
            parts.append(made)
            total += len(made[0])
            if total > CROWD * MOST:
                self.has_given_up = True
                return
            yield
        needs, least, price, parent, pick = (np.concatenate(each) for each in zip(*parts, strict=True))
        kept, packed = np.empty(total, dtype=np.int64), np.empty(total, dtype=np.int64)
        table = np.full(2 * total + 3, -1, dtype=np.int32)
        order = np.argsort(least, kind="stable")
        size = 0
        for first in range(0, total, PORTION):
            some = order[first : first + PORTION]
            size = int(undominated(needs, price, some, size, kept, packed, table))
            self.work += 1 + min(size, COMPARED) * len(some) // 4
            yield
        self.has_given_up = size > MOST
        kept = kept[:size]
        self._needs, self._least, self._price = needs[kept], least[kept], price[kept]
        self._past.append((parent[kept], stage.picks[pick[kept]]))

    def _expand(self, stage: Stage, begin: int) -> tuple[int, list[NDArray[Any]]]:
        """Partial plans from one on with a clique, as many as there is room for: needs, bounds, costs, parents and picks."""
        room = min(PORTION, len(self._least) - begin) * len(stage.cost)
        made = (
            np.empty((room, self._width)),
            np.empty(room),
            np.empty(room),
            np.empty(room, dtype=np.int32),
            np.empty(room, dtype=np.int32),
        )
        end, count = expand(
            self._needs,
            self._least,
            self._price,
            begin,
            stage.cost,
            stage.amount,
            stage.slots,
            stage.fresh,
            stage.before,
            stage.after,
            stage.sums,
            stage.size,
            min(self.target + 1e-6 * max(1.0, abs(self.target)), self._limit),
            *made,
            np.empty((2, len(stage.slots))),
        )
        self.work += 100 + (end - begin) * len(stage.cost)
        return end, [array[:count].copy() for array in made]

    def _way(self) -> IntArray:
        """The cheapest plan, by the picks that led to it."""
        k, plan = int(np.argmin(self._price)), []
        for parent, pick in reversed(self._past):
            if pick[k] >= 0:
                plan.append(int(pick[k]))
            k = int(parent[k])
        return np.array(sorted(plan), dtype=np.int32)
