"""From what engines know of a reduced form to prices of the whole one, as a certificate has them."""

from __future__ import annotations

from dataclasses import dataclass
from time import perf_counter
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csc_array

from pscover.certificate import Certificate, Prices, Split
from pscover.model import CoverForm
from pscover.presolve import Outcome, Reduced

from . import rowwise, subgradient
from .problem import IntArray, Problem
from .rowwise import Shares, shares
from .splits import Part, Splits

if TYPE_CHECKING:
    from .block import Block

FloatArray = NDArray[np.float64]
LongArray = NDArray[np.int64]

UNITS = 480
"""Units of a demand: a multiple of those that engines use."""
DIGITS = 2**20
"""Prices are rounded down to such a part of the mean cost, or less."""
LIMIT = 2.0**57
"""Prices add up to less, as whole numbers."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Paid:
    """What the rows of a part of a reduced form pay for its candidates.

    Parameters
    ----------
    row, column
        Of each entry, in the reduced form.
    price
        Of each entry.
    """

    row: LongArray
    column: LongArray
    price: FloatArray


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Fork:
    """A split on how many candidates of a row of the reduced form a plan has: at most `count`, or more."""

    row: int
    count: int
    few: Paid | Fork
    many: Paid | Fork


STEPS = 10
"""Steps between two looks at the clock."""
SETTLED = 2e-3
"""Steps shorter than this bring nothing."""
LEAVES = 32
"""Most sets of prices in a certificate."""


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

    def improve(self, cost: float, step: float, seconds: float) -> Splits | None:
        """Look for better prices for so long: until their bound, lifted to a multiple of the step, is this cost.

        Returns
        -------
        Splits or None
            If it takes splits.
        """
        end = perf_counter() + seconds
        if perf_counter() >= end or not len(self._problem.lines):
            return None
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
        if better.value[rowwise.BOUND] > enough or not np.isfinite(better.value[rowwise.BOUND]):
            return None
        splits = Splits(self._problem, self.kept.astype(np.int32), better, cost, step)
        while perf_counter() < end and splits.bound <= enough and len(splits.leaves) < LEAVES and splits.turn():
            pass
        return splits if splits.bound > enough else None

    def paid(self, rows: LongArray, columns: LongArray) -> Paid | None:
        """The prices, for rows and candidates as they are numbered in the whole; None if none were taken."""
        if self._paid is None:
            return None
        return Paid(row=rows[self._paid.row], column=columns[self._paid.column], price=self._paid.price)


def forked(part: Part, rows: LongArray, columns: LongArray) -> Paid | Fork:
    """The prices of all parts of a split, numbered likewise."""
    if part.few is not None and part.many is not None:
        few, many = (forked(one, rows, columns) for one in (part.few, part.many))
        return Fork(row=int(rows[part.row]), count=part.count, few=few, many=many)
    column = part.kept[part.priced.candidate]
    return Paid(row=rows[_row(part.priced)], column=columns[column], price=part.priced.kept)


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


def certificate(form: CoverForm, reduced: Reduced, parts: list[Paid | Fork]) -> Certificate | None:
    """A certificate of what the prices of the parts prove of the form; None where numbers would be too large.

    A candidate that another stands in for has the prices of that one. A candidate that is in every plan is paid by the row
    that needs it, and so are those of its clique that it replaces. The others of the clique, which no plan has, are made
    dear in all rows, and it with them: what rows then pay too much for the clique is given back once.

    Parameters
    ----------
    form
        As the model has it: elements are its covering rows.
    reduced
        What presolve left of it.
    parts
        Prices of what is left, part by part.
    """
    leaves = 1
    for part in parts:
        leaves *= _leaves(part)
    if leaves > LEAVES:
        parts = [_first(part) for part in parts]
    W = csc_array(form.W)
    W.sort_indices()
    scale = _scale(form.c, W.nnz)
    proof = None if scale is None else _proof(form, W, reduced, parts, scale)
    return None if proof is None or scale is None else Certificate(units=UNITS, scale=scale, proof=proof)


def _leaves(part: Paid | Fork) -> int:
    return 1 if isinstance(part, Paid) else _leaves(part.few) + _leaves(part.many)


def _first(part: Paid | Fork) -> Paid:
    """One set of prices of a part: as good as any where splits are too many."""
    while isinstance(part, Fork):
        part = part.many
    return part


def _proof(form: CoverForm, W: csc_array, reduced: Reduced, parts: list[Paid | Fork], scale: int) -> Prices | Split | None:
    for k, part in enumerate(parts):
        if isinstance(part, Fork):
            few, many = (
                _proof(form, W, reduced, [*parts[:k], side, *parts[k + 1 :]], scale) for side in (part.few, part.many)
            )
            if few is None or many is None:
                return None
            return Split(element=int(reduced.rows[part.row]), count=part.count, few=few, many=many)
    owner = np.repeat(np.arange(W.shape[1]), np.diff(W.indptr))
    price = _inherited(W, owner, reduced, [part for part in parts if isinstance(part, Paid)])
    lost = (reduced.stand_in[owner] < 0) & ~np.isin(owner, reduced.forced)
    price[lost] = (form.c / np.maximum(np.diff(W.indptr), 1))[owner[lost]]
    _pay_forced(form, W, owner, reduced, lost, price)
    if float(np.abs(price).sum()) * scale >= LIMIT:
        return None
    return Prices(entry=np.floor(price * scale).astype(np.int64), unit=np.zeros(W.shape[0], dtype=np.int64))


def _scale(cost: FloatArray, entries: int) -> int | None:
    """Of the prices: a power of two, which keeps whole costs whole; None where costs are too large."""
    mean = float(cost.mean()) if len(cost) else 1.0
    total = float(cost.sum()) * (entries + 1)
    scale = min(DIGITS / max(mean, 1e-300), 2.0**40, LIMIT / max(total, 1e-300))
    return int(2.0 ** np.floor(np.log2(scale))) if scale >= 1.0 else None


def of_blocks(form: CoverForm, reduced: Reduced, blocks: list[Block], seconds: float) -> Certificate | None:
    """A certificate of what the prices of all blocks prove; None for forms too large to be told all.

    Blocks whose best plan is proven without prices get so long for prices, and splits, that prove it.
    """
    if form.W.nnz > MOST:
        return None
    W = csc_array(reduced.form.W)
    end = perf_counter() + seconds
    parts = []
    for block in blocks:
        rows = np.unique(W[:, block.columns].indices).astype(np.int64)
        part = block.priced(rows, 0.0 if block.is_open else max(0.0, end - perf_counter()))
        if part is not None:
            parts.append(part)
    return certificate(form, reduced, parts)


MOST = 400_000
"""Most entries of a form that gets a certificate."""


def _inherited(W: csc_array, owner: LongArray, reduced: Reduced, parts: list[Paid]) -> FloatArray:
    """The price of each entry of W, by column: that of the entry that stands in for it, 0 where there is none."""
    rows, columns = len(reduced.rows), len(reduced.columns)
    price = np.zeros(W.nnz)
    if not parts:
        return price
    known = np.concatenate([part.column * rows + part.row for part in parts])
    paid = np.concatenate([part.price for part in parts])
    order = np.argsort(known)
    known, paid = known[order], paid[order]
    row = np.full(W.shape[0], -1, dtype=np.int64)
    row[reduced.rows] = np.arange(rows)
    column = np.full(W.shape[1] + 1, -1, dtype=np.int64)
    column[reduced.columns] = np.arange(columns)
    mine, its = column[reduced.stand_in[owner]], row[W.indices]
    inside = np.flatnonzero((mine >= 0) & (its >= 0))
    key = mine[inside] * rows + its[inside]
    at = np.minimum(np.searchsorted(known, key), len(known) - 1)
    price[inside] = np.where(known[at] == key, paid[at], 0.0)
    return price


def _pay_forced(
    form: CoverForm, W: csc_array, owner: LongArray, reduced: Reduced, lost: NDArray[np.bool_], price: FloatArray
) -> None:
    """Prices of the candidates in every plan, of their cliques, and of lost ones that cover what they cover."""
    if not len(reduced.forced):
        return
    group = _home(form)
    # More than rows pay for what is any use to them.
    dear = 2 * float(form.c.max())
    kept = np.isin(np.arange(W.shape[0]), reduced.rows)
    blocked = {}
    for i in reduced.forced.tolist():
        peers = np.flatnonzero(group == group[i])
        blocked[i] = peers[~_replaced(W, peers, i, kept)]
    need = _needs(W, owner, group, blocked)
    for j in need.values():
        _pay_alike(W, owner, lost & (_in_row(W, j) > 0)[owner], j, form.c, price)
    for i, j in need.items():
        spots = np.flatnonzero(np.isin(owner, blocked[i]))
        price[spots] = dear
        excess = dear * np.bincount(owner[spots], minlength=len(group))[blocked[i]] - form.c[blocked[i]]
        same = np.isin(owner, np.setdiff1d(np.flatnonzero(group == group[i]), blocked[i]))
        price[same] = 0.0
        price[same & (W.indices == j)] = form.c[i] + max(0.0, float(excess.max(initial=0.0)))


def _needs(W: csc_array, owner: LongArray, group: LongArray, blocked: dict[int, LongArray]) -> dict[int, int]:
    """The row that needs each candidate of every plan; what is blocked but would do as well is blocked no longer."""
    while True:
        out = np.isin(np.arange(len(group)), np.concatenate(list(blocked.values())))
        need, wrong = {}, []
        for i, others in blocked.items():
            need[i], missing = _neediest(W, owner, np.where(out, -1, group), group[i], i)
            if len(others) and missing <= _in_row(W, need[i])[others].max() + 1e-9:
                wrong.append(i)
        for i in wrong:
            blocked[i] = blocked[i][:0]
        if not wrong:
            return need


def _pay_alike(
    W: csc_array, owner: LongArray, which: NDArray[np.bool_], j: int, cost: FloatArray, price: FloatArray
) -> None:
    """Let row j alone pay for candidates of no further use: what else they cover is met by those that every plan has."""
    price[which] = 0.0
    here = which & (W.indices == j)
    price[here] = cost[owner[here]]


def _replaced(W: csc_array, peers: LongArray, i: int, kept: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """Which peers candidate i replaces, itself among them: it is at least as large in all rows that are kept."""
    most = np.zeros(W.shape[0])
    most[W.indices[W.indptr[i] : W.indptr[i + 1]]] = W.data[W.indptr[i] : W.indptr[i + 1]]
    part = csc_array(W[:, peers])
    larger = kept[part.indices] & (part.data > most[part.indices])
    return ~np.isin(np.arange(len(peers)), np.repeat(np.arange(len(peers)), np.diff(part.indptr))[larger])


def _in_row(W: csc_array, j: int) -> FloatArray:
    """The entries of a row, one a candidate."""
    entry = np.zeros(W.shape[1])
    spots = np.flatnonzero(W.indices == j)
    entry[np.searchsorted(W.indptr, spots, side="right") - 1] = W.data[spots]
    return entry


def _home(form: CoverForm) -> LongArray:
    """The group of each candidate: the largest of its packing rows, or itself."""
    P = form.P
    sizes = np.diff(P.indptr)
    row = np.repeat(np.arange(P.shape[0]), sizes)
    order = np.argsort(sizes[row], kind="stable")
    group = np.arange(P.shape[0], P.shape[0] + P.shape[1])
    group[P.indices[order]] = row[order]
    return group


def _neediest(W: csc_array, owner: LongArray, group: LongArray, own: int, i: int) -> tuple[int, float]:
    """The row of candidate i that other groups than its own leave most to, and how much; -1 is no group."""
    rows = W.indices[W.indptr[i] : W.indptr[i + 1]]
    found, missing = -1, -np.inf
    for j in rows.tolist():
        spots = np.flatnonzero((W.indices == j) & (group[owner] != own) & (group[owner] >= 0))
        most = np.zeros(int(group.max()) + 1)
        np.maximum.at(most, group[owner[spots]], W.data[spots])
        if 1.0 - most.sum() > missing:
            found, missing = j, 1.0 - float(most.sum())
    return found, missing
