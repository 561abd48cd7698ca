"""Bounds never exceed the best plan, and exact search is exact."""

from __future__ import annotations

import itertools
from collections.abc import Iterator

import numpy as np
import pytest

pytest.importorskip("numba")

import pscover
from pscover import registry
from pscover.engine.block import Block
from pscover.engine.merging import BRIEF, Merging
from pscover.engine.problem import Problem, problem_of
from pscover.engine.replaced import stand_ins
from pscover.engine.rowwise import improve, shares, tolled, tolls
from pscover.engine.subgradient import ascend, multipliers
from pscover.engine.tree import Branching
from pscover.enumeration import enumerate_best
from pscover.generate.psc import random_psc
from pscover.goal import Cover
from pscover.instance import Instance
from pscover.model import as_cover
from pscover.testing import random_instance


def cases(count: int = 60) -> Iterator[tuple[Instance, Problem, np.ndarray, float | None]]:
    random = np.random.default_rng(31)
    for _ in range(count):
        instance = random_instance(random)
        best, _ = enumerate_best(instance, Cover())
        problem, columns = problem_of(as_cover(registry.formulation("clique").build(instance)))
        if (np.diff(problem.rptr) > 0).all():
            yield instance, problem, columns, None if best is None else best[0]


def test_subgradient_bounds_hold() -> None:
    close = seen = 0
    for _, problem, _, best in cases():
        if best is None:
            continue
        state = multipliers(problem)
        bound = ascend(problem, state, 300, best * 1.1 + 1)
        assert bound <= best + 1e-7
        close += bound > 0.6 * best
        seen += 1
    assert close > seen / 2


def test_rows_one_by_one_bound_more_than_multipliers() -> None:
    better = 0
    for _, problem, _, best in cases():
        if best is None or best == 0:
            continue
        state = multipliers(problem)
        plain = ascend(problem, state, 300, best)
        parts = shares(problem, state.kept)
        sums = np.bincount(parts.candidate, parts.share, problem.candidates)
        assert (sums <= problem.cost * (1 + 1e-9)).all()
        bound = improve(problem, parts, 60, best)
        assert bound <= best + 1e-7
        assert (np.bincount(parts.candidate, parts.kept, problem.candidates) <= problem.cost * (1 + 1e-9)).all()
        better += bound > plain + 1e-6
    assert better >= 5


def test_shares_are_never_negative() -> None:
    random = np.random.default_rng(5)
    for seed in range(20):
        instance = random_psc(12, 60, covers=3, cheapest=1, dearest=100, low=0.3, seed=seed)
        problem, _ = problem_of(as_cover(registry.formulation("clique").build(instance)))
        for _ in range(20):
            # So dear that costs are shared out to the last digit, and rows that pay nothing.
            y = np.where(random.random(problem.rows) < 0.5, 0.0, random.uniform(0.0, 80.0, problem.rows))
            prices = shares(problem, y)
            assert (prices.share >= 0.0).all()
            assert np.bincount(prices.candidate, prices.share) == pytest.approx(problem.cost)


def test_tolls_keep_what_multipliers_prove() -> None:
    dearer = 0
    for seed in range(30):
        instance = random_psc(4, 15, covers=2, clique_size=3, required=0.9, cheapest=2, dearest=3, seed=seed)
        problem, _ = problem_of(as_cover(registry.formulation("clique").build(instance)))
        best, _ = enumerate_best(instance, Cover())
        if best is None:
            continue
        state = multipliers(problem)
        plain = ascend(problem, state, 300, best[0])
        raised, extra = tolled(problem, tolls(problem, state.kept))
        bound = improve(raised, shares(raised, state.kept), 60, best[0] + extra) - extra
        assert plain - 1e-6 <= bound <= best[0] + 1e-7
        dearer += extra > 1e-6
    assert dearer >= 10


def test_branch_and_bound_after_tolls_loses_no_plan() -> None:
    tolled_ones = 0
    for seed in range(30):
        instance = random_psc(4, 15, covers=2, clique_size=3, required=0.9, cheapest=2, dearest=3, seed=seed)
        best, plan = enumerate_best(instance, Cover())
        if best is None:
            continue
        form = as_cover(registry.formulation("clique").build(instance))
        block = Block(form, np.arange(15, dtype=np.int32), 0, 1.0)
        taken = np.concatenate([np.array(plan), *(clique for clique in instance.conflicts if np.isin(clique, plan).any())])
        spare = np.setdiff1d(np.arange(15), taken)[:1]
        block.offer(np.union1d(plan, spare).astype(np.int32))
        while not block.is_settled and block.is_open:
            block.bind()
            assert block.bound <= best[0] + 1e-7
            if block.shares is None or not block.is_open:
                continue
            paid = np.bincount(block.shares.candidate, block.shares.share, block.problem.candidates)
            if (paid <= block.problem.cost * (1 + 1e-9)).all():
                continue
            tolled_ones += 1
            if block.cost > best[0] + 0.5:
                assert not block._hopeless()[np.isin(block.kept, plan)].any()
            explored(block)
            assert block.cost == pytest.approx(best[0])
    assert tolled_ones >= 5


