"""The shipped checks: they pass what is right, and notice what is not."""

from __future__ import annotations

from dataclasses import dataclass, replace
from fractions import Fraction
from typing import Any, ClassVar

import numpy as np
import pytest
from hypothesis import given, settings

from pscover import registry
from pscover.errors import Refused
from pscover.formulation import Formulation, Relation
from pscover.goal import Cover, Goal
from pscover.instance import Instance
from pscover.model import Model
from pscover.result import Answer, Observer, Settings, Status
from pscover.testing import (
    check_backend,
    check_formulation,
    conflict_free,
    enumerate_best,
    instances,
    random_instance,
)


@dataclass(frozen=True, slots=True)
class Tampered:
    """The clique formulation with one thing changed."""

    change: Any
    relation: Relation = Relation.EXACT
    tolerance: float = 0.0

    name: ClassVar[str] = "tampered"
    goal: ClassVar[Goal] = Cover()

    def build(self, instance: Instance) -> Model:
        model: Model = self.change(registry.formulation("clique").build(instance), instance)
        return model


def without_conflicts(model: Model, instance: Instance) -> Model:
    rows = model.rows - len(instance.conflicts)
    return replace(model, A=model.A[:rows], lo=model.lo[:rows], hi=model.hi[:rows])


CHANGES: dict[str, Any] = {
    "too strict": lambda model, _: replace(model, lo=model.lo * 1.02),
    "too lax": lambda model, _: replace(model, lo=model.lo * 0.9),
    "without conflicts": without_conflicts,
    "other costs": lambda model, _: replace(model, c=model.c * 1.01),
    "an offset": lambda model, _: replace(model, offset=0.5),
    "not binary": lambda model, _: replace(model, integer=np.zeros(model.variables, dtype=bool)),
    "wrong candidates": lambda model, _: replace(model, candidates=model.candidates - 1),
    "wrong shape": lambda model, _: replace(model, ub=model.ub[1:]),
    "infinite": lambda model, _: replace(model, c=model.c * np.inf),
    "crossed bounds": lambda model, _: replace(model, lo=model.hi + 1, hi=model.hi),
}


@pytest.mark.parametrize("change", CHANGES.values(), ids=CHANGES.keys())
def test_a_wrong_formulation_is_noticed(change: Any) -> None:
    wrong: Formulation = Tampered(change)
    with pytest.raises(AssertionError, match=r"Instance\.of"):
        check_formulation(wrong, np.random.default_rng(0), count=60)


def test_a_wrong_relation_is_noticed() -> None:
    with pytest.raises(AssertionError):
        check_formulation(Tampered(CHANGES["too strict"], Relation.RELAXATION), np.random.default_rng(0), count=60)
    with pytest.raises(AssertionError):
        check_formulation(Tampered(CHANGES["too lax"], Relation.RESTRICTION), np.random.default_rng(0), count=60)


def test_the_right_relation_passes() -> None:
    check_formulation(Tampered(CHANGES["too strict"], Relation.RESTRICTION), np.random.default_rng(0), count=30)
    check_formulation(Tampered(CHANGES["too lax"], Relation.RELAXATION), np.random.default_rng(0), count=30)
    cheaper = Tampered(lambda model, _: replace(model, offset=-0.3), Relation.RELAXATION, 0.3)
    check_formulation(cheaper, np.random.default_rng(0), count=30)


def test_an_objective_off_by_more_than_the_tolerance_is_noticed() -> None:
    cheaper = Tampered(lambda model, _: replace(model, offset=-0.3), Relation.RELAXATION, 0.2)
    with pytest.raises(AssertionError, match="too low"):
        check_formulation(cheaper, np.random.default_rng(0), count=60)


def test_refusals_are_one_sentence() -> None:
    def refuse(model: Model, instance: Instance) -> Model:
        raise Refused("two\nlines")

    with pytest.raises(AssertionError, match="one sentence"):
        check_formulation(Tampered(refuse), np.random.default_rng(0), count=1)


