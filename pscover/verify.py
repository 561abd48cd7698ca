"""Check a result against its instance in exact rational arithmetic, without any solver.

Every stored double is a rational number; products of them are compared as fractions, never as logarithms. What can be
recomputed is: the plan's indices and conflicts, the coverage of every element, the requirements, the objective. A bound is
proven as far as the result's certificate goes, the rest is the engine's word; an infeasibility is re-proven where a single
element is out of reach.
"""

from __future__ import annotations

import json
import math
from dataclasses import dataclass
from enum import StrEnum
from fractions import Fraction

import numpy as np

from pscover import registry
from pscover.certificate import certified_bound
from pscover.errors import InvalidResult, PscoverError, UnknownName
from pscover.formulation import Formulation, Relation
from pscover.goal import Cover, Evidence, failures
from pscover.instance import TOLERANCE, Instance
from pscover.result import VALUE_TOLERANCE, Result, Status

AGREEMENT = Fraction(1, 10**9)
"""Reported and exact numbers agree when they differ by no more than this, relative to the larger of 1 and their size."""


class Verdict(StrEnum):
    """Of one check."""

    PASSED = "passed"
    FAILED = "failed"
    UNCHECKED = "unchecked"
    """Nothing in the files proves or refutes it."""


@dataclass(frozen=True, slots=True)
class Check:
    """One thing looked at: what, the verdict, and the numbers in words."""

    what: str
    verdict: Verdict
    detail: str


@dataclass(frozen=True, slots=True)
class Verification:
    """All checks of one result.

    Parameters
    ----------
    checks
        In order.
    certified
        The lower bound that the result's certificate proves, exact; plus infinity where it proves that there is no plan,
        None without a certificate that holds.
    """

    checks: tuple[Check, ...]
    certified: Fraction | float | None = None

    @property
    def passed(self) -> bool:
        """Whether no check failed."""
        return all(check.verdict is not Verdict.FAILED for check in self.checks)


def verify(instance: Instance, result: Result) -> Verification:
    """Recompute everything a result says of an instance.

    Parameters
    ----------
    instance
        The problem.
    result
        What is said of it.

    Returns
    -------
    Verification
        Its `passed` is False as soon as one check fails.

    Examples
    --------
    >>> from pscover.solve import solve
    >>> instance = Instance.of([[0.8, 0.75], [0.0, 0.75]], required=0.7)
    >>> for check in verify(instance, solve(instance, backend="greedy")).checks[1:4]:
    ...     print(check.what, check.verdict, check.detail, sep=": ")
    plan: passed: 1 distinct candidates
    conflicts: passed: none broken
    coverage: passed: 2 elements, lowest 0.75
    """
    checks = [_same_instance(instance, result)]
    if checks[0].verdict is Verdict.FAILED:
        return Verification(tuple(checks))
    certified, bounds = _bound(instance, result)
    if result.chosen is None:
        return Verification((*checks, *bounds, _without_plan(instance, result, certified)), certified)
    indices = _indices(instance, result)
    checks.append(indices)
    if indices.verdict is Verdict.FAILED:
        return Verification((*checks, *bounds), certified)
    chosen = [int(i) for i in result.chosen]
    broken = instance.conflicts.broken_by(chosen)
    detail = f"cliques {broken.tolist()[:10]} hold more than one chosen candidate" if len(broken) else "none broken"
    checks.append(Check("conflicts", _verdict(len(broken) == 0), detail))
    checks.append(_coverage(instance, result, chosen))
    try:
        formulation = _formulation(result)
        evidence = formulation.goal.evaluate(instance, chosen, Fraction)
    except (InvalidResult, UnknownName) as error:
        checks.append(Check("requirements", Verdict.FAILED, str(error)))
        return Verification((*checks, *bounds), certified)
    except PscoverError as error:
        checks.append(Check("requirements", Verdict.UNCHECKED, f"the formulation cannot be rebuilt: {error}"))
        return Verification((*checks, *bounds), certified)
    checks.append(_requirements(evidence, result))
    checks.append(_objective(evidence, result))
    checks += bounds
    checks.append(_status(evidence, formulation, result, certified))
    return Verification(tuple(checks), certified)


def _verdict(good: bool) -> Verdict:
    return Verdict.PASSED if good else Verdict.FAILED


def _agree(exact: Fraction | float, reported: float) -> bool:
    if not math.isfinite(reported):
        return False
    value = Fraction(exact)
    return abs(value - Fraction(reported)) <= AGREEMENT * max(Fraction(1), abs(value))


