"""The sweep over cliques against enumeration, and the tables that bound it against all sums."""

from __future__ import annotations

import itertools

import numpy as np
import pytest
from scipy.sparse import csr_array

from pscover.model import CoverForm

pytest.importorskip("numba")

from pscover.engine import sweep as sweeping
from pscover.engine.branch import Branching
from pscover.engine.problem import Problem, problem_of
from pscover.engine.route import route
from pscover.engine.sweep import Sweep, worth
from pscover.engine.tables import NOTHING, Table


def chain(seed: int, *, whole: bool = True) -> CoverForm:
    """Six rows in a row, cliques of two candidates between neighbours, and one candidate for each row alone."""
    random = np.random.default_rng(seed)
    rows, groups = 6, [(j, j + 1) for j in range(5)] + [(j,) for j in range(6)] + [(0, 2)]
    W, P = np.zeros((rows, 2 * len(groups))), np.zeros((len(groups), 2 * len(groups)))
    for g, held in enumerate(groups):
        for i in (2 * g, 2 * g + 1):
            P[g, i] = 1.0
            W[list(held), i] = random.uniform(0.3, 1.05, len(held))
    cost = np.ones(2 * len(groups)) if whole else random.uniform(0.5, 1.5, 2 * len(groups))
    return CoverForm(c=cost, W=csr_array(np.minimum(W, 1.0)), P=csr_array(P), allowed=np.ones(W.shape[1], dtype=np.bool_))


def best(form: CoverForm) -> float:
    """The least cost, by a dynamic programme over all choices of the cliques that keeps every different supply."""
    W = form.W.toarray()
    states = {tuple(np.zeros(len(W))): 0.0}
    for i in range(0, W.shape[1], 2):
        fresh = dict(states)
        for supply, cost in states.items():
            for k in (i, i + 1):
                now = tuple(np.minimum(1.0, np.array(supply) + W[:, k]).round(12))
                fresh[now] = min(fresh.get(now, np.inf), cost + form.c[k])
        states = fresh
    return min((cost for supply, cost in states.items() if min(supply) > 1 - 1e-9), default=np.inf)


def rooted(form: CoverForm, cost: float, step: float) -> tuple[Problem, Branching]:
    """A search that has looked at its root."""
    problem, _ = problem_of(form)
    search = Branching(problem, cost, step)
    search.turn(1)
    return problem, search


@pytest.mark.parametrize("whole", [True, False])
@pytest.mark.parametrize("seed", range(6))
def test_finds_the_best_plan_or_that_there_is_none_better(seed: int, whole: bool) -> None:
    form, step = chain(seed, whole=whole), 1.0 if whole else 0.0
    least = best(form)
    for cost in (least, least + 1.0):
        problem, search = rooted(form, cost, step)
        if search.is_finished or not search.is_open:
            continue
        found = Sweep(problem, search.tree, search.lower, step)
        while not found.is_finished:
            assert not found.has_given_up
            found.turn(1, worth(cost, step))
        if search.plan.size or found.plan is None:
            known = min(cost, *[float(form.c[search.plan].sum())] if search.plan.size else [cost])
            assert found.plan is None or form.c[found.plan].sum() <= known
            cost = known
        if found.plan is None:
            assert cost == pytest.approx(least)
            continue
        assert form.c[found.plan].sum() == pytest.approx(least)
        assert (form.W[:, found.plan].sum(axis=1) >= 1 - 1e-8).all()
        assert (form.P[:, found.plan].sum(axis=1) <= 1).all()


@pytest.mark.parametrize("seed", range(6))
def test_needs_no_prices(seed: int) -> None:
    form = chain(seed)
    cost = best(form) + 2.0
    problem, search = rooted(form, np.inf, 0.0)
    search.tree.prices[:] = 0.0
    search.tree.state[:] = 0
    sweep = Sweep(problem, search.tree, 0.0, 1.0)
    assert sweep.turn(10**9, worth(cost, 1.0))
    assert sweep.plan is not None
    assert form.c[sweep.plan].sum() == cost - 2.0


