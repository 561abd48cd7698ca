"""The engines themselves, called without `pscover.solve`.

OR-tools and highspy cannot be loaded into one process, so CP-SAT always runs in a worker; the others run here.
"""

from __future__ import annotations

import math
import subprocess
import sys
from collections.abc import Callable, Iterator
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from scipy.sparse import csr_array

from pscover import isolate, registry
from pscover.clock import Clock
from pscover.enumeration import enumerate_best
from pscover.goal import Cover
from pscover.instance import Instance
from pscover.model import Model, as_cover
from pscover.result import Answer, Observer, Progress, Settings, Status, Stop, ignore
from pscover.solve import solve as run_solve
from pscover.testing import random_instance

BACKENDS = registry.names("backend")
EXACT = [name for name in BACKENDS if registry.lookup("backend", name).exact]
HEURISTIC = [name for name in BACKENDS if name not in EXACT]
TAKING_STARTS = ("highs", "scip", "cpsat")
TRACING = ("highs", "scip", "cpsat", "lp-rounding")


def solve(name: str, model: Model, settings: Settings | None = None, observe: Observer = ignore) -> Answer:
    found = registry.lookup("backend", name)
    for package in found.requires:
        pytest.importorskip(package) if package != "ortools" else _needs_ortools()
    settings = settings or Settings()
    if name == "cpsat":
        return isolate.run(found(), model, settings, observe, Clock(120.0))
    answer: Answer = found().solve(model, settings, observe)
    return answer


def _needs_ortools() -> None:
    if registry.missing(registry.lookup("backend", "cpsat")):
        pytest.skip("needs ortools")


def clique_model(instance: Instance) -> Model:
    return registry.formulation("clique").build(instance)


def model(c: Any, A: Any, lo: Any, hi: Any, **changes: Any) -> Model:
    matrix = csr_array(np.array(A, dtype=np.float64).reshape(len(lo), len(c)))
    built = Model(
        c=np.array(c, dtype=np.float64),
        A=matrix,
        lo=np.array(lo, dtype=np.float64),
        hi=np.array(hi, dtype=np.float64),
        ub=np.ones(len(c)),
        integer=np.ones(len(c), dtype=np.bool_),
        candidates=len(c),
    )
    return replace(built, **changes)


def piles(seed: int = 0, *, elements: int = 60, candidates: int = 600, entries: int = 10, clique: int = 10) -> Instance:
    """Too hard to be solved while a test runs, easy to find plans for."""
    random = np.random.default_rng(seed)
    p = np.zeros((elements, candidates))
    for i in range(candidates):
        p[random.choice(elements, entries, replace=False), i] = random.uniform(0.05, 0.4, entries)
    return Instance.of(p, 0.6, 1.0, random.permutation(candidates).reshape(-1, clique))


class Recorder:
    """An observer that keeps what it is told and asks to stop after a number of plans."""

    def __init__(self, plans: float = math.inf) -> None:
        self.plans = plans
        self.told: list[Progress] = []

    def __call__(self, progress: Progress) -> bool:
        self.told.append(progress)
        return len(self.found) >= self.plans

    @property
    def found(self) -> list[Progress]:
        return [progress for progress in self.told if progress.chosen is not None]


TWO = Instance.of([[0.8, 0.0, 0.9, 0.5], [0.0, 0.8, 0.1, 0.5]], required=0.7, cost=[2, 2, 5, 1], conflicts=[(0, 3)])
"""Best are candidates 0 and 1 for 4; who takes 3, the most for its cost, is barred from 0 and ends with 1 and 2 for 7."""


@pytest.mark.parametrize("name", BACKENDS)
def test_hand_made(name: str) -> None:
    answer = solve(name, clique_model(TWO))
    assert answer.chosen is not None
    assert answer.chosen.dtype == np.int32
    assert answer.chosen.tolist() in ([0, 1], [1, 2])
    assert answer.bound <= 4 + 1e-9
    if name in EXACT:
        assert answer.chosen.tolist() == [0, 1]
        assert (answer.status, answer.stop) == (Status.OPTIMAL, Stop.FINISHED)
        assert answer.bound == pytest.approx(4)


