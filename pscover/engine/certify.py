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
from scipy.sparse import block_array, csc_array, csr_array, vstack
from scipy.sparse.csgraph import connected_components

from pscover.certificate import Certificate, refutation
from pscover.model import CoverForm
from pscover.presolve import Reduced, components
from pscover.proof import Part, Parts, Prices, Proof, Sweep

from .account import SWEPT, Account, Paid, in_order, is_narrow
from .forced import Forced
from .problem import least_step, problem_of, several
from .unreduced import unreduced, without_replaced

if TYPE_CHECKING:
    from .block import Block

FloatArray = NDArray[np.float64]
LongArray = NDArray[np.int64]

UNITS = 480
"""Units of a demand: a multiple of those that engines use."""
DIGITS, MORE = 2**20, 2**36
"""Prices are rounded down to such a part of the mean cost, or less; and where costs are no multiples of that."""
LIMIT = 2.0**53
"""Prices add up to less, as whole numbers."""
MOST = 400_000
"""Most entries of a form that gets a certificate."""


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


def of_blocks(form: CoverForm, reduced: Reduced, blocks: list[Block], seconds: float) -> Certificate | None:
    """A certificate of what is known of all blocks, or that one has no plan; None for forms too large to be told all.

    Blocks whose best plan is proven without prices get so long for prices that prove it, or make a sweep shorter. Where
    presolve has found candidates that are in every plan, a small form is swept as it was before.
    """
    # Packing rows of the forms of instances are cliques.
    if form.W.nnz > MOST or several(form) is not None:
        return None
    W = csc_array(reduced.form.W)
    rows = [np.unique(W[:, block.columns].indices).astype(np.int64) for block in blocks]
    for block, held in zip(blocks, rows, strict=True):
        if block.is_infeasible:
            return refuted(form, reduced.rows[held[block.order()]].astype(np.int64))
    plans = [block.columns[block.plan] for block in blocks if block.plan is not None and not block.is_open]
    if len(plans) == len(blocks) and len(reduced.forced) and form.W.nnz <= SWEPT:
        return of_plan(form, reduced.lift(np.concatenate([np.zeros(0, dtype=np.int64), *plans])), seconds)
    turns = _turns([len(block.problem.lines) for block in blocks], seconds)
    known = [block.known(held, turn) for block, held, turn in zip(blocks, rows, turns, strict=True)]
    return certificate(form, reduced, known)


def _turns(sizes: list[int], seconds: float) -> Iterator[float]:
    """How long each of some blocks may take, one after the other: in proportion to their sizes, of what is left."""
    end, total = perf_counter() + seconds, sum(sizes)
    for size in sizes:
        yield max(0.0, end - perf_counter()) * size / max(1, total)
        total -= size


def of_plan(form: CoverForm, plan: LongArray, seconds: float) -> Certificate | None:
    """A certificate that no plan is cheaper than one, part by part, after so long a search for prices."""
    reduced = without_replaced(form)
    W, known = csc_array(reduced.form.W), []
    is_in = np.isin(reduced.columns, reduced.stand_in[plan])
    parts = components(reduced.form)
    for (part, columns), turn in zip(parts, _turns([part.W.nnz for part, _ in parts], seconds), strict=True):
        cost = float(part.c[is_in[columns]].sum())
        account = Account(*problem_of(part))
        is_priced = account.improve(cost, least_step(form.c), turn)
        rows = np.unique(W[:, columns].indices).astype(np.int64)
        paid = account.paid(rows, columns.astype(np.int64))
        order = np.arange(len(rows)) if is_priced else account.swept()
        order = None if order is None else rows[order]
        known.append(Known(rows=rows, paid=paid, order=order, limit=cost - least_step(form.c)))
    return certificate(form, reduced, known)


def refuted(form: CoverForm, rows: LongArray) -> Certificate:
    """A certificate that there is no plan: some rows cannot be met, or these with all that hang together with them."""
    W = csr_array(form.W)
    both = csr_array(vstack([W, form.P]))
    _, label = connected_components(block_array([[None, both], [csr_array(both.T), None]]), directed=False)
    every = np.flatnonzero(label[: W.shape[0]] == label[rows[0]])
    others = every[~np.isin(every, rows)]
    return refutation(W, [rows.tolist(), [*rows.tolist(), *others.tolist()]] if len(others) else [rows.tolist()])


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
    return Certificate(units=UNITS, scale=scale, proof=_whole(form, parts))


def of_multipliers(form: CoverForm, y: FloatArray, limit: float) -> Certificate | None:
    """A certificate that plans cost more than a limit, by a sweep over all rows, which pay y for what they ask for.

    None where that is not likely to come to an end.
    """
    if form.W.nnz > SWEPT:
        return None
    problem, _ = problem_of(form)
    order = in_order(problem)
    if not is_narrow(problem, order):
        return None
    W = csc_array(form.W)
    column = np.repeat(np.arange(W.shape[1]), np.diff(W.indptr))
    row = W.indices.astype(np.int64)
    every = np.arange(W.shape[0])
    paid = Paid(row=row, column=column, price=y[row] * W.data)
    return certificate(form, unreduced(form), [Known(rows=every, paid=paid, order=order, limit=limit)])


def _whole(form: CoverForm, parts: list[Part]) -> Proof:
    """Parts as one proof: nothing if there are none, and without a division if there is one that has all."""
    if not parts:
        rows, entries = (np.zeros(size, dtype=np.int64) for size in (form.W.shape[0], form.W.nnz))
        return Prices(entry=entries, unit=rows)
    is_all = len(parts) == 1 and len(parts[0].elements) == form.W.shape[0] and not len(parts[0].charged)
    return parts[0].proof if is_all else Parts(parts=tuple(parts))


def _proof(reduced: Reduced, block: Known, entry: LongArray, scale: int) -> Proof:
    if block.order is None or not math.isfinite(block.limit):
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
    most = min(2.0**40, LIMIT / max(total, 1e-300))
    for digits in (DIGITS, MORE):
        scale = 2.0 ** np.floor(np.log2(min(digits / max(mean, 1e-300), most)))
        if (np.floor(cost * scale) == cost * scale).all():
            break
    return int(scale) if scale >= 1.0 else None


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
            yield np.sort(self.reduced.rows[block.rows]).astype(np.int64), entries, price[entries], block

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
