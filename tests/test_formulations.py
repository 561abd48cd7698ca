"""Every formulation: its card's claims, its goal, and its model against enumeration of that goal."""

from __future__ import annotations

import importlib
import math
import sys
from collections.abc import Callable
from dataclasses import fields
from fractions import Fraction
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from scipy.optimize import Bounds, LinearConstraint, milp

from pscover import registry
from pscover.errors import InvalidSettings, Refused, UnknownName
from pscover.formulation import Formulation, Relation
from pscover.goal import Cover
from pscover.instance import TOLERANCE, Instance
from pscover.model import Model
from pscover.testing import check_formulation, check_model, conflict_free, enumerate_best, instances, random_instance

NAMES = registry.names("formulation")
VARIANTS: list[tuple[str, dict[str, Any]]] = [
    *((name, {}) for name in NAMES),
    ("budgeted", {"budget": 0.0}),
    ("budgeted", {"budget": 2.5, "tolerance": 0.05}),
    ("budgeted", {"tolerance": 50.0}),
    ("joint", {"side": "relaxation"}),
    ("joint", {"required": 0.05, "precision": 0.01}),
    ("joint", {"required": 0.05, "precision": 0.01, "side": "relaxation"}),
    ("joint", {"required": 0.9999}),
    ("joint", {"required": 0.3, "precision": 1.0}),
    ("robust", {"gamma": 0}),
    ("robust", {"gamma": 2, "deviation": 0.3}),
    ("robust", {"gamma": 100, "deviation": 0.05}),
    ("robust", {"deviation": 1.0}),
    ("scenario", {"count": 7, "seed": 3}),
    ("scenario", {"correlation": 1.0}),
    ("scenario", {"count": 1, "correlation": 0.5}),
]


def ids(variant: tuple[str, dict[str, Any]]) -> str:
    return "-".join([variant[0], *(f"{key}={value}" for key, value in variant[1].items())])


@pytest.fixture(params=VARIANTS, ids=ids)
def form(request: pytest.FixtureRequest) -> Formulation:
    name, options = request.param
    return registry.formulation(name, options)


def module_of(name: str) -> Any:
    return sys.modules[registry.lookup("formulation", name).__module__]


def optimum(model: Model) -> float | None:
    """The first objective's optimum by SciPy, or None if infeasible."""
    found = milp(
        model.c,
        integrality=model.integer.astype(int),
        bounds=Bounds(np.zeros(model.variables), model.ub),
        constraints=[LinearConstraint(model.A, model.lo, model.hi)] if model.rows else [],
        options={"mip_rel_gap": 0.0},
    )
    return None if found.x is None else float(found.fun)


def linear_bound(model: Model) -> float | None:
    """The optimum of the linear relaxation."""
    found = milp(
        model.c,
        bounds=Bounds(np.zeros(model.variables), model.ub),
        constraints=[LinearConstraint(model.A, model.lo, model.hi)] if model.rows else [],
    )
    return None if found.x is None else float(found.fun)


# --- Everything at once -----------------------------------------------------------------------------------------------


def test_the_model_agrees_with_enumeration(form: Formulation) -> None:
    check_formulation(form, np.random.default_rng(11), count=25)


def test_edge_instances_build(form: Formulation) -> None:
    nothing = Instance.of(np.zeros((0, 0)))
    no_candidates = Instance.of(np.zeros((2, 0)))
    no_elements = Instance.of(np.zeros((0, 2)), conflicts=[(0, 1)])
    only_zeros = Instance.of(np.zeros((2, 2)), required=0.0)
    certain = Instance.of([[1.0]], required=0.999999)
    for instance in (nothing, no_candidates, no_elements, only_zeros, certain):
        check_model(form.build(instance), instance)


def test_margins_do_not_disturb(form: Formulation) -> None:
    random = np.random.default_rng(5)
    for _ in range(10):
        instance = random_instance(random)
        raised = instance.require(np.where(instance.required > 0, instance.required + 0.01, 0.0))
        check_model(form.build(raised), raised)


