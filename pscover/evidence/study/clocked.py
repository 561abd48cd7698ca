"""The far side of a metered engine: a worker in which an engine that plans by the clock plans by CPU seconds.

`auto` divides the time it is given among its stages. On a machine that others use too it would get a part of the work it was
promised, so that in its process, and in those it starts, every clock that Python reads is one of CPU seconds.
"""

from __future__ import annotations

import math
import os
import queue
import sys
import time
from typing import Any

from pscover.evidence.cpu_clock import install

BOOT = "import sys, json; sys.path[:] = json.loads(sys.argv[1]); from {module} import serve; serve({engine!r})"
NESTED = "import sys, json; sys.path[:] = json.loads(sys.argv[1]); from {module} import serve_within; serve_within()"
GLANCE = 0.01
"""Wall seconds between two looks at the clock while waiting for a worker."""
KERNELS = 600.0
"""Seconds that compiling may take; before the first job, on nobody's clock."""
PLANNERS = ("auto",)
"""Engines that divide the time they are given, and so have to be told it."""


def boot(engine: str) -> str:
    """The program of a worker for an engine.

    Examples
    --------
    >>> boot("highs").endswith("import serve; serve('highs')")
    True
    """
    return BOOT.format(module=__name__, engine=engine)


def serve(engine: str) -> None:
    """Be the worker of an engine."""
    from pscover import worker

    if engine in PLANNERS:
        plan_by_cpu(os.getpid())
        prepare()
    worker.main()


def serve_within() -> None:
    """Be a worker that a worker of ours has started: the clock is that of both, and HiGHS looks at no other."""
    from pscover import worker

    plan_by_cpu(os.getppid())
    from pscover.backends import highs

    options = highs.options

    def without_limit(settings: Any, left: float) -> dict[str, Any]:
        # HiGHS measures wall time; its callbacks look at the session, which goes by CPU seconds.
        return options(settings, left) | {"time_limit": math.inf}

    highs.options = without_limit
    worker.main()


class _PatientQueue(queue.SimpleQueue[Any]):
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


def plan_by_cpu(root: int) -> None:
    """Make every clock of this process one of the CPU seconds of a process and its children, and so those of its workers."""
    install(root)
    queue.SimpleQueue = _PatientQueue  # type: ignore[misc]
    from pscover import isolate

    isolate.BOOT = NESTED.format(module=__name__)


def prepare() -> None:
    """Load what `auto` needs before any clock runs: kernels ready, a worker of HiGHS up."""
    from pscover import isolate
    from pscover.engine.warm import warming

    if not warming().wait(KERNELS):
        sys.exit("the kernels could not be compiled")
    isolate.warm_up("highs")
    for waiting in isolate._idle:
        waiting.inbox.get()
