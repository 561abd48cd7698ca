"""The whole pipeline: build the model, run the engine under a deadline, hold its claim against evidence."""

from __future__ import annotations

import json
import math
from dataclasses import fields, replace
from functools import cache
from importlib import metadata
from typing import Any

import numpy as np

from pscover import isolate, registry
from pscover.backend import Backend
from pscover.certificate import Certificate
from pscover.clock import Clock
from pscover.errors import InvalidInstance, InvalidSettings, UnknownName
from pscover.formulation import Formulation
from pscover.goal import Cover
from pscover.infeasibility import Diagnosis, unmet, unreachable
from pscover.instance import Instance
from pscover.model import Model
from pscover.result import VALUE_TOLERANCE, Answer, Observer, Result, Settings, Status, Stop, Timing, ignore, relative_gap
from pscover.search import Search


def solve(
    instance: Instance,
    *,
    backend: str | Backend = "highs",
    formulation: str | Formulation = "clique",
    settings: Settings | None = None,
    observe: Observer = ignore,
    **overrides: Any,
) -> Result:
    """Solve an instance and check the answer.

    Parameters
    ----------
    instance
        The problem.
    backend
        Name of an engine, or one of your own (see `pscover.backend.Backend`).
    formulation
        Name of a formulation, or one with parameters from `pscover.registry.formulation`.
    settings
        How to solve; default `Settings()`.
    observe
        Called in this thread at each improvement of plan or bound; return True to stop with the best plan so far.
    **overrides
        Fields of `Settings` to replace, such as `time=1.0`.

    Returns
    -------
    Result
        With objective, coverage and shortfall recomputed from the instance. Ctrl-C ends the solve and returns the best
        plan so far, with `stop` saying so.

    Raises
    ------
    InvalidInstance
        If the instance is none.
    UnknownName, InvalidSettings
        For names and settings that do not exist or are outside their domain.
    MissingDependency
        If the backend's package is not installed.
    Refused
        If the formulation cannot write the instance or the backend cannot take the model; the message says why.
    EngineFailed
        If the engine broke down before it had a plan.

    Examples
    --------
    >>> instance = Instance.of([[0.8, 0.0, 0.75], [0.0, 0.9, 0.75]], required=0.7)
    >>> result = solve(instance, backend="greedy")
    >>> result.chosen.tolist(), result.objective
    ([2], 1.0)
    """
    _check_kinds(instance, backend, formulation, settings, observe)
    settings = _settings(settings or Settings(), overrides)
    clock = Clock(settings.time)
    engine = registry.backend(backend) if isinstance(backend, str) else backend
    form = registry.formulation(formulation) if isinstance(formulation, str) else formulation
    if settings.start is not None and any(not 0 <= i < instance.candidates for i in settings.start):
        raise InvalidSettings(f"start: expected candidate indices below {instance.candidates}, got {settings.start!r}")
    isolate.warm_up(engine)
    model = form.build(instance.with_margin(settings.margin))
    digest = instance.digest
    built = clock.elapsed
    search = Search(instance, form, clock, observe, settings.margin)
    if settings.start is not None:
        search.offer(np.unique(np.asarray(settings.start, dtype=np.int32)))
    answer = search.run(engine, model, settings)
    solved = clock.elapsed
    diagnosis = _diagnose(search, engine, answer, settings)
    finished = clock.elapsed
    plan, evidence = search.plan, search.evidence
    return Result(
        status=_status(answer, form, model, search, settings),
        stop=answer.stop,
        chosen=plan,
        value=() if evidence is None else tuple(float(v) for v in evidence.value),
        bound=_bound(answer, model, search),
        coverage=None if plan is None else instance.coverage(plan),
        shortfall=None if evidence is None else np.array([float(s) for s in evidence.shortfall]),
        backend=engine.name,
        formulation=form.name,
        options=options_text(form),
        settings=settings,
        digest=digest,
        versions=versions(engine),
        timing=Timing(build=built, engine=solved - built, check=finished - solved, total=clock.elapsed),
        trace=tuple(search.trace),
        message=answer.message,
        diagnosis=diagnosis,
        certificate=_certificate(answer, form, search),
    )


