"""Conformance checks for formulations and backends, shipped so that outsiders can test their own.

Everything is held against enumeration: on small random instances all conflict-free plans are listed and weighed by the
goal, which knows no linear model. A failed check raises `AssertionError` with the instance that shows it.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_array

from pscover.backend import Backend
from pscover.enumeration import Plan, Value, conflict_free, enumerate_best, values
from pscover.errors import Refused
from pscover.formulation import Formulation, Relation
from pscover.instance import TOLERANCE, Instance
from pscover.model import Model
from pscover.result import Status

if TYPE_CHECKING:
    from hypothesis.strategies import SearchStrategy

__all__ = [
    "check_backend",
    "check_formulation",
    "check_model",
    "conflict_free",
    "enumerate_best",
    "instances",
    "random_instance",
]

SLACK = 1e-6
"""How far values may differ before they count as different: the tolerance of the engines."""


def random_instance(random: np.random.Generator, *, elements: int | None = None, candidates: int | None = None) -> Instance:
    """A small instance with all that makes instances awkward.

    Overlapping cliques, certain candidates (p = 1), elements without a requirement (q = 0) or without any candidate,
    requirements out of reach, whole and fractional costs all occur; probabilities are multiples of 0.01.

    Parameters
    ----------
    random
        Where the randomness comes from.
    elements, candidates
        How many; by default 1 to 5 and 1 to 8.

    Examples
    --------
    >>> instance = random_instance(np.random.default_rng(0), elements=3, candidates=6)
    >>> instance.elements, instance.candidates
    (3, 6)
    """
    m = int(random.integers(1, 6)) if elements is None else elements
    n = int(random.integers(1, 9)) if candidates is None else candidates
    p = random.integers(5, 100, (m, n)) / 100
    p[random.random((m, n)) < random.choice([0.0, 0.1])] = 1.0
    p[random.random((m, n)) < random.choice([0.2, 0.5, 0.7])] = 0.0
    required = random.choice([0.0, 0.2, 0.5, 0.7, 0.7, 0.9], m)
    cost = random.choice([np.ones(n), random.integers(1, 10, n), random.integers(10, 500, n) / 100])
    cliques = []
    for _ in range(int(random.integers(0, 4)) if n > 1 else 0):
        size = int(random.integers(2, min(n, 4) + 1))
        cliques.append(sorted(random.choice(n, size, replace=False).tolist()))
    return Instance.of(p, required, cost, cliques)


def instances(*, elements: int = 4, candidates: int = 6) -> SearchStrategy[Instance]:
    """A hypothesis strategy for instances of at most the given size; it shrinks to the simplest that fails.

    Raises
    ------
    ImportError
        If hypothesis is not installed.
    """
    from hypothesis import strategies as st

    @st.composite
    def build(draw: st.DrawFn) -> Instance:
        m, n = draw(st.integers(1, elements)), draw(st.integers(1, candidates))
        chance = st.one_of(st.just(0.0), st.integers(1, 100).map(lambda percent: percent / 100))
        p = np.array(draw(st.lists(st.lists(chance, min_size=n, max_size=n), min_size=m, max_size=m)))
        required = draw(st.lists(st.sampled_from([0.0, 0.3, 0.5, 0.7, 0.9]), min_size=m, max_size=m))
        price = st.one_of(st.integers(1, 9).map(float), st.integers(1, 900).map(lambda cents: cents / 100))
        cost = draw(st.lists(price, min_size=n, max_size=n))
        clique = st.lists(st.integers(0, n - 1), min_size=2, max_size=n, unique=True)
        return Instance.of(p, required, cost, draw(st.lists(clique, max_size=3)) if n > 1 else [])

    return build()


def check_formulation(formulation: Formulation, random: np.random.Generator, count: int = 50) -> None:
    """Hold a formulation against enumeration of its goal on small random instances.

    Its models must be well formed and their first variables the candidates; the instance must stay as it was. For
    every conflict-free plan the model and the goal must agree as far as the relation says, and so must the optima:

    - exact: the same plans, the same values;
    - relaxation: the goal's plans are the model's, whose objective is not higher, nor lower by more than `tolerance`;
    - restriction: the model's plans are the goal's.

    Parameters
    ----------
    formulation
        With its parameters.
    random
        Where the instances come from.
    count
        How many instances.

    Raises
    ------
    AssertionError
        With what differs and the instance that shows it.

    Examples
    --------
    >>> from pscover import registry
    >>> check_formulation(registry.formulation("clique"), np.random.default_rng(0), count=5)
    """
    for k in range(count):
        instance = random_instance(random)
        before = instance.digest
        try:
            model = formulation.build(instance)
        except Refused as refusal:
            text = str(refusal)
            _expect(bool(text) and "\n" not in text, instance, f"{formulation.name}: expected one sentence, got {text!r}")
            continue
        _expect(instance.digest == before, instance, f"{formulation.name}: the instance was changed")
        check_model(model, instance)
        _compare_optima(formulation, model, instance)
        if k % 5 == 0 and instance.candidates <= 5:
            _compare_plans(formulation, model, instance)


def check_model(model: Model, instance: Instance) -> None:
    """A model is well formed: shapes fit, entries are finite, the leading variables are the instance's candidates.

    Raises
    ------
    AssertionError
        With the first thing that is not so.
    """
    n, variables, rows = instance.candidates, model.variables, model.rows
    vectors = {"c": (model.c, variables), "ub": (model.ub, variables), "integer": (model.integer, variables)}
    vectors |= {"lo": (model.lo, rows), "hi": (model.hi, rows)}
    vectors |= {f"then[{k}]": (c, variables) for k, c in enumerate(model.then)}
    for name, (vector, size) in vectors.items():
        _expect(vector.shape == (size,), instance, f"{name}: expected shape ({size},), got {vector.shape}")
    for c in (model.c, *model.then):
        _expect(bool(np.isfinite(c).all()), instance, "objectives: expected finite numbers")
    _expect(model.candidates == n, instance, f"candidates: expected {n}, got {model.candidates}")
    _expect(bool(model.integer[:n].all() and (model.ub[:n] <= 1).all()), instance, "candidates: expected binaries")
    _expect(bool((model.ub >= 0).all()), instance, "ub: expected numbers of at least 0")
    _expect(isinstance(model.A, csr_array) and bool(np.isfinite(model.A.data).all()), instance, "A: expected finite CSR")
    _expect(bool((model.A.data != 0).all()), instance, "A: expected no explicit zeros")
    _expect(bool((model.lo <= model.hi).all()), instance, "lo <= hi: expected in every row")


def check_backend(backend: Backend, count: int = 50, seed: int = 0) -> None:
    """Hold a backend against enumeration, over every exact formulation it takes, on small random instances.

    An exact backend must find the same statuses and values; any other must return plans that are feasible and never
    better than the best, and never call a feasible instance infeasible.

    Parameters
    ----------
    backend
        The engine.
    count
        How many instances in all; the formulations take turns.
    seed
        Of the instances.

    Raises
    ------
    AssertionError
        With what differs and the instance that shows it.
    """
    from pscover import registry
    from pscover.solve import solve

    known = [registry.formulation(name) for name in registry.names("formulation")]
    exact = [form for form in known if form.relation is Relation.EXACT]
    random = np.random.default_rng(seed)
    probe = random_instance(random)
    taken = [form for form in exact if _takes(backend, form.build(probe))]
    if not taken:
        raise AssertionError(f"backend {backend.name!r} refuses every exact formulation")
    for k in range(count):
        instance, form = random_instance(random), taken[k % len(taken)]
        if not _takes(backend, form.build(instance)):
            continue
        result = solve(instance, backend=backend, formulation=form, seed=seed)
        best, _ = enumerate_best(instance, form.goal)
        place = f"backend {backend.name!r}, formulation {form.name!r}"
        if result.has_plan:
            _expect(best is not None, instance, f"{place}: {result.chosen} is feasible, but there is no plan")
        if best is None:
            allowed = (Status.INFEASIBLE,) if backend.exact else (Status.INFEASIBLE, Status.UNKNOWN)
            _expect(result.status in allowed, instance, f"{place}: expected no plan, got {result.status}")
            continue
        _expect(result.status is not Status.INFEASIBLE, instance, f"{place}: expected a plan, got {result.status}")
        order = _compare(result.value, best) if result.has_plan else 1
        _expect(order >= 0, instance, f"{place}: {result.value} is better than the best, {best}")
        if backend.exact:
            _expect(result.status is Status.OPTIMAL, instance, f"{place}: expected optimal, got {result.status}")
            _expect(order == 0, instance, f"{place}: expected {best}, got {result.value}")


def _takes(backend: Backend, model: Model) -> bool:
    staged = model.with_objective(model.c) if model.then else model
    return backend.refuses(staged) is None


def _expect(good: bool, instance: Instance, message: str) -> None:
    if good:
        return
    cliques = [clique.tolist() for clique in instance.conflicts]
    shown = f"{instance.probability.toarray().tolist()}, {instance.required.tolist()}, {instance.cost.tolist()}, {cliques}"
    raise AssertionError(f"{message}\non Instance.of({shown})")


def _compare(value: Sequence[float], other: Sequence[float]) -> int:
    """-1, 0 or 1 as the first value is better than, as good as or worse than the other."""
    for mine, its in zip(value, other, strict=True):
        if abs(mine - its) > SLACK * max(1.0, abs(mine), abs(its)) * 10:
            return -1 if mine < its else 1
    return 0


@dataclass(frozen=True, slots=True, eq=False)
class _Point:
    """The optimum of a model: the candidates chosen and the value of every objective."""

    chosen: Plan
    value: Value


def _optimise(model: Model) -> _Point | None:
    """The optimum of a model by SciPy's solver, objective after objective; None if it is infeasible."""
    point = None
    stage = model
    for objective in (model.c, *model.then):
        x = _solve(stage.with_objective(objective))
        if x is None:
            return point
        chosen = tuple(int(i) for i in np.flatnonzero(x[: model.candidates] > 0.5))
        value = tuple(float(c @ x) for c in (model.c, *model.then))
        point = _Point(chosen, (value[0] + model.offset, *value[1:]))
        reached = float(objective @ x)
        limit = np.array([reached + SLACK * max(1.0, abs(reached))])
        stage = stage.with_rows(csr_array(objective[None, :]), np.full(1, -np.inf), limit)
    return point


