"""Verification is exact, needs no solver, and notices every lie."""

from __future__ import annotations

import math
import subprocess
import sys
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

import pscover
from pscover import Instance, Result, Status
from pscover.certificate import Certificate
from pscover.proof import Prices
from pscover.verify import Verdict, verify

INSTANCE = Instance.of([[0.8, 0.0, 0.75], [0.0, 0.9, 0.75]], required=0.7, conflicts=[(0, 2)])
HONEST = pscover.solve(INSTANCE)


def _failed(result: Result, instance: Instance = INSTANCE) -> list[str]:
    return [check.what for check in verify(instance, result).checks if check.verdict is Verdict.FAILED]


def test_an_honest_result_passes() -> None:
    assert _failed(HONEST) == []
    assert {c.what for c in verify(INSTANCE, HONEST).checks} == {
        "instance", "plan", "conflicts", "coverage", "requirements", "objective", "status"
    }  # fmt: skip


@pytest.mark.parametrize(
    ("lie", "where"),
    [
        ({"digest": "0" * 64}, ["instance"]),
        ({"chosen": np.array([2, 2])}, ["plan"]),
        ({"chosen": np.array([7])}, ["plan"]),
        ({"chosen": np.array([-1])}, ["plan"]),
        ({"chosen": np.array([0, 2])}, ["conflicts", "coverage", "objective", "status"]),
        ({"chosen": np.array([0])}, ["coverage", "requirements", "status"]),
        ({"coverage": np.array([0.75, 0.76])}, ["coverage"]),
        ({"coverage": np.array([0.75])}, ["coverage"]),
        ({"coverage": np.array([0.75, np.nan])}, ["coverage"]),
        ({"value": (0.5,)}, ["objective"]),
        ({"value": ()}, ["objective"]),
        ({"shortfall": np.array([0.0, 0.1])}, ["requirements"]),
        ({"shortfall": None}, ["requirements"]),
        ({"options": "{"}, ["requirements"]),
        ({"options": "[1]"}, ["requirements"]),
        ({"formulation": "nope"}, ["requirements"]),
        ({"bound": 0.5}, ["status"]),
        ({"bound": 1.5}, ["status"]),
        ({"status": Status.INFEASIBLE}, ["status"]),
        ({"chosen": None}, ["status"]),
    ],
)
def test_every_lie_is_found_where_it_is(lie: dict[str, Any], where: list[str]) -> None:
    assert _failed(replace(HONEST, **lie)) == where


@pytest.mark.parametrize("status", [Status.OPTIMAL, Status.FEASIBLE])
@pytest.mark.parametrize("bound", [1.5, math.inf])
def test_a_bound_above_the_plan_is_a_lie_whatever_is_certified(status: Status, bound: float) -> None:
    entry = np.zeros(INSTANCE.probability.nnz, dtype=np.int64)
    entry[INSTANCE.probability.indices == 0] = 1
    prices = Prices(entry=entry, unit=np.zeros(2, dtype=np.int64))
    proven = replace(HONEST, certificate=Certificate(units=10, scale=1, proof=prices))
    assert verify(INSTANCE, proven).certified == HONEST.objective
    assert _failed(replace(proven, status=status, bound=bound)) == ["status"]


def test_products_are_compared_as_fractions() -> None:
    required = float(np.nextafter(1 - 0.3 * 0.3, 1))
    instance = Instance.of([[0.7, 0.7]], required=required)
    (check,) = (c for c in verify(instance, pscover.solve(instance)).checks if c.what == "requirements")
    assert check.verdict is Verdict.PASSED
    assert "within 1e-09" in check.detail
    met = Instance.of([[0.75, 0.5]], required=0.875)
    (check,) = (c for c in verify(met, pscover.solve(met)).checks if c.what == "requirements")
    assert check.detail == "all met exactly"


def test_infeasibility_is_proven_again_where_one_element_is_out_of_reach() -> None:
    instance = Instance.of([[0.6, 0.6, 0.5]], required=0.85, conflicts=[(0, 1)])
    last = verify(instance, pscover.solve(instance)).checks[-1]
    assert last.verdict is Verdict.PASSED
    assert "element 0 reaches at most 0.8 of 0.85" in last.detail
    together = Instance.of([[0.8, 0], [0, 0.8]], conflicts=[(0, 1)])
    assert verify(together, pscover.solve(together)).checks[-1].verdict is Verdict.UNCHECKED


def test_an_element_out_of_reach_proves_nothing_of_other_goals() -> None:
    instance = Instance.of([[0.6]], required=0.85)
    claim = replace(pscover.solve(instance), formulation="joint", options='{"required": 0.7}')
    assert verify(instance, claim).checks[-1].verdict is Verdict.UNCHECKED
    for formulation in ("budgeted", "elastic"):
        last = verify(instance, replace(claim, formulation=formulation, options="{}")).checks[-1]
        assert last.verdict is Verdict.FAILED
        assert "the empty plan meets every requirement" in last.detail


def test_infeasibility_is_checked_without_a_search() -> None:
    random = np.random.default_rng(1)
    pairs = [(i, j) for i in range(400) for j in range(i) if random.random() < 0.1]
    instance = Instance.of(random.uniform(0.001, 0.003, (30, 400)), required=0.9, conflicts=pairs)
    claim = replace(HONEST, digest=instance.digest, status=Status.INFEASIBLE, chosen=None)
    assert "element 0 reaches at most" in verify(instance, claim).checks[-1].detail


def test_no_solver_is_imported() -> None:
    code = (
        "import sys, pscover\n"
        "i = pscover.Instance.of([[0.8]])\n"
        "r = pscover.solve(i, backend='greedy')\n"
        "assert pscover.verify(i, r).passed\n"
        "print([m for m in ('highspy', 'scipy.optimize', 'cvxpy', 'pyomo', 'pyscipopt', 'ortools') if m in sys.modules])\n"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout == "[]\n"
