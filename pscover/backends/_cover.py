"""Search over covering and packing rows: a partial plan with what it leaves short, greedy completion and reverse delete."""

from __future__ import annotations

from collections.abc import Callable, Iterable

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csc_array

from pscover.errors import Refused
from pscover.model import CoverForm, Model, as_cover

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.int32]

TOLERANCE = 1e-9
"""A row scaled to 1 counts as met when it is missed by no more than this."""
NOISE = 1e-12
"""Gains below this are what rounding leaves of zero."""
FREE = 1e200
"""Stands for 1 / cost where the cost is 0: such candidates come first."""


class Search:
    """A plan in the making over the rows of a cover form.

    The gain of a candidate is the weighted sum over rows of what it would take off the row's deficit,
    sum_j y_j min(w_ij, max(0, 1 - supply_j)), kept up to date for all candidates at each change.

    Parameters
    ----------
    form
        Covering and packing rows.
    """

    def __init__(self, form: CoverForm) -> None:
        self.form = form
        self.columns = csc_array(form.W)
        self.packing = csc_array(form.P)
        rows, candidates = form.W.shape
        self.weight = np.ones(rows)
        self.deficit = np.ones(rows)
        self.used = np.zeros(form.P.shape[0])
        self.blocks = np.zeros(candidates, dtype=np.int64)
        self.taken = np.zeros(candidates, dtype=bool)
        self.gain = np.bincount(form.W.indices, form.W.data, candidates).astype(np.float64)
        self.worth = np.full(candidates, FREE)
        np.divide(1.0, form.c, out=self.worth, where=form.c > 0)

    def copy(self) -> Search:
        """An independent search at the same point."""
        twin = object.__new__(Search)
        twin.__dict__.update(self.__dict__)
        for name in ("weight", "deficit", "used", "blocks", "taken", "gain"):
            setattr(twin, name, getattr(self, name).copy())
        return twin

    @property
    def chosen(self) -> IntArray:
        """The plan."""
        return np.flatnonzero(self.taken).astype(np.int32)

    @property
    def cost(self) -> float:
        """The plan's cost."""
        return float(self.form.c[self.taken].sum())

    def short(self) -> IntArray:
        """The covering rows that are not met."""
        return np.flatnonzero(self.deficit > TOLERANCE).astype(np.int32)

    def is_feasible(self) -> bool:
        """Whether every row is met and every choice allowed."""
        packed = not len(self.used) or self.used.max() <= 1 + TOLERANCE
        return bool(packed and not len(self.short()) and self.form.allowed[self.taken].all())

    def column(self, i: int) -> tuple[IntArray, FloatArray]:
        """The covering rows of a candidate and its entries there."""
        span = slice(self.columns.indptr[i], self.columns.indptr[i + 1])
        return self.columns.indices[span], self.columns.data[span]

    def available(self) -> NDArray[np.bool_]:
        """The candidates that can be added as the plan stands."""
        free: NDArray[np.bool_] = self.form.allowed & ~self.taken & (self.blocks == 0)
        return free

    def add(self, i: int) -> None:
        """Put a candidate into the plan."""
        self.taken[i] = True
        self._shift(i, 1.0)

    def drop(self, i: int) -> None:
        """Take a candidate out of the plan."""
        self.taken[i] = False
        self._shift(i, -1.0)

    def _shift(self, i: int, sign: float) -> None:
        rows, entries = self.column(i)
        before = _open(self.deficit[rows])
        self.deficit[rows] -= sign * entries
        after = _open(self.deficit[rows])
        moved = np.flatnonzero(before != after)
        if len(moved):
            rows, before, after = rows[moved], before[moved], after[moved]
            spots, owner = _spots(self.form.W.indptr, rows)
            w = self.form.W.data[spots]
            change = self.weight[rows][owner] * (np.minimum(w, after[owner]) - np.minimum(w, before[owner]))
            self.gain += np.bincount(self.form.W.indices[spots], change, len(self.gain))
        span = slice(self.packing.indptr[i], self.packing.indptr[i + 1])
        rows = self.packing.indices[span]
        if len(rows):
            spots, owner = _spots(self.form.P.indptr, rows)
            room = 1 + TOLERANCE - self.form.P.data[spots]
            before = self.used[rows]
            self.used[rows] += sign * self.packing.data[span]
            change = (self.used[rows][owner] > room).astype(np.int8) - (before[owner] > room)
            np.add.at(self.blocks, self.form.P.indices[spots], change)

    def reweigh(self, rows: IntArray, factor: float) -> None:
        """Add `factor` to the weights of covering rows."""
        self.weight[rows] += factor
        spots, owner = _spots(self.form.W.indptr, rows)
        change = factor * np.minimum(self.form.W.data[spots], _open(self.deficit[rows])[owner])
        self.gain += np.bincount(self.form.W.indices[spots], change, len(self.gain))

    def gain_of(self, i: int) -> float:
        """The gain of a candidate, computed afresh."""
        rows, entries = self.column(i)
        return float(self.weight[rows] @ np.minimum(entries, _open(self.deficit[rows])))

    def loss_of(self, i: int) -> float:
        """By how much the weighted deficit grows when a candidate of the plan is dropped."""
        rows, entries = self.column(i)
        deficit = self.deficit[rows]
        return float(self.weight[rows] @ (_open(deficit + entries) - _open(deficit)))

    def blockers(self, i: int) -> list[int]:
        """Candidates of the plan that must go for candidate i to fit: the largest first in each packing row."""
        gone: set[int] = set()
        for at in range(self.packing.indptr[i], self.packing.indptr[i + 1]):
            k = self.packing.indices[at]
            span = slice(self.form.P.indptr[k], self.form.P.indptr[k + 1])
            members, entries = self.form.P.indices[span], self.form.P.data[span]
            inside = self.taken[members]
            excess = self.used[k] + self.packing.data[at] - 1 - TOLERANCE
            for member, entry in sorted(zip(members[inside], entries[inside], strict=True), key=lambda pair: -pair[1]):
                if excess <= 0:
                    break
                excess -= entry
                gone.add(int(member))
        return sorted(gone)

    def complete(self, over: Callable[[], bool], worth: FloatArray | None = None) -> bool:
        """Add the candidate of most gain per cost until every row is met (Wolsey 1982, Dobson 1982).

        Parameters
        ----------
        over
            Asked before each choice whether to stop.
        worth
            What to multiply gains with, shape (candidates,); 1 / cost by default.

        Returns
        -------
        bool
            Whether every row is met; False when stuck or stopped.
        """
        worth = self.worth if worth is None else worth
        while len(self.short()):
            if over():
                return False
            score = np.where(self.available(), self.gain * worth, 0.0)
            best = int(score.argmax()) if len(score) else -1
            if best < 0 or score[best] <= 0:
                return False
            exact = self.gain_of(best)
            if exact <= NOISE:
                self.gain[best] = 0.0
                continue
            self.add(best)
        return True

    def reverse_delete(self) -> None:
        """Drop what is not needed, the most expensive first and, among equals, the least useful."""
        chosen = self.chosen
        supply = self.form.W @ self.taken.astype(np.float64)
        use = np.array([(w / supply[rows]).sum() for rows, w in map(self.column, chosen)])
        for i in chosen[np.lexsort((use, -self.form.c[chosen]))]:
            rows, w = self.column(i)
            if (self.deficit[rows] + w <= TOLERANCE).all():
                self.drop(int(i))

    def take(self, plan: Iterable[int]) -> None:
        """Add the candidates of a plan that still fit, in order."""
        for i in plan:
            if self.form.allowed[i] and not self.taken[i] and self.blocks[i] == 0:
                self.add(int(i))


