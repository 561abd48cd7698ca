"""The size of every model and the bound of its linear relaxation, found by one solver for all."""

from __future__ import annotations

import math
import time
from dataclasses import dataclass, replace

import numpy as np

from pscover import registry
from pscover.errors import Refused
from pscover.evidence.study.families import Folder, Problem, instance_of
from pscover.evidence.study.metered import Metered
from pscover.evidence.sweep import Done
from pscover.model import Model
from pscover.result import Settings, Status, ignore

LP_ENGINE = "highs"
DIGITS = 6
"""Of a bound: what follows the sixth differs from machine to machine."""


@dataclass(frozen=True, slots=True, kw_only=True)
class ModelCase:
    """One formulation, with its default parameters, of one instance."""

    problem: Problem
    formulation: str


@dataclass(frozen=True, slots=True, kw_only=True)
class ModelRow:
    """What a model is.

    Parameters
    ----------
    digest
        Of the instance.
    elements, candidates, cliques
        Of the instance.
    rows, variables, nonzeros
        Of the model; None where the formulation refuses the instance.
    relaxation
        The linear relaxation's optimum; None if it was not found in time or there is none, and for formulations with
        several objectives, whose first is no cost.
    empty
        Whether the linear relaxation has no point at all, so that there is no plan.
    refused
        Why, in a sentence, or "".
    """

    digest: str
    elements: int
    candidates: int
    cliques: int
    rows: int | None = None
    variables: int | None = None
    nonzeros: int | None = None
    relaxation: float | None = None
    empty: bool = False
    refused: str = ""


@dataclass(frozen=True, slots=True, kw_only=True)
class ModelTiming:
    """CPU seconds to build the model and to solve its linear relaxation; None for what was not done or not in time."""

    build: float | None = None
    relaxation: float | None = None


def measure_model(case: ModelCase, limit: float, folder: Folder = None) -> Done[ModelRow, ModelTiming]:
    """Build the model and solve its relaxation, in at most so many CPU seconds.

    Examples
    --------
    >>> done = measure_model(ModelCase(problem=Problem(family="psc", seed=0), formulation="clique"), limit=5.0)
    >>> done.row.refused, done.row.rows == done.row.elements
    ('', True)
    """
    instance = instance_of(case.problem, folder)
    row = ModelRow(
        digest=instance.digest,
        elements=instance.elements,
        candidates=instance.candidates,
        cliques=len(instance.conflicts),
    )
    began = time.process_time()
    try:
        model = registry.formulation(case.formulation).build(instance)
    except Refused as reason:
        return Done(row=replace(row, refused=str(reason)), timing=ModelTiming())
    built = time.process_time() - began
    row = replace(row, rows=model.rows, variables=model.variables, nonzeros=model.nonzeros)
    if model.then:
        return Done(row=row, timing=ModelTiming(build=built))
    bound, spent = relaxed(model, limit)
    known = None if bound is None or math.isinf(bound) else bound
    row = replace(row, relaxation=known, empty=bound == math.inf)
    return Done(row=row, timing=ModelTiming(build=built, relaxation=spent))


def relaxed(model: Model, limit: float) -> tuple[float | None, float | None]:
    """The optimum of the linear relaxation and the CPU seconds that it took.

    The optimum is infinite where the relaxation has no point. Both are None if the seconds did not suffice.
    """
    continuous = replace(model, integer=np.zeros(model.variables, dtype=np.bool_))
    engine = Metered(engine=registry.backend(LP_ENGINE), limit=limit)
    answer = engine.solve(continuous, Settings(), ignore)
    if answer.status is Status.INFEASIBLE:
        return math.inf, engine.spent
    if answer.status is not Status.OPTIMAL or not math.isfinite(answer.bound):
        return None, None
    return round(answer.bound, DIGITS), engine.spent