@pytest.mark.parametrize("name", BACKENDS)
def test_the_offset_is_part_of_objective_and_bound(name: str) -> None:
    seen = Recorder()
    answer = solve(name, replace(clique_model(TWO), offset=10.5), observe=seen)
    assert answer.chosen is not None
    assert seen.found[-1].objective == pytest.approx(10.5 + TWO.cost[answer.chosen].sum())
    assert 10.5 <= answer.bound <= 14.5 + 1e-9
    if name in EXACT:
        assert answer.bound == pytest.approx(14.5)


@pytest.mark.parametrize("name", BACKENDS)
def test_fractional_costs(name: str) -> None:
    answer = solve(name, clique_model(Instance.of(TWO.probability, 0.7, [0.21, 0.22, 0.55, 0.1], [(0, 3)])))
    assert answer.chosen is not None
    assert answer.bound <= 0.43 + 1e-9
    if name in EXACT:
        assert answer.chosen.tolist() == [0, 1]
        assert answer.bound == pytest.approx(0.43)


@pytest.mark.parametrize("name", BACKENDS)
def test_agrees_with_enumeration(name: str) -> None:
    random = np.random.default_rng(11)
    seen = set()
    for _ in range(12):
        instance = random_instance(random)
        best, _ = enumerate_best(instance, Cover())
        answer = solve(name, clique_model(instance), Settings(seed=3))
        seen.add(answer.status)
        if best is None:
            assert answer.chosen is None
            assert answer.status is Status.INFEASIBLE or (answer.status is Status.UNKNOWN and name in HEURISTIC)
            continue
        assert answer.status is not Status.INFEASIBLE
        assert answer.bound <= best[0] + 1e-6
        if answer.chosen is not None:
            assert (instance.required - instance.coverage(answer.chosen)).max(initial=0.0) <= 1e-7
            assert not len(instance.conflicts.broken_by(answer.chosen))
            cost = float(instance.cost[answer.chosen].sum())
            assert cost >= best[0] - 1e-9
            if answer.status is Status.OPTIMAL:
                assert cost == pytest.approx(best[0])
        if name in EXACT:
            assert answer.status is Status.OPTIMAL
    assert len(seen) > 1


@pytest.mark.parametrize("name", BACKENDS)
def test_supply_too_small_is_proven_infeasible(name: str) -> None:
    seen = Recorder()
    answer = solve(name, clique_model(Instance.of([[0.3, 0.3], [0.9, 0.0]], required=0.7)), observe=seen)
    assert (answer.status, answer.chosen, seen.found) == (Status.INFEASIBLE, None, [])


@pytest.mark.parametrize("name", BACKENDS)
def test_conflicts_that_leave_no_plan(name: str) -> None:
    """Each element needs its own candidate, and these exclude each other; halves of both satisfy no relaxation either."""
    answer = solve(name, clique_model(Instance.of([[0.9, 0.0], [0.0, 0.9]], required=0.7, conflicts=[(0, 1)])))
    assert answer.chosen is None
    assert answer.status is (Status.UNKNOWN if name in ("greedy", "local-search") else Status.INFEASIBLE)


@pytest.mark.parametrize("name", BACKENDS)
def test_no_variables(name: str) -> None:
    nothing = model([], [], [], [], offset=3.0)
    answer = solve(name, nothing)
    assert answer.status is Status.OPTIMAL
    assert answer.chosen is not None
    assert len(answer.chosen) == 0
    assert answer.bound == pytest.approx(3.0)
    assert solve(name, model([], [], [1.0], [np.inf])).status is Status.INFEASIBLE