def _solve(model: Model) -> NDArray[np.float64] | None:
    from scipy.optimize import Bounds, LinearConstraint, milp

    if model.variables == 0:
        return np.zeros(0) if bool(((model.lo <= 0) & (model.hi >= 0)).all()) else None
    rows = [LinearConstraint(model.A, model.lo, model.hi)] if model.rows else []
    found = milp(
        model.c,
        integrality=model.integer.astype(int),
        bounds=Bounds(np.zeros(model.variables), model.ub),
        constraints=rows,
        options={"mip_rel_gap": 0.0},
    )
    if found.status not in (0, 2):
        raise AssertionError(f"SciPy's solver gave up: {found.message}")
    x: NDArray[np.float64] | None = found.x
    return x


def _compare_optima(formulation: Formulation, model: Model, instance: Instance) -> None:
    """The best plan of the model against the best plan of the goal."""
    goal, relation, name = formulation.goal, formulation.relation, formulation.name
    best, _ = enumerate_best(instance, goal)
    found = _optimise(model)
    while found is not None and relation is Relation.EXACT:
        short = max(goal.evaluate(instance, found.chosen, float).shortfall, default=0.0)
        if short <= TOLERANCE:
            break
        # An engine lets plans through that miss a requirement by less than its tolerance: only those are cut off.
        _expect(short <= 10 * SLACK, instance, f"{name}: {found.chosen} falls short by {short}")
        groups = goal.missing(instance, found.chosen)
        _expect(len(groups) > 0, instance, f"{name}: {found.chosen} is not feasible")
        rows = _group_rows(groups, model.variables)
        model = model.with_rows(rows, np.ones(len(groups)), np.full(len(groups), np.inf))
        found = _optimise(model)
    if found is None:
        _expect(best is None or relation is Relation.RESTRICTION, instance, f"{name}: infeasible, but {best} can be had")
        return
    evidence = goal.evaluate(instance, found.chosen, float)
    value = values(evidence)
    broken = instance.conflicts.broken_by(list(found.chosen))
    _expect(len(broken) == 0, instance, f"{name}: {found.chosen} breaks the cliques {broken}")
    if relation is Relation.RELAXATION:
        if best is not None:
            _expect(found.value[0] <= best[0] + SLACK * 10, instance, f"{name}: {found.value} is above the best, {best}")
        if evidence.is_feasible:
            off = value[0] - found.value[0]
            _expect(off <= formulation.tolerance + SLACK * 10, instance, f"{name}: the objective is too low by {off}")
        return
    _expect(evidence.is_feasible, instance, f"{name}: {found.chosen} is not feasible")
    order = 1 if best is None else _compare(value, best)
    _expect(order >= 0, instance, f"{name}: {value} is better than the best, {best}")
    _expect(_compare(value, found.value) == 0, instance, f"{name}: the model says {found.value}, the goal {value}")
    if relation is Relation.EXACT:
        _expect(order == 0 and best is not None, instance, f"{name}: expected {best}, got {value}")


