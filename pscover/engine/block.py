"""One independent part of a problem on its way to a proof: its plan, its bound, and who improves them."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_array, vstack

from pscover.model import CoverForm, Model, model_of
from pscover.presolve import fix_by_reduced_cost, lagrangian

from .account import Account
from .certify import Known
from .problem import IntArray, problem_of
from .quest import Quest
from .rowwise import STEPS as TAKEN
from .subgradient import BOUND, LENGTH, STEPS
from .sweep import worth

if TYPE_CHECKING:
    from .cutting import Cutting
    from .exact import Exact
    from .merging import Merging
    from .rowwise import Shares
    from .subgradient import Multipliers

BUSHY, PLAIN = 12_000, 600
"""Most entries for which branch and bound of our own is tried, where several must work together and where they are full."""
FEW, PROMISING = 30, 0.1
"""Branch and bound of our own is likely to finish if there are no more rows than this, or prices leave out such a part for
as many rows, and so much more for more."""
FIRST = 20
"""Moves a row of local search before it begins."""
ROUGH, ROOT = 100, 60
"""Steps on multipliers of rows and on shares before a sweep begins."""
WIDE = 12
"""Candidates a row from which the search looks at those first that multipliers favour."""
CORE, RICH = 3, 12
"""Such candidates a row, where entries are full and where several must work together."""
EACH, MANY = 5, 20
"""Of each row at least so many, in the two cases."""
GLANCE = 40
"""Subgradient steps between two looks at the clock, at most."""
WORK = 400_000
"""Entries that these steps read, at most."""
WARM = 80
"""Subgradient steps after which multipliers are good enough to tell favoured candidates."""
ROUGHLY, NEARLY = 250, 100
"""Steps after which shares are good enough for rows to be merged, and after which they are where they began good."""
LONGEST = 400_000
"""Most entries for which rows are solved one by one: a step must not take long."""
BROADEST, READING = 4_000_000, 2e-6
"""Most entries for which a linear relaxation is cut, for prices of all candidates must not take long; and the seconds an
entry that must be left for it to be begun."""
PATIENCE = 300
"""Moves a row without a better plan after which a search counts as idle."""
VARIED, RESTLESS = 120, 100
"""The same where several candidates must work together and costs differ, so that searches end in many places; and once it
has begun to look elsewhere, where it may look everywhere."""
AIM = 1.1
"""Steps aim at the best bound times this, where that is below the plan's cost: far aims overshoot."""
SHORTEST = 2e-3
"""Steps shorter than this, relative to what would reach the plan's cost, no longer raise the bound."""