def _check_kinds(instance: Any, backend: Any, formulation: Any, settings: Any, observe: Any) -> None:
    """Raise for arguments that are nothing of what they stand for, as a class is that was not called."""
    if not isinstance(instance, Instance):
        raise InvalidInstance(f"instance: expected an Instance (make one with Instance.of), got {type(instance).__name__}")
    for name, given, method in (("backend", backend, "solve"), ("formulation", formulation, "build")):
        if not isinstance(given, str) and (isinstance(given, type) or not hasattr(given, method)):
            raise InvalidSettings(f"{name}: expected a name or a {name}, got {given!r}")
    if settings is not None and not isinstance(settings, Settings):
        raise InvalidSettings(f"settings: expected Settings, got {settings!r}")
    if not callable(observe):
        raise InvalidSettings(f"observe: expected a function of a Progress, got {observe!r}")


def options_text(formulation: Formulation) -> str:
    """The formulation's parameters as JSON text; arrays are given by their shape."""
    values = {f.name: getattr(formulation, f.name) for f in fields(formulation)}  # type: ignore[arg-type]
    return json.dumps(values, default=lambda v: f"array of shape {np.shape(v)}")


@cache
def _version(package: str) -> str:
    try:
        return metadata.version(package)
    except metadata.PackageNotFoundError:
        return "unknown"


def versions(engine: Backend) -> tuple[tuple[str, str], ...]:
    """Versions of pscover and of the packages an engine runs on."""
    return tuple((name, _version(name)) for name in ("pscover", "numpy", "scipy", *engine.requires))


def _settings(settings: Settings, overrides: dict[str, Any]) -> Settings:
    known = [f.name for f in fields(Settings)]
    for name in overrides:
        if name not in known:
            raise UnknownName.among("setting", name, known)
    return replace(settings, **overrides)


def _certificate(answer: Answer, formulation: Formulation, search: Search) -> Certificate | None:
    if answer.certificate is None or not search.proves or not isinstance(formulation.goal, Cover):
        return None
    return answer.certificate.over(search.instance)


def _bound(answer: Answer, model: Model, search: Search) -> float:
    if not search.proves or math.isnan(answer.bound) or search.refutes(answer.bound):
        return -math.inf
    if model.is_integral_cost and math.isfinite(answer.bound):
        return float(math.ceil(answer.bound - VALUE_TOLERANCE * max(1.0, abs(answer.bound))))
    return answer.bound


def _status(answer: Answer, formulation: Formulation, model: Model, search: Search, settings: Settings) -> Status:
    """The claim, weakened by the evidence and by how the model stands to the formulation's goal."""
    if not search.has_feasible_plan:
        is_proof = answer.status is Status.INFEASIBLE and search.proves
        return Status.INFEASIBLE if is_proof else Status.UNKNOWN
    if answer.status is not Status.OPTIMAL or not search.proves or search.refutes(answer.bound):
        return Status.FEASIBLE
    # Where all costs are tiny, so are the differences that count.
    cheapest = float(np.min(np.abs(model.c[model.c != 0]), initial=1.0))
    # A relaxation of unknown quality has an infinite tolerance: then only a bound that is met is a proof.
    tolerance = formulation.tolerance if math.isfinite(formulation.tolerance) else 0.0
    slack = VALUE_TOLERANCE * max(cheapest, abs(search.objective)) + tolerance
    is_close = search.objective <= answer.bound + slack
    return Status.OPTIMAL if is_close or relative_gap(search.objective, answer.bound) <= settings.gap else Status.FEASIBLE


def _diagnose(search: Search, engine: Backend, answer: Answer, settings: Settings) -> Diagnosis | None:
    """Why there is no plan, as far as the time allows; only for the problem itself, not for other goals."""
    is_open = answer.status is Status.INFEASIBLE or (search.plan is None and answer.stop is Stop.FINISHED)
    if search.has_feasible_plan or not is_open or not isinstance(search.formulation.goal, Cover) or search.clock.is_over:
        return None
    alone = unreachable(search.instance, seconds=search.clock.left)
    if alone or search.clock.left < 0.05 or answer.status is not Status.INFEASIBLE:
        return Diagnosis(unreachable=alone) if alone else None
    softened = registry.formulation("elastic")
    capable = engine if engine.exact and engine.refuses(softened.build(search.instance)) is None else "highs"
    nearest = solve(search.instance, backend=capable, formulation=softened, settings=settings, time=search.clock.left)
    return Diagnosis(unreachable=(), unmet=() if nearest.chosen is None else unmet(search.instance, nearest.chosen.tolist()))
