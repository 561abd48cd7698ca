"""The bound of a sweep: elements that share candidates, solved together in whole numbers as far as prices ask for it.

Group after group, one of its candidates is taken or none. What the rest must see to is all that a partial plan leaves: what
each element still needs. Prices say what that costs at least, as they do for whole plans: the needs of each row alone, met
by choices from the groups to come. Of two partial plans that need the same, or one no more than the other anywhere, the
dearer one is dropped. Partial plans whose bound reaches the sweep's limit are not followed: the least of their bounds, or of
the cost of a partial plan that came to the end, is the bound of the sweep.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise
from typing import TYPE_CHECKING

import numpy as np

from pscover.relaxation import FINE, BoolArray, LongArray, Rows

if TYPE_CHECKING:
    from pscover.proof import Sweep

COARSE = 128
"""`FINE` units in a unit of the tables of prices."""
LAST = FINE // COARSE
MOST_PRICED = 2**55
"""The prices of a sweep, and the charges of all parts, add up to less than this; so do limits, or they count as none."""
MOST_LIMIT = 2**57
"""What is at least as dear is not followed, so that sums stay below 2^59."""
DEAREST = 2**56
"""Candidates that cost more are taken to cost this."""
NEVER = 2**60
"""The price of what cannot be."""
MOST_TABLES = 2**24
"""Prices kept for all groups and their elements; a sweep that needs more is not followed."""
MOST_WORK = 4 * 10**7
"""Needs that the sweeps of a certificate look at, each half of what is left; then they end where they are."""
PORTION = 2**18
"""Needs looked at in one go."""
MOST_COMPARED = 1000
"""Candidates of a group up to which those are left out that another replaces."""
MANY, RIVALS = 50, 100
"""Partial plans from which on all are compared with the most promising ones, and with how many."""
SUMS = 64
"""Sums of sizes that are told apart: needs between two of them are one."""
ODD = -7046029254386353131
"""Spreads needs over 64 bits."""


@dataclass
class Effort:
    """What sweeps may still look at."""

    left: int


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Options:
    """A group: at most one of its candidates is taken.

    Parameters
    ----------
    held
        The elements of its candidates.
    size, price, cost
        Of each choice, none first: `FINE` units of and prices in each element, shape (choices, held), and its cost.
    gain
        The least, if below 0, that prices leave of a cost.
    cliques, uses
        Cliques that it shares with other groups, numbered from -1 down, and whether a choice is in them: 0 or 1, shape
        (choices, cliques).
    """

    held: LongArray
    size: LongArray
    price: LongArray
    cost: LongArray
    gain: int
    cliques: LongArray
    uses: LongArray


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Stage:
    """A group on the way.

    Parameters
    ----------
    options
        The group.
    before, after
        What its elements pay at least by what they need, with the group and with those to come alone.
    sums
        What the sizes of groups to come can add up to, for each of its elements; None where that is not told apart.
    """

    options: Options
    before: list[LongArray]
    after: list[LongArray]
    sums: list[LongArray | None]


def swept(rows: Rows, sweep: Sweep, effort: Effort) -> int | None:
    """A lower bound on the cost of what meets all rows, in 1/scale; None if nothing does."""
    order = np.searchsorted(rows.elements, sweep.order)
    options, total = _options(rows, sweep.entry, order)
    stages, first = _stages(options, rows.asks)
    total += first
    if first >= NEVER // 2:
        return None
    limit = MOST_LIMIT if sweep.limit is None else min(sweep.limit, MOST_LIMIT)
    return total if total >= limit or not stages else _followed(stages, total, limit, effort)


def _options(rows: Rows, price: LongArray, order: LongArray) -> tuple[list[Options], int]:
    """The groups in the order of their elements, and what prices leave of the costs of all groups at least."""
    left = np.minimum(rows.cost, DEAREST)
    asked = np.flatnonzero(rows.asks[rows.row])
    owner, row, size, price = rows.owner[asked], rows.row[asked], rows.fine[asked], price[asked]
    cost = left.copy()
    np.subtract.at(left, owner, price)
    total = _lowest(left, rows.group)
    kinds, group = np.unique(rows.group[owner], return_inverse=True)
    place = np.empty(len(rows.elements), dtype=np.int64)
    place[order] = np.arange(len(order))
    early, late = np.full(len(kinds), len(order)), np.zeros(len(kinds), dtype=np.int64)
    np.minimum.at(early, group, place[row])
    np.maximum.at(late, group, place[row])
    way = np.lexsort((kinds, late, early != late, early))
    rank = np.empty(len(kinds), dtype=np.int64)
    rank[way] = np.arange(len(way))
    by_way = np.lexsort((owner, rank[group]))
    ends = np.searchsorted(rank[group][by_way], np.arange(len(kinds) + 1)).tolist()
    owner, row, size, price = owner[by_way], row[by_way], size[by_way], price[by_way]
    found = []
    for a, b in pairwise(ends):
        members, who = np.unique(owner[a:b], return_inverse=True)
        held, what = np.unique(row[a:b], return_inverse=True)
        sizes, prices = (np.zeros((len(members) + 1, len(held)), dtype=np.int64) for _ in range(2))
        sizes[who + 1, what], prices[who + 1, what] = size[a:b], price[a:b]
        costs = np.concatenate(([0], cost[members]))
        gain = min(0, int(left[members].min()))
        cliques, uses = _shared(rows, members)
        stays = _irreplaceable(np.hstack((sizes, -uses)), costs)
        found.append(
            Options(
                held=held,
                size=sizes[stays],
                price=prices[stays],
                cost=costs[stays],
                gain=gain,
                cliques=cliques,
                uses=uses[stays],
            )
        )
    return found, total


def _shared(rows: Rows, members: LongArray) -> tuple[LongArray, LongArray]:
    """The cliques that candidates of a group share with others, and who is in them, after a first who is in none."""
    here = np.isin(rows.member, members)
    cliques, which = np.unique(rows.clique[here], return_inverse=True)
    uses = np.zeros((len(members) + 1, len(cliques)), dtype=np.int64)
    uses[np.searchsorted(members, rows.member[here]) + 1, which] = 1
    return -1 - cliques, uses


def _lowest(left: LongArray, group: LongArray) -> int:
    """The sum over groups of the least of them, if below 0."""
    least = np.zeros(int(group.max(initial=-1)) + 1, dtype=np.int64)
    np.minimum.at(least, group, left)
    return int(least.sum())


def _irreplaceable(size: LongArray, cost: LongArray) -> BoolArray:
    """Choices without those that another one replaces: as large in all elements, and not dearer."""
    if len(cost) > MOST_COMPARED:
        return np.ones(len(cost), dtype=np.bool_)
    by = cost[:, None] >= cost[None, :]
    for column in size.T:
        by &= column[:, None] <= column[None, :]
    # Of choices that are alike, the first stays.
    by &= ~(by.T & np.tri(len(cost), dtype=np.bool_).T)
    return np.asarray(~by.any(axis=1), dtype=np.bool_)


def _stages(options: list[Options], asks: BoolArray) -> tuple[list[Stage], int]:
    """The groups with what elements pay before and after them, and what all pay together; no groups if they are too many."""
    free = np.full(LAST + 1, NEVER)
    free[0] = 0
    now = [free] * len(asks)
    sums: list[LongArray | None] = [np.zeros(1, dtype=np.int64)] * len(asks)
    stages: list[Stage] = []
    room = MOST_TABLES
    for group in reversed(options):
        after, reached = [now[j] for j in group.held], [sums[j] for j in group.held]
        for k, j in enumerate(group.held.tolist()):
            has = group.size[:, k] > 0
            size, price = group.size[has, k], group.price[has, k]
            now[j] = _with(after[k], -(-size // COARSE), price)
            sums[j] = _with_sums(reached[k], size)
        room -= len(after) * (LAST + 1)
        if room >= 0:
            stages.append(Stage(options=group, before=[now[j] for j in group.held], after=after, sums=reached))
    first = 0
    for pays in (now[j] for j in np.flatnonzero(asks)):
        first = min(first + int(pays[LAST]), NEVER)
    return stages[::-1] if room >= 0 else [], first


def _with(after: LongArray, size: LongArray, price: LongArray) -> LongArray:
    """What an element pays at least with one more group."""
    order = np.lexsort((-size, price))
    most, before = 0, after.copy()
    for s, z in zip(size[order].tolist(), price[order].tolist(), strict=True):
        if s > most:
            most = s
            np.minimum(before[s:], after[: LAST + 1 - s] + z, out=before[s:])
            np.minimum(before[:s], after[0] + z, out=before[:s])
    before[before > NEVER // 2] = NEVER
    return before


def _with_sums(sums: LongArray | None, size: LongArray) -> LongArray | None:
    """What sizes can add up to with one more group."""
    if sums is None:
        return None
    size = np.unique(size)
    if len(sums) * len(size) > SUMS * SUMS:
        return None
    found = np.unique(np.concatenate((sums, np.minimum(sums[:, None] + size, FINE).ravel())))
    return found if len(found) <= SUMS else None


@dataclass(eq=False)
class Front:
    """Partial plans: what they need of each open element, what they cost, and what plans with them cost at least.

    Whether they have a candidate of an open clique, 0 or 1, is among the needs, under the clique's number.
    """

    needs: dict[int, LongArray]
    cost: LongArray
    least: LongArray

    def only(self, which: LongArray | BoolArray) -> Front:
        """Some of them."""
        return Front({j: need[which] for j, need in self.needs.items()}, self.cost[which], self.least[which])

    def thinned(self) -> Front:
        """Those that no other one replaces, as far as that is looked for; the most promising first."""
        mixed = np.zeros(len(self.cost), dtype=np.int64)
        for need in self.needs.values():
            mixed = (mixed + need) * ODD
        front = self.only(np.lexsort((self.cost, mixed)))
        other = np.zeros(max(0, len(front.cost) - 1), dtype=np.bool_)
        for need in front.needs.values():
            other |= need[1:] != need[:-1]
        front = front.only(np.concatenate((np.ones(min(1, len(front.cost)), dtype=np.bool_), other)))
        if len(front.cost) > MANY:
            front = front.only(np.argsort(front.least, kind="stable"))
            front = front.only(front._rivalled())
        return front

    def _rivalled(self) -> LongArray:
        """Which are left after a comparison with the most promising ones."""
        left = np.arange(len(self.cost))
        cost, needs = self.cost, list(self.needs.values())
        for i in range(RIVALS):
            if i >= len(left):
                break
            out = cost >= cost[i]
            for need in needs:
                out &= need >= need[i]
            out[i] = False
            if out.any():
                stays = ~out
                left, cost, needs = left[stays], cost[stays], [need[stays] for need in needs]
        return left


def _followed(stages: list[Stage], first: int, limit: int, effort: Effort) -> int | None:
    """The least bound of partial plans that are not followed, and cost of those that come to the end; None without any."""
    last = {j: k for k, stage in enumerate(stages) for j in (*stage.options.held.tolist(), *stage.options.cliques.tolist())}
    one = np.zeros(1, dtype=np.int64)
    front, dropped, enough = Front({}, one, one + first), NEVER, effort.left // 2
    for k, stage in enumerate(stages):
        held = stage.options.held.tolist()
        effort.left -= len(front.cost) * (len(stage.options.cost) * (len(held) + 1) + len(front.needs) * RIVALS // 8)
        if effort.left < enough:
            return min(dropped, int(front.least.min()))
        for j in (*held, *stage.options.cliques.tolist()):
            front.needs.setdefault(j, np.full(len(front.cost), FINE if j >= 0 else 0))
        parts = []
        portion = max(1, PORTION // len(stage.options.cost))
        for begin in range(0, len(front.cost), portion):
            part, least = _taken(stage, front.only(np.arange(begin, min(begin + portion, len(front.cost)))), limit)
            dropped = min(dropped, least)
            parts.append(part)
        front = Front(
            {j: np.concatenate([part.needs[j] for part in parts]) for j in front.needs if last[j] > k},
            np.concatenate([part.cost for part in parts]),
            np.concatenate([part.least for part in parts]),
        ).thinned()
        if not len(front.cost):
            return dropped if dropped < NEVER // 2 else None
    return min(dropped, int(front.least.min()))


def _taken(stage: Stage, front: Front, limit: int) -> tuple[Front, int]:
    """Partial plans with each choice of a group, and the least bound of those that are not followed."""
    options = stage.options
    base = front.least - options.gain
    needs, least = [], options.cost[None, :]
    for k, j in enumerate(options.held.tolist()):
        need = front.needs[j]
        base = base - stage.before[k][(need + COARSE - 1) // COARSE]
        needs.append(np.maximum(need[:, None] - options.size[:, k], 0))
        least = np.minimum(least + stage.after[k][(needs[k] + COARSE - 1) // COARSE], NEVER)
    used = [front.needs[j][:, None] + options.uses[:, k] for k, j in enumerate(options.cliques.tolist())]
    least = least + base[:, None]
    for twice in used:
        least[twice > 1] = NEVER
    is_followed = least < limit
    dropped = int(np.where(is_followed, NEVER, least).min(initial=NEVER))
    who, what = np.nonzero(is_followed)
    part = front.only(who)
    part.cost, part.least = part.cost + options.cost[what], least[who, what]
    for k, j in enumerate(options.held.tolist()):
        part.needs[j] = _met(needs[k][who, what], stage.sums[k])
    for k, j in enumerate(options.cliques.tolist()):
        part.needs[j] = used[k][who, what]
    possible = np.ones(len(who), dtype=np.bool_)
    for j in options.held.tolist():
        possible &= part.needs[j] <= FINE
    return part if possible.all() else part.only(possible), dropped


def _met(need: LongArray, sums: LongArray | None) -> LongArray:
    """The largest needs that are met whenever these are, from groups to come; more than `FINE` where they never are."""
    return need if sums is None else np.append(sums, 2 * FINE)[np.searchsorted(sums, need)]
