"""Every exact formulation on every exact engine, under a limit of CPU seconds."""

from __future__ import annotations

import math
import time
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from enum import StrEnum
from typing import Any, cast

from pscover import registry
from pscover.backend import Backend
from pscover.clock import Clock
from pscover.errors import EngineFailed, InvalidSettings, MissingDependency, Refused
from pscover.evidence.study.families import Folder, Problem, instance_of
from pscover.evidence.study.metered import Metered
from pscover.evidence.sweep import Done
from pscover.formulation import Formulation, Relation
from pscover.goal import Cover
from pscover.instance import Instance
from pscover.result import Answer, Settings, Status, ignore
from pscover.search import Search

BACKENDS = ("auto", "highs", "scipy", "scip", "cpsat")
"""Without CVXPY and Pyomo: they hand the same model to HiGHS, and what they add is measured in `bench_build.py`."""


class End(StrEnum):
    """How a solve ended."""

    SOLVED = "solved"
    """A checked plan, proven optimal for the formulation's model."""
    INFEASIBLE = "infeasible"
    """Proven: the model has no plan."""
    LIMIT = "limit"
    """The CPU seconds were spent."""
    OPEN = "open"
    """The engine gave up before, without a proof."""
    REFUSED = "refused"
    """The formulation cannot write the instance, or the engine cannot take the model."""
    MISSING = "missing"
    """The engine is not installed."""
    FAILED = "failed"
    """The engine broke down."""


FINAL = (End.SOLVED, End.INFEASIBLE)
ENDS: dict[type[Exception], End] = {Refused: End.REFUSED, MissingDependency: End.MISSING, EngineFailed: End.FAILED}
"""What errors of a solve stand for; any other is a mistake."""


@dataclass(frozen=True, slots=True, kw_only=True)
class SolveCase:
    """One formulation, with its default parameters, of one instance on one engine."""

    problem: Problem
    formulation: str
    backend: str


@dataclass(frozen=True, slots=True, kw_only=True)
class SolveRow:
    """What does not depend on the computer: the instance's digest, and why nothing was solved."""

    digest: str
    skipped: str = ""


@dataclass(frozen=True, slots=True, kw_only=True)
class SolveTiming:
    """What an engine reached in its time.

    Parameters
    ----------
    end
        How it ended.
    seconds
        CPU seconds of the engine's processes and of building the model; None if nothing was run.
    cost
        Of the best plan, recomputed from the instance; None without one.
    bound
        Proven for the model, as the engine claims; None without one.
    nodes
        Of branch and bound, as the engine counts; None if it does not or was ended.
    chosen
        The plan.
    """

    end: End
    seconds: float | None = None
    cost: float | None = None
    bound: float | None = None
    nodes: int | None = None
    chosen: tuple[int, ...] | None = None


def exact_formulations(*, covers: bool | None = None) -> tuple[str, ...]:
    """Names of the formulations that are exact; of those whose goal is the problem itself (or is another) where asked.

    Examples
    --------
    >>> exact_formulations(covers=True)
    ('clique', 'pairwise')
    """
    found = {name: registry.formulation(name) for name in registry.names("formulation")}
    exact = {name: form for name, form in found.items() if form.relation is Relation.EXACT}
    return tuple(name for name, form in exact.items() if covers is None or isinstance(form.goal, Cover) is covers)


def checked_backends(names: Iterable[str]) -> tuple[str, ...]:
    """The exact engines of these names, each once, whether they are installed or not.

    Raises
    ------
    UnknownName, InvalidSettings
        If there is no engine of that name; if it proves nothing.

    Examples
    --------
    >>> checked_backends(["highs", "HiGHS"])
    ('highs',)
    """
    found = {}
    for name in names:
        engine = registry.lookup("backend", name)
        if not engine.exact:
            raise InvalidSettings(f"backends: expected exact ones, got {engine.name!r}, which proves nothing")
        found[engine.name] = engine
    return tuple(found)


def solve_cases(
    problems: Iterable[Problem], formulations: Sequence[str], backends: Sequence[str] = BACKENDS
) -> list[SolveCase]:
    """All combinations, problem by problem, so that a sweep that is cut off has compared some problems fully."""
    return [
        SolveCase(problem=problem, formulation=formulation, backend=backend)
        for problem in problems
        for formulation in formulations
        for backend in backends
    ]


def measure_solve(case: SolveCase, limit: float, folder: Folder = None) -> Done[SolveRow, SolveTiming]:
    """Build and solve, in at most so many CPU seconds of the engine; the plan is held against the instance.

    Examples
    --------
    >>> case = SolveCase(problem=Problem(family="psc", seed=0), formulation="clique", backend="highs")
    >>> measure_solve(case, limit=0.0).timing.end
    <End.LIMIT: 'limit'>
    """
    instance = instance_of(case.problem, folder)
    try:
        engine = Metered(engine=registry.backend(case.backend), limit=limit)
        timing = solved(instance, registry.formulation(case.formulation), engine)
    except tuple(ENDS) as reason:
        row = SolveRow(digest=instance.digest, skipped=str(reason))
        return Done(row=row, timing=SolveTiming(end=ENDS[type(reason)]))
    return Done(row=SolveRow(digest=instance.digest), timing=timing)


def solved(instance: Instance, formulation: Formulation, engine: Metered) -> SolveTiming:
    """What the engine reaches with this formulation, for the formulation's own goal.

    Raises
    ------
    Refused, EngineFailed
        As `pscover.solve`.
    """
    search = Search(instance, formulation, Clock(), ignore)
    began = time.process_time()
    model = formulation.build(instance)
    built = time.process_time() - began
    # A protocol's class variables cannot be those of one object.
    answer = search.run(cast(Backend, engine), model, Settings())
    plan = search.plan if search.has_feasible_plan else None
    return SolveTiming(
        end=_end(answer, search, engine),
        seconds=engine.spent + built,
        cost=None if plan is None else float(instance.cost[plan].sum()),
        bound=_finite(answer.bound),
        nodes=engine.nodes,
        chosen=None if plan is None else tuple(plan.tolist()),
    )


def _end(answer: Answer, search: Search, engine: Metered) -> End:
    if answer.status is Status.INFEASIBLE and not search.has_feasible_plan:
        return End.INFEASIBLE
    if answer.status is Status.OPTIMAL and search.has_feasible_plan:
        return End.SOLVED
    return End.LIMIT if engine.spent >= engine.limit else End.OPEN


def _finite(value: Any) -> float | None:
    return float(value) if math.isfinite(value) else None
