"""The sweep over cliques against enumeration, and the tables that bound it against all sums."""

from __future__ import annotations

import itertools
import math

import numpy as np
import pytest
from scipy.sparse import csr_array

from pscover.model import CoverForm, as_cover

pytest.importorskip("numba")

from pscover import registry
from pscover.engine import sweep as sweeping
from pscover.engine.block import Block
from pscover.engine.problem import Problem, problem_of
from pscover.engine.route import route
from pscover.engine.rowwise import Shares, improve, shares
from pscover.engine.subgradient import multipliers
from pscover.engine.sweep import Sweep, worth
from pscover.engine.tables import SUMS, UNITS, fill
from pscover.enumeration import enumerate_best
from pscover.generate.psc import random_psc
from pscover.goal import Cover


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


def priced(form: CoverForm, cost: float, step: float) -> tuple[Problem, Shares, float, np.ndarray]:
    """Prices after a few steps, the bound that they prove, and what no better plan has."""
    problem, _ = problem_of(form)
    prices = shares(problem, multipliers(problem).y)
    bound = improve(problem, prices, 10, cost)
    return problem, prices, bound, bound + prices.penalty > worth(cost, step) + 1e-7


def swept(form: CoverForm, cost: float, step: float) -> Sweep:
    """A sweep that has ended."""
    problem, prices, bound, out = priced(form, cost, step)
    found = Sweep(problem, prices, out, bound, step)
    while not found.is_finished:
        assert not found.has_given_up
        found.turn(1, worth(cost, step))
    return found


@pytest.mark.parametrize("whole", [True, False])
@pytest.mark.parametrize("seed", range(6))
def test_finds_the_best_plan_or_that_there_is_none_better(seed: int, whole: bool) -> None:
    form, step = chain(seed, whole=whole), 1.0 if whole else 0.0
    least = best(form)
    assert swept(form, least, step).plan is None
    plan = swept(form, least + 1.0, step).plan
    assert plan is not None
    assert form.c[plan].sum() == pytest.approx(least)
    assert (form.W[:, plan].sum(axis=1) >= 1 - 1e-8).all()
    assert (form.P[:, plan].sum(axis=1) <= 1).all()


@pytest.mark.parametrize("seed", range(6))
def test_needs_no_prices(seed: int) -> None:
    form = chain(seed)
    cost = best(form) + 2.0
    problem, prices, _, _ = priced(form, cost, 1.0)
    prices.kept[:] = 0.0
    sweep = Sweep(problem, prices, np.zeros(problem.candidates, dtype=np.bool_), 0.0, 1.0)
    assert sweep.turn(10**9, worth(cost, 1.0))
    assert sweep.plan is not None
    assert form.c[sweep.plan].sum() == cost - 2.0


@pytest.mark.parametrize("clique_size", [None, 2, 4])
def test_agrees_with_enumeration_on_random_instances(clique_size: int | None) -> None:
    """No best plan is lost where rows, cliques and needs are of any kind, with the prices a block uses."""
    seen = 0
    for seed in range(40):
        instance = random_psc(
            4, 14, covers=2, clique_size=clique_size, required=0.7, low=0.15, high=0.8, cheapest=1, dearest=3, seed=seed
        )
        least, _ = enumerate_best(instance, Cover())
        if least is None:
            continue
        form = as_cover(registry.formulation("clique").build(instance))
        assert swept(form, least[0], 1.0).plan is None
        plan = swept(form, least[0] + 1.0, 1.0).plan
        assert plan is not None
        problem, columns = problem_of(form)
        assert problem.cost[plan].sum() == least[0]
        assert (instance.coverage(columns[plan]) >= instance.required - 1e-9).all()
        seen += 1
    assert seen > 5


def test_a_block_finds_the_best_plan_or_that_there_is_none() -> None:
    ends = set()
    for seed, clique_size in itertools.product(range(20), (None, 3, 5)):
        instance = random_psc(
            4, 14, covers=2, clique_size=clique_size, required=0.8, low=0.1, high=0.8, cheapest=1, dearest=2, seed=seed
        )
        least, _ = enumerate_best(instance, Cover())
        form = as_cover(registry.formulation("clique").build(instance))
        block = Block(form, np.arange(14, dtype=np.int32), 0, 1.0)
        for _ in range(500):
            if block.is_open:
                block.explore()
        assert not block.is_open
        assert block.is_infeasible == (least is None)
        assert least is None or (block.cost, block.bound) == (least[0], least[0])
        ends.add(block.is_infeasible)
    assert ends == {True, False}


