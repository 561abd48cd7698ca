"""Certificates: whatever numbers they hold, the bound holds; good numbers make it good."""

from __future__ import annotations

import copy
import json
import math
from dataclasses import replace
from fractions import Fraction
from typing import Any, cast
from unittest.mock import patch

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import pscover
from pscover import sweeping
from pscover.certificate import Certificate, certified_bound, common_step, refutation
from pscover.enumeration import enumerate_best
from pscover.errors import InvalidResult
from pscover.goal import Cover, total_cost
from pscover.instance import Instance
from pscover.io.result import decode, encode
from pscover.proof import MOST_DEPTH, Part, Parts, Prices, Proof, Split, Sweep
from pscover.relaxation import FINE, HUGE, SLACK, _at_least, groups, sizes
from pscover.result import Status
from pscover.testing import random_instance
from pscover.verify import Verdict, verify


def hostile(
    instance: Instance, random: np.random.Generator, scale: int, elements: np.ndarray | None = None, depth: int = 3
) -> Proof:
    """Prices of all sizes and signs, sweeps to any limit, splits anywhere, and parts that overlap and charge anything."""
    if elements is None:
        elements = np.arange(instance.elements)
    inside = np.isin(instance.probability.indices, elements)
    kind = str(random.choice(["prices", "sweep", "split", "parts"]))
    if depth and len(elements) and kind == "split":
        few, many = (hostile(instance, random, scale, elements, depth - 1) for _ in range(2))
        return Split(element=int(random.choice(elements)), count=int(random.integers(4)), few=few, many=many)
    if depth and len(elements) and kind == "parts":
        chosen = [np.flatnonzero(random.random(len(elements)) < 0.6) for _ in range(int(random.integers(1, 4)))]
        found = tuple(hostile_part(instance, random, scale, elements[some], depth - 1) for some in chosen if len(some))
        if found:
            return Parts(parts=found)
    size = 10 ** int(random.integers(0, 5))
    entry = random.integers(-size // 3, size + 1, int(inside.sum()))
    entry[random.random(len(entry)) < 0.3] = 0
    if random.random() < 0.4:
        # Prices that are worth something: even parts of the costs.
        owner = np.repeat(np.arange(instance.candidates), np.diff(instance.probability.indptr))[inside]
        entry = np.floor(instance.cost[owner] * scale / np.maximum(np.bincount(owner), 1)[owner]).astype(np.int64)
    entry = entry.astype(np.int64)
    if kind in ("sweep", "parts"):
        limit = None if random.random() < 0.3 else int(random.integers(-5, 12 * scale))
        return Sweep(entry=entry, order=random.permutation(elements).astype(np.int64), limit=limit)
    unit = random.integers(0, size + 1, len(elements)) * (random.random() < 0.5)
    return Prices(entry=entry, unit=unit.astype(np.int64))


def hostile_part(instance: Instance, random: np.random.Generator, scale: int, elements: np.ndarray, depth: int) -> Part:
    inside = np.isin(instance.probability.indices, elements)
    owner = np.unique(np.repeat(np.arange(instance.candidates), np.diff(instance.probability.indptr))[inside])
    charged = owner[random.random(len(owner)) < random.choice([0.0, 0.5, 1.0])]
    whole = np.floor(instance.cost[charged] * scale).astype(np.int64)
    charge = whole if random.random() < 0.3 else random.integers(-scale, 3 * scale + 1, len(charged))
    if random.random() < 0.2:
        charge = np.zeros(len(charged), dtype=np.int64)
    proof = hostile(instance, random, scale, elements, depth)
    return Part(elements=elements, charged=charged, charge=charge.astype(np.int64), proof=proof)


@settings(max_examples=300, deadline=None)
@given(st.integers(0, 2**32 - 1))
def test_no_numbers_prove_too_much(seed: int) -> None:
    random = np.random.default_rng(seed)
    instance = random_instance(random)
    best, plan = enumerate_best(instance, Cover())
    units, scale = int(random.choice([1, 2, 7, 30, 120])), int(random.choice([1, 10, 1000]))
    certificate = Certificate(units=units, scale=scale, proof=hostile(instance, random, scale))
    # So small that sweeps compare partial plans here as well.
    with patch.object(sweeping, "MANY", int(random.choice([2, 50]))), patch.object(sweeping, "RIVALS", 5):
        bound = certified_bound(instance, certificate)
    if best is not None:
        assert bound <= total_cost(instance, plan, Fraction)


@settings(max_examples=100, deadline=None)
@given(st.integers(0, 2**32 - 1))
def test_a_sweep_finds_the_cost_of_the_best_plan(seed: int) -> None:
    """With any prices and order, where nothing is met by a hair."""
    random = np.random.default_rng(seed)
    instance = random_instance(random)
    best, plan = enumerate_best(instance, Cover())
    entry = random.integers(-20, 60, instance.probability.nnz).astype(np.int64)
    sweep = Sweep(entry=entry, order=random.permutation(instance.elements).astype(np.int64), limit=None)
    bound = certified_bound(instance, Certificate(units=1, scale=64, proof=sweep))
    if best is None:
        loose, _ = enumerate_best(with_less_required(instance), Cover())
        assert bound == math.inf or loose is not None
        return
    exact = total_cost(instance, plan, Fraction)
    assert bound <= exact
    lenient, cheaper = enumerate_best(with_less_required(instance), Cover())
    assert lenient is not None
    # Costs are rounded down to parts of 64.
    assert bound > total_cost(instance, cheaper, Fraction) - Fraction(instance.candidates, 64)


def with_less_required(instance: Instance) -> Instance:
    """What sweeps may take for met: sizes are rounded up to 2^-16 of the demand."""
    missed = np.maximum(1.0 - instance.required, 1e-12)
    required = 1.0 - missed ** (1.0 - instance.candidates / 60000.0)
    return Instance.of(instance.probability, np.clip(required, 0.0, 1.0), instance.cost, list(instance.conflicts))


def test_parts_are_lifted_one_by_one() -> None:
    """Two of three are needed for each element; units alone say 120 / 70 of each."""
    instance = Instance.of([[0.5] * 3 + [0.0] * 3, [0.0] * 3 + [0.5] * 3], required=0.7)
    unit = np.ones(1, dtype=np.int64)
    none = np.zeros(0, dtype=np.int64)
    parts = tuple(
        Part(
            elements=np.array([j]),
            charged=none,
            charge=none,
            proof=Prices(entry=np.zeros(3, dtype=np.int64), unit=unit),
        )
        for j in range(2)
    )
    whole = Prices(entry=np.zeros(6, dtype=np.int64), unit=np.ones(2, dtype=np.int64))
    assert certified_bound(instance, Certificate(units=120, scale=100, proof=whole)) == 3
    assert certified_bound(instance, Certificate(units=120, scale=100, proof=Parts(parts=parts))) == 4


def test_parts_share_a_candidate() -> None:
    """It is charged once, wherever that is, and what is charged too much is given back."""
    instance = Instance.of([[0.9, 0.0, 0.9], [0.0, 0.9, 0.9]], cost=[2.0, 2.0, 3.0])
    for first, proven in ((0, 2), (1, 3), (2, 3), (3, 2), (4, 1)):
        found = []
        for j, charge in ((0, first), (1, 3 - first)):
            sweep = Sweep(entry=np.zeros(2, dtype=np.int64), order=np.array([j]), limit=None)
            found.append(Part(elements=np.array([j]), charged=np.array([2]), charge=np.array([charge]), proof=sweep))
        assert certified_bound(instance, Certificate(units=1, scale=1, proof=Parts(parts=tuple(found)))) == proven
    left = replace(found[0], charge=np.array([7]))
    # Left of candidate 2 are 3 - 7 + 1, which the sum over groups counts.
    assert certified_bound(instance, Certificate(units=1, scale=1, proof=Parts(parts=(left, found[1])))) <= 3


def test_a_row_that_cannot_be_met_is_refuted() -> None:
    instance = Instance.of([[0.6, 0.6, 0.5], [0.9, 0.9, 0.9]], required=[0.85, 0.5], conflicts=[(0, 1)])
    rows = instance.probability.tocsr()
    assert certified_bound(instance, refutation(rows, [[0]])) == math.inf
    assert certified_bound(instance, refutation(rows, [[1]])) == 0
    assert certified_bound(instance, refutation(rows, [[1], [1, 0]])) == math.inf


def test_a_sweep_ends_where_it_takes_too_much_work(monkeypatch: pytest.MonkeyPatch) -> None:
    """What it has come to by then is a bound."""
    random = np.random.default_rng(5)
    probability = random.uniform(0.1, 0.6, (3, 9))
    instance = Instance.of(probability, required=0.8)
    even = np.full(27, 33, dtype=np.int64)
    certificate = Certificate(units=1, scale=100, proof=Sweep(entry=even, order=np.arange(3, dtype=np.int64), limit=10_000))
    best, _ = enumerate_best(instance, Cover())
    assert best is not None
    found = []
    for work in (1, 300, 3000, 10**6):
        monkeypatch.setattr("pscover.certificate.MOST_WORK", work)
        found.append(certified_bound(instance, certificate))
    assert found == sorted(found)
    assert 0 < found[0] < found[-1] == best[0]


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


NONE = np.zeros(0, dtype=np.int64)
SWEEP = Sweep(entry=ZERO.entry, order=np.array([1, 0]), limit=3)
PART = Part(
    elements=np.array([1]),
    charged=np.array([2]),
    charge=np.array([5]),
    proof=Prices(entry=np.array([1, 2]), unit=np.array([3])),
)


def parted(**changes: Any) -> Certificate:
    return Certificate(units=10, scale=1, proof=Parts(parts=(replace(PART, **changes),)))


def swept(**changes: Any) -> Certificate:
    return Certificate(units=10, scale=1, proof=replace(SWEEP, **changes))


def nested(levels: int) -> Proof:
    proof: Proof = PART.proof
    for _ in range(levels):
        proof = Parts(parts=(replace(PART, proof=proof),))
    return proof


def deep(levels: int) -> Proof:
    proof: Proof = ZERO
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
        (Certificate(units=10, scale=1, proof=deep(MOST_DEPTH + 1)), "splits and parts within"),
        (Certificate(units=10, scale=1, proof=nested(MOST_DEPTH + 1)), "splits and parts within"),
        (Certificate(units=10, scale=1, proof=Parts(parts=())), "no parts"),
        (parted(elements=NONE, proof=Prices(entry=NONE, unit=NONE)), "elements"),
        (parted(elements=np.array([2])), "elements"),
        (parted(elements=np.array([-1])), "elements"),
        (parted(elements=np.array([1, 1])), "elements"),
        (parted(elements=np.array([1, 0])), "elements"),
        (parted(elements=np.array([0, 1])), "entry"),
        (parted(charged=np.array([3])), "charged"),
        (parted(charged=np.array([-1])), "charged"),
        (parted(charged=np.array([0])), "cover an element"),
        (parted(charged=np.array([2, 1]), charge=np.array([1, 1])), "charged"),
        (parted(charged=NONE), "charges"),
        (parted(charge=np.array([2**55])), "2\\^55"),
        (parted(charge=np.array([-(2**63)])), "2\\^55"),
        (parted(proof=ZERO), "entry"),
        (parted(proof=Split(element=0, count=1, few=PART.proof, many=PART.proof)), "split"),
        (swept(order=np.array([0])), "order"),
        (swept(order=np.array([0, 0])), "order"),
        (swept(order=np.array([0, 2])), "order"),
        (swept(entry=ZERO.entry[1:]), "entry"),
        (swept(entry=np.array([2**55, 0, 0, 0])), "2\\^55"),
        (swept(limit=2**60), "limit"),
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
        made(proof=Parts(parts=cast(Any, [PART]))),
        made(proof=Parts(parts=(cast(Any, None),))),
        made(proof=Parts(parts=cast(Any, None))),
        made(proof=replace(SWEEP, limit=cast(Any, 1.5))),
        made(proof=replace(SWEEP, order=cast(Any, [0, 1]))),
        made(proof=Parts(parts=(replace(PART, charged=cast(Any, None)),))),
        made(proof=Parts(parts=(replace(PART, elements=np.array([1.0])),))),
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


def test_parts_and_sweeps_survive_their_file() -> None:
    inner = replace(PART, proof=Sweep(entry=np.array([4, -2]), order=np.array([1]), limit=None))
    outer = Split(element=0, count=1, few=SWEEP, many=Parts(parts=(PART, inner)))
    certificate = Certificate(units=7, scale=9, proof=outer)
    result = replace(pscover.solve(GOOD, backend="greedy"), certificate=certificate)
    text = encode(result)
    again = decode(text)
    assert encode(again) == text
    assert again.certificate is not None
    assert again.certificate.leaves == 3
    assert certified_bound(GOOD, again.certificate) == certified_bound(GOOD, certificate)
    proof = again.certificate.proof
    assert isinstance(proof, Split)
    assert isinstance(proof.few, Sweep)
    assert isinstance(proof.many, Parts)
    assert (proof.few.limit, proof.few.order.tolist()) == (3, [1, 0])
    one, other = proof.many.parts
    assert (one.elements.tolist(), one.charged.tolist(), one.charge.tolist()) == ([1], [2], [5])
    assert isinstance(other.proof, Sweep)
    assert other.proof.limit is None


def test_files_of_parts_that_are_none_are_refused() -> None:
    certificate = Certificate(units=7, scale=9, proof=Parts(parts=(PART,)))
    text = encode(replace(pscover.solve(GOOD, backend="greedy"), certificate=certificate))
    whole = json.loads(text)
    part = whole["certificate"]["proof"]["parts"][0]
    for proof in (
        {"type": "parts", "parts": []},
        {"type": "part", "parts": [part]},
        *({"type": "parts", "parts": [{**part, **more}]} for more in ({"elements": "1"}, {"charge": [2**60]}, {"x": 1})),
        {"type": "parts", "parts": [{key: part[key] for key in part if key != "charged"}]},
        {"type": "sweep", "entry": [1, 2], "order": [0, 1]},
    ):
        broken = copy.deepcopy(whole)
        broken["certificate"]["proof"] = proof
        with pytest.raises(InvalidResult, match="certificate"):
            decode(json.dumps(broken).encode())
    many = copy.deepcopy(whole)
    for _ in range(MOST_DEPTH + 1):
        part = {"elements": [1], "charged": [], "charge": [], "proof": many["certificate"]["proof"]}
        many["certificate"]["proof"] = {"type": "parts", "parts": [part]}
    with pytest.raises(InvalidResult, match="within each other"):
        decode(json.dumps(many).encode())


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


@pytest.mark.parametrize("goes", ["at once", "by presolve"])
def test_what_auto_proves_is_certified(goes: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """Plans and that there are none, also where presolve has taken candidates in and out, and cliques overlap."""
    _wait_for_kernels()
    from pscover.backends.auto import Auto

    if goes == "by presolve":
        monkeypatch.setattr(Auto, "_at_once", lambda *_: (None, None))
    found = dict.fromkeys(Status, 0)
    for seed in range(60):
        random = np.random.default_rng(seed)
        instance = random_instance(random) if seed % 2 else of_cliques(random, seed)
        result = pscover.solve(instance, backend="auto", time=20)
        verification = verify(instance, result)
        assert verification.passed
        assert verification.certified is not None
        assert verification.certified >= result.objective * (1 - 1e-9)
        found[result.status] += 1
    assert found[Status.OPTIMAL] >= 20
    assert found[Status.INFEASIBLE] >= 10


def test_candidates_in_every_plan_are_charged_where_they_are_needed(monkeypatch: pytest.MonkeyPatch) -> None:
    """Block by block after presolve, as for large instances: bounds hold, and most are all that is claimed."""
    _wait_for_kernels()
    from pscover.backends.auto import Auto

    monkeypatch.setattr(Auto, "_at_once", lambda *_: (None, None))
    monkeypatch.setattr("pscover.engine.certify.SWEPT", 0)
    full = 0
    for seed in range(60):
        random = np.random.default_rng(seed)
        instance = random_instance(random) if seed % 2 else of_cliques(random, seed)
        verification = verify(instance, result := pscover.solve(instance, backend="auto", time=20))
        assert verification.passed
        assert verification.certified is not None
        assert verification.certified <= result.objective * (1 + 1e-9)
        full += bool(verification.certified >= result.objective * (1 - 1e-9))
    assert full >= 45


def of_cliques(random: np.random.Generator, seed: int) -> Instance:
    """Small enough for a proof, too large to be enumerated; some of them without a plan."""
    from pscover.generate.psc import random_psc

    elements, candidates, covers, size = (int(random.integers(*ends)) for ends in ((3, 12), (20, 90), (1, 4), (2, 6)))
    required = float(random.choice([0.7, 0.9]))
    return random_psc(
        elements, candidates, covers=covers, clique_size=size, required=required, cheapest=1, dearest=3, seed=seed
    )


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


def test_levels_of_prices_bound_what_rows_cost() -> None:
    random = np.random.default_rng(3)
    close = 0
    for _ in range(150):
        count = int(random.integers(1, 9))
        group = np.sort(random.integers(0, 6, count))
        price = random.integers(-20, [3, 50, 10**6][random.integers(3)], count)
        fine = random.integers(1, FINE + 1, count)
        best = math.inf
        for bits in range(1 << count):
            held = np.flatnonzero((bits >> np.arange(count)) & 1)
            if len(set(group[held].tolist())) == len(held) and fine[held].sum() >= FINE:
                best = min(best, int(price[held].sum()))
        found = _at_least(group, price, fine)
        assert found <= best
        close += best < math.inf and best - found <= 0.01 * abs(best) + 60
    assert close > 50


def test_prices_that_a_few_units_cannot_tell_apart_prove_more() -> None:
    instance = Instance.of([[0.4999] * 5], required=0.75, cost=[1.0] * 5)
    # Two of them lack a trifle, which rounding up to tenths makes up for.
    prices = Prices(entry=np.full(5, 4), unit=np.zeros(1, dtype=np.int64))
    assert certified_bound(instance, Certificate(units=10, scale=4, proof=prices)) == 3