def test_float_and_exact_arithmetic_agree(form: Formulation) -> None:
    random = np.random.default_rng(7)
    for _ in range(30):
        instance = random_instance(random)
        for plan in conflict_free(instance)[:: int(random.integers(1, 5))]:
            quick = form.goal.evaluate(instance, plan, float)
            exact = form.goal.evaluate(instance, plan, Fraction)
            assert all(isinstance(v, Fraction) for v in (*exact.value, *exact.shortfall))
            assert [float(v) for v in exact.value] == pytest.approx([float(v) for v in quick.value], abs=1e-12)
            assert [float(v) for v in exact.shortfall] == pytest.approx([float(v) for v in quick.shortfall], abs=1e-12)


def test_cuts_spare_every_feasible_plan(form: Formulation) -> None:
    random = np.random.default_rng(3)
    cut_off = 0
    for _ in range(25):
        instance = random_instance(random)
        weighed = [(plan, form.goal.evaluate(instance, plan, float).is_feasible) for plan in conflict_free(instance)]
        feasible = [set(plan) for plan, good in weighed if good]
        for plan, good in weighed:
            groups = [set(group) for group in form.goal.missing(instance, plan)]
            assert not (good and groups)
            for group in groups:
                cut_off += 1
                assert group.isdisjoint(plan)
                assert all(not group.isdisjoint(other) for other in feasible), (instance, plan, group)
            if not good and form.name != "budgeted":
                assert groups
    assert cut_off > 0 or form.name in ("budgeted", "elastic")


@pytest.mark.parametrize(
    ("name", "options"),
    [
        ("robust", {"gamma": 10**400}),
        ("robust", {"deviation": 1.0, "gamma": 5}),
        ("budgeted", {"budget": 0.0}),
        ("budgeted", {"tolerance": 1e300}),
        ("budgeted", {"weights": [0.0, 0.0]}),
        ("joint", {"required": 1e-9}),
        ("joint", {"required": 1e-9, "side": "relaxation"}),
        ("joint", {"required": float(np.nextafter(1, 0))}),
        ("joint", {"precision": 1.0}),
        ("scenario", {"count": 1, "correlation": 1.0}),
    ],
)
def test_parameters_at_the_ends_of_their_ranges_build(name: str, options: dict[str, Any]) -> None:
    instance = Instance.of([[1.0, 0.5], [0.5, 0.9]], required=0.8)
    model = registry.formulation(name, options).build(instance)
    assert np.isfinite(model.A.data).all()
    assert not np.isnan(model.lo).any()
    assert not np.isnan(model.hi).any()


@pytest.mark.parametrize("required", [0.0, 5e-324, 1e-300, 1.0])
def test_a_joint_probability_beyond_all_engines_is_refused(required: float) -> None:
    with pytest.raises(InvalidSettings, match="required: expected a probability"):
        registry.formulation("joint", {"required": required})


def test_weights_without_a_finite_sum_are_refused() -> None:
    with pytest.raises(InvalidSettings, match="weights: expected numbers with a finite sum"):
        registry.formulation("budgeted", {"weights": [1e308, 1e308]})


def test_contract(form: Formulation) -> None:
    assert form.name in NAMES
    assert isinstance(form.relation, Relation)
    assert form.tolerance >= 0
    if form.relation is Relation.EXACT:
        assert form.tolerance == 0
    assert module_of(form.name).formulation is type(form)


@pytest.mark.parametrize("name", NAMES)
def test_unknown_parameters_are_named(name: str) -> None:
    with pytest.raises(UnknownName, match="colour"):
        registry.formulation(name, {"colour": 3})


# --- The size claims of the cards -------------------------------------------------------------------------------------


def covered(instance: Instance, keep: Callable[[Any, Any], Any] = lambda p, q: p > 0) -> int:
    """How many stored probabilities of elements with q_j > 0 satisfy a condition on (p_ij, q_j)."""
    entries = instance.probability.tocoo()
    q = instance.required[entries.row]
    return int(((q > 0) & keep(entries.data, q)).sum())


def pairwise_size(instance: Instance, form: Any) -> tuple[int, int, int]:
    pairs = len({pair for clique in instance.conflicts for pair in _pairs(clique.tolist())})
    entries = instance.probability.tocoo()
    idle = int(((entries.data == 1) & (instance.required[entries.row] == 0)).sum())
    return instance.candidates, instance.elements + pairs, instance.probability.nnz - idle + 2 * pairs


