"""The linear relaxation with inequalities of single rows: a bound, and what each row then pays for each candidate.

    minimise c x   subject to   W x >= 1,   inequalities of its rows,   at most one candidate a clique,   0 <= x <= 1

The inequalities are rounded rows (`rounding`) at first, and facets (`facets`), which take longer, once those bring little.
One that follows from one row alone can be paid for by that row: with prices y of the inequalities and z of the cliques,
row j pays sum over its inequalities of y times the coefficient of i for candidate i, and all that is paid sums up to no more
than c_i and the z of i's cliques. So the prices are shares as well (`rowwise`), and prove as much there.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csc_array, csr_array, hstack

from pscover.model import CoverForm

from .facets import missed_facet
from .favoured import favoured
from .problem import IntArray, Problem
from .programme import Programme
from .rounding import rounded, violated

FloatArray = NDArray[np.float64]
LongArray = NDArray[np.int64]

SLICE, LONGER = 200, 1.3
"""Steps of a turn at first, and by what that grows until the programme is solved: to begin again takes time, too."""
DEAR = 10.0
"""What it costs, relative to the dearest candidate for each row, to leave rows short that those at hand cannot meet."""
LOOKED_AT, FACETS = 1500, 10
"""In so many rows inequalities are looked for at once, over the most candidates that one has in the point; and facets."""
DEEP = 1e-3
"""Facets are looked for once the bound has risen by less than this part of it in a round."""
CORE, EACH = 20, 20
"""Candidates a row that the programme begins with, by their reduced costs, and of each row at least."""
JOIN = 2
"""Most candidates a row that join it at once."""
FLAT, LEVEL = 3, 1e-3
"""It ends when the bound has risen by less than this part of it in so many rounds."""
SAFE = 1e-10
"""What a bound may lose to rounding, relative to it."""


@dataclass(frozen=True, slots=True, eq=False)
class Cut:
    """An inequality that follows from a row: the row, coefficients of the row's entries, and the right side."""

    row: int
    entries: FloatArray
    right: float