def _same_instance(instance: Instance, result: Result) -> Check:
    same = result.digest == instance.digest
    detail = instance.digest[:16] if same else f"the result is of {result.digest[:16]}, this is {instance.digest[:16]}"
    return Check("instance", _verdict(same), detail)


def _indices(instance: Instance, result: Result) -> Check:
    assert result.chosen is not None
    chosen = result.chosen
    good = bool((np.diff(chosen) > 0).all() and ((chosen >= 0) & (chosen < instance.candidates)).all())
    expected = (
        f"{len(chosen)} distinct candidates" if good else f"expected sorted distinct indices below {instance.candidates}"
    )
    return Check("plan", _verdict(good), expected)


def _coverage(instance: Instance, result: Result, chosen: list[int]) -> Check:
    exact = [1 - miss for miss in failures(instance, chosen, Fraction)]
    if result.coverage is None or len(result.coverage) != len(exact):
        return Check("coverage", Verdict.FAILED, f"expected {len(exact)} numbers")
    wrong = [j for j, (e, r) in enumerate(zip(exact, result.coverage, strict=True)) if not _agree(e, float(r))]
    if wrong:
        j = wrong[0]
        detail = f"element {j}: {float(result.coverage[j])} is reported, exact is {float(exact[j])}"
        return Check("coverage", Verdict.FAILED, detail)
    lowest = f"lowest {float(min(exact)):.6g}" if exact else "no elements"
    return Check("coverage", Verdict.PASSED, f"{len(exact)} elements, {lowest}")


def _formulation(result: Result) -> Formulation:
    try:
        options = json.loads(result.options)
    except ValueError:
        options = None
    if not isinstance(options, dict):
        raise InvalidResult(f"options: expected a JSON object, got {result.options!r}")
    return registry.formulation(result.formulation, options)


def _requirements(evidence: Evidence, result: Result) -> Check:
    worst = max(evidence.shortfall, default=0)
    reported = () if result.shortfall is None else result.shortfall
    if len(reported) != len(evidence.shortfall) or not all(map(_agree, evidence.shortfall, map(float, reported))):
        return Check("requirements", Verdict.FAILED, f"other shortfalls are reported, the worst is {float(worst):.3g}")
    if worst == 0:
        return Check("requirements", Verdict.PASSED, "all met exactly")
    count = sum(1 for s in evidence.shortfall if s > TOLERANCE)
    if evidence.is_feasible:
        detail = f"all met within {TOLERANCE:g}; the worst is short by {float(worst):.3g}"
        return Check("requirements", Verdict.PASSED, detail)
    verdict = Verdict.FAILED if result.has_plan else Verdict.UNCHECKED
    return Check("requirements", verdict, f"{count} missed, the worst by {float(worst):.3g}")


def _objective(evidence: Evidence, result: Result) -> Check:
    exact = ", ".join(f"{float(v):.10g}" for v in evidence.value)
    if len(evidence.value) == len(result.value) and all(
        _agree(e, r) for e, r in zip(evidence.value, result.value, strict=True)
    ):
        return Check("objective", Verdict.PASSED, exact)
    reported = ", ".join(f"{v:.10g}" for v in result.value)
    return Check("objective", Verdict.FAILED, f"{reported} is reported, exact is {exact}")


def _bound(instance: Instance, result: Result) -> tuple[Fraction | float | None, list[Check]]:
    """What the certificate proves, and the check that says so; nothing without a certificate."""
    if result.certificate is None:
        return None, []
    try:
        if not isinstance(_formulation(result).goal, Cover):
            raise InvalidResult(f"certificate: expected none with formulation {result.formulation}, whose goal is another")
        certified = certified_bound(instance, result.certificate)
    except PscoverError as error:
        return None, [Check("bound", Verdict.FAILED, str(error))]
    if certified == math.inf:
        return certified, [Check("bound", Verdict.PASSED, "certified: no plan meets every requirement (exact)")]
    return certified, [
        Check("bound", Verdict.PASSED, f"certified lower bound: {float(certified):.10g} (exact){_claim(result, certified)}")
    ]


def _claim(result: Result, certified: Fraction | float) -> str:
    """What the engine says beyond the certificate."""
    if math.isfinite(result.bound) and result.bound > certified + VALUE_TOLERANCE * max(1.0, abs(result.bound)):
        return f"; the engine claims {result.bound:.10g}"
    return ""