def _pairs(clique: list[int]) -> list[tuple[int, int]]:
    return [(i, k) for i in clique for k in clique if i < k]


def clique_size(instance: Instance, form: Any) -> tuple[int, int, int]:
    m, q, members = needed(instance), len(instance.conflicts), len(instance.conflicts.members)
    return instance.candidates, m + q, covered(instance) + members


def single_cover_size(instance: Instance, form: Any) -> tuple[int, int, int]:
    m, q, members = needed(instance), len(instance.conflicts), len(instance.conflicts.members)
    return instance.candidates, m + q, covered(instance, lambda p, q: p >= q) + members


def elastic_size(instance: Instance, form: Any) -> tuple[int, int, int]:
    m, q, members = needed(instance), len(instance.conflicts), len(instance.conflicts.members)
    return instance.candidates + 2 * m, 2 * m + q, covered(instance) + members + 3 * m


def budgeted_size(instance: Instance, form: Any) -> tuple[int, int, int]:
    n, m, q, k = instance.candidates, instance.elements, len(instance.conflicts), len(form.lines(instance))
    assert k <= 2 + 0.72 / math.sqrt(form.tolerance / m)
    nonzeros = 2 * k * m + m + n + instance.probability.nnz + len(instance.conflicts.members)
    return n + 2 * m, (k + 1) * m + 1 + q, nonzeros


def joint_size(instance: Instance, form: Any) -> tuple[int, int, int]:
    n, m, q = instance.candidates, needed(instance), len(instance.conflicts)
    members = len(instance.conflicts.members)
    if m == 0:
        return n, q, members
    k = len(form.lines(m))
    least, error = -math.log(1 - form.required), 0.9 * form.slack / m
    assert k == pytest.approx(-math.log(math.tanh(least / 4)) / math.sqrt(8 * error), rel=0.1, abs=2)
    return n + 2 * m, (k + 2) * m + 1 + q, (2 * k + 2) * m + members + 2 * covered(instance)


def robust_size(instance: Instance, form: Any) -> tuple[int, int, int]:
    n, m, q, members = instance.candidates, needed(instance), len(instance.conflicts), len(instance.conflicts.members)
    k = guarded = positive = 0
    for j in np.flatnonzero(instance.required > 0):
        p = instance.probability.toarray()[j]
        b = -math.log1p(-instance.required[j])
        nominal = [min(1.0, weight(x) / b) for x in p if x > 0]
        worst = [min(1.0, weight(max(0.0, x - form.deviation)) / b) for x in p if x > 0]
        drops = sum(a > w for a, w in zip(nominal, worst, strict=True))
        is_guarded = drops > form.gamma >= 1
        k, guarded = k + is_guarded * drops, guarded + is_guarded
        positive += sum(a > 0 for a in (nominal if is_guarded or form.gamma == 0 else worst))
    return n + guarded + k, m + k + q, 4 * k + guarded + positive + members


def weight(p: float) -> float:
    return math.inf if p == 1 else -math.log1p(-p)


def scenario_size(instance: Instance, form: Any) -> tuple[int, int, int]:
    outcomes, members = form.draw(instance), len(instance.conflicts.members)
    distinct = successes = 0
    for j in np.flatnonzero(instance.required > 0):
        block = outcomes[:, instance.probability.indices == j]
        sets = {tuple(row) for row in block.tolist() if any(row)}
        distinct, successes = distinct + len(sets), successes + sum(map(sum, sets))
    n, m, scenarios = instance.candidates, needed(instance), len(outcomes)
    assert distinct <= m * scenarios
    return n + distinct, distinct + m + len(instance.conflicts), 2 * distinct + successes + members


def needed(instance: Instance) -> int:
    return int((instance.required > 0).sum())


SIZES: dict[str, Callable[[Instance, Any], tuple[int, int, int]]] = {
    "budgeted": budgeted_size,
    "clique": clique_size,
    "elastic": elastic_size,
    "joint": joint_size,
    "pairwise": pairwise_size,
    "robust": robust_size,
    "scenario": scenario_size,
    "single_cover": single_cover_size,
}


