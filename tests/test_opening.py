"""The opening of a solve of a large form: bounds that hold, cores with what is needed, plans at once, an end."""

from __future__ import annotations

import math

import numpy as np
import pytest
from scipy.sparse import csr_array

pytest.importorskip("numba")

import pscover
from pscover import Settings, Status, registry
from pscover.backends._opening import Opening
from pscover.backends._session import Session
from pscover.certificate import certified_bound
from pscover.engine.pricing import Pricing
from pscover.engine.warm import warming
from pscover.generate.psc import random_psc
from pscover.instance import Instance
from pscover.model import CoverForm, Model, as_cover
from pscover.presolve import lagrangian
from pscover.result import ignore


@pytest.fixture(scope="module", autouse=True)
def _ready() -> None:
    """Compiling is not what these tests are about."""
    warming().wait(120.0)
    assert warming().error is None


def model_of(instance: Instance) -> Model:
    return registry.formulation("clique").build(instance)


def settled(form: CoverForm) -> Pricing:
    pricing = Pricing(form)
    rounds = 0
    while not pricing.is_settled:
        before = pricing.bound
        assert pricing.turn() == (pricing.bound > before)
        rounds += 1
        assert rounds < 500
    return pricing


@pytest.mark.parametrize("clique_size", [None, 3])
def test_bounds_of_pricing_hold(clique_size: int | None) -> None:
    for seed in range(3):
        instance = random_psc(12, 120, covers=3, clique_size=clique_size, dearest=3, required=0.9, seed=seed)
        form = as_cover(model_of(instance))
        pricing = settled(form)
        best = pscover.solve(instance, backend="highs")
        assert 0.5 * best.objective < pricing.bound <= best.objective
        reduced, bound = lagrangian(form, pricing.multipliers)
        assert bound == pytest.approx(pricing.bound)
        assert np.allclose(reduced, pricing.reduced)


def test_candidates_that_are_not_allowed_are_no_part_of_it() -> None:
    form = as_cover(model_of(random_psc(15, 200, covers=3, required=0.9, seed=1)))
    allowed = np.arange(200) % 3 > 0
    pricing = settled(CoverForm(c=form.c, W=form.W, P=form.P, allowed=allowed))
    assert np.isinf(pricing.reduced[~allowed]).all()
    assert allowed[pricing.favoured(pricing.reduced, 5, 5)].all()
    assert allowed[pricing.strongest(np.arange(15, dtype=np.int32))].all()


def test_favoured_are_the_cheapest() -> None:
    form = as_cover(model_of(random_psc(10, 300, covers=3, clique_size=4, required=0.9, seed=2)))
    pricing = settled(form)
    chosen = pricing.favoured(pricing.reduced, 3, 4)
    others = np.setdiff1d(np.arange(300), chosen)
    assert np.sort(pricing.reduced)[:30].max() <= pricing.reduced[others].min()
    for j in range(10):
        members = form.W.indices[form.W.indptr[j] : form.W.indptr[j + 1]]
        left = np.setdiff1d(members, chosen)
        assert len(members) - len(left) >= 4
        assert not len(left) or np.sort(pricing.reduced[members])[3] <= pricing.reduced[left].min()
    problem, columns = pricing.problem(chosen)
    assert columns.tolist() == chosen.tolist()
    assert problem.cost.tolist() == form.c[chosen].tolist()


def test_strongest_have_the_largest_entry_of_each_clique() -> None:
    W = csr_array(np.array([[0.5, 0.7, 0.2, 0.9], [0.6, 0.1, 1.0, 0.0]]))
    P = csr_array(np.array([[1.0, 1.0, 0.0, 0.0], [0.0, 0.0, 1.0, 1.0]]))
    pricing = Pricing(CoverForm(c=np.ones(4), W=W, P=P, allowed=np.ones(4, dtype=np.bool_)))
    assert pricing.strongest(np.array([0], dtype=np.int32)).tolist() == [1, 3]
    assert pricing.strongest(np.array([1], dtype=np.int32)).tolist() == [0, 2]
    assert pricing.strongest(np.zeros(0, dtype=np.int32)).tolist() == []


def opened(instance: Instance, time: float, start: tuple[int, ...] | None = None) -> tuple[Opening, Session]:
    model = model_of(instance)
    session = Session(model, Settings(time=time, start=start), ignore)
    session.start()
    opening = Opening(as_cover(model), session)
    opening.run()
    return opening, session


def test_plans_and_certificate() -> None:
    instance = random_psc(30, 900, covers=5, clique_size=5, required=0.9, dearest=4, seed=3)
    opening, session = opened(instance, 1.5)
    assert session.chosen is not None
    assert opening.plan is not None
    assert (instance.coverage(session.chosen) >= instance.required - 1e-9).all()
    assert not len(instance.conflicts.broken_by(session.chosen))
    assert session.objective == instance.cost[session.chosen].sum()
    proof = opening.certificate()
    assert proof is not None
    proven = certified_bound(instance, proof)
    assert 0.9 * session.bound <= proven <= session.objective


def test_a_start_with_idle_candidates_is_kept() -> None:
    part = random_psc(30, 900, covers=5, clique_size=5, required=0.9, seed=3)
    p = csr_array(np.hstack([part.probability.toarray(), np.zeros((30, 1))]))
    instance = Instance.of(p, part.required, 1.0, [list(clique) for clique in part.conflicts])
    good = pscover.solve(instance, backend="greedy").chosen
    assert good is not None
    _, session = opened(instance, 20.0, (*good.tolist(), 900))
    assert session.objective <= len(good)


def test_it_ends_where_nothing_is_feasible() -> None:
    # Two rows, all whose candidates are in one clique, among many that can be met.
    part = random_psc(30, 900, covers=5, required=0.9, seed=4)
    p = np.zeros((32, 904))
    p[:30, :900] = part.probability.toarray()
    p[30, 900:902] = p[31, 902:] = 0.95
    instance = Instance.of(p, 0.9, 1.0, [[900, 901, 902, 903]])
    opening, session = opened(instance, math.inf)
    assert opening.plan is None
    assert session.chosen is None
    assert registry.backend("auto").solve(model_of(instance), Settings(), ignore).status is Status.INFEASIBLE
