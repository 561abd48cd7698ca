"""What each step of presolve finds, and what it must leave alone."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import ArrayLike
from scipy.sparse import csr_array

from pscover import registry
from pscover.generate.garments import garments
from pscover.grasping.candidates import candidates
from pscover.model import CoverForm, as_cover
from pscover.presolve import Outcome, presolve


def form_of(W: ArrayLike, P: ArrayLike = (), c: ArrayLike | None = None) -> CoverForm:
    rows = np.atleast_2d(np.asarray(W, dtype=float))
    n = rows.shape[1]
    packing = csr_array(np.asarray(P, dtype=float).reshape(-1, n))
    cost = np.ones(n) if c is None else np.asarray(c, dtype=float)
    return CoverForm(c=cost, W=csr_array(rows), P=packing, allowed=np.ones(n, dtype=bool))


def test_forced_counts_one_of_each_clique() -> None:
    W, P = [[0.6, 0.5, 0.35, 0.3]], [[0, 1, 1, 1]]
    reduced = presolve(form_of(W, P), steps=["forced"])
    assert reduced.forced.tolist() == [0, 1]
    assert reduced.status is Outcome.SOLVED
    assert presolve(form_of(W), steps=["forced"]).forced.tolist() == []


def test_forced_proves_that_a_row_is_out_of_reach_of_its_cliques() -> None:
    W = [[1.0, 1.0, 1.0], [0.5, 0.6, 0.0]]
    assert presolve(form_of(W, [[1, 1, 0]]), steps=["forced"]).infeasible_row == 1
    assert presolve(form_of(W), steps=["forced"]).status is Outcome.SOLVED


def test_two_forced_columns_that_exclude_each_other_prove_infeasibility() -> None:
    reduced = presolve(form_of([[1.0, 0.0], [0.0, 1.0]], [[1, 1]]), steps=["forced"])
    assert reduced.status is Outcome.INFEASIBLE
    assert reduced.infeasible_row in (0, 1)


def test_what_is_left_of_a_demand_keeps_its_tolerance() -> None:
    near, short = 0.1 - 0.4e-9, 0.1 - 1.6e-9
    reduced = presolve(form_of([[0.9, near, near, short], [1.0, 0.0, 0.0, 0.0]]), steps=["forced"])
    assert reduced.forced.tolist() == [0]
    assert (reduced.form.W.toarray() >= 1 - 1e-9).tolist() == [[True, True, False]]


def test_probing_drops_what_shuts_out_a_needed_clique() -> None:
    W, P = [[0.6, 0.2, 0.4], [1.0, 1.0, 0.3]], [[1, 1, 0]]
    reduced = presolve(form_of(W, P), steps=["probing"])
    assert reduced.columns.tolist() == [0, 2]


def test_entries_too_small_to_matter_are_dropped() -> None:
    reduced = presolve(form_of([[1.0, 0.3, 0.3, 1.0]]), steps=["entries"])
    assert reduced.form.W.toarray().tolist() == [[1.0, 0.0, 0.0, 1.0]]
    assert presolve(form_of([[1.0, 0.5, 0.5]]), steps=["entries"]).form.W.nnz == 3
    assert presolve(form_of([[1.0, 0.5, 0.5]], [[0, 1, 1]]), steps=["entries"]).form.W.nnz == 1


def test_demand_rises_to_the_smallest_sum() -> None:
    reduced = presolve(form_of([[0.6, 0.7, 0.8, 1.0]]), steps=["demand"])
    np.testing.assert_allclose(reduced.form.W.toarray(), [[0.6 / 1.3, 0.7 / 1.3, 0.8 / 1.3, 1.0]])
    exact = presolve(form_of([[0.1, 0.2, 0.7]]), steps=["demand"])
    np.testing.assert_array_equal(exact.form.W.toarray(), [[0.1, 0.2, 0.7]])


def test_a_row_implied_by_another_goes() -> None:
    W = [[0.5, 0.5, 0.6], [0.5, 0.4, 0.0], [0.5, 0.5, 0.6], [0.4, 0.0, 0.9]]
    assert presolve(form_of(W), steps=["row-dominance"]).rows.tolist() == [1, 3]
    assert presolve(form_of([W[0], W[2]]), steps=["row-dominance"]).rows.tolist() == [0]


def test_the_best_of_a_clique_stands_for_the_others() -> None:
    W, P = [[0.5, 0.6, 0.2, 0.5], [0.3, 0.3, 0.4, 0.0]], [[1, 1, 1, 0]]
    reduced = presolve(form_of(W, P), steps=["clique-dominance"])
    assert reduced.columns.tolist() == [1, 2, 3]
    assert reduced.project([0, 3]).tolist() == [0, 2]
    dear = presolve(form_of(W, P, c=[1, 2, 1, 1]), steps=["clique-dominance"])
    assert dear.columns.tolist() == [0, 1, 2, 3]


def test_a_column_does_not_stand_for_one_with_fewer_conflicts() -> None:
    W, P = [[0.5, 0.6, 0.3]], [[1, 1, 0], [0, 1, 1]]
    assert presolve(form_of(W, P), steps=["clique-dominance"]).columns.tolist() == [0, 1, 2]


@pytest.mark.parametrize("steps", [["cover-dominance"], ["identical"], ["cover-dominance", "identical"]])
def test_what_is_better_everywhere_does_not_make_a_candidate_superfluous(steps: list[str]) -> None:
    reduced = presolve(form_of([[0.6, 0.5]]), steps=steps)
    assert reduced.columns.tolist() == [0, 1]


def test_full_columns_make_others_superfluous() -> None:
    W = [[1.0, 0.5, 0.0], [1.0, 0.0, 1.0]]
    assert presolve(form_of(W), steps=["cover-dominance"]).columns.tolist() == [0]
    assert presolve(form_of(W, c=[2, 1, 2]), steps=["cover-dominance"]).columns.tolist() == [0, 1]


def test_a_few_columns_together_make_one_superfluous() -> None:
    W = [[0.5, 0.6, 0.4, 0.1]]
    assert presolve(form_of(W), steps=["cover-dominance"]).columns.tolist() == [0, 1]
    assert presolve(form_of([[0.3, 0.4, 0.2]]), steps=["cover-dominance"]).columns.tolist() == [0, 1, 2]


@pytest.mark.parametrize(("entry", "kept"), [(1.0, 1), (0.5, 2), (0.34, 3), (0.26, 4), (0.1, 6)])
def test_as_many_copies_stay_as_can_be_useful(entry: float, kept: int) -> None:
    reduced = presolve(form_of([[entry] * 6], c=[3, 1, 2, 1, 1, 1]), steps=["identical"])
    assert len(reduced.columns) == kept
    assert 1 in reduced.columns


def test_pairs_become_a_clique() -> None:
    pairs = [[1, 1, 0, 0], [1, 0, 1, 0], [0, 1, 1, 0], [0, 0, 1, 1]]
    reduced = presolve(form_of([[0.5] * 4], pairs), steps=["cliques"])
    assert sorted(map(tuple, reduced.form.P.toarray().tolist())) == [(0, 0, 1, 1), (1, 1, 1, 0)]
    weighted = presolve(form_of([[0.5] * 3], [[0.6, 0.7, 0.5]]), steps=["cliques"])
    assert weighted.form.P.toarray().tolist() == [[1, 1, 1]]


def test_packing_rows_without_effect_go() -> None:
    reduced = presolve(form_of([[0.5] * 3], [[0.3, 0.3, 0.4], [1.0, 0.0, 0.0], [0.5, 0.6, 0.0]]), steps=["useless"])
    assert reduced.form.P.toarray().tolist() == [[0.5, 0.6, 0.0]]


def test_useless_columns_go_and_gifts_are_taken() -> None:
    reduced = presolve(form_of([[0.5, 0.0, 0.5, 0.5]], [[1, 0, 0, 1]], c=[0, 1, 0, 1]), steps=["useless"])
    assert reduced.forced.tolist() == [2]
    assert reduced.columns.tolist() == [0, 3]


def test_forbidden_columns_are_gone_from_the_start() -> None:
    form = form_of([[1.0, 1.0]])
    form = CoverForm(c=form.c, W=form.W, P=form.P, allowed=np.array([False, True]))
    reduced = presolve(form, steps=[])
    assert reduced.columns.tolist() == [1]
    assert reduced.project([0, 1]).tolist() == [0]


@pytest.mark.parametrize("size", [5, 70, 200])
def test_large_cliques_are_compared_like_small_ones(size: int) -> None:
    rng = np.random.default_rng(size)
    W = rng.integers(1, 8, (3, size)) / 10
    reduced = presolve(form_of(W, np.ones((1, size))), steps=["clique-dominance"])
    over = (W[:, :, None] >= W[:, None, :]).all(axis=0)
    equal = over & over.T
    strict = over & (~equal | (np.arange(size)[:, None] < np.arange(size)))
    assert reduced.columns.tolist() == np.flatnonzero(~strict.any(axis=0)).tolist()


def test_cliques_over_many_rows_are_compared_pair_by_pair() -> None:
    rng = np.random.default_rng(1)
    n, m = 40, 300
    W = np.where(rng.random((m, n)) < 0.2, rng.integers(1, 10, (m, n)) / 10, 0.0)
    better = rng.permutation(n)
    W[:, better[:10]] = np.minimum(W[:, better[10:20]], W[:, better[:10]])
    W[:, better[20]] = W[:, better[21]]
    reduced = presolve(form_of(W, np.ones((1, n))), steps=["clique-dominance"])
    gone = set(better[:10].tolist()) | {max(better[20], better[21])}
    assert set(range(n)) - set(reduced.columns.tolist()) == gone


@pytest.mark.parametrize("formulation", ["clique", "pairwise"])
def test_garments_apart_need_no_search(formulation: str) -> None:
    instance = candidates(garments(20, seed=0), seed=0)
    reduced = presolve(as_cover(registry.formulation(formulation).build(instance)))
    assert reduced.status is Outcome.SOLVED
    coverage = instance.coverage(reduced.lift([]))
    assert (coverage >= instance.required - 1e-9).all()


def test_formulations_of_conflicts_reduce_to_the_same() -> None:
    instance = candidates(garments(12, seed=2, layout="piled"), seed=0)
    one, other = (presolve(as_cover(registry.formulation(name).build(instance))) for name in ("clique", "pairwise"))
    assert one.columns.tolist() == other.columns.tolist()
    assert one.form.P.shape == other.form.P.shape