def test_size_is_as_the_card_says(form: Formulation) -> None:
    if form.name not in SIZES:
        pytest.fail(f"write down the size that the card of {form.name!r} claims")
    random = np.random.default_rng(23)
    for _ in range(25):
        instance = random_instance(random)
        model = form.build(instance)
        assert (model.variables, model.rows, model.nonzeros) == SIZES[form.name](instance, form)


# --- Each by hand -----------------------------------------------------------------------------------------------------


@settings(max_examples=40, deadline=None)
@given(instances())
def test_clique_is_never_weaker_than_pairwise(instance: Instance) -> None:
    clique, pairwise = (registry.formulation(name).build(instance) for name in ("clique", "pairwise"))
    assert (optimum(clique) is None) == (optimum(pairwise) is None)
    tight, loose = linear_bound(clique), linear_bound(pairwise)
    if tight is not None:
        assert loose is not None
        assert tight >= loose - 1e-6


def test_pairwise_is_equation_2_to_the_letter() -> None:
    p = [[0.5, 0.8, 0.0], [0.0, 0.3, 1.0]]
    model = registry.formulation("pairwise").build(Instance.of(p, required=[0.7, 0.6], conflicts=[(0, 1, 2)]))
    expected = [
        [math.log(0.5), math.log(1 - 0.8), 0],
        [0, math.log(0.7), math.log(0.4)],
        [1, 1, 0],
        [1, 0, 1],
        [0, 1, 1],
    ]
    assert model.A.toarray() == pytest.approx(np.array(expected))
    assert model.hi == pytest.approx([math.log(0.3), math.log(0.4), 1, 1, 1])
    assert (model.lo == -np.inf).all()
    assert model.is_integral_cost


