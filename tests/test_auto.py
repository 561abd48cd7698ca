"""The default engine: proofs, deadlines, starts, blocks, and models of other forms."""

from __future__ import annotations

import math
import time

import numpy as np
import pytest
from scipy.sparse import block_diag

pytest.importorskip("numba")

import pscover
from pscover import EngineFailed, Settings, Status, isolate, registry
from pscover.backends._course import Course
from pscover.backends._kernels import await_kernels, least_step
from pscover.backends._neighbourhoods import Neighbourhoods
from pscover.backends._session import Session
from pscover.engine.unreduced import unreduced
from pscover.engine.warm import warming
from pscover.generate.psc import random_psc
from pscover.instance import Instance
from pscover.model import as_cover
from pscover.presolve import presolve
from pscover.result import Answer, Progress, Stop, ignore

OURS = ("auto", "local-search", "lagrangian")


@pytest.fixture(scope="module", autouse=True)
def _ready() -> None:
    """Compiling is not what these tests are about."""
    warming().wait(120.0)
    assert warming().error is None


@pytest.mark.parametrize("clique_size", [None, 3])
def test_agrees_with_highs(clique_size: int | None) -> None:
    for seed in range(6):
        instance = random_psc(15, 70, covers=3, clique_size=clique_size, cheapest=1, dearest=3, required=0.9, seed=seed)
        exact = pscover.solve(instance, backend="highs")
        ours = pscover.solve(instance, backend="auto")
        assert ours.status == exact.status
        if exact.has_plan:
            assert ours.objective == pytest.approx(exact.objective)
            assert pscover.verify(instance, ours).passed


def test_blocks_are_solved_apart() -> None:
    drawn = [random_psc(4, 14, covers=2, clique_size=2, required=0.9, seed=seed) for seed in range(16)]
    parts = [part for part in drawn if pscover.solve(part, backend="highs").has_plan]
    assert len(parts) > 8
    p = block_diag([part.probability for part in parts], format="csc")
    required = np.concatenate([part.required for part in parts])
    cliques = [clique + 14 * k for k, part in enumerate(parts) for clique in part.conflicts]
    result = pscover.solve(Instance.of(p, required, 1.0, cliques), backend="auto")
    assert result.status is Status.OPTIMAL
    assert result.objective == sum(pscover.solve(part, backend="highs").objective for part in parts)


def hard(seed: int = 0) -> Instance:
    return random_psc(150, 2000, covers=6, required=0.97, clique_size=5, dearest=20, seed=seed)


@pytest.mark.parametrize("name", OURS)
def test_deadline_and_trace(name: str) -> None:
    result = pscover.solve(hard(), backend=name, time=1.0)
    assert result.has_plan
    assert result.stop in (Stop.TIME, Stop.FINISHED)
    assert result.timing.total < 3.0
    objectives = [step.objective for step in result.trace]
    bounds = [step.bound for step in result.trace]
    assert objectives == sorted(objectives, reverse=True)
    assert bounds == sorted(bounds)
    assert result.bound <= result.objective


@pytest.mark.parametrize("name", OURS)
def test_the_observer_ends_it(name: str) -> None:
    began = time.monotonic()
    result = pscover.solve(hard(), backend=name, observe=lambda progress: progress.objective < math.inf, time=30.0)
    assert time.monotonic() - began < 15
    assert result.stop is Stop.OBSERVER
    assert result.has_plan


@pytest.mark.parametrize("name", OURS)
def test_what_the_observer_raises_comes_out(name: str) -> None:
    def observe(progress: Progress) -> bool:
        raise LookupError("no more")

    with pytest.raises(LookupError, match="no more"):
        pscover.solve(hard(), backend=name, observe=observe, time=5.0)


@pytest.mark.parametrize("name", OURS)
def test_a_start_is_never_lost(name: str) -> None:
    instance = hard()
    good = pscover.solve(instance, backend="local-search", time=1.0)
    assert good.chosen is not None
    again = pscover.solve(instance, backend=name, start=good.chosen.tolist(), time=0.3)
    assert again.objective <= good.objective


