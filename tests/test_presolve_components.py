"""Independent blocks, and fixing by reduced costs."""

from __future__ import annotations

import itertools

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.sparse import csr_array

from pscover import registry
from pscover.model import CoverForm, as_cover
from pscover.presolve import components, fix_by_reduced_cost, lagrangian
from pscover.testing import random_instance


def drawn(rng: np.random.Generator, candidates: int = 9) -> CoverForm:
    instance = random_instance(rng, candidates=int(rng.integers(1, candidates)))
    form = as_cover(registry.formulation("clique").build(instance))
    return CoverForm(c=form.c, W=form.W, P=form.P, allowed=rng.random(len(form.c)) < 0.9)


def plans(form: CoverForm) -> NDArray[np.float64]:
    """All feasible plans."""
    n = len(form.c)
    x = np.array(list(itertools.product((0.0, 1.0), repeat=n))).reshape(2**n, n)
    good = (x @ form.W.toarray().T >= 1 - 1e-9).all(axis=1) & (x @ form.P.toarray().T <= 1 + 1e-9).all(axis=1)
    feasible: NDArray[np.float64] = x[good & (x[:, ~form.allowed] == 0).all(axis=1)]
    return feasible


def least(form: CoverForm) -> float:
    return float(np.min(plans(form) @ form.c, initial=np.inf))


def test_blocks_add_up() -> None:
    rng = np.random.default_rng(1)
    several = 0
    for _ in range(300):
        form = drawn(rng)
        blocks = components(form)
        several += len(blocks) > 1
        together = np.concatenate([columns for _, columns in blocks] or [np.zeros(0, dtype=int)])
        assert len(np.unique(together)) == len(together)
        assert sum(least(block) for block, _ in blocks) == pytest.approx(least(form))
        assert sum(block.W.shape[0] for block, _ in blocks) == form.W.shape[0]
        for block, columns in blocks:
            np.testing.assert_array_equal(block.c, form.c[columns])
            np.testing.assert_array_equal(block.allowed, form.allowed[columns])
    assert several > 20


def test_blocks_are_as_small_as_can_be() -> None:
    size = 40
    W = csr_array(np.kron(np.eye(size), [[0.5, 0.6]])[:, np.random.default_rng(0).permutation(2 * size)])
    P = csr_array((0, 2 * size))
    form = CoverForm(c=np.ones(2 * size), W=W, P=P, allowed=np.ones(2 * size, dtype=bool))
    blocks = components(form)
    assert [block.W.shape for block, _ in blocks] == [(1, 2)] * size
    joined = CoverForm(c=form.c, W=W, P=csr_array(np.ones((1, 2 * size))), allowed=form.allowed)
    assert len(components(joined)) == 1


def test_a_row_without_columns_is_a_block() -> None:
    form = CoverForm(c=np.ones(1), W=csr_array([[0.0], [1.0]]), P=csr_array((0, 1)), allowed=np.ones(1, dtype=bool))
    assert [(block.W.shape, columns.tolist()) for block, columns in components(form)] == [((1, 0), []), ((1, 1), [0])]


def test_the_bound_of_multipliers_holds() -> None:
    rng = np.random.default_rng(2)
    for _ in range(300):
        form = drawn(rng)
        y = rng.uniform(-0.5, 5, form.W.shape[0])
        reduced, lower = lagrangian(form, y)
        x = plans(form)
        assert (x @ form.c >= lower - 1e-9).all()
        assert (x @ form.c >= np.maximum(y, 0).sum() + x @ reduced - 1e-9).all()


@pytest.mark.parametrize("whole", [False, True])
def test_better_plans_agree_with_what_is_fixed(whole: bool) -> None:
    rng = np.random.default_rng(3)
    fixed_columns = 0
    for _ in range(500):
        form = drawn(rng)
        if whole:
            form = CoverForm(c=np.ceil(form.c), W=form.W, P=form.P, allowed=form.allowed)
        reduced, lower = lagrangian(form, rng.uniform(0, 4, form.W.shape[0]) * rng.random())
        x = plans(form)
        upper = float(rng.choice(x @ form.c)) if len(x) else 5.0
        fixed = fix_by_reduced_cost(form, reduced, lower, upper, step=1.0 if whole else 0.0)
        better = x[x @ form.c < upper - 1e-6]
        assert (better[:, fixed.zero] == 0).all()
        assert (better[:, fixed.one] == 1).all()
        fixed_columns += len(better) and len(fixed.zero) + len(fixed.one)
    assert fixed_columns > 50


def test_a_clique_shares_its_gain() -> None:
    form = CoverForm(
        c=np.array([1.0, 1.0, 3.0]), W=csr_array([[1.0, 1.0, 1.0]]), P=csr_array([[1.0, 1.0, 0.0]]), allowed=np.ones(3, bool)
    )
    reduced, lower = lagrangian(form, np.array([2.0]))
    assert lower == 1.0
    fixed = fix_by_reduced_cost(form, reduced, lower, upper=2.0, step=1.0)
    assert fixed.zero.tolist() == [2]
    assert fixed.one.tolist() == []