def _status(evidence: Evidence, formulation: Formulation, result: Result, certified: Fraction | float | None) -> Check:
    claim = str(result.status.value)
    if result.status is Status.INFEASIBLE:
        verdict = _verdict(not evidence.is_feasible)
        return Check("status", verdict, "the plan is feasible" if evidence.is_feasible else claim)
    if result.has_plan and not evidence.is_feasible:
        return Check("status", Verdict.FAILED, f"{claim} is reported, but the plan misses a requirement")
    objective = float(evidence.value[0])
    slack = VALUE_TOLERANCE * max(1.0, abs(objective))
    if result.has_plan and result.bound > objective + slack:
        return Check("status", Verdict.FAILED, f"the bound {result.bound:.10g} is above the plan's {objective:.10g}")
    if certified is not None and result.has_plan and certified >= evidence.value[0]:
        return Check("status", Verdict.PASSED, f"{claim}; proven optimal: the certified bound is the plan's objective")
    if certified is not None and result.has_plan and _agree(evidence.value[0], float(certified)):
        detail = (
            f"{claim}; proven optimal to within {float(AGREEMENT):g}, to which the certified bound is the plan's objective"
        )
        return Check("status", Verdict.PASSED, detail)
    if result.status is not Status.OPTIMAL:
        return Check("status", Verdict.PASSED, claim)
    if formulation.relation is Relation.RESTRICTION:
        return Check("status", Verdict.FAILED, "optimal is reported, but the formulation is a restriction")
    if objective - result.bound <= result.settings.gap * abs(objective) + formulation.tolerance + slack:
        return Check("status", Verdict.UNCHECKED, f"optimal by the engine's bound {result.bound:.10g}, {_lack(certified)}")
    return Check("status", Verdict.FAILED, f"optimal is reported with a bound of {result.bound:.10g}")


def _lack(certified: Fraction | float | None) -> str:
    return "which has no certificate" if certified is None else f"of which {float(certified):.10g} is certified"


def _without_plan(instance: Instance, result: Result, certified: Fraction | float | None) -> Check:
    if result.has_plan:
        return Check("status", Verdict.FAILED, f"{result.status.value} is reported without a plan")
    if result.status is not Status.INFEASIBLE:
        return Check("status", Verdict.PASSED, f"{result.status.value}: nothing is claimed")
    try:
        goal = _formulation(result).goal
        if goal.evaluate(instance, (), Fraction).is_feasible:
            return Check("status", Verdict.FAILED, "infeasible is reported, but the empty plan meets every requirement")
    except PscoverError as error:
        return Check("status", Verdict.UNCHECKED, f"infeasible by the engine's word; no formulation to check: {error}")
    if certified == math.inf:
        return Check("status", Verdict.PASSED, "infeasible: the certificate proves it")
    # Other goals do not ask for the coverage of single elements.
    found = _out_of_reach(instance) if isinstance(goal, Cover) else None
    if found is not None:
        element, ceiling = found
        required = float(instance.required[element])
        detail = f"infeasible: element {element} reaches at most {float(ceiling):.6g} of {required:g}"
        return Check("status", Verdict.PASSED, detail)
    return Check("status", Verdict.UNCHECKED, "infeasible by the engine's word: no single element is out of reach")


def _out_of_reach(instance: Instance) -> tuple[int, Fraction] | None:
    """An element that no plan covers often enough, and the most it can reach, if that is easily proven.

    Every clique of a partition of its candidates gives its best one.
    """
    clique_of: dict[int, int] = {}
    for k, clique in enumerate(instance.conflicts):
        for i in clique.tolist():
            clique_of.setdefault(i, k)
    rows = instance.probability.tocsr()
    for j in np.flatnonzero(instance.required > 0).tolist():
        span = slice(rows.indptr[j], rows.indptr[j + 1])
        best: dict[int, float] = {}
        for i, p in zip(rows.indices[span].tolist(), rows.data[span].tolist(), strict=True):
            group = clique_of.get(i, -1 - i)
            best[group] = max(best.get(group, 0.0), p)
        # Fractions are slow: floats say where they are worth it.
        if 1.0 - math.prod(1.0 - p for p in best.values()) > instance.required[j] + VALUE_TOLERANCE:
            continue
        ceiling = 1 - math.prod((1 - Fraction(p) for p in best.values()), start=Fraction(1))
        if ceiling < Fraction(float(instance.required[j])):
            return j, ceiling
    return None