@pytest.mark.parametrize("name", BACKENDS)
def test_no_rows(name: str) -> None:
    answer = solve(name, model([1.0, 2.0], [], [], []))
    assert (answer.status, answer.bound) == (Status.OPTIMAL, 0.0)
    assert answer.chosen is not None
    assert len(answer.chosen) == 0


@pytest.mark.parametrize("name", BACKENDS)
def test_a_row_without_entries(name: str) -> None:
    assert solve(name, model([1.0], [[0.0]], [1.0], [np.inf])).status is Status.INFEASIBLE
    assert solve(name, model([1.0], [[0.0]], [-np.inf], [1.0])).status is Status.OPTIMAL


@pytest.mark.parametrize("name", EXACT)
def test_continuous_and_general_integer_variables(name: str) -> None:
    mixed = model([3.0, 1.0, 1.0], [[1, 1, 0], [0, 1, -1], [1, 0, 1]], [1.5, -np.inf, 1.0], [np.inf, 0.25, 4.0])
    mixed = replace(mixed, ub=np.array([1.0, 2.0, 2.0]), candidates=1)
    whole = solve(name, mixed)
    assert whole.status is Status.OPTIMAL
    assert whole.bound == pytest.approx(4.0)
    assert whole.chosen is not None
    assert len(whole.chosen) == 0
    split = replace(mixed, integer=np.array([True, False, False]))
    engine = registry.lookup("backend", name)()
    if engine.refuses(split) is None:
        assert solve(name, split).bound == pytest.approx(2.75)
        loose = solve(name, replace(mixed, integer=np.zeros(3, dtype=np.bool_)))
        assert loose.status is Status.OPTIMAL
        assert loose.bound == pytest.approx(2.75)


@pytest.mark.parametrize("name", [name for name in EXACT if name != "cpsat"])
def test_an_unbounded_model_is_neither_optimal_nor_infeasible(name: str) -> None:
    for integer in (True, False):
        odd = model([-1.0, 1.0], [[1, -1]], [0.0], [np.inf], ub=np.full(2, np.inf), integer=np.array([integer, integer]))
        answer = solve(name, odd)
        assert answer.status in (Status.UNKNOWN, Status.FEASIBLE)
        assert answer.bound == -math.inf
        assert answer.message


@pytest.mark.parametrize("name", TRACING)
def test_the_trace_improves(name: str) -> None:
    seen = Recorder()
    answer = solve(name, clique_model(piles()), Settings(time=2.0), seen)
    objectives = [progress.objective for progress in seen.found]
    assert objectives
    assert objectives == sorted(set(objectives), reverse=True)
    bounds = [progress.bound for progress in seen.told]
    assert bounds == sorted(bounds)
    assert all(progress.bound <= progress.objective for progress in seen.told)
    assert [progress.seconds for progress in seen.told] == sorted(progress.seconds for progress in seen.told)
    assert answer.status is Status.FEASIBLE
    assert answer.stop is (Stop.FINISHED if name == "lp-rounding" else Stop.TIME)
    assert answer.chosen is not None
    assert seen.found[-1].chosen is not None
    assert answer.chosen.tolist() == seen.found[-1].chosen.tolist()
    assert answer.bound >= bounds[-1]


@pytest.mark.parametrize("name", [*TRACING, "greedy"])
def test_the_observer_stops_it(name: str) -> None:
    seen = Recorder(plans=1)
    answer = solve(name, clique_model(piles()), Settings(time=60.0), seen)
    assert (answer.status, answer.stop) == (Status.FEASIBLE, Stop.OBSERVER)
    assert answer.chosen is not None
    # What an engine finds between the wish to stop and its end counts too.
    assert len(answer.chosen) <= seen.found[-1].objective
    assert Clock().elapsed < 60


@pytest.mark.parametrize("name", [name for name in BACKENDS if name != "cpsat"])
def test_what_the_observer_raises_comes_out(name: str) -> None:
    def interrupted(progress: Progress) -> bool:
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        solve(name, clique_model(piles()), Settings(time=2.0), interrupted)