def test_pairwise_refuses_before_it_runs_out_of_memory(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(module_of("pairwise"), "PAIR_LIMIT", 434)
    with pytest.raises(Refused, match="435 conflicting pairs"):
        registry.formulation("pairwise").build(Instance.of(np.full((1, 30), 0.5), conflicts=[range(30)]))


def test_single_cover_loses_what_adds_up() -> None:
    single = registry.formulation("single_cover")
    adds_up = Instance.of([[0.6, 0.6]], required=0.7)
    assert optimum(single.build(adds_up)) is None
    assert enumerate_best(adds_up, single.goal) == ((2.0,), (0, 1))
    assert optimum(single.build(Instance.of([[0.7, 0.9]], required=0.7, cost=[2, 3]))) == pytest.approx(2)


def test_single_cover_loses_nothing_on_certain_candidates() -> None:
    random = np.random.default_rng(1)
    for _ in range(30):
        certain = Instance.of((random.random((4, 7)) < 0.4).astype(float), required=0.7)
        single, clique = (optimum(registry.formulation(name).build(certain)) for name in ("single_cover", "clique"))
        assert single == (clique if clique is None else pytest.approx(clique))


def test_elastic_orders_its_objectives() -> None:
    goal = registry.formulation("elastic").goal
    # Element 2 is out of reach; candidate 3 would come nearest to it but excludes what covers the other two.
    p = [[0.9, 0.0, 0.0, 0.0], [0.0, 0.9, 0.0, 0.0], [0.0, 0.0, 0.3, 0.5]]
    instance = Instance.of(p, required=0.7, cost=[1, 1, 5, 1], conflicts=[(0, 3), (1, 3), (2, 3)])
    value, chosen = enumerate_best(instance, goal)
    assert chosen == (0, 1, 2)
    assert value == pytest.approx((1, 1 - math.log(0.7) / math.log(0.3), 7))


def test_elastic_prices_shortfall_above_cost_and_unmet_above_shortfall() -> None:
    goal = registry.formulation("elastic").goal
    instance = Instance.of([[0.5]], required=0.75, cost=9)
    met = goal.evaluate(instance.require(0.5), [0], Fraction)
    half = goal.evaluate(instance, [0], float)
    none = goal.evaluate(instance, [], float)
    assert list(met.value) == [0, 0, 9]
    assert half.value == pytest.approx((1, 0.5, 9))
    assert none.value == pytest.approx((1, 1, 0))
    assert all(evidence.is_feasible for evidence in (met, half, none))


def test_budgeted_takes_the_best_plan_of_the_budget() -> None:
    p = [[0.9, 0.0, 0.6], [0.0, 0.8, 0.6]]
    instance = Instance.of(p, required=0.0)
    for budget, weights, best in ((0, None, ()), (1, None, (2,)), (2, None, (0, 1)), (1, (9.0, 1.0), (0,))):
        form = registry.formulation("budgeted", {"budget": budget, "weights": weights})
        value, chosen = enumerate_best(instance, form.goal)
        assert chosen == best
        found = optimum(form.build(instance))
        assert found is not None
        assert value is not None
        assert value[0] - form.tolerance - 1e-6 <= found <= value[0] + 1e-6


def test_budgeted_is_exact_where_a_candidate_is_certain() -> None:
    form = registry.formulation("budgeted", {"tolerance": 0.2})
    assert optimum(form.build(Instance.of([[1.0]]))) == pytest.approx(0, abs=1e-9)


def test_budgeted_reports_what_is_overspent() -> None:
    goal = registry.formulation("budgeted", {"budget": 2.5}).goal
    evidence = goal.evaluate(Instance.of([[0.5, 0.5]], cost=[1.5, 2.0]), [0, 1], Fraction)
    assert evidence.value == (Fraction(1, 4),)
    assert list(evidence.shortfall) == [1]
    assert not evidence.is_feasible


@pytest.mark.parametrize("bad", [{"budget": -1}, {"budget": math.nan}, {"tolerance": 0}, {"weights": [1, -1]}])
def test_budgeted_refuses_nonsense(bad: dict[str, Any]) -> None:
    with pytest.raises(InvalidSettings, match=next(iter(bad))):
        registry.formulation("budgeted", bad)


def test_budgeted_wants_one_weight_an_element() -> None:
    form = registry.formulation("budgeted", {"weights": [1, 2, 3]})
    for use in (form.build, lambda instance: form.goal.evaluate(instance, [], float)):
        with pytest.raises(InvalidSettings, match="expected 2, one an element, got 3"):
            use(Instance.of([[0.5], [0.5]]))


@pytest.mark.parametrize("options", [("budgeted", {"tolerance": 1e-13}), ("joint", {"precision": 1e-13})])
def test_too_many_lines_are_refused(options: tuple[str, dict[str, Any]]) -> None:
    with pytest.raises(Refused, match="raise it"):
        registry.formulation(*options).build(Instance.of(np.full((50, 2), 0.5)))


def test_joint_lies_between_its_precisions() -> None:
    random = np.random.default_rng(17)
    strict = 0
    for _ in range(40):
        instance = random_instance(random)
        required = float(random.uniform(0.02, 0.9))
        precision = float(random.choice([1e-3, 0.05]))
        options = {"required": required, "precision": precision}
        below, at, above = (
            enumerate_best(instance, registry.formulation("joint", {"required": q}).goal)[0] or (math.inf,)
            for q in (max(required - precision, 1e-9), required, min(required + precision, 1 - 1e-9))
        )
        safe = optimum(registry.formulation("joint", options).build(instance))
        loose = optimum(registry.formulation("joint", options | {"side": "relaxation"}).build(instance))
        assert at[0] - 1e-6 <= (math.inf if safe is None else safe) <= above[0] + 1e-6
        assert below[0] - 1e-6 <= (math.inf if loose is None else loose) <= at[0] + 1e-6
        strict += below[0] < above[0]
    assert strict > 0


def test_joint_multiplies_and_skips_elements_without_requirement() -> None:
    instance = Instance.of([[0.5, 0.5], [0.5, 0.0], [0.0, 0.1]], required=[0.1, 0.9, 0.0])
    evidence = registry.formulation("joint", {"required": 0.5}).goal.evaluate(instance, [0, 1], Fraction)
    assert evidence.shortfall == (Fraction(1, 2) - Fraction(3, 8),)


@pytest.mark.parametrize("bad", [{"required": 0}, {"required": 1}, {"precision": 0}, {"side": "inside"}])
def test_joint_refuses_nonsense(bad: dict[str, Any]) -> None:
    with pytest.raises(InvalidSettings, match=next(iter(bad)) if "side" not in bad else "inside"):
        registry.formulation("joint", bad)


def test_robust_takes_the_worst_subset() -> None:
    random = np.random.default_rng(2)
    for _ in range(200):
        size, gamma = int(random.integers(1, 6)), int(random.integers(0, 4))
        p = np.where(random.random(size) < 0.2, 1.0, random.integers(1, 100, size) / 100)
        deviation = float(random.choice([0.0, 0.1, 0.5, 1.0]))
        goal = registry.formulation("robust", {"deviation": deviation, "gamma": gamma}).goal
        instance = Instance.of(p[None, :], required=0.999)
        short = goal.evaluate(instance, range(size), Fraction).shortfall[0]
        worst = max(
            math.prod(
                min(Fraction(1), 1 - Fraction(x) + Fraction(deviation)) if bits >> i & 1 else 1 - Fraction(x)
                for i, x in enumerate(p.tolist())
            )
            for bits in range(2**size)
            if bits.bit_count() <= gamma
        )
        assert short == max(0, Fraction(0.999) - (1 - worst))


def test_robust_without_deviation_is_the_problem_itself() -> None:
    random = np.random.default_rng(4)
    for _ in range(20):
        instance = random_instance(random)
        best = enumerate_best(instance, Cover())
        for options in ({"deviation": 0.0}, {"gamma": 0}):
            assert enumerate_best(instance, registry.formulation("robust", options).goal) == best


def test_robust_pays_for_protection_by_steps() -> None:
    instance = Instance.of(np.full((1, 8), 0.5), required=0.75)
    costs = [
        enumerate_best(instance, registry.formulation("robust", {"gamma": g, "deviation": 0.2}).goal)[0] for g in range(5)
    ]
    assert costs == [(2.0,), (3.0,), (3.0,), (4.0,), (4.0,)]


@pytest.mark.parametrize("bad", [{"deviation": -0.1}, {"deviation": 1.1}, {"gamma": -1}, {"gamma": 0.5}])
def test_robust_refuses_nonsense(bad: dict[str, Any]) -> None:
    with pytest.raises(InvalidSettings, match=next(iter(bad))):
        registry.formulation("robust", bad)


# --- Scenarios --------------------------------------------------------------------------------------------------------


def test_scenario_counts_recorded_trials() -> None:
    instance = Instance.of([[0.5, 0.5, 0.5]], required=0.75, cost=[1, 1, 3])
    trials = np.array([[1, 0, 1], [1, 0, 1], [0, 1, 1], [0, 0, 0]], dtype=bool)
    form = registry.formulation("scenario", {"outcomes": trials})
    assert enumerate_best(instance, form.goal) == ((2.0,), (0, 1))
    assert optimum(form.build(instance)) == pytest.approx(2)
    assert form.goal.missing(instance, [0]) == [[1, 2]]
    assert enumerate_best(instance.require(0.76), form.goal)[0] is None
    assert optimum(form.build(instance.require(0.76))) is None
    trials[:] = False
    assert enumerate_best(instance, form.goal) == ((2.0,), (0, 1))


def test_scenario_options_come_from_text() -> None:
    form: Any = registry.formulation("scenario", {"count": "20", "correlation": "0.25", "seed": 5})
    assert (form.count, form.correlation, form.seed, form.outcomes) == (20, 0.25, 5, None)
    assert form.draw(Instance.of([[0.5]])).shape == (20, 1)


@pytest.mark.parametrize(
    ("bad", "says"),
    [
        ({"count": 0}, "count"),
        ({"correlation": 1.5}, "correlation"),
        ({"seed": -1}, "seed"),
        ({"outcomes": "all"}, "outcomes"),
        ({"outcomes": np.ones((3, 1))}, "booleans"),
        ({"outcomes": np.ones(3, dtype=bool)}, "shape"),
        ({"outcomes": np.ones((0, 1), dtype=bool)}, "shape"),
    ],
)
def test_scenario_refuses_nonsense(bad: dict[str, Any], says: str) -> None:
    with pytest.raises(InvalidSettings, match=says):
        registry.formulation("scenario", bad)


def test_scenario_wants_one_column_a_probability() -> None:
    form = registry.formulation("scenario", {"outcomes": np.ones((4, 3), dtype=bool)})
    with pytest.raises(InvalidSettings, match="expected 2 columns"):
        form.build(Instance.of([[0.5, 0.5]]))


def test_scenario_refuses_before_it_runs_out_of_memory(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(module_of("scenario"), "OUTCOME_LIMIT", 199)
    with pytest.raises(Refused, match="100 scenarios of 2 probabilities"):
        registry.formulation("scenario").build(Instance.of([[0.5, 0.5]]))


@pytest.mark.parametrize("correlation", [0.0, 0.6, 1.0])
def test_draws_keep_the_marginals_and_follow_the_correlation(correlation: float) -> None:
    instance = Instance.of([[0.2, 0.5, 1.0], [0.0, 0.5, 0.9]])
    form: Any = registry.formulation("scenario", {"count": 40_000, "correlation": correlation, "seed": 1})
    outcomes = form.draw(instance)
    assert outcomes.mean(axis=0) == pytest.approx(instance.probability.data, abs=0.02)
    assert outcomes[:, instance.probability.data == 1].all()
    first, second = (outcomes[:, k] for k in np.flatnonzero(instance.probability.data == 0.5))
    # Sheppard 1899: two standard normal numbers of correlation r fall below 0 together with 1/4 + arcsin(r) / (2 pi).
    assert (first & second).mean() == pytest.approx(0.25 + math.asin(correlation) / (2 * math.pi), abs=0.015)
    assert not outcomes.flags.writeable


def test_draws_depend_on_the_seed_alone() -> None:
    again = [Instance.of([[0.3, 0.5, 0.7]]) for _ in range(2)]
    form: Any = registry.formulation("scenario", {"seed": 2})
    other: Any = registry.formulation("scenario", {"seed": 3})
    assert (form.draw(again[0]) == form.draw(again[1])).all()
    assert (form.draw(again[0]) != other.draw(again[0])).any()


def test_many_scenarios_approach_independence() -> None:
    instance = Instance.of([[0.5, 0.6, 0.7], [0.8, 0.0, 0.3]], required=0.0)
    goal = registry.formulation("scenario", {"count": 20_000}).goal
    short = goal.evaluate(instance.require(0.99), [0, 1, 2], float).shortfall
    assert [0.99 - float(s) for s in short] == pytest.approx(instance.coverage([0, 1, 2]).tolist(), abs=0.01)


# --- Lines around convex functions ------------------------------------------------------------------------------------


@pytest.mark.parametrize("error", [0.3, 1e-2, 1e-4, 1e-5])
@pytest.mark.parametrize("shape", ["EXPONENTIAL", "LOSS"])
def test_lines_stay_on_their_side_within_the_error(shape: str, error: float) -> None:
    convex = importlib.import_module("pscover.formulations._convex")
    function = getattr(convex, shape)
    start, stop = (0.0, 12.0) if shape == "EXPONENTIAL" else (0.01, 12.0)
    grid = np.linspace(start, stop, 20_001)
    truth = np.array([function.value(s) for s in grid])
    for lines, sign in (
        (convex.tangents(function, start, stop, error), 1),
        (convex.secants(function, start, stop, error), -1),
    ):
        envelope = np.max(lines.intercept[:, None] - lines.fall[:, None] * grid, axis=0)
        gap = sign * (truth - np.maximum(envelope, 0.0))
        assert gap.min() >= -1e-12
        assert gap.max() <= error * (1 + 1e-6) + 1e-12
        assert gap.max() >= error / 2
        assert (lines.fall > 0).all()
    tangent = convex.tangents(function, start, stop, error)
    assert (tangent.intercept - tangent.fall * tangent.cap <= 1e-12).all()


def test_every_parameter_has_a_default_that_fits() -> None:
    for name in NAMES:
        found = registry.lookup("formulation", name)
        assert found() is not None
        assert all(f.name == f.name.lower() for f in fields(found))


def test_tolerance_is_the_goals() -> None:
    # The share of scenarios asked for is the smallest that the goal accepts, to the last one.
    outcomes = np.array([[True]] * 7 + [[False]] * 3)
    form = registry.formulation("scenario", {"outcomes": outcomes})
    for required, fits in ((0.7, True), (0.7 + TOLERANCE / 2, True), (0.7 + 3 * TOLERANCE, False)):
        instance = Instance.of([[0.5]], required=required)
        assert form.goal.evaluate(instance, [0], Fraction).is_feasible is fits
        assert (optimum(form.build(instance)) is not None) is fits