class Block:
    """A block of a cover form.

    Parameters
    ----------
    form
        Its rows; packing rows are cliques.
    columns
        Its candidates in the whole.
    seed
        Of everything random.
    step
        The least by which the costs of two plans differ.
    """

    def __init__(self, form: CoverForm, columns: IntArray, seed: int, step: float) -> None:
        self.form = form
        self.columns = columns
        self.quest = Quest(seed, step)
        self.step = step
        self.problem, self.kept = problem_of(form)
        self.is_fractional = bool((form.W.data < 1 - 1e-9).any())
        self.is_varied = self.is_fractional and bool((self.problem.cost != self.problem.cost[:1]).any())
        self.plan: IntArray | None = None
        self.cost = math.inf
        self.bound = 0.0
        self.is_infeasible = False
        self.is_exhausted = False
        self.multipliers: Multipliers | None = None
        self.shares: Shares | None = None
        self._priced: tuple[NDArray[np.float64], float] | None = None
        self._toll = np.zeros(self.problem.candidates)
        self._tolled, self._extra = self.problem, 0.0
        self.cutting: Cutting | None = None
        self._inequalities = csr_array((0, len(form.c)))
        self._has_cut = not self.is_fractional or len(self.problem.lines) > BROADEST
        self.merging: Merging | None = None
        self._merges = 0
        self.has_core = False
        self._exact: Exact | None = None
        self._account = Account(self.problem, self.kept)
        self._stall = 0
        self._has_tightened = False

    @property
    def is_open(self) -> bool:
        """Whether a better plan may exist."""
        return not (self.is_infeasible or self.is_exhausted or self.bound >= self.cost - 1e-9 * max(1.0, abs(self.cost)))

    @property
    def is_settled(self) -> bool:
        """Whether no bound rises any more."""
        return self._stall >= 2 and self._has_cut and self._has_tightened and not self._may_merge

    @property
    def _may_merge(self) -> bool:
        """Whether rows are being merged, or shares are better than those that they were merged at, to be worth it anew."""
        if self.shares is None or len(self.problem.lines) > LONGEST:
            return False
        is_merging = self.merging is not None and not self.merging.is_finished
        return is_merging or (self.shares.value[TAKEN] >= ROUGHLY) + self._has_tightened > self._merges

    @property
    def is_wide(self) -> bool:
        """Whether there are so many candidates that the search had better look at favoured ones only."""
        return not self.is_small and self.problem.candidates > (2 * MANY if self.is_fractional else WIDE) * self.problem.rows

    @property
    def is_focused(self) -> bool:
        """Whether the search knows where to look: it need not, or multipliers have told."""
        return self.has_core or self.plan is None or not self.is_wide

    @property
    def is_idle(self) -> bool:
        """Whether the search has long found nothing."""
        patience = RESTLESS if self.quest.turns and not self.is_wide else VARIED if self.is_varied else PATIENCE
        return self.quest.idle > patience * (self.problem.rows + 20)

    @property
    def is_quiet(self) -> bool:
        """Whether it has found nothing since it last chose where to look."""
        return self.is_idle or self.quest.in_vain > 0

    @property
    def _enough(self) -> float:
        """What a better plan costs at most."""
        return self.cost - max(self.step, 1e-9 * self.cost)

    def offer(self, plan: IntArray) -> bool:
        """Take a feasible plan (candidates of the block) if it is the best; whether it was."""
        cost = float(self.form.c[plan].sum())
        if cost >= self.cost:
            return False
        self.plan, self.cost = np.sort(plan).astype(np.int32), cost
        self.quest.in_vain = 0
        return True

    def prove(self, bound: float) -> bool:
        """Take a bound if it is the best, rounded up to what costs can be; whether it was. If infinite, there is no plan."""
        if math.isinf(bound) and bound > 0:
            return self._exhausted()
        if self.step > 0 and math.isfinite(bound):
            bound = math.ceil(bound / self.step - 1e-6 * max(1.0, abs(bound / self.step))) * self.step
        if bound <= self.bound + 1e-12:
            return False
        self.bound = bound
        return True

    @property
    def is_small(self) -> bool:
        """Whether branch and bound of our own may finish it."""
        return len(self.problem.lines) <= (BUSHY if self.is_fractional else PLAIN)

    @property
    def is_promising(self) -> bool:
        """Whether rows are so few, or prices leave out so many candidates, that branch and bound may come to an end."""
        if self.problem.rows <= FEW:
            return True
        enough = PROMISING * self.problem.rows / FEW
        return self.shares is not None and math.isfinite(self.cost) and float(self._hopeless().mean()) >= enough

    @property
    def work(self) -> int:
        """What branch and bound has looked at."""
        return 0 if self._exact is None else self._exact.work

    def explore(self) -> bool:
        """A turn: a short search, prices of rows, a sweep if that is possible, else a tree; whether it helped."""
        if not self.quest.has_begun:
            return self._search_briefly()
        if self.shares is None or self._extra > 0.0:
            self._note()
            return self._price()
        if self._exact is None:
            from .exact import Exact

            self._exact = Exact(self.problem, self.shares, self._hopeless(), self.bound, self.cost, self.step)
        exact = self._exact
        if exact.wants_a_search():
            return self._search_briefly()
        plan = exact.turn(self.cost)
        moved = plan is not None and self.offer(self.kept[plan])
        if exact.is_finished:
            return self._exhausted()
        return self.prove(min(exact.lower, self.cost)) or moved

    def _price(self) -> bool:
        """Share the candidates' costs among their rows; whether the bound rose or proved something."""
        from . import rowwise, subgradient

        if self.multipliers is None:
            self.multipliers = subgradient.multipliers(self.problem)
        goal = self.cost if math.isfinite(self.cost) else float(self.problem.cost.sum())
        subgradient.ascend(self.problem, self.multipliers, ROUGH, goal)
        # Without tolls: branch and bound adds up what candidates cost.
        self._share_out(np.zeros(self.problem.candidates))
        assert self.shares is not None
        enough = worth(goal, self.step)
        bound = float(rowwise.improve(self.problem, self.shares, ROOT, enough + 1e-6 * max(1.0, abs(enough))))
        if math.isinf(bound) and bound > 0:
            return self._exhausted()
        return self.prove(min(bound, self.cost))

    def _hopeless(self) -> NDArray[np.bool_]:
        """Candidates that no better plan has, by the prices of rows."""
        from . import rowwise

        assert self.shares is not None
        bound = float(self.shares.value[rowwise.BOUND]) - self._extra
        most: NDArray[np.bool_] = bound + self.shares.penalty > worth(self.cost, self.step) + 1e-7
        return most

    def _exhausted(self) -> bool:
        """Nothing is left to look at: the plan at hand is the best, or there is none."""
        self.is_infeasible = self.plan is None
        self.is_exhausted = True
        self.bound = self.cost if self.plan is not None else self.bound
        return True

    def _search_briefly(self) -> bool:
        """A short search; whether it found a better plan."""
        self._begin_search()
        moved = False
        for plan in self.quest.briefly(FIRST * self.problem.rows):
            moved |= self.offer(plan)
        return moved

    def search(self) -> bool:
        """A turn of local search; whether it found a better plan."""
        self._begin_search()
        plan = self.quest.turn()
        return plan is not None and self.offer(plan)

    def _begin_search(self) -> None:
        if not self.quest.has_begun:
            self.quest.begin(self.problem, self.kept, self.plan, self._enough)

    def bind(self, left: float = math.inf) -> bool:
        """Raise the bound by a few steps, of a few milliseconds and no more than what is left; whether it rose."""
        if self.has_core and not self._has_cut:
            return self._cut(left)
        if self._stall < 2:
            risen = self.ascend()
            if self._stall >= 2 or (
                self.multipliers is not None and not self.has_core and self.multipliers.value[STEPS] >= WARM
            ):
                self._shrink_by_prices()
            return risen
        if self._may_merge:
            return self._merge()
        return not self._has_tightened and self._tighten()

    def ascend(self) -> bool:
        """A few subgradient steps; whether the bound rose."""
        from .subgradient import ascend, multipliers

        if self.multipliers is None:
            self.multipliers = multipliers(self.problem)
        before = float(self.multipliers.value[BOUND])
        goal = min(self.cost, AIM * before) if before > 0 else self.cost
        if not math.isfinite(self.cost):
            goal = 2 * max(1.0, before) + 1
        size = 2 * len(self.problem.lines) + self.problem.candidates + self.problem.rows
        bound = float(ascend(self.problem, self.multipliers, max(1, min(GLANCE, WORK // (size + 1))), goal))
        self._stall = self._stall + 1 if self.multipliers.value[LENGTH] <= SHORTEST else 0
        if self.plan is None and bound > self.problem.cost.sum() * (1 + 1e-9):
            self.is_infeasible = True
        # Candidates left out by reduced costs are in no plan cheaper than the one at hand.
        return bound > before and self.prove(min(bound, self.cost))

    def _cut(self, left: float) -> bool:
        """A turn of the linear relaxation with rounded rows; whether the bound rose."""
        if self.cutting is None:
            from .cutting import Cutting

            if left < READING * len(self.problem.lines):
                self._has_cut = True
                return False
            try:
                self.cutting = Cutting(self.form, self.kept, self.reduced[self.kept])
            except ImportError:
                self._has_cut = True
                return False
        cutting = self.cutting
        risen = cutting.turn(left) and self.prove(min(cutting.bound, self.cost))
        if self.plan is None and cutting.bound > self.problem.cost.sum() * (1 + 1e-9):
            self.is_infeasible = True
        if cutting.is_finished:
            self._has_cut, self.cutting, self._stall = True, None, 2
            if math.isfinite(cutting.bound):
                self._adopt_prices(cutting)
                self._shrink_by_prices()
        return risen

    def _adopt_prices(self, cutting: Cutting) -> None:
        """Go on with the prices of the relaxation: for what rows pay, and where to look."""
        from .rowwise import known, laid, resolution, shares_of, tolled

        found = cutting.inequalities
        columns = self.kept[found.indices]
        self._inequalities = csr_array((found.data, columns, found.indptr), shape=(found.shape[0], len(self.form.c)))
        self._toll, (self._tolled, self._extra) = cutting.toll, tolled(self.problem, cutting.toll)
        paid = cutting.paid_in(self.problem)
        self.shares = shares_of(self._tolled, paid, resolution(self.problem))
        known(self.shares, paid[laid(self.problem)[1]], cutting.least, ROUGHLY - NEARLY)
        self.merging, self._merges, self._has_tightened = None, 0, len(self.problem.lines) > LONGEST
        self._priced = self.form.c.copy(), cutting.bound
        self._priced[0][self.kept] = cutting.reduced

    def _tighten(self) -> bool:
        """A few steps on the shares of the rows; whether the bound rose."""
        from .rowwise import BOUND, LENGTH, improve, tolls

        assert self.multipliers is not None
        entries = len(self.problem.lines)
        if self.shares is None:
            if not self.is_fractional or entries > LONGEST or not math.isfinite(self.cost):
                self._has_tightened = True
                return False
            self._share_out(tolls(self.problem, self.multipliers.kept))
            assert self.shares is not None
        extra, state = self._extra, self.shares
        before = float(state.value[BOUND])
        # Without a plan an aim that is neither out of reach nor reached: steps towards infinity lead nowhere.
        goal = extra + (self.cost if math.isfinite(self.cost) else 2 * max(1.0, before - extra) + 1)
        bound = float(improve(self._tolled, state, max(1, min(GLANCE, WORK // (50 * entries + 1))), goal))
        is_vain = state.value[TAKEN] >= ROUGHLY and not state.penalty.any()
        if state.value[LENGTH] < SHORTEST or is_vain or (bound >= goal and math.isfinite(self.cost)):
            self._has_tightened = True
        if self.step > 0 or self._has_tightened:
            self._leave_out(bound - extra + state.penalty > self.cost - self.step + 1e-6 * max(1.0, self.cost))
        return bound > before and self.prove(min(bound - extra, self.cost))

    def _share_out(self, toll: NDArray[np.float64]) -> None:
        """Begin with shares of costs and a toll, as multipliers have them."""
        from .rowwise import shares, tolled

        assert self.multipliers is not None
        self._toll, (self._tolled, self._extra) = toll, tolled(self.problem, toll)
        self.shares = shares(self._tolled, self.multipliers.kept)
        self.merging, self._merges = None, 0

    def _merge(self) -> bool:
        """Go on merging rows: briefly once shares are about right, thoroughly once they are; whether the bound rose."""
        from .merging import BRIEF, LONG, Merging

        if self.merging is None or self.merging.is_finished:
            assert self.shares is not None
            self.merging = Merging(self.form, self.kept, self.shares, LONG if self._has_tightened else BRIEF)
            self._merges = 1 + self._has_tightened
        if not self.merging.turn():
            return False
        return self.prove(min(self.merging.bound - self._extra, self.cost))

    @property
    def reduced(self) -> NDArray[np.float64]:
        """Reduced costs of the candidates by the best prices, as far as there are any."""
        return self._best_prices()[0]

    def _best_prices(self) -> tuple[NDArray[np.float64], float]:
        """Reduced costs of the candidates, and the bound that they come with."""
        if self._priced is not None:
            return self._priced
        if self.multipliers is None:
            return self.form.c, 0.0
        return lagrangian(self.form, self.multipliers.kept)

    def _shrink_by_prices(self) -> None:
        """Leave out what no better plan contains, by reduced costs; where many are left, look at favoured ones first."""
        reduced, lower = self._best_prices()
        # A relaxation at work knows the candidates by their numbers.
        if math.isfinite(self.cost) and self.cutting is None:
            fixed = fix_by_reduced_cost(self.form, reduced, lower, self.cost, step=self.step)
            self._leave_out(np.isin(self.kept, fixed.zero))
        self.has_core = True
        if self.is_wide or self.quest.turns:
            self._search_favoured(reduced)

    def _search_favoured(self, reduced: NDArray[np.float64]) -> None:
        """Search among favoured candidates and those of the plan; every second time that all were searched, from scratch."""
        overall, each = (RICH, MANY) if self.is_fractional else (CORE, EACH)
        if not self.is_wide:
            overall, each = self.quest.sizes
        core = self.form.allowed & self.quest.favoured(self.form.W, reduced, overall, each)
        if self.plan is not None:
            core[self.plan] = True
        part = problem_of(CoverForm(c=self.form.c, W=self.form.W, P=self.form.P, allowed=core))
        is_anew = not self.is_wide and self.quest.in_vain % 2 == 1
        self.quest.begin(*part, None if is_anew else self.plan, self._enough)

    def _leave_out(self, gone: NDArray[np.bool_]) -> None:
        """Go on without some of the candidates kept, if they are many."""
        from .rowwise import tolled, without
        from .subgradient import carried

        if gone.sum() < 0.2 * len(gone) or self.multipliers is None:
            return
        if gone.all():
            self.is_exhausted, self.bound = True, self.cost
            return
        self._note()
        allowed = self.form.allowed.copy()
        allowed[self.kept[gone]] = False
        self.form = CoverForm(c=self.form.c, W=self.form.W, P=self.form.P, allowed=allowed)
        self.problem, self.kept = problem_of(self.form)
        self.multipliers = carried(self.problem, self.multipliers)
        self.shares, self._toll = None if self.shares is None else without(self.shares, gone), self._toll[~gone]
        self._tolled, self._extra = tolled(self.problem, self._toll)
        self._stall, self._has_tightened = 2 if self._has_cut and self.is_fractional else 0, False
        self.cutting = self.merging = None
        self._merges = 0
        self._exact = None
        self.quest.end()

    def _note(self) -> None:
        """Keep what rows pay now for a certificate, if it is the best so far."""
        if self.multipliers is not None and len(self.kept):
            self._account.note(self._numbers(), self.multipliers.kept, self.shares, self._extra)

    def known(self, rows: NDArray[np.int64], seconds: float) -> Known:
        """What is known of it, whose rows are these in the whole; better prices are looked for so long if it takes them."""
        account, order = self._account, None
        if self.cutting is not None and math.isfinite(self.cutting.bound):
            self._adopt_prices(self.cutting)
        self._note()
        exact = self._exact
        is_swept = exact is not None and exact.sweeps and (exact.is_finished or exact.lower >= self.bound - 1e-9)
        if is_swept and math.isfinite(self.cost):
            order = self.order()
        elif math.isfinite(self.cost) and not self.is_open:
            is_priced = account.improve(self.cost, self.step, seconds)
            order = np.arange(len(rows)) if is_priced else account.swept()
        paid = account.paid(rows, self.columns.astype(np.int64))
        # Nothing is proven beyond the cost of a plan, whatever a bound says.
        limit = min(self.bound, self.cost) - self.step
        return Known(rows=rows, paid=paid, order=None if order is None else rows[order], limit=limit)

    def order(self) -> NDArray[np.int64]:
        """Its rows in the order of a sweep."""
        return self._account.order()

    def _numbers(self) -> IntArray:
        """The candidates kept, among those that there were at first."""
        return np.searchsorted(self._account.kept, self.kept).astype(np.int32)

    def refocus(self) -> None:
        """Choose anew which candidates are favoured, by the multipliers as they are now, once the search is idle.

        A search that has looked everywhere goes on in turn with those.
        """
        if not self.is_idle or self.multipliers is None or self.quest.returns(self._enough):
            return
        problem, search = self.problem, self.quest.turn_elsewhere()
        self._shrink_by_prices()
        self.quest.let_rest(None if self.is_wide or self.problem is not problem else search)

    def model(self) -> tuple[Model, IntArray]:
        """What is left as a model, with the inequalities found for its rows, and its candidates in the block."""
        kept = problem_of(self.form)[1]
        rows = vstack([self.form.W, self._inequalities], format="csr")
        return model_of(replace(self.form, W=csr_array(rows)).among(kept)), kept