def test_turns_do_not_change_what_is_done() -> None:
    form = chain(3)
    ends = []
    for work in (1, 10**9):
        problem, prices, bound, out = priced(form, 8.0, 1.0)
        sweep = Sweep(problem, prices, out, bound, 1.0)
        while not (sweep.is_finished or sweep.has_given_up):
            sweep.turn(work, worth(8.0, 1.0))
        ends.append((sweep.work, sweep.target, None if sweep.plan is None else sweep.plan.tolist()))
    assert ends[0] == ends[1]


def test_gives_up_where_there_are_too_many_partial_plans(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(sweeping, "MOST", 1)
    problem, prices, _, out = priced(chain(0), 20.0, 1.0)
    sweep = Sweep(problem, prices, out, 0.0, 0.0)
    sweep.turn(10**9, 20.0)
    assert sweep.has_given_up
    assert not sweep.is_finished
    assert sweep.plan is None


def test_the_route_takes_every_clique_once_and_keeps_few_rows() -> None:
    problem, prices, _, out = priced(chain(1), 20.0, 0.0)
    stages, _ = route(problem, prices, out)
    picks = [i for stage in stages for i in stage.picks.tolist() if i >= 0]
    assert len(picks) == len(set(picks))
    assert max(int(stage.slots.max()) for stage in stages) <= 3
    starts = sum(int(stage.fresh.sum()) for stage in stages)
    assert starts == problem.rows


def tables(amounts: list[np.ndarray], shares_: list[np.ndarray]) -> tuple[np.ndarray, ...]:
    """What a row costs before and after each of its cliques, what sums are left, and their number."""
    many = len(amounts)
    before, after, sums = np.empty((many, UNITS + 1)), np.empty((many, UNITS + 1)), np.empty((many, SUMS))
    size, full = np.empty(many, dtype=np.int32), np.empty(1)
    start = np.cumsum([0, *map(len, amounts)]).astype(np.int32)
    fill(
        np.zeros(many, dtype=np.int32),
        start,
        np.concatenate(amounts),
        np.concatenate(shares_),
        before,
        after,
        sums,
        size,
        full,
    )
    assert full[0] == before[0, UNITS]
    return before, after, sums, size


def test_tables_bound_all_choices_closely_and_know_their_sums() -> None:
    random = np.random.default_rng(5)
    amounts, prices = [random.uniform(0.05, 0.4, 2) for _ in range(5)], [random.uniform(0.0, 1.0, 2) for _ in range(5)]
    before, after, sums, size = tables(amounts, prices)
    found: list[tuple[float, float]] = []
    for picks in itertools.product(range(3), repeat=4):
        held = [(amounts[g + 1][k - 1], prices[g + 1][k - 1]) for g, k in enumerate(picks) if k]
        found.append((min(1.0, sum(amount for amount, _ in held)), sum(price for _, price in held)))
    assert (after[0] == before[1]).all()
    assert (after[-1, 1:] == np.inf).all()
    known = np.unique(np.round([supply for supply, _ in found if supply > 0], 12))
    assert np.unique(np.round(sums[0, : size[0]], 12)).tolist() == known.tolist()
    for need in random.uniform(0.01, 1.0, 50):
        least = min((price for supply, price in found if supply >= need), default=np.inf)
        nearly = min((price for supply, price in found if supply >= need - 5 / UNITS), default=np.inf)
        assert nearly - 1e-12 <= after[0, math.ceil(need * UNITS)] <= least + 1e-12


def test_too_many_sums_are_not_told() -> None:
    random = np.random.default_rng(6)
    amounts = [random.uniform(0.01, 0.2, 2) for _ in range(12)]
    _, _, sums, size = tables(amounts, [np.ones(2)] * 12)
    assert size[0] == 0
    assert size[-2] == 2
    assert sums[-2, :2].tolist() == sorted(amounts[-1].tolist())
    assert (np.diff(sums[-4, : size[-4]]) > 0).all()
