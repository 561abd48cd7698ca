"""What the rows of a block pay for its candidates, as it is kept and improved for a certificate."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise
from time import perf_counter

import numpy as np
from numpy.typing import NDArray

from . import rowwise, subgradient
from .problem import IntArray, Problem
from .route import along
from .rowwise import Shares, shares

FloatArray = NDArray[np.float64]
LongArray = NDArray[np.int64]

SWEPT, BROADEST = 12_000, 14
"""Most entries of a block, and most rows at the front, for which a sweep is asked for where none has brought the proof."""
STEPS = 10
"""Steps between two looks at the clock."""
ROUGH = 200
"""Steps on multipliers before shares are made of them."""
SETTLED = 2e-3
"""Steps shorter than this bring nothing."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Paid:
    """What the rows of a block pay for its candidates.

    Parameters
    ----------
    row, column
        Of each entry, in the block.
    price
        Of each entry.
    """

    row: LongArray
    column: LongArray
    price: FloatArray


class Account:
    """What the rows of a block pay for its candidates, those included that have been left out since.

    Parameters
    ----------
    problem, kept
        The block as it was at first, and its candidates.
    """

    def __init__(self, problem: Problem, kept: IntArray) -> None:
        self._problem, self.kept = problem, kept.astype(np.int64)
        self._paid: Paid | None = None
        self._bound = -np.inf

    def note(self, kept: IntArray, multipliers: FloatArray, better: Shares | None, extra: float = 0.0) -> None:
        """Take the prices as they are: those of multipliers at first, then the best shares; `extra` is what tolls add."""
        if self._paid is None:
            first = shares(self._problem, multipliers)
            row = _row(first)
            column = self.kept[first.candidate]
            order = np.lexsort((row, column))
            self._paid = Paid(row=row[order], column=column[order], price=first.share[order])
        bound = -np.inf if better is None else float(better.value[rowwise.BOUND]) - extra
        if better is not None and bound >= self._bound:
            self._bound = bound
            rows = len(better.starts)
            known = self._paid.column * rows + self._paid.row
            now = self.kept[kept][better.candidate] * rows + _row(better)
            self._paid.price[np.searchsorted(known, now)] = better.kept

    def improve(self, cost: float, step: float, seconds: float) -> bool:
        """Look for better prices for so long, or until their bound, lifted to a multiple of the step, is this cost.

        Returns
        -------
        bool
            Whether it is.
        """
        end = perf_counter() + seconds
        if seconds <= 0 or not len(self._problem.lines):
            return False
        rough = subgradient.multipliers(self._problem)
        for _ in range(0, ROUGH if self._paid is None else 0, STEPS):
            subgradient.ascend(self._problem, rough, STEPS, cost)
            if perf_counter() > end - seconds / 2:
                break
        better = shares(self._problem, rough.kept, rowwise.resolution(self._problem))
        if self._paid is not None:
            at = np.lexsort((_row(better), better.candidate))
            paid = np.empty(len(at))
            paid[at] = self._paid.price
            # Tolls are in these prices.
            total = np.bincount(better.candidate, paid, self._problem.candidates)
            paid *= np.minimum(1.0, self._problem.cost / np.maximum(total, 1e-300))[better.candidate]
            better.share[:] = better.kept[:] = paid
        enough = min(cost, cost - step + 1e-6 * max(1.0, cost))
        while better.value[rowwise.LENGTH] > SETTLED:
            if rowwise.improve(self._problem, better, STEPS, cost) > enough or perf_counter() > end:
                break
        self.note(np.arange(len(self.kept), dtype=np.int32), rough.kept, better)
        return bool(better.value[rowwise.BOUND] > enough)

    def paid(self, rows: LongArray, columns: LongArray) -> Paid | None:
        """The prices, for rows and candidates as they are numbered in the whole; None if none were taken."""
        if self._paid is None:
            return None
        return Paid(row=rows[self._paid.row], column=columns[self._paid.column], price=self._paid.price)

    def order(self) -> LongArray:
        """Its rows in the order of a sweep."""
        return in_order(self._problem)

    def swept(self) -> LongArray | None:
        """The same where a sweep is likely to come to an end."""
        order = in_order(self._problem) if len(self._problem.lines) <= SWEPT else None
        return order if order is not None and is_narrow(self._problem, order) else None


def is_narrow(problem: Problem, order: LongArray) -> bool:
    """Whether a sweep in this order has few rows at its front at a time."""
    place = np.empty(problem.rows, dtype=np.int64)
    place[order] = np.arange(problem.rows)
    home = np.unique(problem.homes[problem.lines["candidate"]], return_inverse=True)[1]
    at = np.repeat(place, np.diff(problem.rptr))
    # Groups are taken as their first row comes; a row is at the front from the first group that has it to the last.
    early = np.full(problem.candidates, problem.rows)
    np.minimum.at(early, home, at)
    first, last = place.copy(), place.copy()
    np.minimum.at(first, at, early[home])
    np.maximum.at(last, at, early[home])
    change = np.bincount(first, minlength=problem.rows + 1)
    change[1:] -= np.bincount(last, minlength=problem.rows)
    return int(np.cumsum(change).max(initial=0)) <= BROADEST


def in_order(problem: Problem) -> LongArray:
    """Rows in the order of a sweep."""
    row = np.repeat(np.arange(problem.rows), np.diff(problem.rptr))
    pairs = np.unique(problem.homes[problem.lines["candidate"]] * problem.rows + row)
    home, held = np.divmod(pairs, problem.rows)
    starts = [*np.flatnonzero(np.diff(home, prepend=-1)).tolist(), len(held)]
    every = held.tolist()
    return np.array(along([every[a:b] for a, b in pairwise(starts)], problem.rows), dtype=np.int64)


def _row(priced: Shares) -> LongArray:
    return np.repeat(np.arange(len(priced.starts) - 1), np.diff(priced.starts))
