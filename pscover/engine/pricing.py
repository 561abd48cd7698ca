"""Multipliers of a large form, found over a core of its candidates that pricing all of them chooses anew in every round."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_array

from pscover.model import CoverForm

from .favoured import favoured
from .problem import COLUMN, LINE, FloatArray, IntArray, Problem, problem_of
from .subgradient import BOUND, LENGTH, ascend, begun

CORE, EACH = 12, 20
"""Candidates of least reduced cost in a core, for each row: so many overall, and so many of those that cover it."""
STEPS = 20
"""Subgradient steps between two changes of what they aim at."""
REPEATS = 3
"""So many times in a round."""
AIM, FAR = 1.1, 2.0
"""Steps aim at the best bound times this, or that where the last round raised it by more than `STEEP`, relatively."""
STEEP = 0.25
RISE = 1e-3
"""A round that raises the bound by less, relatively, brings nothing."""
PATIENCE = 4
"""Rounds that bring nothing after which no more are made."""


class Pricing:
    """Row multipliers, the bound that they prove of all candidates, and the candidates that they favour.

    As a subgradient step over all candidates of a large form takes milliseconds, steps are made over the candidates of least
    reduced cost; now and then all are priced, which gives a bound that holds and a better choice (Caprara, Fischetti and
    Toth 1999).

    Parameters
    ----------
    form
        Rows that can be met; packing rows are cliques.

    Attributes
    ----------
    multipliers
        The best of the rows so far, shape (rows,).
    reduced
        Reduced costs at those, shape (candidates,); infinite where a candidate is not allowed.
    bound
        The best bound so far.
    """

    def __init__(self, form: CoverForm) -> None:
        self.form = form
        self._columns = csr_array(form.W.T)
        self._packing = csr_array(form.P.T)
        self._cost = np.where(form.allowed, form.c, np.inf)
        self._home = _home(form)
        self._core = np.zeros(len(form.c), dtype=np.bool_)
        self._length = 0.5
        self._idle = 0
        self._aim = AIM
        self._y = self._first()
        self.multipliers, self.bound = self._y, -np.inf
        self.reduced, self._last = self._price()

    @property
    def is_settled(self) -> bool:
        """Whether further rounds bring little."""
        return self._idle >= PATIENCE

    def turn(self) -> bool:
        """A round: choose candidates, take steps, price all; whether the bound rose."""
        self._core[self.favoured(self._last, CORE, EACH)] = True
        problem = self._by_column(np.flatnonzero(self._core))
        state = begun(problem, self._y, self._length)
        for _ in range(REPEATS):
            top = max(float(state.value[BOUND]), self.bound)
            ascend(problem, state, STEPS, self._aim * top if top > 0 else 1.0 + float(self._y.sum()))
        self._y, self._length = state.kept, max(float(state.value[LENGTH]), 0.02)
        before = self.bound
        _, self._last = self._price()
        self._aim = FAR if self.bound > before + STEEP * abs(before) else AIM
        self._idle = 0 if self.bound > before + RISE * abs(before) else self._idle + 1
        return self.bound > before

    def problem(self, chosen: NDArray[np.int64]) -> tuple[Problem, IntArray]:
        """The problem over some candidates, and which of all candidates are its own."""
        part = CoverForm(
            c=self.form.c[chosen],
            W=csr_array(csr_array(self._columns[chosen]).T),
            P=csr_array(csr_array(self._packing[chosen]).T),
            allowed=self.form.allowed[chosen],
        )
        problem, kept = problem_of(part)
        return problem, chosen[kept].astype(np.int32)

    def favoured(self, reduced: FloatArray, overall: int, each: int) -> NDArray[np.int64]:
        """The candidates of least reduced cost: so many for each row overall, and of each row so many."""
        return np.flatnonzero(favoured(csr_array(self.form.W), reduced, overall, each) & self.form.allowed)

    def strongest(self, rows: IntArray) -> NDArray[np.int64]:
        """Of each clique the candidate of largest entry in each of some rows: what those cannot meet, none can."""
        W = self.form.W
        chosen = [np.zeros(0, dtype=np.int64)]
        for j in rows:
            span = slice(W.indptr[j], W.indptr[j + 1])
            members, entries = W.indices[span], W.data[span]
            order = np.lexsort((entries, self._home[members]))
            last = np.diff(self._home[members][order], append=-1) != 0
            chosen.append(members[order[last]])
        found = np.unique(np.concatenate(chosen))
        return found[self.form.allowed[found]]

    def _first(self) -> FloatArray:
        """Each row pays what its cheapest candidate asks, shared over that candidate's entries."""
        W = self.form.W
        each = self._cost / np.maximum(self._columns @ np.ones(W.shape[0]), 1e-12)
        return np.asarray(np.minimum.reduceat(each[W.indices], W.indptr[:-1]), dtype=np.float64)

    def _by_column(self, chosen: NDArray[np.int64]) -> Problem:
        """What subgradient steps read of the problem over some candidates."""
        part, rows = self._columns[chosen], self.form.W.shape[0]
        columns = np.zeros(part.nnz, dtype=COLUMN)
        columns["entry"], columns["row"] = part.data, part.indices
        home, cliques = self._home[chosen], self.form.P.shape[0]
        none = np.zeros(len(chosen) + 1, dtype=np.int32)
        return Problem(
            cost=self.form.c[chosen].astype(np.float64),
            cptr=part.indptr.astype(np.int32),
            columns=columns,
            rptr=np.zeros(rows + 1, dtype=np.int32),
            lines=np.zeros(0, dtype=LINE),
            gptr=none,
            gclq=none[:0],
            home=np.where(home < cliques, home, -1).astype(np.int32),
            cliques=np.array([cliques], dtype=np.int32),
        )

    def _price(self) -> tuple[FloatArray, FloatArray]:
        """Price all candidates at the multipliers as they are; the reduced costs at the best ones, and at these."""
        reduced = self._cost - self._columns @ self._y
        below = np.flatnonzero(reduced < 0.0)
        least = np.zeros(self.form.P.shape[0] + len(reduced))
        np.minimum.at(least, self._home[below], reduced[below])
        total = float(self._y.sum())
        bound = total + float(least.sum())
        bound -= 1e-12 * (total - float(least.sum()))
        if bound > self.bound:
            self.bound, self.multipliers, self.reduced = bound, self._y, reduced
        return self.reduced, reduced


def _home(form: CoverForm) -> IntArray:
    """The largest clique of each candidate; those in none are numbered after the cliques."""
    P = form.P
    sizes = np.diff(P.indptr)
    owner = np.repeat(np.arange(P.shape[0]), sizes)
    order = np.argsort(sizes[owner], kind="stable")
    home = P.shape[0] + np.arange(P.shape[1])
    home[P.indices[order]] = owner[order]
    return np.asarray(home, dtype=np.int32)