def refusal(model: Model) -> str | None:
    """Why a model is not covering and packing over binaries, or None."""
    try:
        as_cover(model)
    except Refused as reason:
        return str(reason)
    return None


def hopeless_rows(form: CoverForm) -> IntArray:
    """Covering rows that all allowed candidates together do not meet: each proves that there is no plan."""
    supply = form.W @ form.allowed.astype(np.float64)
    return np.flatnonzero(supply < 1 - TOLERANCE).astype(np.int32)


def dual_bound(form: CoverForm) -> float:
    """A lower bound on the cost: the value of a feasible dual of the covering rows, found in one pass.

    Row by row, those with the fewest candidates first, y_j rises until the reduced cost of a candidate of the row is 0
    (dual ascent: Bilde and Krarup 1977). Packing rows are left out, which keeps the bound valid.

    Examples
    --------
    >>> from scipy.sparse import csr_array
    >>> W = csr_array(np.array([[1.0, 1.0, 0.0], [0.0, 0.5, 1.0]]))
    >>> form = CoverForm(c=np.array([2.0, 3.0, 4.0]), W=W, P=csr_array((0, 3)), allowed=np.ones(3, dtype=bool))
    >>> round(dual_bound(form), 9)
    4.0
    """
    slack = np.where(form.allowed, form.c, np.inf)
    total = 0.0
    W = form.W
    for j in np.argsort(np.diff(W.indptr), kind="stable"):
        span = slice(W.indptr[j], W.indptr[j + 1])
        i, w = W.indices[span], W.data[span]
        if not len(i):
            continue
        y = float((slack[i] / w).min())
        if np.isfinite(y) and y > 0:
            slack[i] = np.maximum(slack[i] - y * w, 0.0)
            total += y
    return total * (1 - 1e-12)


