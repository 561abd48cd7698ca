"""The compiled search: what it keeps up to date, what it finds, and that nothing but its inputs decides."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

pytest.importorskip("numba")

from pscover import registry
from pscover.engine import greedy, weighting
from pscover.engine.hunt import Hunt
from pscover.engine.problem import Problem, problem_of, several
from pscover.engine.state import KEEPS, State, empty, put, take_out, weigh
from pscover.enumeration import enumerate_best
from pscover.errors import Refused
from pscover.generate.psc import random_psc
from pscover.goal import Cover
from pscover.instance import Instance
from pscover.model import CoverForm, as_cover
from pscover.testing import random_instance


def form_of(instance: Instance) -> CoverForm:
    return as_cover(registry.formulation("clique").build(instance))


def dense(problem: Problem) -> np.ndarray:
    W = np.zeros((problem.rows, problem.candidates))
    row = np.repeat(np.arange(problem.rows), np.diff(problem.rptr))
    W[row, problem.lines["candidate"]] = problem.lines["entry"]
    return W


def penalties(W: np.ndarray, weight: np.ndarray, x: np.ndarray) -> float:
    deficit = 1 - W @ x
    return float(weight @ np.where(deficit > 1e-9, deficit, 0.0))


def check(problem: Problem, state: State, W: np.ndarray) -> None:
    x = state.candidates["taken"].astype(float)
    weight = state.rows["weight"]
    now = penalties(W, weight, x)
    assert np.allclose(state.rows["supply"], W @ x)
    assert state.value[0] == pytest.approx(problem.cost @ x)
    short = np.sort(state.rows["lacking"][: state.counts[1]])
    assert short.tolist() == np.flatnonzero(1 - W @ x > 1e-9).tolist()
    for i in range(problem.candidates):
        other = x.copy()
        other[i] = 1 - x[i]
        change = penalties(W, weight, other) - now
        if x[i]:
            assert state.candidates[i]["loss"] == pytest.approx(change, abs=1e-9)
        elif state.counts[KEEPS]:
            assert state.candidates[i]["worth"] == pytest.approx(-change, abs=1e-9)


@pytest.mark.parametrize("covers", [2, 9])
def test_what_is_kept_up_to_date_equals_what_is_computed_afresh(covers: int) -> None:
    problem, _ = problem_of(form_of(random_psc(12, 40, covers=covers, low=0.2, high=0.6, clique_size=4, seed=3)))
    W, state, random = dense(problem), empty(problem, 1), np.random.default_rng(0)
    assert bool(state.counts[KEEPS]) is (covers == 9)
    steps = python_versions()
    for _ in range(200):
        i = int(random.integers(problem.candidates))
        if state.candidates[i]["taken"]:
            steps["take_out"](problem, state, i)
        elif all(state.occupant[g] < 0 for g in problem.gclq[problem.gptr[i] : problem.gptr[i + 1]]):
            steps["put"](problem, state, i)
        else:
            steps["weigh"](problem, state, int(random.integers(problem.rows)), 1.5)
        check(problem, state, W)


def python_versions() -> dict[str, Any]:
    """Moves that compiled kernels are made of, callable from here."""
    from numba import njit

    @njit
    def put_(problem, state, i):  # type: ignore[no-untyped-def]
        put(problem, state, i)

    @njit
    def take_out_(problem, state, i):  # type: ignore[no-untyped-def]
        take_out(problem, state, i)

    @njit
    def weigh_(problem, state, j, more):  # type: ignore[no-untyped-def]
        weigh(problem, state, j, more)

    return {"put": put_, "take_out": take_out_, "weigh": weigh_}


@pytest.mark.parametrize("clique_size", [None, 5])
def test_state_stays_right_while_searching(clique_size: int | None) -> None:
    problem, _ = problem_of(form_of(random_psc(15, 60, covers=4, clique_size=clique_size, dearest=5, seed=2)))
    W, hunt = dense(problem), Hunt(problem, 5, 1.0)
    hunt.begin()
    for moves in range(50, 2000, 150):
        hunt.turn(moves)
        check(problem, hunt.state, W)
        occupied = hunt.state.occupant[hunt.state.occupant >= 0]
        assert hunt.state.candidates["taken"][occupied].all()


def test_plans_are_feasible_and_mostly_the_best() -> None:
    random = np.random.default_rng(8)
    solved = best_found = 0
    for _ in range(80):
        instance = random_instance(random)
        best, _ = enumerate_best(instance, Cover())
        problem, columns = problem_of(form_of(instance))
        hunt = Hunt(problem, 1)
        hunt.begin()
        while hunt.moves < 3000 and problem.candidates and hunt.cost != 0:
            hunt.turn(3000)
        if best is None:
            assert hunt.cost == np.inf or not problem.rows
            continue
        solved += 1
        if hunt.cost < np.inf:
            plan = columns[hunt.plan]
            assert (instance.coverage(plan) >= instance.required - 2e-9).all()
            assert not len(instance.conflicts.broken_by(plan))
            assert hunt.cost >= best[0] - 1e-9
            best_found += hunt.cost <= best[0] + 1e-9
    assert best_found >= 0.95 * solved


def test_turns_do_not_change_the_course() -> None:
    problem, _ = problem_of(form_of(random_psc(30, 300, covers=5, clique_size=6, seed=4)))
    plans = []
    for work in (300, 20_000, 1_000_000):
        state = empty(problem, 9)
        state.value[2] = 1.0
        greedy.choose(problem, state, problem.cost)
        while state.counts[2] < 4000:
            weighting.search(problem, state, work, 4000)
        plans.append((float(state.value[1]), state.candidates["taken"].tolist()))
    assert plans[0] == plans[1] == plans[2]


def test_lazy_greedy_equals_plain_greedy() -> None:
    from pscover.backends._cover import Search

    for seed in range(5):
        form = form_of(random_psc(20, 120, covers=4, clique_size=5, dearest=9, seed=seed))
        problem, columns = problem_of(form)
        state = empty(problem, 0)
        whole = greedy.choose(problem, state, problem.cost)
        search = Search(form)
        assert search.complete(lambda: False) == whole
        assert columns[np.flatnonzero(state.candidates["taken"])].tolist() == search.chosen.tolist()


def test_packing_rows_that_are_no_cliques_are_refused() -> None:
    from scipy.sparse import csr_array

    P = csr_array(np.array([[0.5, 0.4, 0.7]]))
    form = CoverForm(c=np.ones(3), W=csr_array(np.ones((1, 3))), P=P, allowed=np.ones(3, dtype=bool))
    assert several(form) is not None
    with pytest.raises(Refused, match="room for several"):
        problem_of(form)
    clique = CoverForm(c=form.c, W=form.W, P=csr_array(np.array([[0.6, 0.5, 0.7]])), allowed=form.allowed)
    assert several(clique) is None
