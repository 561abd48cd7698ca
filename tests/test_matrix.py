"""Every formulation with every backend: solved and equal to enumeration, or refused with a reason.

`pytest tests/test_matrix.py --instances 200` looks at more instances a cell.
"""

from __future__ import annotations

import zlib

import numpy as np
import pytest

import pscover
from pscover import Instance, Refused, Status, registry
from pscover.backend import Backend
from pscover.formulation import Formulation, Relation
from pscover.testing import SLACK, enumerate_best, random_instance

BACKENDS, FORMULATIONS = registry.names("backend"), registry.names("formulation")
PARAMETERS = {"budgeted": {"budget": 4.0}, "scenario": {"count": 12, "correlation": 0.3}, "joint": {"required": 0.5}}
TINY = Instance.of([[0.9, 0.6, 0.65, 0.0], [0.0, 0.6, 0.65, 0.9]], required=0.7, conflicts=[(0, 2)])
COVERS = ("clique", "pairwise", "single_cover")
HEURISTICS = ("greedy", "lp-rounding", "local-search", "lagrangian")
TAKEN = {**dict.fromkeys(HEURISTICS, COVERS), "cpsat": (*COVERS, "scenario")}
REFUSED = {(b, f) for b in BACKENDS for f in FORMULATIONS if f not in TAKEN.get(b, FORMULATIONS)}
"""The cells that cannot be: heuristics read covering and packing rows only, CP-SAT has no continuous variables."""


def _backend(name: str) -> Backend:
    absent = registry.missing(registry.lookup("backend", name))
    if absent:
        pytest.skip(f"needs {', '.join(absent)}")
    return registry.backend(name)


def _formulation(name: str) -> Formulation:
    return registry.formulation(name, PARAMETERS.get(name))


@pytest.mark.parametrize("formulation", FORMULATIONS)
@pytest.mark.parametrize("backend", BACKENDS)
def test_every_cell_solves_or_says_why_not(backend: str, formulation: str) -> None:
    engine = _backend(backend)
    form = _formulation(formulation)
    if (backend, formulation) in REFUSED:
        with pytest.raises(Refused, match=rf"^backend '{backend}' refuses formulation '{formulation}': [^\n]+$"):
            pscover.solve(TINY, backend=engine, formulation=form)
        return
    result = pscover.solve(TINY, backend=engine, formulation=form)
    assert result.has_plan
    assert pscover.verify(TINY, result).passed


@pytest.mark.parametrize("formulation", FORMULATIONS)
@pytest.mark.parametrize("backend", BACKENDS)
def test_every_cell_agrees_with_enumeration(backend: str, formulation: str, request: pytest.FixtureRequest) -> None:
    engine, form = _backend(backend), _formulation(formulation)
    if (backend, formulation) in REFUSED:
        pytest.skip("refused: see the test above")
    random = np.random.default_rng(zlib.crc32(f"{backend} {formulation}".encode()))
    solved = infeasible = 0
    for _ in range(request.config.getoption("--instances")):
        instance = random_instance(random)
        result = pscover.solve(instance, backend=engine, formulation=form)
        best, _ = enumerate_best(instance, form.goal)
        _agree(result, best, engine, form, instance)
        assert pscover.verify(instance, result).passed
        solved += result.has_plan
        infeasible += result.status is Status.INFEASIBLE
    assert solved
    assert infeasible or form.relation is Relation.RESTRICTION or formulation in ("elastic", "budgeted")


def _agree(
    result: pscover.Result, best: tuple[float, ...] | None, engine: Backend, form: Formulation, instance: Instance
) -> None:
    shown = (
        instance.probability.toarray().tolist(),
        instance.required.tolist(),
        instance.cost.tolist(),
        [clique.tolist() for clique in instance.conflicts],
        result.status,
        result.value,
        best,
    )
    if best is None:
        assert not result.has_plan, shown
        assert result.status is Status.INFEASIBLE or not engine.exact or form.relation is Relation.RESTRICTION, shown
        return
    assert result.status is not Status.INFEASIBLE, shown
    if not result.has_plan:
        assert not engine.exact or form.relation is Relation.RESTRICTION, shown
        return
    worse = [mine - its for mine, its in zip(result.value, best, strict=True)]
    room = [10 * SLACK * max(1.0, abs(its)) for its in best]
    first = next((k for k in range(len(best)) if abs(worse[k]) > room[k]), None)
    assert first is None or worse[first] > 0, shown
    assert result.bound <= best[0] + room[0], shown
    if engine.exact and form.relation is not Relation.RESTRICTION:
        assert result.status is Status.OPTIMAL, shown
        assert first is None or worse[first] <= form.tolerance + room[first], shown