def test_bounds_rise_and_hold_while_there_is_no_plan() -> None:
    risen = 0
    for seed in range(12):
        instance = random_psc(12, 60, covers=3, clique_size=4, required=0.9, cheapest=2, dearest=9, seed=seed)
        best = pscover.solve(instance, backend="highs")
        if not best.has_plan:
            continue
        form = as_cover(registry.formulation("clique").build(instance))
        block = Block(form, np.arange(60, dtype=np.int32), 0, 1.0)
        assert not block._price() or block.plan is None
        first = float(block.shares.value[0]) if block.shares is not None else 0.0
        for _ in range(40):
            block._tighten()
            assert block.bound <= best.objective + 1e-7
        assert block.shares is not None
        assert np.isfinite(block.shares.share).all()
        risen += float(block.shares.value[0]) > first + 0.1
    assert risen >= 3


def explored(block: Block) -> None:
    """A block to the end of branch and bound, whose prices never add up to more than candidates cost."""
    while block.is_open:
        block.explore()
        assert block.shares is not None
        paid = np.bincount(block.shares.candidate, block.shares.share, block.problem.candidates)
        assert block._exact is None or (paid <= block.problem.cost * (1 + 1e-9)).all()


def test_merged_rows_bound_plans() -> None:
    risen = 0
    for instance, problem, columns, best in cases():
        if best is None or best == 0:
            continue
        prices = shares(problem, multipliers(problem).y)
        apart = improve(problem, prices, 40, best)
        form = as_cover(registry.formulation("clique").build(instance))
        merging = Merging(form, columns, prices, BRIEF)
        assert merging.bound == pytest.approx(apart, abs=1e-6)
        while not merging.is_finished:
            before = merging.bound
            has_risen = merging.turn()
            assert merging.bound > before if has_risen else merging.bound == pytest.approx(before)
        assert merging.bound <= best + 1e-7
        risen += merging.bound > apart + 1e-6
    assert risen >= 3


def test_penalties_bound_plans_with_a_candidate() -> None:
    for instance, problem, columns, best in cases(25):
        if best is None:
            continue
        parts = shares(problem, multipliers(problem).y)
        bound = improve(problem, parts, 30, best + 1)
        for k, i in enumerate(columns):
            cost = instance.cost.copy()
            cost[np.arange(len(cost)) != i] += 0
            forced = Instance.of(instance.probability, instance.required, _discounted(cost, i), instance.conflicts)
            with_it, plan = enumerate_best(forced, Cover())
            if with_it is not None and i in plan:
                least = with_it[0] + cost[i] - 1e-6 * cost[i]
                assert bound + parts.penalty[k] <= least + 1e-6


def _discounted(cost: np.ndarray, i: int) -> np.ndarray:
    """Costs under which candidate i is next to free."""
    changed = cost.copy()
    changed[i] = 1e-6 * cost[i]
    return changed


def finish(problem: Problem, upper: float = np.inf, step: float = 0.0) -> np.ndarray | None:
    """The best plan below `upper`, None if there is none; in short turns, so that it is resumed often."""
    search = tree(problem, upper, step)
    while not search.is_finished:
        assert search.work < 10_000_000
        search.turn(500)
    return search.plan


def tree(problem: Problem, upper: float = np.inf, step: float = 0.0) -> Branching:
    """A search with prices that nobody improved."""
    return Branching(problem, shares(problem, multipliers(problem).y), upper, step)


def test_branching_is_exact() -> None:
    for _, problem, _, best in cases(80):
        plan = finish(problem)
        if best is None:
            assert plan is None
        else:
            assert plan is not None
            assert problem.cost[plan].sum() == pytest.approx(best, abs=1e-9)
            assert finish(problem, upper=best) is None


def entangled(seed: int) -> Instance:
    """Candidates with different costs, most of them in several cliques; some instances have no plan."""
    random = np.random.default_rng(seed)
    drawn = random_psc(4, 12, covers=2, required=0.75, low=0.3, high=0.9, seed=seed)
    pairs = [pair for pair in itertools.combinations(range(12), 2) if random.random() < 0.3]
    return Instance.of(drawn.probability, drawn.required, random.uniform(0.5, 2.0, 12), conflicts=np.array(pairs))


