"""Certificates: whatever numbers they hold, the bound holds; good numbers make it good."""

from __future__ import annotations

import math
from dataclasses import replace
from fractions import Fraction
from typing import Any, cast

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import pscover
from pscover.certificate import MOST_DEPTH, Certificate, Prices, Split, certified_bound, common_step
from pscover.enumeration import enumerate_best
from pscover.errors import InvalidResult
from pscover.goal import Cover, total_cost
from pscover.instance import Instance
from pscover.io.result import decode, encode
from pscover.relaxation import HUGE, SLACK, groups, sizes
from pscover.testing import random_instance
from pscover.verify import Verdict, verify


def hostile(instance: Instance, random: np.random.Generator, depth: int = 2) -> Prices | Split:
    """Prices of all sizes and signs, and splits anywhere."""
    if depth and instance.elements and random.random() < 0.5:
        few, many = (hostile(instance, random, depth - 1) for _ in range(2))
        return Split(element=int(random.integers(instance.elements)), count=int(random.integers(4)), few=few, many=many)
    size = 10 ** int(random.integers(0, 5))
    entry = random.integers(-size // 3, size + 1, instance.probability.nnz)
    entry[random.random(len(entry)) < 0.3] = 0
    unit = random.integers(0, size + 1, instance.elements) * (random.random() < 0.5)
    return Prices(entry=entry.astype(np.int64), unit=unit.astype(np.int64))


@settings(max_examples=250, deadline=None)
@given(st.integers(0, 2**32 - 1))
def test_no_numbers_prove_too_much(seed: int) -> None:
    random = np.random.default_rng(seed)
    instance = random_instance(random)
    best, plan = enumerate_best(instance, Cover())
    units, scale = int(random.choice([1, 2, 7, 30, 120])), int(random.choice([1, 10, 1000]))
    bound = certified_bound(instance, Certificate(units=units, scale=scale, proof=hostile(instance, random)))
    if best is not None:
        assert bound <= total_cost(instance, plan, Fraction)


@settings(max_examples=60, deadline=None)
@given(st.integers(0, 2**32 - 1))
def test_splits_on_counts_leave_no_plan_out(seed: int) -> None:
    """Prices that are good without limits, under limits that cut the best plan off on one side."""
    random = np.random.default_rng(seed)
    instance = random_instance(random)
    best, plan = enumerate_best(instance, Cover())
    if best is None or not instance.elements:
        return
    even = np.repeat(
        instance.cost / np.maximum(np.diff(instance.probability.indptr), 1), np.diff(instance.probability.indptr)
    )
    prices = Prices(entry=np.floor(even * 1000).astype(np.int64), unit=np.zeros(instance.elements, dtype=np.int64))
    for element in range(instance.elements):
        held = int(sum(instance.probability[element, i] > 0 for i in plan))
        for count in {max(0, held - 1), held}:
            proof = Split(element=element, count=count, few=prices, many=prices)
            bound = certified_bound(instance, Certificate(units=60, scale=1000, proof=proof))
            plain = certified_bound(instance, Certificate(units=60, scale=1000, proof=prices))
            assert plain <= bound <= total_cost(instance, plan, Fraction)


def test_rows_are_solved_exactly() -> None:
    """Two of three are needed: prices of candidates say so, prices of units only once whole costs lift their bound."""
    instance = Instance.of([[0.5, 0.5, 0.5]], required=0.7)
    zero = np.zeros(1, dtype=np.int64)
    certificate = Certificate(units=120, scale=1, proof=Prices(entry=np.ones(3, dtype=np.int64), unit=zero))
    assert certified_bound(instance, certificate) == 2
    # Each is 70 units of 120: 120 / 70 is lifted to the next multiple of a step.
    units = Prices(entry=np.zeros(3, dtype=np.int64), unit=np.ones(1, dtype=np.int64))
    by_units = Certificate(units=120, scale=70, proof=units)
    assert certified_bound(instance, by_units) == 2
    assert certified_bound(replace_cost(instance, [1.0, 1.0, 1.25]), by_units) == Fraction(7, 4)


def replace_cost(instance: Instance, cost: list[float]) -> Instance:
    return Instance.of(instance.probability, instance.required, cost, instance.conflicts)


def test_splits_prove_more_than_prices() -> None:
    """One candidate would do for element 0, or two; with at most one only that one is left."""
    instance = Instance.of([[0.9, 0.6, 0.6, 0.0], [0.0, 0.6, 0.6, 0.9]], cost=[3.0, 2.0, 2.0, 3.0])
    best, _ = enumerate_best(instance, Cover())
    assert best == (4.0,)
    none = np.zeros(2, dtype=np.int64)
    even, nothing = (Prices(entry=np.array(e, dtype=np.int64), unit=none) for e in ((3, 1, 1, 1, 1, 3), (0,) * 6))
    assert certified_bound(instance, Certificate(units=100, scale=1, proof=even)) == 4
    assert certified_bound(instance, Certificate(units=100, scale=1, proof=nothing)) == 0
    # With at most one candidate of each only the dear ones are left: they are paid. No two are four.
    dear = Prices(entry=np.array((3, 0, 0, 0, 0, 3), dtype=np.int64), unit=none)
    inner = Split(element=1, count=1, few=dear, many=even)
    split = Split(element=0, count=1, few=inner, many=even)
    assert certified_bound(instance, Certificate(units=100, scale=1, proof=dear)) == 0
    assert certified_bound(instance, Certificate(units=100, scale=1, proof=split)) == 4


def test_an_instance_without_plans_is_proven_so() -> None:
    instance = Instance.of([[0.6, 0.6, 0.5]], required=0.85, conflicts=[(0, 1)])
    nothing = Prices(entry=np.zeros(3, dtype=np.int64), unit=np.zeros(1, dtype=np.int64))
    certificate = Certificate(units=120, scale=1, proof=nothing)
    assert certified_bound(instance, certificate) == math.inf
    claim = replace(pscover.solve(instance, backend="highs"), certificate=certificate)
    verification = verify(instance, claim)
    assert verification.passed
    assert verification.certified == math.inf


@settings(max_examples=100, deadline=None)
@given(st.lists(st.floats(1e-12, 1.0), min_size=1, max_size=4), st.floats(1e-8, 1 - 1e-9), st.integers(1, 4096))
def test_sizes_are_a_relaxation(probabilities: list[float], required: float, units: int) -> None:
    """A choice that meets the requirement, in exact arithmetic and to within the slack, has enough units."""
    instance = Instance.of([probabilities], required=required)
    size, asks = sizes(instance, units)
    missed = math.prod((1 - Fraction(p) for p in probabilities), start=Fraction(1))
    if missed <= 1 - Fraction(required) + Fraction(SLACK) and asks[0]:
        assert size.sum() >= units
    assert ((size >= 1) | ~asks[0]).all()
    assert (size <= units).all()


def test_plans_within_the_tolerance_of_a_goal_count() -> None:
    required = 1 - 0.3 * 0.3
    instance = Instance.of([[0.7, 0.7, 0.2]], required=required + 0.9e-9, cost=[1.0, 1.0, 1.0])
    assert Cover().evaluate(instance, [0, 1], Fraction).is_feasible
    entry = np.ones(3, dtype=np.int64)
    proof = Prices(entry=entry, unit=np.zeros(1, dtype=np.int64))
    assert certified_bound(instance, Certificate(units=4096, scale=1, proof=proof)) == 2


def test_groups_are_disjoint_and_inside_cliques() -> None:
    random = np.random.default_rng(2)
    for _ in range(50):
        instance = random_instance(random)
        group = groups(instance)
        for g in np.unique(group):
            members = np.flatnonzero(group == g)
            assert len(members) == 1 or any(np.isin(members, clique).all() for clique in instance.conflicts)


def test_common_steps() -> None:
    assert common_step(Instance.of([[0.5] * 3], cost=[4.0, 6.0, 10.0])) == 2
    assert common_step(Instance.of([[0.5] * 2], cost=[0.1, 0.3])) < Fraction(1, 10**9)


GOOD = Instance.of([[0.8, 0.0, 0.75], [0.0, 0.9, 0.75]], required=0.7, conflicts=[(0, 1)])
ZERO = Prices(entry=np.zeros(4, dtype=np.int64), unit=np.zeros(2, dtype=np.int64))


def deep(levels: int) -> Prices | Split:
    proof: Prices | Split = ZERO
    for _ in range(levels):
        proof = Split(element=0, count=1, few=ZERO, many=proof)
    return proof


@pytest.mark.parametrize(
    ("certificate", "where"),
    [
        (Certificate(units=0, scale=1, proof=ZERO), "units"),
        (Certificate(units=5000, scale=1, proof=ZERO), "units"),
        (Certificate(units=10, scale=0, proof=ZERO), "scale"),
        (Certificate(units=10, scale=1, proof=Prices(entry=np.zeros(3, dtype=np.int64), unit=ZERO.unit)), "entry"),
        (Certificate(units=10, scale=1, proof=Prices(entry=ZERO.entry, unit=np.zeros(3, dtype=np.int64))), "unit"),
        (Certificate(units=10, scale=1, proof=Prices(entry=ZERO.entry, unit=np.array([-1, 0]))), "at least 0"),
        (Certificate(units=10, scale=1, proof=Prices(entry=np.array([HUGE, 0, 0, 0]), unit=ZERO.unit)), "2\\^59"),
        (Certificate(units=10, scale=1, proof=Prices(entry=np.array([-(2**63), 0, 0, 0]), unit=ZERO.unit)), "2\\^59"),
        (Certificate(units=10, scale=1, proof=Split(element=2, count=1, few=ZERO, many=ZERO)), "split"),
        (Certificate(units=10, scale=1, proof=Split(element=0, count=-1, few=ZERO, many=ZERO)), "split"),
        (Certificate(units=10, scale=1, proof=deep(MOST_DEPTH + 1)), "splits within"),
    ],
)
def test_what_is_no_certificate_is_refused(certificate: Certificate, where: str) -> None:
    with pytest.raises(InvalidResult, match=where):
        certified_bound(GOOD, certificate)
    result = replace(pscover.solve(GOOD, backend="greedy"), certificate=certificate)
    assert [c.what for c in verify(GOOD, result).checks if c.verdict is Verdict.FAILED] == ["bound"]


def made(units: object = 10, proof: object = ZERO) -> Any:
    return Certificate(units=cast(Any, units), scale=1, proof=cast(Any, proof))


@pytest.mark.parametrize(
    "certificate",
    [
        7,
        made(units="10"),
        made(units=object()),
        made(proof=None),
        made(proof=Prices(entry=cast(Any, "abc"), unit=ZERO.unit)),
        made(proof=Prices(entry=cast(Any, None), unit=ZERO.unit)),
        made(proof=Split(element=cast(Any, "0"), count=1, few=ZERO, many=ZERO)),
        made(proof=Split(element=0, count=cast(Any, 1.5), few=ZERO, many=ZERO)),
        made(proof=Split(element=0, count=1, few=ZERO, many=cast(Any, []))),
    ],
    ids=lambda certificate: type(getattr(certificate, "proof", 0)).__name__,
)
def test_certificates_made_by_hand_of_wrong_types_are_refused(certificate: Any) -> None:
    with pytest.raises(InvalidResult, match=r"^certificate: "):
        certified_bound(GOOD, certificate)
    result = replace(pscover.solve(GOOD, backend="greedy"), certificate=certificate)
    assert [c.what for c in verify(GOOD, result).checks if c.verdict is Verdict.FAILED] == ["bound"]
    with pytest.raises(InvalidResult):
        encode(result)


def test_a_certificate_survives_its_file() -> None:
    proof = Split(element=1, count=1, few=ZERO, many=Prices(entry=np.array([3, -1, 0, 2]), unit=np.array([0, 5])))
    result = replace(pscover.solve(GOOD, backend="greedy"), certificate=Certificate(units=7, scale=9, proof=proof))
    again = decode(encode(result)).certificate
    assert again is not None
    assert isinstance(again.proof, Split)
    assert isinstance(again.proof.many, Prices)
    assert (again.units, again.scale, again.leaves, again.proof.count) == (7, 9, 2, 1)
    assert again.proof.many.entry.tolist() == [3, -1, 0, 2]
    assert again.proof.many.unit.tolist() == [0, 5]
    with pytest.raises(InvalidResult, match="certificate"):
        decode(encode(result).replace(b'"units": 7', b'"units": 0'))


def _wait_for_kernels() -> None:
    """Without them engines have time for plans, but not for prices."""
    pytest.importorskip("numba")
    from pscover.engine.warm import warming

    if not warming().wait(300):
        pytest.skip("the kernels took more than 300 s to compile")


@pytest.mark.parametrize("backend", ["auto", "lagrangian"])
def test_engines_certify_their_bounds(backend: str) -> None:
    _wait_for_kernels()
    from pscover.generate.psc import random_psc

    instance = random_psc(15, 120, covers=3, clique_size=4, required=0.9, cheapest=1, dearest=3, seed=4)
    result = pscover.solve(instance, backend=backend, time=20)
    exact = pscover.solve(instance, backend="highs")
    assert result.certificate is not None
    verification = verify(instance, decode(encode(result)))
    assert verification.passed
    assert verification.certified is not None
    assert 0.8 * exact.objective <= verification.certified <= exact.objective


def test_elements_that_ask_for_nothing_are_passed_over() -> None:
    _wait_for_kernels()
    instance = Instance.of([[0.5, 0.5, 0.5], [0.4, 0.0, 0.9], [0.0, 0.6, 0.6]], required=[0.7, 0.0, 0.5])
    result = pscover.solve(instance, backend="auto")
    assert result.objective == 2
    assert verify(instance, result).certified == 2


def test_other_goals_have_no_certificates() -> None:
    _wait_for_kernels()
    assert pscover.solve(GOOD, backend="auto", formulation="single_cover").certificate is None
    assert pscover.solve(GOOD, backend="auto", margin=0.01).certificate is None


def test_proven_by_certificate() -> None:
    _wait_for_kernels()
    result = pscover.solve(GOOD, backend="auto")
    status = next(c for c in verify(GOOD, result).checks if c.what == "status")
    assert status.verdict is Verdict.PASSED
    assert "proven" in status.detail