def test_turns_do_not_change_what_is_done() -> None:
    form = chain(3)
    ends = []
    for work in (1, 10**9):
        problem, search = rooted(form, 8.0, 1.0)
        sweep = Sweep(problem, search.tree, search.lower, 1.0)
        while not (sweep.is_finished or sweep.has_given_up):
            sweep.turn(work, worth(8.0, 1.0))
        ends.append((sweep.work, sweep.target, None if sweep.plan is None else sweep.plan.tolist()))
    assert ends[0] == ends[1]


def test_gives_up_where_there_are_too_many_partial_plans(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(sweeping, "MOST", 1)
    problem, search = rooted(chain(0), 20.0, 1.0)
    sweep = Sweep(problem, search.tree, 0.0, 0.0)
    sweep.turn(10**9, 20.0)
    assert sweep.has_given_up
    assert not sweep.is_finished
    assert sweep.plan is None


def test_the_route_takes_every_clique_once_and_keeps_few_rows() -> None:
    problem, search = rooted(chain(1), 20.0, 0.0)
    stages, _ = route(problem, search.tree)
    picks = [i for stage in stages for i in stage.picks.tolist() if i >= 0]
    assert len(picks) == len(set(picks))
    assert max(int(stage.slots.max()) for stage in stages) <= 3
    starts = sum(int(stage.fresh.sum()) for stage in stages)
    assert starts == problem.rows


def test_a_table_knows_all_sums_and_their_least_prices() -> None:
    random = np.random.default_rng(5)
    groups = [(random.uniform(0.05, 0.4, 2), random.uniform(0.0, 1.0, 2)) for _ in range(4)]
    table = NOTHING
    for amount, share in groups:
        table = table.with_group(amount, share)
    found: dict[float, float] = {}
    for picks in itertools.product(range(3), repeat=4):
        held = [(groups[g][0][k - 1], groups[g][1][k - 1]) for g, k in enumerate(picks) if k]
        supply = min(1.0, sum(amount for amount, _ in held))
        found[supply] = min(found.get(supply, np.inf), sum(share for _, share in held))
    for need in random.uniform(0.01, 1.0, 50):
        least = min((price for supply, price in found.items() if supply >= need), default=np.inf)
        assert table.price_of(need) == pytest.approx(least)
        values = table.sums[1]
        above = [supply for supply in found if supply >= need]
        assert not above or values[np.searchsorted(values, need)] == pytest.approx(min(above))


def test_a_free_entry_lowers_what_is_above_it() -> None:
    table = NOTHING.with_group(np.array([0.4]), np.array([0.0])).with_group(np.array([0.5, 0.7]), np.array([1.0, 2.0]))
    assert [table.price_of(need) for need in (0.3, 0.5, 0.9, 0.95)] == [0.0, 1.0, 1.0, 2.0]


def test_a_table_with_too_many_points_bounds_from_below() -> None:
    random = np.random.default_rng(6)
    table, exact = NOTHING, {0.0: 0.0}
    for _ in range(12):
        amount, share = random.uniform(0.01, 0.2, 2), random.uniform(0.1, 1.0, 2)
        table = table.with_group(amount, share)
        fresh = dict(exact)
        for supply, price in exact.items():
            for a, s in zip(amount.tolist(), share.tolist(), strict=True):
                key = min(1.0, round(supply + a, 4))
                fresh[key] = min(fresh.get(key, np.inf), price + s)
        exact = fresh
    assert len(table.sums[1]) == 0
    for need in np.linspace(0.05, 0.99, 40):
        least = min((price for supply, price in exact.items() if supply >= need - 2e-3), default=np.inf)
        assert table.price_of(float(need)) <= max(least, 0.0) + 0.2
    joined = Table.joined([table, NOTHING, table])
    assert joined.prices[0].tolist() == [0, len(table.prices[1]), len(table.prices[1]), 2 * len(table.prices[1])]
