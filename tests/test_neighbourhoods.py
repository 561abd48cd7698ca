"""Parts of plans solved by HiGHS: what comes back covers, is free of conflicts and never costs more."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.sparse import csr_array

import pscover
from pscover import registry
from pscover.backends._cover import Search
from pscover.backends._kernels import feasible_start
from pscover.backends._neighbourhoods import Neighbourhoods
from pscover.backends._session import Session
from pscover.generate.psc import random_psc
from pscover.model import CoverForm, as_cover, model_of
from pscover.result import Settings


def form_of(rows: int, candidates: int, seed: int, cliques: int = 0) -> CoverForm:
    """A sparse random form with whole costs, in which each row has some candidates of its own."""
    rng = np.random.default_rng(seed)
    W = np.where(rng.random((rows, candidates)) < 3.0 / rows, rng.uniform(0.3, 0.8, (rows, candidates)), 0.0)
    for j in range(rows):
        W[j, rng.choice(candidates, 6, replace=False)] = rng.uniform(0.5, 1.0, 6)
    P = np.zeros((cliques, candidates))
    for k in range(cliques):
        P[k, rng.choice(candidates, 2, replace=False)] = 1.0
    allowed = np.ones(candidates, dtype=np.bool_)
    return CoverForm(c=rng.integers(1, 20, candidates).astype(float), W=csr_array(W), P=csr_array(P), allowed=allowed)


def session_of(form: CoverForm) -> Session:
    return Session(model_of(form), Settings(time=30.0), lambda _: False)


@pytest.mark.parametrize("seed", range(3))
def test_parts_keep_plans_feasible_and_make_a_poor_one_cheaper(seed: int) -> None:
    form = form_of(rows=40, candidates=150, seed=seed, cliques=20)
    search = Search(CoverForm(c=np.ones(150), W=form.W, P=form.P, allowed=form.allowed))
    assert search.complete(lambda: False)
    plan = first = search.chosen
    neighbourhoods, session = Neighbourhoods(form, form.c, seed), session_of(form)
    for _ in range(6):
        better = neighbourhoods.turn(plan, session)
        assert form.c[better].sum() <= form.c[plan].sum()
        assert feasible_start(form, better.tolist()) is not None
        plan = better
    assert form.c[plan].sum() < form.c[first].sum()


def test_the_whole_plan_given_up_leads_to_the_optimum() -> None:
    instance = random_psc(10, 50, covers=3, clique_size=3, dearest=9, required=0.9, seed=0)
    form = as_cover(registry.formulation("clique").build(instance))
    best = pscover.solve(instance, backend="highs")
    neighbourhoods, session = Neighbourhoods(form, form.c, 0), session_of(form)
    search = Search(form)
    assert search.complete(lambda: False)
    assert form.c[neighbourhoods.turn(search.chosen, session)].sum() == pytest.approx(best.objective)


def test_a_plan_of_little_use_is_given_up_whole() -> None:
    W = csr_array(np.array([[0.6, 0.0, 0.6, 1.0], [0.6, 0.0, 0.6, 1.0]]))
    form = CoverForm(c=np.array([5.0, 1.0, 5.0, 3.0]), W=W, P=csr_array((0, 4)), allowed=np.ones(4, dtype=np.bool_))
    # Candidate 1 covers no row: no row leads to it.
    plan = np.array([0, 1, 2], dtype=np.int32)
    assert Neighbourhoods(form, form.c, 0).turn(plan, session_of(form)).tolist() == [3]


def test_forms_whose_candidates_cover_many_rows_do_not_suit() -> None:
    sparse = form_of(rows=200, candidates=300, seed=0)
    dense = CoverForm(
        c=np.ones(30), W=csr_array(np.full((10, 30), 0.5)), P=csr_array((0, 30)), allowed=np.ones(30, dtype=np.bool_)
    )
    assert Neighbourhoods.suit(sparse)
    assert not Neighbourhoods.suit(dense)


def test_other_plans_give_what_they_do_better() -> None:
    # Two rows; of each a cheap and a dear candidate, and one that is cheaper than either but in none of the plans.
    W = csr_array(np.repeat(np.eye(2), 3, axis=1))
    form = CoverForm(c=np.array([2.0, 5.0, 1.0] * 2), W=W, P=csr_array((0, 6)), allowed=np.ones(6, dtype=np.bool_))
    plans = [np.array([0, 4], dtype=np.int32), np.array([1, 3], dtype=np.int32), np.array([1, 4], dtype=np.int32)]
    neighbourhoods = Neighbourhoods(form, form.c, 0)
    assert neighbourhoods._core_of_plans(plans[0], session_of(form), plans).tolist() == [0, 3]
    # They have their turn after the other two ways.
    turns = [neighbourhoods.turn(plans[0], session_of(form), plans).tolist() for _ in range(3)]
    assert turns == [[2, 5], [2, 5], [0, 3]]
