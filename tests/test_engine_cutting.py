"""Inequalities of rows cut off no plan, and the prices of a relaxation with them prove what they say."""

from __future__ import annotations

import itertools
from collections.abc import Iterator

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.sparse import csr_array

pytest.importorskip("numba")
pytest.importorskip("highspy")

from pscover import registry
from pscover.engine import cutting as module
from pscover.engine.block import Block
from pscover.engine.cutting import Cutting
from pscover.engine.problem import problem_of
from pscover.engine.programme import Programme
from pscover.engine.rounding import Rounded, rounded, violated
from pscover.enumeration import enumerate_best
from pscover.generate.psc import random_psc
from pscover.goal import Cover
from pscover.model import CoverForm, as_cover
from pscover.result import Settings, Status

FloatArray = NDArray[np.float64]


def forms(count: int, candidates: int = 14) -> Iterator[tuple[CoverForm, float]]:
    for seed in range(count):
        instance = random_psc(5, candidates, covers=3, clique_size=3, required=0.95, cheapest=2, dearest=5, seed=seed)
        best, _ = enumerate_best(instance, Cover())
        if best is not None:
            yield as_cover(registry.formulation("clique").build(instance)), best[0]


def finished(form: CoverForm) -> Cutting:
    _, kept = problem_of(form)
    found = Cutting(form, kept, form.c[kept])
    while not found.is_finished:
        found.turn()
    return found


def whole_points(count: int) -> FloatArray:
    return np.array(list(itertools.product((0.0, 1.0), repeat=count)))


def test_inequalities_hold_for_every_choice_that_meets_the_row() -> None:
    random = np.random.default_rng(5)
    seen, flipped = 0, 0
    choices = whole_points(9)
    for _ in range(150):
        entries = random.choice([0.1, 0.2, 0.25, 1 / 3, 0.4, 0.5, 0.7, 1.0, random.uniform()], 9)
        W = csr_array(entries[None])
        meets = choices[choices @ entries >= 1 - 1e-9]
        point = np.round(random.uniform(0, 1, 9) ** 2, 2) * (random.uniform(size=9) < 0.7)
        point[random.integers(9)] = 1.0
        for one in violated(W, point):
            found = rounded(entries, point, one)
            assert found is not None
            coefficients, right = found
            assert (coefficients >= 0).all()
            assert coefficients @ point < right
            assert (meets @ coefficients >= right - 1e-9).all()
            seen += 1
            flipped += bool((point >= one.level).any())
    assert seen > 60
    assert flipped > 20


def test_bounds_hold_and_close_much_of_the_gap() -> None:
    gap = left = 0.0
    for form, best in forms(40):
        found = finished(form)
        both = csr_array(np.vstack([form.W.toarray(), -form.P.toarray()]))
        plain = Programme(form.c, both, np.repeat([1.0, -1.0], [5, form.P.shape[0]]))
        assert plain.run(10_000, 10.0)
        assert form.c @ plain.x - 1e-6 <= found.bound <= best + 1e-7
        gap += best - float(form.c @ plain.x)
        left += best - found.bound
    assert left < 0.6 * gap


def test_what_rows_pay_proves_the_bound() -> None:
    proven = 0
    for form, best in forms(25):
        problem, kept = problem_of(form)
        found = finished(form)
        paid, rows = found.paid_in(problem), np.repeat(np.arange(problem.rows), np.diff(problem.rptr))
        candidate = problem.lines["candidate"]
        total = np.bincount(candidate, paid, problem.candidates)
        assert total + found.reduced == pytest.approx(form.c[kept] + found.toll)
        cliques = form.P.toarray()[:, kept]
        choices = whole_points(len(kept))
        free = choices[(choices @ cliques.T <= 1).all(axis=1)]
        for row in range(problem.rows):
            mine = rows == row
            entry, price = np.zeros(len(kept)), np.zeros(len(kept))
            entry[candidate[mine]], price[candidate[mine]] = problem.lines["entry"][mine], paid[mine]
            meets = free[free @ entry >= 1 - 1e-9]
            assert (meets @ price).min() >= found.least[row] - 1e-7
        proven += 0.0 < found.bound <= best + 1e-7
    assert proven >= 10


