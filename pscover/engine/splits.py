"""A bound that rises by splits on how many candidates a row has in a plan: few or many, and each part priced anew.

Where a plan may have at most k candidates of a row, those that are not among any k that meet it are out, and the fewer a row
may have the dearer it is; where it must have more, the row costs more. Both parts gain, unlike those of a split on single
candidates, of which there are too many that are alike. The part of the least bound is split first.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from .problem import IntArray, Problem
from .rowwise import UNITS, Shares, improve, without

MOST = 3
"""Candidates counted at most: they are a dimension of the rows' dynamic programme."""
TRIED = 4
"""Rows tried for a split."""
GLANCE = 10
"""Steps on each part of a split that is tried."""
LOOK = 60
"""Steps on each part of a split that is made."""
CLEAR = 1e-6
"""By how much a bound must exceed a multiple of the step to be lifted to the next."""


@dataclass(slots=True, eq=False)
class Part:
    """Plans within some limits, and what bounds them.

    Parameters
    ----------
    problem, kept
        Without the candidates that are out, and which these are.
    priced
        Prices; limits are in them.
    bound
        Proven of all plans in it.
    row, count, few, many
        The split, once there is one.
    """

    problem: Problem
    kept: IntArray
    priced: Shares
    bound: float
    row: int = -1
    count: int = 0
    few: Part | None = None
    many: Part | None = None


class Splits:
    """Best-first splitting.

    Parameters
    ----------
    problem, kept, priced
        The problem, its candidates as the caller numbers them, and settled prices.
    cost
        Of a plan at hand.
    step
        The least by which costs of plans differ.
    """

    def __init__(self, problem: Problem, kept: IntArray, priced: Shares, cost: float, step: float) -> None:
        self.cost, self.step = cost, step
        self.root = Part(problem, kept, _copy(priced), float(priced.value[0]))
        self.leaves = [self.root]

    @property
    def bound(self) -> float:
        """Proven of all plans: the least of all parts."""
        return min(leaf.bound for leaf in self.leaves)

    def turn(self) -> bool:
        """Split the part of the least bound; whether it could be."""
        part = self._weakest()
        found = self._split_of(part)
        if found is None:
            return False
        part.row, part.count, part.few, part.many = found
        for child in (part.few, part.many):
            self._price(child, LOOK)
            child.bound = max(child.bound, part.bound)
        self.leaves.remove(part)
        self.leaves += [part.few, part.many]
        return True

    def _weakest(self) -> Part:
        return min(self.leaves, key=lambda leaf: leaf.bound)

    def _price(self, part: Part, steps: int) -> None:
        """Improve the prices of a part until its bound is lifted beyond that of the whole, or for so many steps."""
        aim = (math.floor(self.bound / self.step + CLEAR) + 1) * self.step * (1 + CLEAR) if self.step else self.cost
        for _ in range(0, steps, GLANCE):
            part.bound = max(part.bound, float(improve(part.problem, part.priced, GLANCE, self.cost)))
            if part.bound > aim:
                return

    def _split_of(self, part: Part) -> tuple[int, int, Part, Part] | None:
        """The best of a few splits: row, count and the two parts."""
        best, found = -math.inf, None
        for row, count in _likely(part.priced)[:TRIED]:
            few, many = _few(part, row, count), _many(part, row, count)
            for child in (few, many):
                self._price(child, GLANCE)
            worth = min(few.bound, many.bound) + 0.1 * min(self.cost, max(few.bound, many.bound))
            if worth > best:
                best, found = worth, (row, count, few, many)
        return found


def _copy(priced: Shares) -> Shares:
    fresh = {name: getattr(priced, name).copy() for name in ("mean", "low", "high", "chosen", "penalty", "value")}
    return priced._replace(share=priced.kept.copy(), kept=priced.kept.copy(), **fresh)


def _likely(priced: Shares) -> list[tuple[int, int]]:
    """Rows with about half a candidate more or less in recent choices, the likeliest first, and what to split them at."""
    row = np.repeat(np.arange(len(priced.low)), np.diff(priced.starts))
    held = np.bincount(row, np.maximum(priced.mean, 0.0), len(priced.low))
    count = np.floor(held)
    split = (count >= 1) & (count <= MOST) & (count > priced.low - 1) & ((priced.high < 0) | (count < priced.high))
    far = np.where(split, np.abs(held - count - 0.5), np.inf)
    order = np.argsort(far, kind="stable")
    return [(int(j), int(count[j])) for j in order[: int(np.isfinite(far).sum())].tolist()]


def _few(part: Part, row: int, count: int) -> Part:
    """Plans with at most so many candidates of the row."""
    old = part.priced
    span = slice(old.starts[row], old.starts[row + 1])
    units = old.units[span]
    others = int(np.sort(units)[::-1][: count - 1].sum())
    gone = np.zeros(part.problem.candidates, dtype=np.bool_)
    gone[old.candidate[span][units + others < UNITS]] = True
    priced = _limited(without(old, gone), row, high=count)
    problem = part.problem._replace(cost=np.ascontiguousarray(part.problem.cost[~gone]))
    return Part(problem, part.kept[~gone], priced, part.bound)


def _many(part: Part, row: int, count: int) -> Part:
    """Plans with more."""
    return Part(part.problem, part.kept, _limited(_copy(part.priced), row, low=count + 1), part.bound)


def _limited(priced: Shares, row: int, *, low: int = 0, high: int = -1) -> Shares:
    """Fresh limits on a row, and choices to begin with that do not speak for any price."""
    lows, highs = priced.low.copy(), priced.high.copy()
    lows[row] = max(lows[row], low)
    highs[row] = high if highs[row] < 0 else min(highs[row], high) if high >= 0 else highs[row]
    chosen = np.ones(len(priced.share), dtype=np.int32)
    value = np.array([-np.inf, 0.1, 0.0, 0.0, 1.0])
    return priced._replace(low=lows, high=highs, chosen=chosen, value=value)