def test_local_search_depends_on_seed_and_moves_only() -> None:
    engine = registry.backend("local-search", {"moves": "3000"})
    results = [pscover.solve(hard(), backend=engine, seed=seed) for seed in (4, 4, 5)]
    plans = [None if result.chosen is None else result.chosen.tolist() for result in results]
    assert plans[0] == plans[1]
    assert plans[0] is not None
    assert plans[0] != plans[2]


def test_infeasible_is_proven() -> None:
    instance = Instance.of([[0.9, 0.0], [0.0, 0.9]], required=0.7, conflicts=[(0, 1)])
    assert pscover.solve(instance, backend="auto").status is Status.INFEASIBLE


def test_other_models_go_to_highs() -> None:
    instance = random_psc(5, 12, covers=2, seed=1)
    form = registry.formulation("budgeted", {"budget": "3"})
    ours, exact = (pscover.solve(instance, backend=name, formulation=form) for name in ("auto", "highs"))
    assert ours.status is exact.status is Status.OPTIMAL
    assert ours.objective == pytest.approx(exact.objective)


def test_nothing_to_cover() -> None:
    for name in OURS:
        result = pscover.solve(Instance.of([[0.5, 0.5]], required=0.0), backend=name)
        assert result.status is Status.OPTIMAL
        assert result.objective == 0


def test_waiting_for_kernels_looks_at_the_clock(monkeypatch: pytest.MonkeyPatch) -> None:
    from pscover.engine import warm

    class Never:
        error = None
        is_done = False

        def wait(self, seconds: float) -> bool:
            time.sleep(seconds)
            return False

    monkeypatch.setattr(warm, "warming", Never)
    model = registry.formulation("clique").build(hard())
    assert not await_kernels(Session(model, Settings(time=0.05), ignore))
    for name in OURS:
        result = pscover.solve(hard(), backend=name, time=0.5)
        assert result.has_plan, name
        assert result.stop is Stop.TIME


def test_least_step() -> None:
    assert least_step(np.array([4.0, 6.0, 10.0])) == 2
    assert least_step(np.array([0.5, 1.0])) == 0
    assert least_step(np.zeros(0)) == 0


def test_the_plan_survives_an_engine_that_dies(monkeypatch: pytest.MonkeyPatch) -> None:
    calls: list[object] = []

    def died(*given: object) -> Answer:
        calls.append(given)
        raise EngineFailed("the process of backend 'highs' died")

    monkeypatch.setattr(isolate, "run", died)
    model = registry.formulation("clique").build(random_psc(40, 200, covers=4, dearest=90, required=0.95, seed=1))
    form = as_cover(model)
    course = Course(form, presolve(form), Session(model, Settings(time=30.0), ignore), 0.5)
    block = max(course.blocks, key=lambda one: len(one.columns))
    while block.plan is None:
        block.search()
    plan = block.plan
    course._branch(block)
    assert not course._exchange(block, Neighbourhoods(block.form, block.reduced, 0))
    assert len(calls) == 2
    assert block.is_open
    assert block.plan is plan


def test_searches_that_end_leave_their_plans() -> None:
    model = registry.formulation("clique").build(random_psc(30, 150, covers=4, dearest=90, required=0.95, seed=2))
    form = as_cover(model)
    block = Course(form, unreduced(form), Session(model, Settings(time=30.0), ignore), 0.5).blocks[0]
    assert block.is_varied
    while len(block.quest.others) < 2:
        block.search()
        if block.has_core:
            block.refocus()
        elif block.is_idle:
            while not block.has_core:
                block.bind()
    costs = [float(form.c[plan].sum()) for plan in block.quest.others]
    assert costs == sorted(costs)
    assert costs[0] == block.cost
    assert all((form.W[:, plan].sum(axis=1) >= 1 - 1e-9).all() for plan in block.quest.others)
