"""What a stronger promise costs in grasps, and whether it is kept: plans of several formulations, tried out many times."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass

import numpy as np

from pscover import registry
from pscover.evidence.study.families import Folder, Problem, instance_of
from pscover.evidence.study.metered import Metered
from pscover.evidence.study.outcomes import WORLDS, Outcome, simulate
from pscover.evidence.study.solves import ENDS, SolveRow, SolveTiming, solved
from pscover.evidence.sweep import Done
from pscover.formulation import Formulation
from pscover.instance import Instance

TOGETHER = 0.7
"""Probability with which `joint`, and the even split of it, promise that all elements are covered at once."""
CORRELATION = 0.5
"""That the scenarios are drawn with."""
GARMENTS = ("apart", "groups", "pile", "psc", "psc-cliques")
"""Families with probabilities: elsewhere all promises are the same."""


@dataclass(frozen=True, slots=True)
class Promise:
    """A formulation, and of which instance it is asked for a plan."""

    what: str
    formulation: Callable[[], Formulation]
    of: Callable[[Instance], Instance] = lambda instance: instance


def even_split(instance: Instance) -> Instance:
    """Each element required so often that all at once are, were elements independent: q_j raised to R^(1/m).

    Examples
    --------
    >>> even_split(Instance.of([[0.9], [0.9]], required=0.5)).required.round(3)
    array([0.837, 0.837])
    """
    needed = instance.required > 0
    count = max(1, int(needed.sum()))
    return instance.require(np.where(needed, np.maximum(instance.required, TOGETHER ** (1 / count)), 0.0))


PROMISES = {
    "clique": Promise("each element with q", lambda: registry.formulation("clique")),
    "single_cover": Promise("each element with q by one grasp alone", lambda: registry.formulation("single_cover")),
    "robust": Promise(
        "each element with q though one grasp is overrated by 0.1",
        lambda: registry.formulation("robust", {"gamma": 1, "deviation": 0.1}),
    ),
    "joint": Promise("all elements at once with 0.7", lambda: registry.formulation("joint", {"required": TOGETHER})),
    "even split": Promise(
        "the same, by raising every q to the m-th root of 0.7", lambda: registry.formulation("clique"), even_split
    ),
    "scenario": Promise(
        "each element with q under a common cause of correlation 0.5, in 100 scenarios",
        lambda: registry.formulation("scenario", {"count": 100, "correlation": CORRELATION, "seed": 1}),
    ),
}
"""What can be promised, the paper's promise first."""


@dataclass(frozen=True, slots=True, kw_only=True)
class PlanCase:
    """A promise for one instance."""

    problem: Problem
    promise: str


@dataclass(frozen=True, slots=True, kw_only=True)
class PlanTiming:
    """The plan that was found in time, and what came of it.

    Parameters
    ----------
    solve
        How it was found.
    predicted
        Probability that all elements are covered at once, were all successes independent; None without a plan.
    outcomes
        One a world; none without a plan.
    """

    solve: SolveTiming
    predicted: float | None = None
    outcomes: tuple[Outcome, ...] = ()


def plan_cases(problems: Iterable[Problem]) -> list[PlanCase]:
    """Every promise for every instance, problem by problem; instances without probabilities are left out."""
    return [
        PlanCase(problem=problem, promise=promise)
        for problem in problems
        if problem.family in GARMENTS
        for promise in PROMISES
    ]


def measure_plan(
    case: PlanCase, limit: float, trials: int, engine: str, folder: Folder = None
) -> Done[SolveRow, PlanTiming]:
    """Find the cheapest plan that keeps the promise, in at most so many CPU seconds, and try it in every world.

    Examples
    --------
    >>> case = PlanCase(problem=Problem(family="psc", seed=0), promise="clique")
    >>> done = measure_plan(case, limit=5.0, trials=1000, engine="highs")
    >>> done.timing.solve.end, [outcome.broken for outcome in done.timing.outcomes][:2]
    (<End.SOLVED: 'solved'>, [0.0, 0.0])
    """
    instance, promise = instance_of(case.problem, folder), PROMISES[case.promise]
    try:
        metered = Metered(engine=registry.backend(engine), limit=limit)
        found = solved(promise.of(instance), promise.formulation(), metered)
    except tuple(ENDS) as reason:
        row = SolveRow(digest=instance.digest, skipped=str(reason))
        return Done(row=row, timing=PlanTiming(solve=SolveTiming(end=ENDS[type(reason)])))
    row = SolveRow(digest=instance.digest)
    if found.chosen is None:
        return Done(row=row, timing=PlanTiming(solve=found))
    coverage = instance.coverage(found.chosen)[instance.required > 0]
    outcomes = tuple(
        simulate(instance, found.chosen, world, trials, seed=[case.problem.seed, k]) for k, world in enumerate(WORLDS)
    )
    return Done(row=row, timing=PlanTiming(solve=found, predicted=float(np.prod(coverage)), outcomes=outcomes))