def repair(search: Search, rng: np.random.Generator, moves: int, over: Callable[[], bool]) -> bool:
    """Look for a plan that meets every row from one that is stuck; whether it was found.

    Local search with row weights, as in solvers of pseudo-Boolean problems: for a row that is short, put in the candidate
    that takes most off the weighted deficit after what blocks it is taken out; where no choice helps, rows that are short
    weigh more from then on. What was just put in or taken out stays so for a few moves.
    """
    frozen = np.zeros(len(search.gain), dtype=np.int64)
    for move in range(moves):
        short = search.short()
        if not len(short):
            return True
        if over():
            return False
        j = int(rng.choice(short))
        span = slice(search.form.W.indptr[j], search.form.W.indptr[j + 1])
        listed = search.form.W.indices[span]
        listed = listed[search.form.allowed[listed] & ~search.taken[listed] & (frozen[listed] <= move)]
        best, best_net, best_out = -1, -np.inf, list[int]()
        for i in listed[np.argsort(-search.gain[listed], kind="stable")][:SHORTLIST]:
            out = search.blockers(int(i))
            if any(frozen[b] > move for b in out):
                continue
            net = search.gain[i] - sum(search.loss_of(b) for b in out)
            if net > best_net:
                best, best_net, best_out = int(i), net, out
        if best_net <= NOISE:
            search.reweigh(short, 1.0)
        if best >= 0:
            for b in best_out:
                search.drop(b)
                frozen[b] = move + rng.integers(3, 10)
            search.add(best)
            frozen[best] = move + rng.integers(1, 4)
    return not len(search.short())


SHORTLIST = 12
"""How many candidates of a row a repair move compares."""


def _open(deficit: FloatArray) -> FloatArray:
    """What is left to cover: 0 for rows that are met."""
    return np.where(deficit > TOLERANCE, deficit, 0.0)


def _spots(indptr: IntArray, rows: IntArray) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Positions of all entries of some rows, and for each position which of `rows` it belongs to."""
    begin = indptr[rows].astype(np.int64)
    count = indptr[np.asarray(rows) + 1] - begin
    owner = np.repeat(np.arange(len(rows)), count)
    first = np.cumsum(count) - count
    return np.arange(int(count.sum())) + (begin - first)[owner], owner