@pytest.mark.parametrize("name", [name for name in EXACT if name != "cpsat"])
def test_a_time_limit_is_said(name: str) -> None:
    answer = solve(name, clique_model(piles()), Settings(time=1.0))
    assert answer.status in (Status.FEASIBLE, Status.UNKNOWN)
    assert answer.stop is Stop.TIME
    assert answer.bound <= 23


@pytest.mark.parametrize("name", BACKENDS)
def test_no_time_at_all(name: str) -> None:
    answer = solve(name, clique_model(piles()), Settings(time=1e-6))
    assert answer.status in (Status.FEASIBLE, Status.UNKNOWN)
    assert answer.stop is Stop.TIME


@pytest.mark.parametrize("name", BACKENDS)
def test_the_same_seed_gives_the_same_plan(name: str) -> None:
    small = clique_model(piles(elements=12, candidates=60, entries=4, clique=5))
    first, second = (solve(name, small, Settings(seed=7)) for _ in range(2))
    assert first.chosen is not None
    assert second.chosen is not None
    assert first.chosen.tolist() == second.chosen.tolist()
    assert first.bound == second.bound


@pytest.mark.parametrize("name", BACKENDS)
def test_a_gap_is_enough(name: str) -> None:
    answer = solve(name, clique_model(piles(elements=12, candidates=60, entries=4, clique=5)), Settings(gap=0.5))
    assert answer.chosen is not None
    if name in EXACT:
        assert answer.status is Status.OPTIMAL
        assert answer.bound >= 0.5 * len(answer.chosen) - 1e-6


@pytest.mark.parametrize("name", BACKENDS)
def test_a_start_is_never_lost(name: str) -> None:
    instance = piles()
    start = solve("lp-rounding", clique_model(instance), Settings(seed=1)).chosen
    assert start is not None
    seen = Recorder()
    answer = solve(name, clique_model(instance), Settings(time=1.0, start=tuple(start.tolist())), seen)
    assert answer.chosen is not None
    assert len(answer.chosen) <= len(start)
    assert seen.found[0].objective <= len(start)


STARTED = """
from pscover import registry
from pscover.result import Settings, ignore
from pscover.backends._session import Session
from test_backends import clique_model, piles
model = clique_model(piles())
start = registry.backend("greedy").solve(model, Settings(), ignore).chosen
session = Session(model, Settings(start=tuple(start.tolist())), ignore)
"""
FIRST_PLAN = {
    "highs": """
from pscover.backends import highs
engine = highs.load(model)
highs.configure(engine, session.settings, 1.0)
highs._offer(engine, highs._complete(session))
plans = []
engine.cbMipImprovingSolution += lambda event: plans.append(event.data_out.objective_function_value)
engine.run()
first = plans[0]
""",
    "scip": """
from pscover.backends import scip
engine, x = scip.load(model)
scip._configure(engine, session)
scip._offer(engine, x, session)
engine.setParam("limits/solutions", 1)
engine.optimize()
first = engine.getObjVal()
""",
    "cpsat": """
from ortools.sat.python import cp_model
from pscover.backends import cpsat
built, unit = cpsat.load(model)
cpsat._offer(built, model, session.settings)
engine = cp_model.CpSolver()
cpsat._configure(engine.parameters, session)
engine.parameters.stop_after_first_solution = True
engine.solve(built)
first = engine.objective_value / unit
""",
}


@pytest.mark.parametrize("name", TAKING_STARTS)
def test_the_engine_itself_takes_the_start(name: str) -> None:
    """The engine's own first plan, and not only what is reported for it, is no worse than the start."""
    if registry.missing(registry.lookup("backend", name)):
        pytest.skip("its package is not installed")
    code = STARTED + FIRST_PLAN[name] + "print(first <= len(start) + 1e-6)"
    assert _run(code) == "True"