# --- Backends ---------------------------------------------------------------------------------------------------------


@dataclass(frozen=True, slots=True)
class Claimer:
    """An engine that answers the same whatever the model: all candidates, or none, with a claim."""

    status: Status
    chosen: bool

    name: ClassVar[str] = "claimer"
    exact: ClassVar[bool] = True
    isolated: ClassVar[bool] = False
    requires: ClassVar[tuple[str, ...]] = ()
    extra: ClassVar[str] = ""

    def refuses(self, model: Model) -> str | None:
        return None

    def solve(self, model: Model, settings: Settings, observe: Observer) -> Answer:
        plan = np.arange(model.candidates, dtype=np.int32) if self.chosen else None
        return Answer(status=self.status, chosen=plan, bound=-np.inf)


class Guesser(Claimer):
    """The same, without claiming to be exact."""

    exact: ClassVar[bool] = False


@pytest.mark.parametrize("engine", [Claimer, Guesser])
def test_a_backend_that_lies_is_noticed(engine: type[Claimer]) -> None:
    with pytest.raises(AssertionError):
        check_backend(engine(Status.INFEASIBLE, False))


def test_an_exact_backend_must_find_the_optimum() -> None:
    with pytest.raises(AssertionError):
        check_backend(Claimer(Status.OPTIMAL, True))


def test_a_heuristic_may_find_nothing() -> None:
    check_backend(Guesser(Status.UNKNOWN, False))


def test_a_picky_backend_is_noticed() -> None:
    class Picky(Claimer):
        def refuses(self, model: Model) -> str | None:
            return "no"

    with pytest.raises(AssertionError, match="every exact formulation"):
        check_backend(Picky(Status.UNKNOWN, False))


def test_highs_and_greedy_pass() -> None:
    check_backend(registry.backend("highs"), count=20, seed=1)
    check_backend(registry.backend("greedy"), count=20, seed=1)


# --- The oracle -------------------------------------------------------------------------------------------------------


@settings(max_examples=100, deadline=None)
@given(instances())
def test_listing_is_complete(instance: Instance) -> None:
    plans = conflict_free(instance)
    everything = [tuple(i for i in range(instance.candidates) if bits >> i & 1) for bits in range(2**instance.candidates)]
    assert sorted(plans) == sorted(p for p in everything if len(instance.conflicts.broken_by(list(p))) == 0)
    weighed = [(plan, Cover().evaluate(instance, plan, Fraction)) for plan in plans]
    feasible = [evidence.value[0] for _, evidence in weighed if evidence.is_feasible]
    value, chosen = enumerate_best(instance, Cover())
    assert (value is None) == (not feasible)
    if value is not None:
        assert value[0] == pytest.approx(float(min(feasible)))
        assert Cover().evaluate(instance, chosen, Fraction).is_feasible


def test_listing_has_a_limit() -> None:
    with pytest.raises(Refused, match="at most 20 candidates, got 21"):
        conflict_free(Instance.of(np.full((1, 21), 0.5)))


def test_random_instances_have_all_that_is_awkward() -> None:
    random = np.random.default_rng(0)
    drawn = [random_instance(random) for _ in range(300)]
    outcomes = [enumerate_best(instance, Cover())[0] for instance in drawn]
    assert 0.1 < np.mean([value is None for value in outcomes]) < 0.9
    assert any((i.probability.data == 1).any() for i in drawn)
    assert any((i.required == 0).any() for i in drawn)
    assert any((np.bincount(i.probability.indices, minlength=i.elements) == 0).any() for i in drawn)
    assert any((i.cost != np.round(i.cost)).any() for i in drawn)
    assert any(len(np.unique(i.conflicts.members)) < len(i.conflicts.members) for i in drawn)
    again = np.random.default_rng(0)
    assert [i.digest for i in drawn[:20]] == [random_instance(again).digest for _ in range(20)]
