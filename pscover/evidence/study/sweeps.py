"""The sweeps of the study: what each runs, and over what."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from functools import partial

from pscover.evidence.study.families import FAMILIES, Folder, Problem, problem_of
from pscover.evidence.study.models import ModelCase, ModelRow, ModelTiming, measure_model
from pscover.evidence.study.price import PlanCase, PlanTiming, measure_plan
from pscover.evidence.study.solves import SolveCase, SolveRow, SolveTiming, measure_solve
from pscover.evidence.sweep import Sweep

LIMIT = 10.0
"""CPU seconds of an engine on one model."""
SEEDS = 3
MODELS, SOLVES, PLANS = "models", "solves", "plans"
"""Folders of the sweeps."""


def problems(families: Iterable[str] = tuple(FAMILIES), seeds: int = SEEDS, folder: Folder = None) -> list[Problem]:
    """The instances, seed by seed, so that a sweep that is cut off has all families."""
    listed = list(families)
    return [problem_of(family, seed, folder) for seed in range(seeds) for family in listed]


def models(limit: float, folder: Folder = None) -> Sweep[ModelCase, ModelRow, ModelTiming]:
    """Sizes and relaxations."""
    return Sweep(
        name="study of formulations: models",
        run=partial(measure_model, limit=limit, folder=folder),
        case=ModelCase,
        row=ModelRow,
        timing=ModelTiming,
        settings={"limit": limit},
    )


def model_cases(listed: Sequence[Problem], formulations: Sequence[str]) -> list[ModelCase]:
    """Every formulation of every instance."""
    return [ModelCase(problem=problem, formulation=name) for problem in listed for name in formulations]


def solves(limit: float, folder: Folder = None) -> Sweep[SolveCase, SolveRow, SolveTiming]:
    """Exact formulations on exact engines."""
    return Sweep(
        name="study of formulations: solves",
        run=partial(measure_solve, limit=limit, folder=folder),
        case=SolveCase,
        row=SolveRow,
        timing=SolveTiming,
        settings={"limit": limit},
    )


def plans(limit: float, trials: int, engine: str, folder: Folder = None) -> Sweep[PlanCase, SolveRow, PlanTiming]:
    """What promises cost, and whether they are kept; the engine finds the plans."""
    return Sweep(
        name="study of formulations: plans",
        run=partial(measure_plan, limit=limit, trials=trials, engine=engine, folder=folder),
        case=PlanCase,
        row=SolveRow,
        timing=PlanTiming,
        settings={"limit": limit, "trials": trials, "engine": engine},
    )
