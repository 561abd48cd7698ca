"""Presolve against enumeration: the same status and value before and after, whatever steps run in whatever order."""

from __future__ import annotations

import itertools
from collections.abc import Callable

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.sparse import csr_array

from pscover import registry
from pscover.errors import UnknownName
from pscover.model import CoverForm, as_cover
from pscover.presolve import DEFAULT, STEPS, Outcome, presolve
from pscover.testing import random_instance

TOLERANCE = 1e-9
Draw = Callable[[np.random.Generator], CoverForm]


def best(form: CoverForm) -> tuple[float | None, NDArray[np.bool_]]:
    """The cheapest plan by listing all subsets, and all feasible ones."""
    n = len(form.c)
    x = np.array(list(itertools.product((0.0, 1.0), repeat=n))).reshape(2**n, n)
    good = (x @ form.W.toarray().T >= 1 - TOLERANCE).all(axis=1) & (x @ form.P.toarray().T <= 1 + TOLERANCE).all(axis=1)
    good &= (x[:, ~form.allowed] == 0).all(axis=1)
    if not good.any():
        return None, x[:0] > 0
    cost = x[good] @ form.c
    return float(cost.min()), x[good][cost <= cost.min() + 1e-9] > 0


def is_feasible(form: CoverForm, chosen: NDArray[np.int64]) -> bool:
    x = np.zeros(len(form.c))
    x[chosen] = 1
    covered = (form.W @ x >= 1 - TOLERANCE).all() and (form.P @ x <= 1 + TOLERANCE).all()
    return bool(covered) and bool(form.allowed[chosen].all())


def from_instance(rng: np.random.Generator) -> CoverForm:
    instance = random_instance(rng, candidates=int(rng.integers(1, 10)))
    name = str(rng.choice(["clique", "pairwise", "single-cover"]))
    return as_cover(registry.formulation(name).build(instance))


