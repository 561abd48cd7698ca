"""What a run is worth, from its trace of (CPU seconds, objective, bound)."""

from __future__ import annotations

import math
from collections.abc import Iterable
from typing import Any

Trace = Iterable[tuple[float, float | None, float | None]]


def at(trace: Trace, seconds: float) -> tuple[float, float]:
    """Objective and bound after so many CPU seconds; infinite where there was none."""
    objective, bound = math.inf, -math.inf
    for when, plan, proven in trace:
        if when > seconds:
            break
        objective = objective if plan is None else plan
        bound = bound if proven is None else proven
    return objective, bound


def relative_gap(objective: float, bound: float) -> float:
    """(objective - bound) / objective, in [0, 1]: 1 without a plan or a bound."""
    if not (math.isfinite(objective) and math.isfinite(bound)):
        return 1.0
    return min(1.0, max(0.0, (objective - bound) / objective))


def primal_integral(trace: Trace, best: float, horizon: float) -> float:
    """The mean over the time of how far the plan is from the best known, 1 while there is none (Berthold 2013).

    Parameters
    ----------
    trace
        Of a run; after its end the last plan counts on.
    best
        Objective of the best plan known from anybody.
    horizon
        CPU seconds.
    """
    total, since, distance = 0.0, 0.0, 1.0
    for when, objective, _ in trace:
        if when > horizon:
            break
        total, since = total + distance * (when - since), when
        if objective is not None:
            distance = max(0.0, (objective - best) / objective)
    return (total + distance * (horizon - since)) / horizon


def first_within(trace: Trace, target: float) -> float:
    """CPU seconds until a plan of that objective or better; infinite if never."""
    return next((when for when, objective, _ in trace if objective is not None and objective <= target), math.inf)


def geometric_mean(values: list[float]) -> float:
    """Of positive numbers; not a number for none."""
    return math.exp(sum(map(math.log, values)) / len(values)) if values else math.nan


def best_of(runs: Iterable[dict[str, Any]]) -> float:
    """The least objective of some runs."""
    return min((run["objective"] for run in runs if run["objective"] is not None), default=math.inf)
