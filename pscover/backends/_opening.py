"""The opening of a solve of a large form: a plan at once, multipliers by pricing, and searches among what they favour."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from pscover.certificate import Certificate
from pscover.model import CoverForm

from ._kernels import least_step
from ._session import Session

if TYPE_CHECKING:
    from pscover.engine.hunt import Hunt

IntArray = NDArray[np.int32]

RICH = ((25, 40), (12, 20), (7, 12))
"""Favoured candidates a search is made among, in turn: for each row so many overall, and so many of its own."""
LEAN = ((6, 10), (3, 5), (12, 20))
"""The same where all entries are full, so that one candidate meets a row."""
MOVES = 40
"""Moves a row without a better plan after which a search begins anew elsewhere; more once searches bring nothing."""
ROUNDS = 5
"""Rounds of pricing before the first search."""
PRICED = 2
"""Rounds of pricing after each search."""
BRIEF = 300
"""Moves without a better plan after which the first search, for any plan, is given up."""
TRIES = 3
"""Such searches after a round of pricing."""
EARLY = 0.4
"""The part of the time that these may take."""
STALE = 6
"""Searches in a row that bring nothing after which the opening is over."""
SHARE = 0.25
"""The part of the time that the opening may take where what follows is worth it."""
SMALL = 20_000
"""Entries of a form up to which branch and bound of our own may prove it, so that the opening is shorter:"""
SHORT, SHORTLY = 0.15, 0.5
"""That part of the time, and no more than so many seconds."""
HEAVY = 8e-6
"""Seconds an entry that presolve and what is built on it take."""
ROOM = 1.5
"""What follows is worth it where that many times its seconds are left."""


class Opening:
    """Plans and bounds of a large form, as good as they come without presolve; the longer, the better.

    What multipliers favour is a small part of a large form, and a search among few candidates is fast and goes deep: it
    begins anew in a different part of them once it finds no more.

    Parameters
    ----------
    form
        Rows that can be met; packing rows are cliques.
    session
        Whom to tell.
    """

    def __init__(self, form: CoverForm, session: Session) -> None:
        from pscover.engine.pricing import Pricing

        self.form, self.session = form, session
        self.pricing = Pricing(form)
        self.step = least_step(form.c[form.allowed])
        self.cost = math.inf
        self.plan: IntArray | None = None
        self._end = session.seconds + (SHARE * session.left if form.W.nnz > SMALL else min(SHORT * session.left, SHORTLY))
        self._random = np.random.default_rng(session.settings.seed)
        self._sizes = RICH if (form.W.data < 1 - 1e-9).any() else LEAN
        self._needed = np.zeros(0, dtype=np.int64)
        self._stale = 0
        if session.chosen is not None:
            self._take(session.chosen)

    @property
    def follows(self) -> bool:
        """Whether enough time is left for presolve and what is built on it."""
        return bool(self.session.left > ROOM * HEAVY * self.form.W.nnz)

    def run(self) -> None:
        """Go on until the time for it is up, or neither plan nor bound gets better."""
        self._tell()
        end = self.session.seconds + EARLY * self.session.left
        for _ in range(ROUNDS):
            if not self._is_over() and self.session.seconds < end and self._price():
                self._try()
        turn = 0
        while not self._is_over():
            self._search(turn, MOVES * (1 + self._stale) * (self.form.W.shape[0] + 20))
            for _ in range(PRICED):
                if not self.pricing.is_settled and not self._is_over():
                    self._price()
            turn += 1

    def certificate(self) -> Certificate | None:
        """What proves the bound: what rows pay for a unit of their demand; a sweep by these prices where it is proven."""
        from pscover.engine.certify import MOST, of_multipliers
        from pscover.proof import Prices

        nnz = self.form.W.nnz
        if nnz > MOST:
            return None
        if self.session.is_proven():
            swept = of_multipliers(self.form, self.pricing.multipliers, self.cost - self.step)
            if swept is not None:
                return swept
        scale = 2.0 ** math.floor(math.log2(FINE / max(float(self.form.c.mean()), 1e-300)))
        unit = np.floor(self.pricing.multipliers / UNITS * scale)
        if not 1.0 <= scale <= 2.0**40 or float(unit.sum()) * UNITS >= MOST_PAID:
            return None
        prices = Prices(entry=np.zeros(nnz, dtype=np.int64), unit=unit.astype(np.int64))
        return Certificate(units=UNITS, scale=int(scale), proof=prices)

    def _is_over(self) -> bool:
        session = self.session
        if session.over() or session.is_proven():
            return True
        done = self._stale >= STALE and (self.pricing.is_settled or self.plan is None)
        return (done or session.seconds > self._end) and self.follows

    def _price(self) -> bool:
        risen = self.pricing.turn()
        if risen:
            self._tell()
        return risen

    def _tell(self) -> None:
        self.session.bounded(self.session.model.offset + self.pricing.bound * (1 - 1e-12))

    def _try(self) -> None:
        """Look for a first plan, each time among more candidates of the rows that were left short."""
        for _ in range(TRIES):
            if self.plan is None and not self._is_over():
                self._search(0, BRIEF)

    def _search(self, turn: int, patience: int) -> None:
        """Look for a better plan among favoured candidates until so many moves bring none."""
        hunt, columns = self._hunt(turn)
        before = self.cost
        while hunt.idle < patience and not self._is_over():
            if hunt.turn(hunt.moves - hunt.idle + patience):
                self._take(columns[hunt.plan])
        if self.plan is None:
            self._needed = np.union1d(self._needed, self.pricing.strongest(hunt.lacking))
        self._stale = 0 if self.cost < before else self._stale + 1

    def _hunt(self, turn: int) -> tuple[Hunt, IntArray]:
        from pscover.engine.favoured import blurred
        from pscover.engine.hunt import Hunt

        overall, each = self._sizes[turn % len(self._sizes)]
        reduced = self.pricing.reduced
        if turn >= len(self._sizes):
            reduced = blurred(reduced, overall * self.form.W.shape[0], self._random)
        favoured = self.pricing.favoured(reduced, overall, each)
        favoured = np.union1d(favoured, self._needed if self.plan is None else self.plan)
        problem, columns = self.pricing.problem(favoured)
        hunt = Hunt(problem, self.session.settings.seed + turn, self.step)
        if self.plan is not None and turn % 2 == 1:
            kept = self.plan[np.isin(self.plan, columns)]
            hunt.resume(np.searchsorted(columns, kept).astype(np.int32))
        else:
            # Without a limit: on its way down from a dear plan a search learns which rows are hard.
            hunt.begin()
        return hunt, columns

    def _take(self, plan: IntArray) -> bool:
        """Take a plan if it is the best; whether it was."""
        cost = float(self.form.c[plan].sum())
        if cost >= self.cost:
            return False
        self.plan, self.cost = np.sort(plan).astype(np.int32), cost
        self.session.plan(self.plan, cost + self.session.model.offset)
        return True


UNITS = 1920
"""Into how many units a certificate divides a demand."""
FINE = 2.0**30
"""Prices of units are whole numbers of the mean cost divided by this, or finer."""
MOST_PAID = 2.0**57
"""They add up to less."""