def _run(code: str) -> str:
    from pathlib import Path

    here = str(Path(__file__).parent)
    boot = f"import sys; sys.path[:] = {[*sys.path, here]!r}\n"
    done = subprocess.run([sys.executable, "-c", boot + code], capture_output=True, text=True, check=False, timeout=120)
    assert done.returncode == 0, done.stderr
    return done.stdout.strip()


def test_highs_completes_a_start() -> None:
    """Variables that are no candidates get their best values, so that the start is a point of the model."""
    from pscover.backends._session import Session
    from pscover.backends.highs import _complete

    tied = model([1.0, 1.0, 5.0], [[1, 0, 1], [0, 1, 1]], [1.0, 1.0], [np.inf, np.inf], candidates=2)
    completed = _complete(Session(tied, Settings(start=(0,)), ignore))
    assert completed is not None
    assert completed.tolist() == [1.0, 0.0, 1.0]
    barred = tied.with_rows(csr_array(np.array([[0.0, 0.0, 1.0]])), np.array([-np.inf]), np.zeros(1))
    assert _complete(Session(barred, Settings(start=(0,)), ignore)) is None


def test_greedy_prunes_the_start() -> None:
    """Greedy takes 0 (most gain per cost) and then needs two more; the start holds the better pair and a spare."""
    instance = Instance.of(
        [[0.8, 0.9, 0.0, 0.0], [0.8, 0.0, 0.9, 0.0], [0.0, 0.9, 0.0, 0.0], [0.0, 0.0, 0.9, 0.0]], cost=[1, 1.2, 1.2, 1]
    )
    alone = solve("greedy", clique_model(instance))
    assert alone.chosen is not None
    assert alone.chosen.tolist() == [1, 2]
    kept = solve("greedy", clique_model(instance), Settings(start=(0, 1, 2, 3)))
    assert kept.chosen is not None
    assert kept.chosen.tolist() == [1, 2]


BLOCKED = Instance.of([[0.9, 0.0, 0.9, 0.0], [0.9, 0.0, 0.0, 0.9], [0.0, 0.9, 0.0, 0.0]], required=0.7, conflicts=[(0, 1)])
"""Greedy takes 0, which bars 1, the only candidate of the last element."""


def test_greedy_finds_a_way_out_of_conflicts() -> None:
    from pscover.backends.greedy import Greedy

    assert Greedy(moves=0).solve(clique_model(BLOCKED), Settings(), ignore).status is Status.UNKNOWN
    answer = Greedy().solve(clique_model(BLOCKED), Settings(), ignore)
    assert answer.chosen is not None
    assert answer.chosen.tolist() == [1, 2, 3]


def test_greedy_finds_a_way_out_of_many_conflicts() -> None:
    """A plan is hidden: the first member of each clique; every other member covers more at first sight."""
    random = np.random.default_rng(5)
    groups = np.arange(120).reshape(40, 3)
    p = np.zeros((40, 120))
    for k, (own, *decoys) in enumerate(groups):
        p[k, own] = 0.8
        for decoy in decoys:
            p[random.choice(np.delete(np.arange(40), k), 2, replace=False), decoy] = 0.75
    instance = Instance.of(p, 0.7, 1.0, groups)
    answer = solve("greedy", clique_model(instance))
    assert answer.chosen is not None
    assert (instance.coverage(answer.chosen) >= 0.7 - 1e-9).all()
    assert not len(instance.conflicts.broken_by(answer.chosen))


@pytest.mark.parametrize("seed", range(4))
def test_greedy_leaves_nothing_to_spare(seed: int) -> None:
    instance = piles(seed, elements=20, candidates=100, entries=5, clique=5)
    answer = solve("greedy", clique_model(instance))
    assert answer.chosen is not None
    for i in answer.chosen:
        without = instance.coverage(np.setdiff1d(answer.chosen, i))
        assert (without < instance.required - 1e-9).any()


