"""From what engines know of a reduced form to a certificate about the whole one."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass
from itertools import pairwise
from time import perf_counter
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csc_array, csr_array

from pscover.certificate import Certificate, refutation
from pscover.model import CoverForm
from pscover.presolve import Outcome, Reduced
from pscover.proof import Part, Parts, Prices, Proof, Sweep

from . import rowwise, subgradient
from .forced import Forced
from .problem import IntArray, Problem
from .route import along
from .rowwise import Shares, shares

if TYPE_CHECKING:
    from .block import Block

FloatArray = NDArray[np.float64]
LongArray = NDArray[np.int64]

UNITS = 480
"""Units of a demand: a multiple of those that engines use."""
DIGITS = 2**20
"""Prices are rounded down to such a part of the mean cost, or less."""
LIMIT = 2.0**53
"""Prices add up to less, as whole numbers."""
MOST = 400_000
"""Most entries of a form that gets a certificate."""
SWEPT = 12_000
"""Most entries of a block for which a sweep is asked for where none has brought the proof."""
STEPS = 10
"""Steps between two looks at the clock."""
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


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Known:
    """What is known of a block, in numbers of the reduced form.

    Parameters
    ----------
    rows
        Its rows, rising.
    paid
        Prices, if there are any.
    order
        In which order a sweep goes through its rows; None where prices alone are to bound its cost.
    limit
        More than this is what a sweep is to show that plans cost.
    """

    rows: LongArray
    paid: Paid | None
    order: LongArray | None
    limit: float


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

    def note(self, kept: IntArray, multipliers: FloatArray, better: Shares | None) -> None:
        """Take the prices as they are: those of multipliers at first, then the best shares."""
        if self._paid is None:
            first = shares(self._problem, multipliers)
            row = _row(first)
            column = self.kept[first.candidate]
            order = np.lexsort((row, column))
            self._paid = Paid(row=row[order], column=column[order], price=first.share[order])
        if better is not None:
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
        if perf_counter() >= end or not len(self._problem.lines):
            return False
        rough = subgradient.multipliers(self._problem)
        while self._paid is None and perf_counter() < end - seconds / 2 and rough.value[subgradient.LENGTH] > SETTLED:
            subgradient.ascend(self._problem, rough, STEPS, cost)
        better = shares(self._problem, rough.kept)
        if self._paid is not None:
            at = np.lexsort((_row(better), better.candidate))
            paid = np.empty(len(at))
            paid[at] = self._paid.price
            # Tolls are in these prices.
            total = np.bincount(better.candidate, paid, self._problem.candidates)
            paid *= np.minimum(1.0, self._problem.cost / np.maximum(total, 1e-300))[better.candidate]
            better.share[:] = better.kept[:] = paid
        enough = min(cost, cost - step + 1e-6 * max(1.0, cost))
        while perf_counter() < end and better.value[rowwise.LENGTH] > SETTLED:
            if rowwise.improve(self._problem, better, STEPS, cost) > enough:
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
        problem = self._problem
        row = np.repeat(np.arange(problem.rows), np.diff(problem.rptr))
        pairs = np.unique(problem.homes[problem.lines["candidate"]] * problem.rows + row)
        home, held = np.divmod(pairs, problem.rows)
        starts = [*np.flatnonzero(np.diff(home, prepend=-1)).tolist(), len(held)]
        every = held.tolist()
        return np.array(along([every[a:b] for a, b in pairwise(starts)], problem.rows), dtype=np.int64)


def _row(priced: Shares) -> LongArray:
    return np.repeat(np.arange(len(priced.starts) - 1), np.diff(priced.starts))


def unreduced(form: CoverForm) -> Reduced:
    """A form from which nothing was taken."""
    every = np.arange(len(form.c))
    return Reduced(
        form=form,
        fixed_cost=0.0,
        status=Outcome.REDUCED,
        columns=every,
        rows=np.arange(form.W.shape[0]),
        forced=np.zeros(0, dtype=np.int64),
        stand_in=every,
        infeasible_row=None,
        log=(),
    )


def of_blocks(form: CoverForm, reduced: Reduced, blocks: list[Block], seconds: float) -> Certificate | None:
    """A certificate of what is known of all blocks, or that one has no plan; None for forms too large to be told all.

    Blocks whose best plan is proven without prices get so long for prices that prove it, or make a sweep shorter.
    """
    if form.W.nnz > MOST:
        return None
    W = csc_array(reduced.form.W)
    end = perf_counter() + seconds
    known = []
    for block in blocks:
        rows = np.unique(W[:, block.columns].indices).astype(np.int64)
        if block.is_infeasible:
            needed = Forced(Whole(form, reduced)).needed
            return refutation(csr_array(form.W), [*reduced.rows[rows[block.order()]].tolist(), *needed])
        known.append(block.known(rows, max(0.0, end - perf_counter())))
    return certificate(form, reduced, known)


def certificate(form: CoverForm, reduced: Reduced, blocks: list[Known]) -> Certificate | None:
    """A certificate of what is known of the blocks; None where numbers would be too large.

    Each block is a part. A candidate that another stands in for has the prices of that one. A candidate that is in every
    plan is charged where the row that needs it is a part of its own, and is free in the others.

    Parameters
    ----------
    form
        As the model has it: elements are its covering rows.
    reduced
        What presolve left of it.
    blocks
        All of it, or what has no plan.
    """
    scale = _scale(form.c, form.W.nnz)
    if scale is None:
        return None
    whole = Whole(form, reduced)
    forced = Forced(whole)
    left, parts = form.c.copy(), forced.parts(scale)
    for part in parts:
        left[part.charged] -= part.charge / scale
    for elements, entries, price, block in whole.divided(blocks):
        charged, charge = forced.charges(entries)
        owner = whole.owner[entries]
        cost = left.copy()
        cost[charged] = charge
        share = cost[owner] / np.bincount(owner)[owner]
        left[owner] = left[owner] - cost[owner]
        entry = np.floor(np.where(np.isnan(price) | np.isin(owner, charged), share, price) * scale)
        if float(np.abs(entry).sum() + charge.sum() * scale) >= LIMIT:
            return None
        proof = _proof(reduced, block, entry.astype(np.int64), scale)
        parts.append(Part(elements=elements, charged=charged, charge=_times(charge, scale), proof=proof))
    return Certificate(units=UNITS, scale=scale, proof=Parts(parts=tuple(parts))) if parts else None


def _proof(reduced: Reduced, block: Known, entry: LongArray, scale: int) -> Proof:
    if block.order is None:
        return Prices(entry=entry, unit=np.zeros(len(block.rows), dtype=np.int64))
    limit = math.floor(block.limit * scale) + 1
    return Sweep(entry=entry, order=reduced.rows[block.order].astype(np.int64), limit=limit)


def _times(charge: FloatArray, scale: int) -> LongArray:
    """Charges as whole numbers, rounded as costs are."""
    return np.floor(charge * scale).astype(np.int64)


def _scale(cost: FloatArray, entries: int) -> int | None:
    """Of the prices: a power of two, which keeps whole costs whole; None where costs are too large."""
    mean = float(cost.mean()) if len(cost) else 1.0
    total = float(cost.sum()) * (entries + 1)
    scale = min(DIGITS / max(mean, 1e-300), 2.0**40, LIMIT / max(total, 1e-300))
    return int(2.0 ** np.floor(np.log2(scale))) if scale >= 1.0 else None


class Whole:
    """A form by its entries, column by column, and what presolve left of it."""

    def __init__(self, form: CoverForm, reduced: Reduced) -> None:
        self.form, self.reduced = form, reduced
        self.W = csc_array(form.W)
        self.W.sort_indices()
        self.owner = np.repeat(np.arange(self.W.shape[1]), np.diff(self.W.indptr))

    def divided(self, blocks: list[Known]) -> Iterator[tuple[LongArray, LongArray, FloatArray, Known]]:
        """For each block its elements, entries and what is known of their prices, else NaN."""
        label = np.full(self.W.shape[0], -1, dtype=np.int64)
        for k, block in enumerate(blocks):
            label[self.reduced.rows[block.rows]] = k
        labels = label[self.W.indices]
        order = np.argsort(labels, kind="stable")
        starts = np.searchsorted(labels[order], np.arange(len(blocks) + 1))
        price = self._inherited([block.paid for block in blocks if block.paid is not None])
        for block, (a, b) in zip(blocks, pairwise(starts.tolist()), strict=True):
            entries = order[a:b]
            yield self.reduced.rows[block.rows].astype(np.int64), entries, price[entries], block

    def _inherited(self, parts: list[Paid]) -> FloatArray:
        """The price of each entry: that of the entry that stands in for it, NaN where there is none."""
        reduced = self.reduced
        rows, columns = len(reduced.rows), len(reduced.columns)
        price = np.full(self.W.nnz, np.nan)
        if not parts:
            return price
        known = np.concatenate([part.column * rows + part.row for part in parts])
        paid = np.concatenate([part.price for part in parts])
        order = np.argsort(known)
        known, paid = known[order], paid[order]
        row = np.full(self.W.shape[0], -1, dtype=np.int64)
        row[reduced.rows] = np.arange(rows)
        column = np.full(self.W.shape[1] + 1, -1, dtype=np.int64)
        column[reduced.columns] = np.arange(columns)
        mine, its = column[reduced.stand_in[self.owner]], row[self.W.indices]
        inside = np.flatnonzero((mine >= 0) & (its >= 0))
        key = mine[inside] * rows + its[inside]
        at = np.minimum(np.searchsorted(known, key), len(known) - 1)
        price[inside] = np.where(known[at] == key, paid[at], 0.0)
        return price
