"""The relaxation that certificates speak of, in whole numbers; why it is one is said in `certificate`."""

from __future__ import annotations

import math
from dataclasses import dataclass
from decimal import ROUND_CEILING, ROUND_FLOOR, Context, Decimal
from fractions import Fraction
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from pscover.instance import TOLERANCE, Instance

if TYPE_CHECKING:
    from pscover.proof import Prices

LongArray = NDArray[np.int64]
BoolArray = NDArray[np.bool_]
Limits = dict[int, tuple[int, int | None]]
"""The least and the most candidates that elements have, None for no most."""

SLACK = 2 * TOLERANCE
"""By how much a requirement may be missed: twice what a goal forgives, so that plans weighed in floating point count too."""
MOST_UNITS = 4096
FINE = 2**16
"""Units of a demand in sweeps, and where prices are told apart by levels."""
LEVELS = 4096
"""Of prices, up to that of some choice that meets a row."""
HUGE = 2**59
"""Prices add up to less than this, so that sums of a few such numbers fit 64 bits."""
NEVER = 2**61
"""The price of what cannot be: above all prices, and twice it fits 64 bits."""
BINARY = 2**40
"""Fixed-point logarithms: the largest demand, 20.1 for a requirement of 1, times this and the most units fits 64 bits."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Rows:
    """Elements, and candidates that cover them, in whole numbers.

    Parameters
    ----------
    elements, candidates
        Which of the instance's they are, rising; here they are numbered in this order.
    asks
        Which elements ask for anything.
    owner, row
        The candidate and the element of each entry, in the order of `Instance.probability`.
    size, fine
        Of each entry, in units of the certificate and in `FINE` units.
    group, cost
        Of each candidate.
    member, clique
        Candidates of cliques that are not within one group, and of which they are.
    units
        Of the certificate.
    """

    elements: LongArray
    candidates: LongArray
    asks: BoolArray
    owner: LongArray
    row: LongArray
    size: LongArray
    fine: LongArray
    group: LongArray
    cost: LongArray
    member: LongArray
    clique: LongArray
    units: int

    @classmethod
    def of(cls, instance: Instance, units: int, scale: int) -> Rows:
        """All of an instance, costs rounded down to whole numbers of 1/scale."""
        p = instance.probability
        supply, asked = _amounts(instance)
        whole = {c: min(HUGE, math.floor(Fraction(c) * scale)) for c in np.unique(instance.cost).tolist()}
        group = groups(instance)
        member, clique = instance.conflicts.members.astype(np.int64), instance.conflicts.owner().astype(np.int64)
        across = np.isin(clique, clique[group[member] != clique])
        return cls(
            elements=np.arange(instance.elements),
            candidates=np.arange(instance.candidates),
            asks=asked > 0,
            owner=np.repeat(np.arange(instance.candidates), np.diff(p.indptr)),
            row=p.indices.astype(np.int64),
            size=_in_units(supply, asked[p.indices], units),
            fine=_in_units(supply, asked[p.indices], FINE),
            group=group,
            cost=np.array([whole[c] for c in instance.cost.tolist()], dtype=np.int64),
            member=member[across],
            clique=clique[across],
            units=units,
        )

    def part(self, which: LongArray, entries: LongArray) -> tuple[Rows, LongArray]:
        """Some elements with all their entries, both rising and as numbered here; and the candidates that these are of."""
        owner = self.owner[entries]
        fresh = np.diff(owner, prepend=-1) != 0
        some = owner[fresh]
        place = np.zeros(len(self.elements), dtype=np.int64)
        place[which] = np.arange(len(which))
        own = np.minimum(np.searchsorted(some, self.member), max(0, len(some) - 1))
        inside = some[own] == self.member if len(some) else np.zeros(len(own), dtype=np.bool_)
        part = Rows(
            elements=self.elements[which],
            candidates=self.candidates[some],
            asks=self.asks[which],
            owner=np.cumsum(fresh) - 1,
            row=place[self.row[entries]],
            size=self.size[entries],
            fine=self.fine[entries],
            group=self.group[some],
            cost=self.cost[some],
            member=own[inside],
            clique=self.clique[inside],
            units=self.units,
        )
        return part, some

    def bound(self, prices: Prices, limits: Limits) -> int | None:
        """Of one set of prices, in 1/scale; None where no plan is within the limits."""
        allowed = self._allowed(limits)
        unit = np.where(self.asks, prices.unit, 0)
        paid = prices.entry + unit[self.row] * self.size
        left = self.cost.copy()
        np.subtract.at(left, self.owner, paid)
        total = int(unit.sum()) * self.units + gain(left[allowed], self.group[allowed])
        inside = np.flatnonzero(allowed[self.owner])
        row, group, price = self.row[inside], self.group[self.owner[inside]], prices.entry[inside]
        best = _undominated(row, group, price, self.size[inside])
        starts = np.searchsorted(row[best], np.arange(len(self.elements) + 1))
        fine = _undominated(row, group, price, self.fine[inside])
        fines = np.searchsorted(row[fine], np.arange(len(self.elements) + 1))
        size = self.size[inside]
        for j in range(len(self.elements)):
            span = best[starts[j] : starts[j + 1]]
            demand = self.units if self.asks[j] else 0
            if not demand and j not in limits:
                total += gain(price[span], group[span])
                continue
            low, high = limits.get(j, (0, None))
            cheapest = _cheapest(group[span].tolist(), price[span].tolist(), size[span].tolist(), demand, low, high)
            if cheapest is None:
                return None
            if j not in limits:
                span = fine[fines[j] : fines[j + 1]]
                cheapest = max(cheapest, _at_least(group[span], price[span], self.fine[inside[span]]))
            total += cheapest
        return total

    def _allowed(self, limits: Limits) -> BoolArray:
        """Candidates without those that are in no choice of few enough candidates that meets a row."""
        allowed = np.ones(len(self.candidates), dtype=np.bool_)
        for j, (_, high) in limits.items():
            if high is None or not self.asks[j]:
                continue
            own = np.flatnonzero(self.row == j)
            others = int(np.sort(self.size[own])[::-1][: max(0, high - 1)].sum())
            allowed[self.owner[own[self.size[own] + others < self.units]]] = False
            if high == 0:
                allowed[self.owner[own]] = False
        return allowed


def sizes(instance: Instance, units: int) -> tuple[LongArray, BoolArray]:
    """Sizes s_ij in whole units of the demand, at most all of it, for each stored p_ij; and which elements ask for anything.

    Examples
    --------
    >>> size, asks = sizes(Instance.of([[0.5, 1.0, 0.1]], required=0.75), 10)
    >>> size.tolist(), asks.tolist()
    ([6, 10, 1], [True])
    """
    supply, asked = _amounts(instance)
    return _in_units(supply, asked[instance.probability.indices], units), asked > 0


def _amounts(instance: Instance) -> tuple[LongArray, LongArray]:
    """What entries supply, at most all of the demand, rounded up, and what elements ask for, rounded down: fixed point."""
    p = instance.probability
    down, up = Context(prec=40, rounding=ROUND_FLOOR), Context(prec=40, rounding=ROUND_CEILING)
    one, binary = Decimal(1), Decimal(BINARY)
    # A correctly rounded logarithm of 40 digits is off by less than 1e-36 here: two such steps outward are enough.
    step = Decimal("1e-36")
    demand = np.zeros(instance.elements, dtype=np.int64)
    for q in np.unique(instance.required).tolist():
        rest = up.add(up.subtract(one, Decimal(q)), Decimal(SLACK))
        if rest < one:
            need = down.subtract(down.minus(down.ln(rest)), step)
            demand[instance.required == q] = max(0, int(down.multiply(need, binary)))
    values, place = np.unique(p.data, return_inverse=True)
    weight = np.full(len(values), -1, dtype=np.int64)
    for k, value in enumerate(values.tolist()):
        if value < 1.0:
            most = up.add(up.minus(up.ln(down.subtract(one, Decimal(value)))), step)
            weight[k] = int(up.multiply(most, binary)) + 1
    asked = demand[p.indices]
    supply = weight[place]
    return np.where(supply < 0, asked, np.minimum(supply, asked)), demand


def _in_units(supply: LongArray, asked: LongArray, units: int) -> LongArray:
    """What entries supply in whole units of what their elements ask for, rounded up; 0 where that is nothing."""
    size = np.zeros_like(supply)
    some = asked > 0
    size[some] = (supply[some] * units + asked[some] - 1) // asked[some]
    return size


def groups(instance: Instance) -> LongArray:
    """Disjoint groups of which a plan holds at most one candidate each: the largest clique of each candidate, or itself.

    Examples
    --------
    >>> groups(Instance.of([[0.5, 0.5, 0.5, 0.5]], conflicts=[(0, 1), (1, 2, 3)])).tolist()
    [0, 1, 1, 1]
    """
    cliques = instance.conflicts
    group = np.arange(len(cliques), len(cliques) + instance.candidates, dtype=np.int64)
    large = np.diff(cliques.starts)
    order = np.argsort(large[cliques.owner()], kind="stable")
    group[cliques.members[order]] = cliques.owner()[order]
    return group


def gain(value: LongArray, group: LongArray) -> int:
    """The sum over groups of min(0, the least value)."""
    below = np.flatnonzero(value < 0)
    order = below[np.lexsort((value[below], group[below]))]
    first = np.diff(group[order], prepend=-1) != 0
    return int(value[order[first]].sum())


def _undominated(row: LongArray, group: LongArray, price: LongArray, size: LongArray) -> LongArray:
    """Entries by row and group without those that another of their row and group replaces: as large and not dearer."""
    order = np.lexsort((-size, price, group, row))
    fresh = (np.diff(row[order], prepend=-1) != 0) | (np.diff(group[order], prepend=-1) != 0)
    rising = np.cumsum(fresh) * (FINE + 1) + size[order]
    before = np.concatenate(([-1], np.maximum.accumulate(rising)[:-1])) if len(rising) else rising
    kept: LongArray = order[fresh | (rising > before)]
    return kept


def _cheapest(group: list[int], price: list[int], size: list[int], demand: int, low: int, high: int | None) -> int | None:
    """The least price of a choice of `low` to `high` entries, at most one a group, that gives the demand; None without one.

    State (e, d): the least price of e entries (as many or more for the last e where there is no `high`) of at least d units.
    """
    last = low if high is None else min(high, len(set(group)))
    if low > last:
        return None
    table = np.full((last + 1, demand + 1), NEVER, dtype=np.int64)
    table[0, 0] = 0
    k = 0
    while k < len(group):
        before, end = table.copy(), k
        while end < len(group) and group[end] == group[k]:
            _take(table, before, price[end], size[end], capped=high is None)
            end += 1
        k = end
    least = int(table[low:, demand].min())
    return None if least >= NEVER // 2 else least


def _at_least(group: LongArray, price: LongArray, fine: LongArray) -> int:
    """What a choice of entries by group, at most one each, costs at least if it gives the demand, in fine units.

    Where `_cheapest` rounds sizes up to units, this rounds prices down to levels: it looks for the most that choices of each
    level give. What is below 0 is free, and all of it is paid out beforehand.
    """
    dear = np.maximum(price, 0)
    order = np.argsort(dear * FINE // np.maximum(fine, 1), kind="stable")
    _, first = np.unique(group[order], return_index=True)
    chosen = order[np.sort(first)]
    enough = int(np.searchsorted(np.cumsum(fine[chosen]), FINE))
    if enough == len(chosen):
        return gain(price, group)
    level = max(1, -(-int(dear[chosen[: enough + 1]].sum()) // LEVELS))
    steps = dear // level
    most = np.zeros(LEVELS + 1, dtype=np.int64)
    held = np.flatnonzero(steps <= LEVELS)
    ends = np.flatnonzero(np.diff(group[held], append=-1))
    begin = 0
    for end in (ends + 1).tolist():
        before = most.copy()
        for step, size in zip(steps[held[begin:end]].tolist(), fine[held[begin:end]].tolist(), strict=True):
            np.maximum(most[step:], before[: LEVELS + 1 - step] + size, out=most[step:])
        begin = end
    return int(np.searchsorted(most, FINE)) * level + gain(price, group)


def _take(table: LongArray, before: LongArray, price: int, size: int, *, capped: bool) -> None:
    """Lower the states that one more entry reaches."""
    demand = table.shape[1] - 1
    size = min(size, demand)
    sources = [(slice(0, -1), slice(1, None))] if len(table) > 1 else []
    if capped:
        sources.append((slice(-1, None), slice(-1, None)))
    for source, target in sources:
        old, new = before[source], table[target]
        np.minimum(new[:, size:], old[:, : demand + 1 - size] + price, out=new[:, size:])
        np.minimum(new[:, :size], old[:, :1] + price, out=new[:, :size])