def test_packing_rows_with_room_for_several() -> None:
    """A knapsack of capacity 5: {0, 1} fill it, and the cheap candidate 2 does not fit beside either."""
    tight = model([2.0, 2.0, 1.0], [[1, 0, 1], [0, 1, 0], [2, 3, 4]], [1, 1, -np.inf], [np.inf, np.inf, 5.0])
    for name in BACKENDS:
        answer = solve(name, tight)
        assert answer.chosen is not None, name
        assert answer.chosen.tolist() == [0, 1], name


def test_gains_and_blocks_stay_right() -> None:
    """What is kept up to date incrementally equals what is computed afresh, for any row weights and packing rows."""
    from pscover.backends._cover import Search, _open

    random = np.random.default_rng(2)
    W = random.uniform(0.1, 0.7, (8, 30)) * (random.random((8, 30)) < 0.5)
    P = random.uniform(0.1, 0.6, (5, 30)) * (random.random((5, 30)) < 0.4)
    form = as_cover(model(np.ones(30), np.vstack([W, P]), [1.0] * 8 + [-np.inf] * 5, [np.inf] * 8 + [1.0] * 5))
    search = Search(form)
    for _ in range(300):
        taken = search.chosen
        if len(taken) and random.random() < 0.4:
            search.drop(int(random.choice(taken)))
        elif len(free := np.flatnonzero(search.available())):
            search.add(int(random.choice(free)))
        if random.random() < 0.2:
            search.reweigh(search.short(), 0.5)
        x = search.taken.astype(float)
        deficit = _open(1 - W @ x)
        gain = (search.weight[:, None] * np.minimum(W, deficit[:, None])).sum(axis=0)
        assert np.allclose(search.gain, gain, atol=1e-10)
        assert np.allclose(search.used, P @ x, atol=1e-12)
        fits = ((P @ x)[:, None] + P <= 1 + 1e-9) | (P == 0)
        assert ((search.blocks == 0) == fits.all(axis=0))[~search.taken].all()
        for i in np.flatnonzero(~search.taken)[:5]:
            after = x.copy()
            after[search.blockers(int(i))] = 0
            after[i] = 1
            assert (P @ after)[P[:, i] > 0].max(initial=0.0) <= 1 + 1e-9


def _bounded_instances() -> Iterator[tuple[Instance, Model, float]]:
    random = np.random.default_rng(23)
    for _ in range(60):
        instance = random_instance(random)
        best, _ = enumerate_best(instance, Cover())
        if best is not None:
            yield instance, clique_model(instance), best[0]


def test_the_dual_of_one_pass_is_a_bound() -> None:
    from pscover.backends._cover import dual_bound

    bounds = [(dual_bound(as_cover(built)), best) for _, built, best in _bounded_instances()]
    assert all(0 <= bound <= best + 1e-9 for bound, best in bounds)
    assert sum(bound > 0.6 * best for bound, best in bounds) > len(bounds) / 2


def test_any_multipliers_prove_a_bound() -> None:
    from pscover.backends.lp_rounding import _dual_value

    random = np.random.default_rng(3)
    for _, built, best in _bounded_instances():
        for _ in range(10):
            assert _dual_value(built, random.normal(size=built.rows)) <= best + 1e-9


def test_lp_rounding_bounds_by_the_relaxation() -> None:
    from pscover.backends._session import Session
    from pscover.backends.lp_rounding import _relax

    built = clique_model(piles())
    relaxed = _relax(Session(built, Settings(), ignore))
    assert relaxed is not None
    x, bound = relaxed
    assert bound == pytest.approx(float(built.c @ x), abs=1e-6)
    assert 16 < bound < 17
    assert solve("lp-rounding", built).bound == 17.0


def test_lp_rounding_proves_integral_relaxations() -> None:
    answer = solve("lp-rounding", clique_model(Instance.of(np.eye(6) * 0.9, cost=np.arange(1, 7) / 8)))
    assert answer.status is Status.OPTIMAL
    assert answer.bound == pytest.approx(21 / 8)


