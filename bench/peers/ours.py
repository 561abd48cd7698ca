"""`auto` as a contestant: every clock it plans by is one of CPU seconds, in its own process and in its workers."""

from __future__ import annotations

import math
import queue
import time
from typing import Any

from bench.peers.cpu_clock import install

BOOT = (
    "import sys, json; sys.path[:] = json.loads(sys.argv[1]); from bench.peers.ours import worker; worker(); "
    "from pscover.worker import main; main()"
)
GLANCE = 0.01
"""Wall seconds between two looks at the clock while waiting for a worker."""


def worker() -> None:
    """In a worker: the clock of the whole family, and no wall clock inside HiGHS."""
    import os

    install(os.getppid())
    from pscover.backends import highs

    options = highs.options

    def without_limit(settings: Any, left: float) -> dict[str, Any]:
        # HiGHS measures wall time; its callbacks look at the session, which goes by CPU seconds.
        return options(settings, left) | {"time_limit": math.inf}

    highs.options = without_limit


class PatientQueue(queue.SimpleQueue[Any]):
    """A queue whose time-outs are in seconds of the replaced clock."""

    def get(self, block: bool = True, timeout: float | None = None) -> Any:
        """As `queue.SimpleQueue.get`."""
        if timeout is None or not block:
            return super().get(block, timeout)
        end = time.monotonic() + timeout
        while True:
            try:
                return super().get(True, GLANCE)
            except queue.Empty:
                if time.monotonic() >= end:
                    raise


def prepare() -> None:
    """Outside the clock: kernels ready, a worker of HiGHS up."""
    from pscover import isolate
    from pscover.engine.warm import warming

    isolate.BOOT = BOOT
    queue.SimpleQueue = PatientQueue  # type: ignore[misc]
    warming().wait(600.0)
    isolate.warm_up()
    (warm,) = isolate._idle
    warm.inbox.get()


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