class Cutting:
    """The relaxation of a form's candidates kept.

    Parameters
    ----------
    form, kept
        The form, and its candidates that count.
    reduced
        Rough reduced costs of those kept: by them the programme's first candidates are chosen.

    Attributes
    ----------
    bound
        Proven of every plan made of those kept.
    reduced
        Reduced costs at that bound, of those kept.
    least
        What each row costs at least by what it pays.
    toll
        What cliques add to the costs of those kept.
    is_finished
        Whether there is no more to be had.
    """

    def __init__(self, form: CoverForm, kept: IntArray, reduced: FloatArray) -> None:
        self._W = csr_array(csr_array(form.W)[:, kept])
        self._W.sort_indices()
        P = csr_array(csr_array(form.P)[:, kept])
        self._P = csr_array(P[np.diff(P.indptr) >= 2])
        self._cost = np.asarray(form.c[kept], dtype=np.float64)
        self._row = np.repeat(np.arange(self._W.shape[0]), np.diff(self._W.indptr))
        self._home = self._P.shape[0] + np.arange(len(kept))
        clique = np.repeat(np.arange(self._P.shape[0]), np.diff(self._P.indptr))
        self._home[self._P.indices] = clique
        self._columns = self._first(reduced)
        self._cuts: list[Cut] = []
        self._programme = self._begun()
        self._slice = float(SLICE)
        self._found: list[Cut] | None = None
        self._next = 0
        self._point, self._inside = np.zeros(0), self._W
        self._history: list[float] = []
        self._is_deep = False
        self._in_vain: dict[int, bytes] = {}
        self.bound, self.reduced = -np.inf, reduced
        self.toll, self._paid = np.zeros(len(kept)), np.zeros(self._W.nnz)
        self.least = np.zeros(self._W.shape[0])
        self.is_finished = False

    def turn(self, left: float = math.inf) -> bool:
        """Go on for a moment, for no more than so many seconds; whether the bound rose."""
        if self._found is not None:
            self._look()
            return False
        if not self._programme.run(round(self._slice), left):
            self.is_finished = self._programme.has_failed
            self._slice *= LONGER
            return False
        self._slice = float(SLICE)
        risen, more = self._priced()
        if len(more):
            self._widen(more)
            return risen
        self._history.append(self.bound)
        recent = self._history[-FLAT - 1 :]
        if len(recent) > FLAT and recent[-1] - recent[0] < LEVEL * abs(self.bound):
            self.is_finished = self._is_deep
        if len(recent) > 1 and recent[-1] - recent[-2] < DEEP * abs(self.bound):
            self._begin_facets()
        if self.is_finished:
            return risen
        self._point = np.zeros(len(self._cost))
        self._point[self._columns] = self._programme.x[1:]
        self._inside = self._W.copy()
        self._inside.data = np.where(self._point[self._inside.indices] > 0, self._inside.data, 0.0)
        self._inside.eliminate_zeros()
        self._found, self._next = [], 0
        return risen

    @property
    def inequalities(self) -> csr_array:
        """Those of the programme as it is now, over those kept; all right sides are 1."""
        scaled = [Cut(cut.row, cut.entries / cut.right, 1.0) for cut in self._cuts]
        return self._matrix(scaled, np.arange(len(self._cost)), len(self._cost))

    def paid_in(self, problem: Problem) -> FloatArray:
        """What rows pay for those kept, in the order of the lines of their problem."""
        row = np.repeat(np.arange(problem.rows), np.diff(problem.rptr))
        order = np.lexsort((problem.lines["candidate"], row))
        paid = np.empty(len(order))
        paid[order] = self._paid
        return paid

    def _first(self, reduced: FloatArray) -> LongArray:
        rows = self._W.shape[0]
        if len(reduced) <= 2 * CORE * rows:
            return np.arange(len(reduced))
        return np.flatnonzero(favoured(self._W, reduced, CORE, EACH))

    def _begun(self) -> Programme:
        W, P = self._W[:, self._columns], self._P[:, self._columns]
        lack = csr_array(np.repeat([1.0, 0.0], [W.shape[0], P.shape[0]])[:, None])
        matrix = csr_array(hstack([lack, _stacked(csr_array(W), csr_array(-P))]))
        cost = np.append(DEAR * W.shape[0] * float(self._cost.max(initial=0.0)), self._cost[self._columns])
        return Programme(cost, matrix, np.repeat([1.0, -1.0], [W.shape[0], P.shape[0]]))

    def _priced(self) -> tuple[bool, LongArray]:
        """Take the bound that prices prove for all candidates; whether it rose, and candidates that the programme needs."""
        rows, cliques = self._W.shape[0], self._P.shape[0]
        prices = self._programme.prices
        y, z, own = np.split(prices, [rows, rows + cliques])
        paid = y[self._row] * self._W.data
        least = y.copy()
        for price, cut in zip(own.tolist(), self._cuts, strict=True):
            if price > 0:
                paid[self._W.indptr[cut.row] : self._W.indptr[cut.row + 1]] += price * cut.entries
                least[cut.row] += price * cut.right
        toll = np.asarray(self._P.T @ z)
        reduced = self._cost + toll - np.bincount(self._W.indices, paid, len(self._cost))
        gain = np.zeros(cliques + len(self._cost))
        np.minimum.at(gain, self._home, reduced)
        bound = float(least.sum() - z.sum() + gain.sum())
        bound -= SAFE * abs(bound)
        risen = bound > self.bound
        if risen:
            self.bound, self.reduced, self.toll, self.least, self._paid = bound, reduced, toll, least, paid
        outside = reduced.copy()
        outside[self._columns] = 0.0
        more = np.flatnonzero(outside < -1e-7 * float(self._cost.mean()))
        most = JOIN * rows
        if len(more) > most:
            more = more[np.argpartition(outside[more], most)[:most]]
        return risen, more

    def _widen(self, more: LongArray) -> None:
        """Let candidates join the programme."""
        place = np.full(len(self._cost), -1)
        place[more] = np.arange(len(more))
        W, P = self._W[:, more], self._P[:, more]
        cuts = self._matrix(self._cuts, place, len(more))
        self._programme.widen(self._cost[more], csc_array(_stacked(_stacked(csr_array(W), csr_array(-P)), cuts)))
        self._columns = np.concatenate((self._columns, more))

    def _matrix(self, cuts: list[Cut], place: LongArray, columns: int) -> csr_array:
        """Inequalities over some candidates: `place` says where each is, -1 for none."""
        indptr, indices, data = [0], [np.zeros(0, dtype=np.int64)], [np.zeros(0)]
        for cut in cuts:
            at = place[self._W.indices[self._W.indptr[cut.row] : self._W.indptr[cut.row + 1]]]
            holds = (at >= 0) & (cut.entries != 0.0)
            indices.append(at[holds])
            data.append(cut.entries[holds])
            indptr.append(indptr[-1] + len(data[-1]))
        return csr_array((np.concatenate(data), np.concatenate(indices), indptr), shape=(len(cuts), columns))

    def _look(self) -> None:
        """Look for inequalities of a few rows; when all rows have been looked at, let those found join."""
        assert self._found is not None
        widest = int(np.diff(self._inside.indptr).max(initial=1))
        many = max(1, LOOKED_AT // widest)
        first, self._next = self._next, min(self._next + (min(many, FACETS) if self._is_deep else many), self._W.shape[0])
        for one in violated(csr_array(self._inside[first : self._next]), self._point):
            entry, taken, _ = self._of(first + one.row)
            inequality = rounded(entry, taken, one)
            if inequality is not None:
                self._found.append(Cut(first + one.row, *inequality))
        for row in range(first, self._next) if self._is_deep else ():
            facet = self._facet(row)
            if facet is not None:
                self._found.append(facet)
        if self._next < self._W.shape[0]:
            return
        found, self._found = self._found, None
        if not found:
            self.is_finished = self._is_deep
            self._begin_facets()
            return
        fixed = self._W.shape[0] + self._P.shape[0]
        slack = self._programme.slack
        slack = slack[slack >= fixed]
        if len(slack):
            self._programme.leave(slack)
            gone = set((slack - fixed).tolist())
            self._cuts = [cut for number, cut in enumerate(self._cuts) if number not in gone]
        place = np.full(len(self._cost), -1)
        place[self._columns] = np.arange(len(self._columns))
        sides = np.array([cut.right for cut in found])
        matrix = hstack([csr_array(sides[:, None]), self._matrix(found, place, len(self._columns))])
        self._programme.join(csr_array(matrix), sides)
        self._cuts += found

    def _begin_facets(self) -> None:
        if not self._is_deep:
            self._is_deep, self._history = True, []

    def _of(self, row: int) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Entries of a row, how much of its candidates is taken, and their reduced costs."""
        begin, end = self._W.indptr[row], self._W.indptr[row + 1]
        held = self._W.indices[begin:end]
        return self._W.data[begin:end], self._point[held], self.reduced[held]

    def _facet(self, row: int) -> Cut | None:
        """A facet that the point misses, unless it has been looked for at the same point in vain."""
        entry, taken, dear = self._of(row)
        mark = np.round(taken, 9).tobytes()
        if self._in_vain.get(row) == mark:
            return None
        facet = missed_facet(entry, taken, dear)
        if facet is None:
            self._in_vain[row] = mark
            return None
        return Cut(row, *facet)


def _stacked(upper: csr_array, lower: csr_array) -> csr_array:
    return csr_array(
        (
            np.concatenate((upper.data, lower.data)),
            np.concatenate((upper.indices, lower.indices)),
            np.concatenate((upper.indptr, upper.indptr[-1] + lower.indptr[1:])),
        ),
        shape=(upper.shape[0] + lower.shape[0], upper.shape[1]),
    )