def test_cpsat_solves_a_relaxation_in_integers() -> None:
    """Rounding lets every point of the model through, and none that misses a row by more than 2^-20 a variable."""
    from pscover.backends.cpsat import scaled

    random = np.random.default_rng(9)
    for scale in (1.0, 1e-3, 1e6):
        A = random.uniform(-1, 1, (6, 40)) * scale
        built = model(random.uniform(0, 3, 40), A, np.full(6, -0.3 * scale), np.full(6, 0.4 * scale))
        whole = scaled(built)
        up, down = (np.array(part, dtype=object).reshape(6, 40) for part in whole.coefficients)
        assert max(int(np.abs(part).sum(axis=1).max()) for part in (up, down)) < 2**54
        passed = 0
        for _ in range(2000):
            x = (random.random(40) < 0.1).astype(int)
            meets = bool(((A @ x >= built.lo) & (A @ x <= built.hi)).all())
            lets = bool((up @ x >= whole.lo).all() and (down @ x <= whole.hi).all())
            assert lets or not meets
            assert not lets or (A @ x >= built.lo - 40 * 2.0**-20 * scale).all()
            assert float(whole.cost @ x) / whole.unit == pytest.approx(float(built.c @ x), rel=1e-9)
            assert float(whole.cost @ x) / whole.unit <= float(built.c @ x) + 1e-12
            passed += lets
        assert passed > 20


def test_cpsat_keeps_whole_rows_exact() -> None:
    from pscover.backends.cpsat import scaled

    whole = scaled(model([1.0, 2.0], [[1, 1], [3, -2]], [-np.inf, 0.5], [1.0, np.inf]))
    assert whole.coefficients[0].tolist() == whole.coefficients[1].tolist() == [1, 1, 3, -2]
    assert whole.hi[0] == 1
    assert whole.lo[1] == 1
    assert whole.unit == 1.0


SIMPLE = model([1.0, 1.0], [[1.0, 1.0]], [1.0], [np.inf])
REFUSALS: list[tuple[str, Model, str]] = [
    ("cpsat", replace(SIMPLE, integer=np.array([True, False])), "1 continuous"),
    ("cpsat", replace(SIMPLE, ub=np.array([1.0, np.inf])), "unbounded"),
    ("greedy", replace(SIMPLE, c=np.array([1.0, -1.0])), "negative costs"),
    ("greedy", replace(SIMPLE, ub=np.array([1.0, 3.0])), "not binary"),
    ("lp-rounding", replace(SIMPLE, hi=np.ones(1)), "both sides"),
    ("lp-rounding", model([1.0, 1.0], [[1.0, -1.0]], [1.0], [np.inf]), "both signs"),
]


@pytest.mark.parametrize(("name", "refused", "words"), REFUSALS)
def test_refusals_are_sentences(name: str, refused: Model, words: str) -> None:
    reason = registry.lookup("backend", name)().refuses(refused)
    assert reason is not None
    assert words in reason
    assert "\n" not in reason


@pytest.mark.parametrize("name", BACKENDS)
def test_nothing_simple_is_refused(name: str) -> None:
    assert registry.lookup("backend", name)().refuses(SIMPLE) is None


@pytest.mark.parametrize("name", BACKENDS)
def test_the_contract(name: str) -> None:
    found = registry.lookup("backend", name)
    assert found.name == name
    assert found.isolated is (name not in ("greedy", "auto", "lagrangian", "local-search"))
    # Without an extra it is one of pscover's own dependencies.
    assert found.requires if found.extra else set(found.requires) <= {"highspy"}
    assert found() == found()


def test_importing_backends_imports_no_engine() -> None:
    modules = [f"pscover.backends.{name.replace('-', '_')}" for name in BACKENDS]
    engines = {"highspy", "ortools", "cvxpy", "pyomo", "pyscipopt", "scipy.optimize"}
    code = f"import {', '.join(modules)}\nprint(sorted({engines!r} & set(sys.modules)))"
    assert _run(code) == "[]"


