"""`auto` as a contestant: every clock it plans by is one of CPU seconds, in its own process and in its workers."""

from __future__ import annotations

import os
from typing import Any

from pscover.evidence.study import clocked


def run(instance: Any, limit: float, seed: int, tell: Any, options: dict[str, Any]) -> str:
    """Solve by a backend of pscover, the building of the model included; `tell(objective, bound, chosen)`."""
    import pscover

    def observe(progress: Any) -> bool:
        tell(progress.bound, progress.chosen)
        return False

    backend = options.get("backend", "auto")
    result = pscover.solve(instance, backend=backend, time=limit, seed=seed, observe=observe)
    tell(result.bound, result.chosen)
    return str(result.status.value)


def prepare() -> None:
    """Outside the clock: clocks replaced, kernels ready, a worker of HiGHS up."""
    clocked.plan_by_cpu(os.getpid())
    clocked.prepare()
