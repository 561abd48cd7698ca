"""What goes into a solve and what comes out: settings, progress, an engine's claim, and the claim held against evidence."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from enum import StrEnum
from numbers import Integral, Real
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pscover.certificate import Certificate
from pscover.errors import InvalidSettings
from pscover.infeasibility import Diagnosis

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.int32]

VALUE_TOLERANCE = 1e-6
"""Objectives closer than this, relative to the larger of 1 and their size, count as equal."""


class Status(StrEnum):
    """What is known of the problem after a solve."""

    OPTIMAL = "optimal"
    """The plan is feasible and no feasible plan is better by more than the gap asked for and the formulation's tolerance."""
    FEASIBLE = "feasible"
    """The plan is feasible; a better one may exist."""
    INFEASIBLE = "infeasible"
    """Proven: no plan meets every requirement."""
    UNKNOWN = "unknown"
    """No feasible plan was found, and none was proven not to exist."""


class Stop(StrEnum):
    """Why a solve ended: separate from what it holds."""

    FINISHED = "finished"
    TIME = "time limit"
    OBSERVER = "stopped by the observer"
    INTERRUPT = "interrupted"


THREAD_LIMIT = 256
"""Most threads that can be asked for: engines start as many as they are told, whatever the machine has."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Settings:
    """How to solve; the same meaning for every backend.

    Parameters
    ----------
    time
        Seconds of wall time from the call of `solve`, building included: a deadline, not a wish. Infinite by default.
    gap
        Relative gap (objective - bound) / |objective| at which to stop; 0 asks for a proof of optimality.
    threads
        How many threads an engine may use, where it can use several; at most 256.
    seed
        Seed of everything random.
    margin
        Added to every positive requirement (kept below 1), so that a plan is strictly feasible despite tolerances. What is
        proven of the raised requirements is not of the real ones: with a margin there is no bound, and the status is
        "feasible" or "unknown".
    start
        Candidate indices of a plan to start from, or None. Returned if nothing better is found.
    """

    time: float = math.inf
    gap: float = 0.0
    threads: int = 1
    seed: int = 0
    margin: float = 0.0
    start: tuple[int, ...] | None = None

    def __post_init__(self) -> None:
        for name in ("time", "gap", "margin"):
            object.__setattr__(self, name, _number(name, getattr(self, name)))
        for name in ("threads", "seed"):
            object.__setattr__(self, name, _whole(name, getattr(self, name)))
        if self.start is not None:
            object.__setattr__(self, "start", _indices("start", self.start))
        checks = (
            ("time", self.time > 0, "a positive number of seconds", self.time),
            ("gap", 0 <= self.gap < math.inf, "a number of at least 0", self.gap),
            ("threads", 1 <= self.threads <= THREAD_LIMIT, f"a whole number from 1 to {THREAD_LIMIT}", self.threads),
            ("seed", 0 <= self.seed < 2**31, "a whole number from 0 to 2^31 - 1", self.seed),
            ("margin", 0 <= self.margin < 1, "a number in [0, 1)", self.margin),
        )
        for name, good, expected, got in checks:
            if not good:
                raise InvalidSettings(f"{name}: expected {expected}, got {got!r}")


def _number(name: str, given: Any) -> float:
    if not isinstance(given, Real):
        raise InvalidSettings(f"{name}: expected a number, got {given!r}")
    return float(given)


def _whole(name: str, given: Any) -> int:
    if not isinstance(given, Integral):
        raise InvalidSettings(f"{name}: expected a whole number, got {given!r}")
    return int(given)


def _indices(name: str, given: Any) -> tuple[int, ...]:
    try:
        listed = list(given)
    except TypeError:
        raise InvalidSettings(f"{name}: expected candidate indices, got {given!r}") from None
    return tuple(_whole(f"{name}[{k}]", i) for k, i in enumerate(listed))


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Progress:
    """One improvement of the plan or the bound.

    Parameters
    ----------
    seconds
        Wall time since `solve` was called.
    objective
        Of the best plan so far; infinite while there is none.
    bound
        Proven lower bound on the objective so far; minus infinity while there is none.
    chosen
        Candidates of the best plan if it is new, else None.
    """

    seconds: float
    objective: float
    bound: float
    chosen: IntArray | None = None


Observer = Callable[[Progress], bool]
"""Called at each improvement; True asks to stop."""


def ignore(progress: Progress) -> bool:
    """The observer that never asks to stop."""
    return False


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Answer:
    """What an engine claims of a model; nothing in it has been checked.

    Parameters
    ----------
    status
        The claim.
    chosen
        Indices of the chosen candidates, or None without a plan.
    bound
        Claimed lower bound on the model's objective, minus infinity if none.
    stop
        Why the engine ended.
    message
        The engine's own words, if any.
    certificate
        What proves a bound, if anything; its elements are the model's covering rows in their order.
    nodes
        Of the engine's branch and bound tree, as it counts them; None where it keeps none or does not say.
    """

    status: Status
    chosen: IntArray | None
    bound: float
    stop: Stop = Stop.FINISHED
    message: str = ""
    certificate: Certificate | None = None
    nodes: int | None = None


@dataclass(frozen=True, slots=True, kw_only=True)
class Timing:
    """Wall seconds of a solve by stage; `total` runs from the call of `solve` to its return."""

    build: float
    engine: float
    check: float
    total: float


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Result:
    """An engine's claim, weakened by what was recomputed from the instance.

    Parameters
    ----------
    status
        The claim after the evidence: a plan that misses a requirement is not feasible whatever the engine said, and a
        restriction proves neither optimality nor infeasibility.
    stop
        Why the solve ended.
    chosen
        Candidates of the plan, sorted, or None.
    value
        The plan's objectives in order of priority, recomputed (one number for most formulations; empty without a plan).
    bound
        Lower bound on `objective` as the engine claims it, rounded up where costs are integers; minus infinity if none.
    coverage
        The probability that each element is covered, recomputed, shape (elements,), or None.
    shortfall
        By how much each of the formulation's requirements is missed, recomputed, >= 0, or None.
    backend, formulation
        Names of who solved what.
    options
        The formulation's parameters, as JSON text.
    settings
        As given.
    digest
        Of the instance.
    versions
        Of pscover and of the packages that took part, as (name, version).
    timing
        Where the time went.
    trace
        Every improvement, oldest first.
    message
        Words of the engine, if any.
    diagnosis
        For an infeasible instance, why; else None.
    certificate
        Of a lower bound, not necessarily as high as `bound`; `pscover.certificate.certified_bound` tells how high. None
        without one.
    """

    status: Status
    stop: Stop
    chosen: IntArray | None
    value: tuple[float, ...]
    bound: float
    coverage: FloatArray | None
    shortfall: FloatArray | None
    backend: str
    formulation: str
    options: str
    settings: Settings
    digest: str
    versions: tuple[tuple[str, str], ...]
    timing: Timing
    trace: tuple[Progress, ...]
    message: str = ""
    diagnosis: Diagnosis | None = None
    certificate: Certificate | None = None

    @property
    def has_plan(self) -> bool:
        """Whether the result holds a plan that was checked to be feasible."""
        return self.status in (Status.OPTIMAL, Status.FEASIBLE)

    @property
    def objective(self) -> float:
        """The first (highest-priority) component of `value`; infinite without a plan."""
        return self.value[0] if self.value else math.inf

    @property
    def gap(self) -> float:
        """(objective - bound) / |objective|; infinite without a plan or a bound, 0 when they meet."""
        return relative_gap(self.objective, self.bound)


def relative_gap(objective: float, bound: float) -> float:
    """(objective - bound) / |objective|, not below 0; infinite unless both are finite.

    Examples
    --------
    >>> relative_gap(20.0, 19.0)
    0.05
    """
    if not (math.isfinite(objective) and math.isfinite(bound)):
        return math.inf
    difference = max(0.0, objective - bound)
    return 0.0 if difference == 0 else difference / max(abs(objective), 1e-12)
