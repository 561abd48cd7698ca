"""A bound that rises as rows are merged: a group of rows is solved together, at the prices that its rows have agreed on.

Rows solved one by one (`rowwise`) may each choose other candidates. Two groups of rows that are made to agree cost at least
what they cost apart, and often more, for any shares of the candidates' costs, so that the sum over groups stays a bound of
all plans. Merged groups are solved by a sweep among the few candidates that the rows' own prices leave. At first those are
left out that make a group cost more than a little above its least, and that little grows until a choice is found.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_array

from pscover.model import CoverForm

from .problem import FloatArray, IntArray, problem_of
from .rowwise import Shares, laid
from .sweep import Sweep

BRIEF, LONG = 3_000_000, 24_000_000
"""What an attempt at a merge may look at, where merging is to be brief and where it is to be thorough."""
PATIENCE, LONGER = 20, 60
"""Attempts in a row that bring next to nothing after which brief merging ends, and a thorough one:"""
WORTH = 0.2
"""less than that part of what is expected at first. And less than"""
ROUND = 1e-6
"""that part is rounding."""
HARDER = 8
"""Once nothing more can be merged with less work, all is tried again with so many times as much."""
TURN = 400_000
"""What a turn looks at."""
LITTLE, MORE = 0.02, 1.7
"""By how much a merge is expected to raise the bound at first, relative to the mean cost; and by which factor after that."""


@dataclass(frozen=True, slots=True, eq=False)
class Group:
    """Rows solved together, rising, and what they cost at least."""

    rows: NDArray[np.int64]
    value: float


class Merging:
    """Merges of the likeliest groups first: those whose rows chose the same candidates lately.

    Parameters
    ----------
    form
        Packing rows are cliques.
    kept
        The candidates that the shares are about, as the form numbers them.
    priced
        Shares of their costs.
    most
        What an attempt at a merge may look at.
    """

    def __init__(self, form: CoverForm, kept: IntArray, priced: Shares, most: int) -> None:
        row = np.repeat(np.arange(form.W.shape[0]), np.diff(priced.starts))
        shape = (form.W.shape[0], len(kept))
        self._entries = csr_array(form.W[:, kept])
        self._packing = csr_array(csr_array(form.P[:, kept]).T)
        self._priced = priced
        self._share = csr_array((priced.kept, (row, priced.candidate)), shape=shape)
        self._least, penalty = _penalties(priced)
        self._penalty = csr_array((penalty, (row, priced.candidate)), shape=shape)
        chosen = csr_array((np.maximum(priced.mean, 0.0), (row, priced.candidate)), shape=shape)
        self._alike = np.asarray((chosen @ chosen.T).toarray())
        self._vain = np.zeros(self._alike.shape, dtype=np.bool_)
        self._groups = [Group(np.array([j]), float(value)) for j, value in enumerate(np.maximum(self._least, priced.least))]
        self._little = LITTLE * float(form.c[kept].mean())
        self._work, self._most = BRIEF, most
        self._fruitless = 0
        self._attempt: Attempt | None = None
        self.is_finished = False

    @property
    def bound(self) -> float:
        """Proven of all plans: the sum over groups."""
        return sum(group.value for group in self._groups) * (1 - 1e-11)

    def turn(self) -> bool:
        """Go on with a merge, or begin the likeliest; whether the bound rose."""
        attempt = self._attempt or self._next()
        if attempt is None:
            return False
        attempt.turn(self._work)
        self._attempt = None if attempt.is_finished else attempt
        if not attempt.is_finished:
            return False
        first, second = attempt.first, attempt.second
        rise = attempt.value - self._groups[first].value - self._groups[second].value
        risen = rise > ROUND * self._little
        self._fruitless = 0 if rise > WORTH * self._little else self._fruitless + 1
        self.is_finished = self._fruitless >= (PATIENCE if self._most == BRIEF else LONGER)
        if risen or attempt.is_solved:
            self._merge(attempt)
        else:
            self._vain[first, second] = self._vain[second, first] = True
        return risen

    def _next(self) -> Attempt | None:
        """An attempt at the two groups that chose the most alike for their size; None if there are none."""
        size = np.array([len(group.rows) for group in self._groups])
        both = size[:, None] + size[None, :]
        score = np.where(self._vain, 0.0, self._alike / (size[:, None] * size[None, :] * both))
        np.fill_diagonal(score, 0.0)
        at = int(np.argmax(score))
        first, second = divmod(at, len(size))
        if score[first, second] > 0.0:
            return Attempt(self, first, second)
        self._work *= HARDER
        self.is_finished = self._work > self._most or not self._vain.any()
        self._vain[:] = False
        return None

    def _merge(self, attempt: Attempt) -> None:
        first, second = attempt.first, attempt.second
        self._alike[first] += self._alike[second]
        self._alike[:, first] += self._alike[:, second]
        self._vain[first] = self._vain[:, first] = False
        self._groups[first] = Group(attempt.rows, attempt.value)
        del self._groups[second]
        for axis in range(2):
            self._alike, self._vain = np.delete(self._alike, second, axis), np.delete(self._vain, second, axis)

    def values(self, first: int, second: int) -> tuple[NDArray[np.int64], float, float]:
        """The rows of two groups, what the groups cost at least, and from which rise of that on one looks further."""
        one, other = self._groups[first], self._groups[second]
        return np.sort(np.concatenate((one.rows, other.rows))), one.value + other.value, self._little

    def sweep(self, rows: NDArray[np.int64], most: float) -> Sweep | None:
        """A sweep over the candidates that some rows can afford if they may cost no more than this in all.

        None if a row is left without any.
        """
        dear = np.asarray(self._penalty[rows].sum(axis=0)).ravel()
        entries = csr_array(self._entries[rows])
        columns = np.unique(entries.indices)
        columns = columns[dear[columns] <= most - float(self._least[rows].sum())]
        share = csr_array(csr_array(self._share[rows])[:, columns])
        part = CoverForm(
            c=np.asarray(share.sum(axis=0)).ravel(),
            W=csr_array(entries[:, columns]),
            P=csr_array(csr_array(self._packing[columns]).T),
            allowed=np.ones(len(columns), dtype=np.bool_),
        )
        if (np.diff(part.W.indptr) == 0).any():
            return None
        problem, _ = problem_of(part)
        row, order = laid(problem)
        candidate = np.ascontiguousarray(problem.lines["candidate"][order])
        paid = np.asarray(share.toarray()[row, candidate])
        priced = self._priced._replace(share=paid, kept=paid, candidate=candidate, starts=problem.rptr)
        return Sweep(problem, priced, np.zeros(len(columns), dtype=np.bool_), 0.0, 0.0)


class Attempt:
    """What two groups cost together, looked for below a limit that rises.

    Parameters
    ----------
    merging
        Whose groups they are.
    first, second
        Their numbers.

    Attributes
    ----------
    rows
        Of both.
    value
        What they cost at least.
    is_solved
        Whether they cost just that.
    is_finished
        Whether they are solved, or that takes more work than it may.
    """

    def __init__(self, merging: Merging, first: int, second: int) -> None:
        self.merging, self.first, self.second = merging, first, second
        self.rows, self.value, self._rise = merging.values(first, second)
        self.is_solved = self.is_finished = False
        self._apart, self._work = self.value, 0
        self._sweep: Sweep | None = None

    def turn(self, most: int) -> None:
        """Go on for a moment; the work in all may be so much."""
        limit = self._apart + self._rise
        sweep = self._sweep = self._sweep or self.merging.sweep(self.rows, limit)
        if sweep is not None and sweep.turn(TURN, limit):
            assert sweep.plan is not None
            self.value = max(self.value, sweep.cost)
            self.is_solved = self.is_finished = True
        elif sweep is None or sweep.is_finished:
            self.value = limit
            self._rise *= MORE
            self._work += sweep.work if sweep is not None else 0
            self._sweep = None
        else:
            self.is_finished = sweep.has_given_up or self._work + sweep.work > most


def _penalties(priced: Shares) -> tuple[FloatArray, FloatArray]:
    """What each row costs at least at the best shares, and how much more if it must have an entry."""
    starts, clique = priced.starts, priced.group
    full = priced.full
    least, penalty = np.zeros(len(starts) - 1), np.zeros(len(priced.kept))
    for j, (first, last) in enumerate(pairwise(starts.tolist())):
        share, short = priced.kept[first:last], np.maximum(full - priced.units[first:last], 0)
        # The prices of 0 to `full` units, of the cliques gone through so far.
        price = np.full(full + 1, np.inf)
        price[0] = 0.0
        ends = np.append(np.flatnonzero(np.diff(clique[first:last])) + 1, last - first)
        begin = 0
        for end in ends.tolist():
            rest = np.maximum(np.arange(full + 1) - priced.units[first + begin : first + end, None], 0)
            price = np.minimum(price, (price[rest] + share[begin:end, None]).min(axis=0))
            begin = end
        least[j] = price[full]
        penalty[first:last] = np.maximum(share + price[short] - price[full], 0.0)
    return least, penalty