def partitioned(rng: np.random.Generator) -> CoverForm:
    """Disjoint cliques over few rows with few different entries: much dominance, ties, forced columns."""
    m, n = int(rng.integers(1, 5)), int(rng.integers(1, 12))
    W = rng.choice([0.0, 0.3, 0.5, 0.5, 0.7, 1.0], (m, n), p=rng.dirichlet(np.ones(6)))
    owner = rng.integers(0, max(1, n // int(rng.integers(1, 5))), n)
    P = np.array([owner == k for k in range(n) if (owner == k).any()], dtype=float)
    c = rng.choice([1.0, 1.0, 2.0, 0.0], n) if rng.random() < 0.3 else np.ones(n)
    return CoverForm(c=c, W=csr_array(W), P=csr_array(P), allowed=rng.random(n) < 0.95)


def knapsacks(rng: np.random.Generator) -> CoverForm:
    """Packing rows of any entries, sums that hit 1 exactly, no conflicts at times."""
    m, n, p = int(rng.integers(0, 5)), int(rng.integers(1, 10)), int(rng.integers(0, 4))
    W = np.minimum(rng.choice([0.0, 0.1, 0.2, 0.25, 0.4, 0.5, 1 / 3, 1.0], (m, n)), 1.0)
    P = rng.choice([0.0, 0.0, 0.2, 0.4, 0.5, 0.6, 1.0], (p, n))
    c = rng.choice([0.0, 1.0, 1.5, 2.0], n)
    return CoverForm(c=c, W=csr_array(W), P=csr_array(P), allowed=rng.random(n) < 0.95)


def unweighted(rng: np.random.Generator) -> CoverForm:
    """Plain set cover with repeated rows and columns."""
    m, n = int(rng.integers(1, 7)), int(rng.integers(1, 11))
    W = (rng.random((m, n)) < rng.uniform(0.1, 0.7)).astype(float)
    W, c = W[rng.integers(0, m, m)][:, rng.integers(0, n, n)], rng.integers(0, 4, n).astype(float)
    return CoverForm(c=c, W=csr_array(W), P=csr_array((0, n)), allowed=np.ones(n, dtype=bool))


def copies(rng: np.random.Generator) -> CoverForm:
    """Identical columns of which several are needed, some in cliques."""
    m, kinds, n = int(rng.integers(1, 4)), int(rng.integers(1, 4)), int(rng.integers(2, 11))
    W = rng.choice([0.0, 0.25, 0.35, 0.5, 0.6], (m, kinds))[:, rng.integers(0, kinds, n)]
    P = (rng.random((int(rng.integers(0, 3)), n)) < 0.3).astype(float)
    return CoverForm(c=rng.choice([1.0, 2.0], n), W=csr_array(W), P=csr_array(P), allowed=np.ones(n, dtype=bool))


def on_the_edge(rng: np.random.Generator) -> CoverForm:
    """Supplies that meet or miss a row by a fraction of the tolerance."""
    m, n = int(rng.integers(1, 4)), int(rng.integers(1, 9))
    exact = rng.choice([0.0, 0.1, 0.1, 0.2, 0.4, 0.5, 0.9, 1.0], (m, n))
    W = np.where(exact > 0, exact + rng.choice([0.0, 0.0, -0.2e-9, -1.3e-9, 1e-13], (m, n)), 0.0)
    P = (rng.random((int(rng.integers(0, 3)), n)) < 0.4).astype(float)
    return CoverForm(c=rng.choice([1.0, 2.0], n), W=csr_array(W), P=csr_array(P), allowed=np.ones(n, dtype=bool))


def clear_of_the_edge(form: CoverForm) -> bool:
    """Whether no plan is so near the tolerance that the rounding of a sum decides."""
    n = len(form.c)
    x = np.array(list(itertools.product((0.0, 1.0), repeat=n))).reshape(2**n, n)
    return bool((np.abs(x @ form.W.toarray().T - (1 - TOLERANCE)) > 1e-11).all())


FAMILIES: list[Draw] = [from_instance, partitioned, knapsacks, unweighted, copies, on_the_edge]


def drawn(family: Draw, rng: np.random.Generator) -> CoverForm:
    while not clear_of_the_edge(form := family(rng)):
        pass
    return form


def check(form: CoverForm, steps: tuple[str, ...]) -> None:
    value, plans = best(form)
    before = [a.copy() for a in (form.c, form.W.data, form.P.data, form.allowed)]
    reduced = presolve(form, steps=steps)
    for old, new in zip(before, (form.c, form.W.data, form.P.data, form.allowed), strict=True):
        np.testing.assert_array_equal(old, new)
    shown = f"{steps}\n{form.c}\n{form.W.toarray()!r}\n{form.P.toarray()!r}\n{form.allowed}"
    assert reduced.form.W.shape == (len(reduced.rows), len(reduced.columns))
    assert reduced.form.P.shape[1] == len(reduced.columns)
    assert reduced.form.allowed.all()
    left, left_plans = (
        best(reduced.form) if reduced.status is Outcome.REDUCED else (0.0, np.zeros((1, len(reduced.columns)), bool))
    )
    if value is None:
        assert reduced.status is not Outcome.SOLVED, shown
        assert reduced.status is Outcome.INFEASIBLE or left is None, shown
        assert (reduced.infeasible_row is not None) == (reduced.status is Outcome.INFEASIBLE)
        assert reduced.infeasible_row is None or 0 <= reduced.infeasible_row < form.W.shape[0]
        return
    assert reduced.status is not Outcome.INFEASIBLE, shown
    assert left is not None, shown
    assert left + reduced.fixed_cost == pytest.approx(value), shown
    for plan in left_plans[:5]:
        lifted = reduced.lift(np.flatnonzero(plan))
        assert is_feasible(form, lifted), shown
        assert form.c[lifted].sum() == pytest.approx(value), shown
    for plan in plans[:5]:
        start = reduced.project(np.flatnonzero(plan))
        assert len(start) <= plan.sum()


@pytest.mark.parametrize("step", DEFAULT)
@pytest.mark.parametrize("family", FAMILIES)
def test_each_step_alone_keeps_status_and_value(family: Draw, step: str) -> None:
    rng = np.random.default_rng(list(family.__name__.encode()) + list(step.encode()))
    for _ in range(60):
        check(drawn(family, rng), (step,))


@pytest.mark.parametrize("family", FAMILIES)
def test_all_steps_in_any_order_keep_status_and_value(family: Draw) -> None:
    rng = np.random.default_rng(list(family.__name__.encode()))
    for _ in range(250):
        order = tuple(str(step) for step in rng.permutation(DEFAULT))
        check(drawn(family, rng), DEFAULT if rng.random() < 0.3 else order)


def test_an_unknown_step_is_named() -> None:
    form = unweighted(np.random.default_rng(0))
    with pytest.raises(UnknownName, match="did you mean 'forced'"):
        presolve(form, steps=["force"])


def test_no_step_runs_once_time_is_over() -> None:
    form = unweighted(np.random.default_rng(0))
    reduced = presolve(form, over=lambda: True)
    assert reduced.log == ()
    assert reduced.columns.tolist() == list(range(len(form.c)))


@pytest.mark.parametrize("family", FAMILIES)
def test_stopping_anywhere_leaves_a_valid_form(family: Draw) -> None:
    rng = np.random.default_rng(3)
    for _ in range(60):
        form = family(rng)
        clock = iter([False] * int(rng.integers(1, 30)))
        reduced = presolve(form, over=lambda: next(clock, True))  # noqa: B023
        value, _ = best(form)
        if reduced.status is Outcome.INFEASIBLE:
            assert value is None
            continue
        left, _ = best(reduced.form)
        assert (left is None) == (value is None)
        assert left is None or left + reduced.fixed_cost == pytest.approx(value)


@pytest.mark.parametrize("family", FAMILIES)
def test_a_start_survives_dominance_in_cliques(family: Draw) -> None:
    rng = np.random.default_rng(4)
    for _ in range(60):
        form = drawn(family, rng)
        _, plans = best(form)
        reduced = presolve(form, steps=["clique-dominance"])
        for plan in plans[:5]:
            start = reduced.project(np.flatnonzero(plan))
            assert is_feasible(reduced.form, start)
            assert reduced.form.c[start].sum() <= form.c[plan].sum() + 1e-9


def test_each_step_is_listed_and_the_log_tells_what_ran() -> None:
    form = partitioned(np.random.default_rng(5))
    assert set(DEFAULT) == set(STEPS)
    reduced = presolve(form, steps=["forced", "useless"])
    assert {entry.step for entry in reduced.log} <= {"forced", "useless"}
    assert sum(entry.columns for entry in reduced.log) == form.allowed.sum() - len(reduced.columns)
