"""One engine on one instance, on a clock of CPU seconds, and ended when they are spent."""

from __future__ import annotations

import math
import time
from dataclasses import dataclass
from functools import cache
from typing import cast

from pscover import registry
from pscover.backend import Backend
from pscover.errors import InvalidSettings
from pscover.evidence.study.metered import Metered
from pscover.instance import Instance
from pscover.result import Status
from pscover.solve import solve

FIRST = 60.0
"""CPU seconds for an engine to solve the smallest problem, kernels to be compiled included."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Engine:
    """A way to solve: a backend on a formulation, written BACKEND/FORMULATION.

    Parameters
    ----------
    backend, formulation
        Their names.
    """

    backend: str
    formulation: str

    @classmethod
    def parse(cls, text: str) -> Engine:
        """Read "highs/clique".

        Raises
        ------
        InvalidSettings
            If it is not written so.

        Examples
        --------
        >>> str(Engine.parse("highs/clique"))
        'highs/clique'
        """
        backend, slash, formulation = text.partition("/")
        if not (backend and slash and formulation):
            raise InvalidSettings(f"engine: expected BACKEND/FORMULATION, got {text!r}")
        return cls(backend=backend, formulation=formulation)

    def __str__(self) -> str:
        return f"{self.backend}/{self.formulation}"


@dataclass(frozen=True, slots=True, kw_only=True)
class Run:
    """How an engine did.

    Parameters
    ----------
    engine
        As text.
    seconds
        Of CPU, from the call of `solve` to the checked plan: building the model, the engine with all its threads and
        processes, the check.
    is_cut_off
        Whether it was ended by the limit.
    status, objective, bound
        Of the checked result; None for what there is not.
    """

    engine: str
    seconds: float
    is_cut_off: bool
    status: str
    objective: float | None
    bound: float | None


def timed(instance: Instance, engine: Engine, limit: float) -> Run:
    """Solve under a limit of CPU seconds, one thread, the engine loaded before the clock starts.

    Parameters
    ----------
    instance
        What to solve.
    engine
        How.
    limit
        CPU seconds.

    Raises
    ------
    UnknownName, MissingDependency, Refused, EngineFailed
        As `pscover.solve`.

    Examples
    --------
    >>> instance = Instance.of([[0.8, 0.0, 0.75], [0.0, 0.9, 0.75]], required=0.7)
    >>> run = timed(instance, Engine.parse("scipy/clique"), 5.0)
    >>> run.status, run.objective, run.bound, run.is_cut_off
    ('optimal', 1.0, 1.0, False)
    """
    form = registry.formulation(engine.formulation)
    backend = registry.backend(engine.backend)
    # Its process is up and its kernels are loaded before the clock starts.
    solve(_smallest(), backend=cast("Backend", Metered(engine=backend, limit=FIRST)), formulation=form)
    metered = Metered(engine=backend, limit=limit)
    began = time.thread_time()
    result = solve(instance, backend=cast("Backend", metered), formulation=form, threads=1)
    ours = time.thread_time() - began
    is_proven = result.status in (Status.OPTIMAL, Status.INFEASIBLE)
    return Run(
        engine=str(engine),
        seconds=ours + metered.spent,
        is_cut_off=not is_proven and metered.spent >= limit,
        status=str(result.status),
        objective=_finite(result.objective),
        bound=_finite(result.bound),
    )


@cache
def _smallest() -> Instance:
    return Instance.of([[0.8]], required=0.7)


def _finite(value: float) -> float | None:
    return value if math.isfinite(value) else None