def test_branching_is_exact_where_candidates_are_in_several_cliques() -> None:
    ends = set()
    for seed in range(40):
        instance = entangled(seed)
        best, _ = enumerate_best(instance, Cover())
        form = as_cover(registry.formulation("clique").build(instance))
        problem, _ = problem_of(form)
        block = Block(form, np.arange(12, dtype=np.int32), 0, 0.0)
        assert not problem.is_split
        if (np.diff(problem.rptr) == 0).any():
            continue
        plan = finish(problem)
        assert (None if plan is None else problem.cost[plan].sum()) == (None if best is None else pytest.approx(best[0]))
        assert plan is None or best is None or finish(problem, upper=best[0]) is None
        for _ in range(200):
            if block.is_open:
                block.explore()
        assert not block.is_open
        assert block.is_infeasible == (best is None)
        assert best is None or [block.cost, block.bound] == pytest.approx([best[0], best[0]])
        ends.add(block.is_infeasible)
    assert ends == {True, False}


def test_branching_is_exact_in_whole_steps() -> None:
    """Plans whose costs differ by exactly the step count as better."""
    for seed in range(12):
        instance = random_psc(4, 14, covers=2, clique_size=2, required=0.9, cheapest=2, dearest=2, seed=seed)
        best, _ = enumerate_best(instance, Cover())
        problem, _ = problem_of(as_cover(registry.formulation("clique").build(instance)))
        plan = finish(problem, step=2.0)
        assert (None if plan is None else (float(problem.cost[plan].sum()),)) == best


@pytest.mark.parametrize("clique_size", [None, 4])
def test_branching_agrees_with_highs(clique_size: int | None) -> None:
    import pscover

    for seed in range(4):
        instance = random_psc(12, 60, covers=3, clique_size=clique_size, cheapest=1, dearest=3, low=0.3, seed=seed)
        exact = pscover.solve(instance, backend="highs")
        problem, columns = problem_of(as_cover(registry.formulation("clique").build(instance)))
        plan = finish(problem, step=1.0)
        if exact.chosen is None:
            assert plan is None
        else:
            assert plan is not None
            assert problem.cost[plan].sum() == exact.objective
            assert (instance.coverage(columns[plan]) >= instance.required - 1e-9).all()


def test_branching_depends_on_work_only_and_its_bound_holds() -> None:
    problem, _ = problem_of(as_cover(registry.formulation("clique").build(random_psc(20, 60, covers=3, seed=1))))
    once, often = tree(problem, step=1.0), tree(problem, step=1.0)
    while not once.is_finished:
        once.turn(10_000_000)
    assert once.plan is not None
    best = problem.cost[once.plan].sum()
    while not often.is_finished:
        often.turn(2_000)
        assert often.is_finished or often.lower <= best + 1e-6
    assert once.plan is not None
    assert often.plan is not None
    assert once.plan.tolist() == often.plan.tolist()
    assert once.nodes == often.nodes


def test_what_another_of_the_clique_replaces_is_the_same_as_in_presolve() -> None:
    from pscover.presolve import presolve

    for seed in range(6):
        instance = random_psc(8, 60, covers=3, clique_size=6, low=0.2, high=0.9, seed=seed)
        form = as_cover(registry.formulation("clique").build(instance))
        problem, columns = problem_of(form)
        once = presolve(form, steps=("clique-dominance",)).columns
        found = stand_ins(problem)
        assert columns[np.unique(found)].tolist() == once.tolist()
        W = form.W[:, columns].toarray()
        assert (W[:, found] >= W).all()
        assert (problem.cost[found] <= problem.cost).all()
        assert (problem.home[found] == problem.home).all()


@pytest.mark.parametrize("clique_size", [None, 4])
def test_leaving_candidates_out_keeps_the_best_plan(clique_size: int | None) -> None:
    """A block that only bounds and fixes, from a plan at hand, never claims a bound above the optimum."""
    import pscover

    for seed in range(6):
        instance = random_psc(12, 90, covers=3, clique_size=clique_size, cheapest=1, dearest=4, seed=seed)
        exact = pscover.solve(instance, backend="highs")
        form = as_cover(registry.formulation("clique").build(instance))
        block = Block(form, np.arange(90, dtype=np.int32), 0, 1.0)
        for _ in range(300):
            block.search()
            block.bind()
            if not block.is_open or block.is_settled:
                break
        assert block.cost >= exact.objective - 1e-9
        assert block.bound <= exact.objective + 1e-9