def test_candidates_left_out_at_first_come_in_where_prices_want_them(monkeypatch: pytest.MonkeyPatch) -> None:
    joined = 0
    for form, best in forms(15, candidates=18):
        whole = finished(form)
        with monkeypatch.context() as few:
            few.setattr(module, "CORE", 1)
            few.setattr(module, "EACH", 1)
            _, kept = problem_of(form)
            found = Cutting(form, kept, form.c[kept])
            first = len(found._columns)
            while not found.is_finished:
                found.turn()
        assert found.bound <= best + 1e-7
        assert found.bound == pytest.approx(whole.bound, rel=0.05)
        joined += len(found._columns) > first
    assert joined >= 5


def test_a_form_without_a_plan_is_refuted() -> None:
    form = CoverForm(
        c=np.ones(3), W=csr_array([[0.6, 0.6, 0.6]]), P=csr_array([[1.0, 1.0, 1.0]]), allowed=np.ones(3, dtype=np.bool_)
    )
    block = Block(form, np.arange(3, dtype=np.int32), 0, 1.0)
    for _ in range(400):
        if not block.is_open:
            break
        block.bind()
    assert block.is_infeasible


def test_no_time_is_no_failure() -> None:
    programme = Programme(np.ones(2), csr_array([[1.0, 0.5]]), np.ones(1))
    assert not programme.run(0, 1.0)
    assert not programme.has_failed
    assert programme.run(100, 1.0)


def test_a_block_takes_the_prices_and_proves_no_less() -> None:
    for form, best in forms(8):
        block = Block(form, np.arange(len(form.c), dtype=np.int32), 0, 0.0)
        bound = finished(form).bound
        while not block.is_settled and block.is_open:
            block.bind()
            assert block.bound <= best + 1e-7
        assert not block.is_open or block.bound >= bound - 1e-6 * abs(bound)


def test_a_model_with_the_inequalities_has_the_same_optimum() -> None:
    seen = 0
    for form, best in forms(8):
        block = Block(form, np.arange(len(form.c), dtype=np.int32), 0, 0.0)
        while not block.is_settled and block.is_open:
            block.bind()
        model, kept = block.model()
        seen += model.rows > len(form.among(kept).P.indptr) - 1 + form.W.shape[0]
        found = registry.backend("highs").solve(model, Settings(time=20.0), lambda _: False)
        assert found.status is Status.OPTIMAL
        assert found.chosen is not None
        assert form.c[kept[found.chosen]].sum() == pytest.approx(best)
    assert seen >= 4


def test_nothing_is_rounded_where_other_candidates_are_in_the_point() -> None:
    entries, point = np.full(40, 0.3), np.full(40, 0.9)
    found = violated(csr_array(entries[None]), point)
    assert all(rounded(entries, point, one) is None for one in found)
    wide = Rounded(missed=1.0, row=0, divisor=0.3, level=0.5)
    assert rounded(entries, point, wide) is None


def test_more_cliques_than_candidates_keep_the_bound() -> None:
    seen = 0
    for seed in range(12):
        random = np.random.default_rng(seed)
        W = csr_array(random.uniform(0.2, 0.7, (3, 10)) * (random.uniform(size=(3, 10)) < 0.8))
        pairs = [(a, b) for a, b in itertools.combinations(range(10), 2) if random.uniform() < 0.5]
        P = csr_array(
            (np.ones(2 * len(pairs)), np.array(pairs).ravel(), 2 * np.arange(len(pairs) + 1)), shape=(len(pairs), 10)
        )
        form = CoverForm(c=random.integers(1, 6, 10).astype(float), W=W, P=P, allowed=np.ones(10, dtype=np.bool_))
        choices = whole_points(10)
        good = (choices @ P.toarray().T <= 1).all(axis=1) & (choices @ W.toarray().T >= 1 - 1e-9).all(axis=1)
        best = (choices[good] @ form.c).min(initial=np.inf)
        seen += np.isfinite(best)
        _, kept = problem_of(form)
        found = Cutting(form, kept, form.c[kept])
        while not found.is_finished:
            found.turn()
            assert found.bound <= best + 1e-7
    assert seen >= 6