def test_cpsat_never_imports_highspy() -> None:
    _needs_ortools()
    code = """
from pscover import registry
from pscover.result import Settings, ignore
from test_backends import clique_model, TWO
answer = registry.backend("cpsat").solve(clique_model(TWO), Settings(), ignore)
print(answer.status, answer.chosen.tolist(), "highspy" in sys.modules)
"""
    assert _run(code) == "optimal [0, 1] False"


@pytest.mark.parametrize("name", ["highs", "scip"])
def test_silence(name: str) -> None:
    if registry.missing(registry.lookup("backend", name)):
        pytest.skip("its package is not installed")
    code = f"""
from pscover import registry
from pscover.result import Settings, ignore
from test_backends import clique_model, piles
registry.backend({name!r}).solve(clique_model(piles(elements=12, candidates=60, entries=4, clique=5)), Settings(), ignore)
"""
    assert _run(code) == ""


def test_reports_of_bounds_are_spaced(monkeypatch: pytest.MonkeyPatch) -> None:
    from pscover.backends import _session

    now = [0.0]
    monkeypatch.setattr(_session, "perf_counter", lambda: now[0])
    seen = Recorder()
    session = _session.Session(replace(SIMPLE, offset=0.5), Settings(time=9.0), seen)
    steps: list[tuple[float, Callable[[], bool]]] = [
        (0.000, lambda: session.bounded(0.1)),
        (0.001, lambda: session.bounded(0.2)),
        (0.002, lambda: session.plan(np.zeros(1, dtype=np.int32), 2.0)),
        (0.003, lambda: session.plan(np.zeros(1, dtype=np.int32), 2.0)),
        (0.030, lambda: session.bounded(0.2)),
        (0.031, lambda: session.bounded(0.3)),
        (9.000, lambda: session.bounded(3.0)),
    ]
    stops = []
    for at, step in steps:
        now[0] = at
        stops.append(step())
    assert [(told.seconds, told.objective, told.bound) for told in seen.told] == [
        (0.0, math.inf, 0.1),
        (0.002, 2.0, 0.2),
        (0.031, 2.0, 0.3),
        (9.0, 2.0, 2.0),
    ]
    assert stops == [False] * 6 + [True]
    answer = session.answer(Status.UNKNOWN)
    assert (answer.status, answer.stop, answer.bound) == (Status.FEASIBLE, Stop.TIME, 2.0)


def test_engines_that_clash_share_no_worker() -> None:
    """OR-tools and highspy, each after the other: whoever came second to a process could not load."""
    _needs_ortools()
    built = clique_model(TWO)
    for name in ("cpsat", "highs", "cpsat", "highs"):
        answer = isolate.run(registry.backend(name), built, Settings(), ignore, Clock(60.0))
        assert answer.status is Status.OPTIMAL


def test_cpsat_is_not_led_astray_by_large_coefficients() -> None:
    _needs_ortools()
    probability = [
        [0.99, 0.0, 0.0, 0.89, 0.09, 0.0, 0.87, 0.9],
        [0.0, 0.21, 0.91, 0.39, 0.43, 0.0, 0.19, 0.51],
        [0.47, 0.1, 0.72, 0.94, 0.0, 0.25, 0.96, 0.12],
        [0.12, 0.76, 0.0, 0.29, 0.0, 0.94, 0.28, 0.0],
    ]
    cost = [0.19, 4.44, 2.94, 4.62, 3.69, 1.94, 4.1, 1.54]
    instance = Instance.of(probability, [0.5, 0.7, 0.7, 0.7], cost, [[0, 2, 3, 7]])
    result = run_solve(instance, backend="cpsat")
    assert result.status is Status.OPTIMAL
    assert result.objective == pytest.approx(8.98)