def _group_rows(groups: Sequence[Sequence[int]], variables: int) -> csr_array:
    rows = np.zeros((len(groups), variables))
    for k, group in enumerate(groups):
        rows[k, list(group)] = 1.0
    return csr_array(rows)


def _compare_plans(formulation: Formulation, model: Model, instance: Instance) -> None:
    """Plan by plan: what the model says of it against what the goal says of it."""
    goal, relation, name = formulation.goal, formulation.relation, formulation.name
    allowed = set(conflict_free(instance))
    for plan in _all_plans(instance.candidates):
        point = _optimise(_fixed(model, plan))
        if plan not in allowed:
            _expect(point is None, instance, f"{name}: {plan} breaks a conflict, but the model takes it")
            continue
        evidence = goal.evaluate(instance, plan, float)
        if any(TOLERANCE / 10 < missing < 10 * SLACK for missing in evidence.shortfall):
            continue
        if evidence.is_feasible and relation is not Relation.RESTRICTION:
            _expect(point is not None, instance, f"{name}: {plan} is feasible, but the model refuses it")
        if point is not None and relation is not Relation.RELAXATION:
            _expect(evidence.is_feasible, instance, f"{name}: {plan} is not feasible, but the model takes it")
        if point is not None and evidence.is_feasible:
            off = values(evidence)[0] - point.value[0]
            fits = -10 * SLACK <= off <= formulation.tolerance + 10 * SLACK
            _expect(fits, instance, f"{name}: {plan} is worth {evidence.value}, but the model says {point.value}")


def _all_plans(candidates: int) -> list[Plan]:
    return [tuple(i for i in range(candidates) if bits >> i & 1) for bits in range(2**candidates)]


def _fixed(model: Model, plan: Plan) -> Model:
    """The model with its candidates fixed to a plan."""
    chosen = np.zeros(model.candidates)
    chosen[list(plan)] = 1.0
    identity = csr_array(np.eye(model.candidates, model.variables))
    return model.with_rows(identity, chosen, chosen)
