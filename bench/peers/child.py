"""One contestant on one instance, in a process of its own: `python child.py job.json`; speaks JSON lines.

The first line says that the engine is loaded and where its clock stood, each further one a better bound or a plan with the
clock's reading, the last one how it ended.
"""

from __future__ import annotations

import ctypes
import json
import math
import os
import resource
import signal
import sys
import time
from importlib import metadata
from pathlib import Path
from typing import Any

sys.path.insert(0, str(Path(__file__).parents[2]))

from pscover.evidence.cpu_clock import install

PARENT_DEATH = 1
THROTTLE = 0.01
"""Least CPU seconds between two lines that bring nothing but a better bound."""


def main() -> None:
    """Run the job."""
    # Linux: end when the runner ends, whatever its end.
    ctypes.CDLL(None).prctl(PARENT_DEATH, signal.SIGKILL)
    job = json.loads(Path(sys.argv[1]).read_text())
    outlet = os.fdopen(os.dup(1), "w", buffering=1)
    os.dup2(os.open(os.devnull, os.O_WRONLY), 1)
    clock = install(os.getpid()) if job["contestant"] == "auto" else time.process_time
    from bench.peers.contestants import LOAD, PACKAGES
    from pscover.io import load_instance

    instance = load_instance(Path(job["instance"]))
    best_bound, last, began = -math.inf, -math.inf, math.inf

    def say(**line: Any) -> None:
        outlet.write(json.dumps(line) + "\n")

    def tell(bound: float, chosen: Any) -> None:
        nonlocal best_bound, last
        now = clock() - began
        rises = math.isfinite(bound) and abs(bound) < 1e19 and not bound <= best_bound + 1e-9 * abs(bound)
        if chosen is None and not (rises and now - last >= THROTTLE):
            return
        last, best_bound = now, max(best_bound, bound) if rises else best_bound
        told = best_bound if math.isfinite(best_bound) else None
        say(t=now, bound=told, chosen=None if chosen is None else [int(i) for i in chosen])

    solve = LOAD[job["contestant"]](instance, job["seed"], {**job["options"], "limit": job["limit"]}, tell)
    versions = {name: metadata.version(name) for name in PACKAGES[job["contestant"]]}
    began = clock()
    wall = time.time()
    say(loaded=began, versions=versions)
    status = solve()
    last = -math.inf
    ended = clock() - began
    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024
    workers = resource.getrusage(resource.RUSAGE_CHILDREN).ru_maxrss / 1024
    say(ended=ended, wall=time.time() - wall, status=status, peak_mib=peak, worker_mib=workers)
    outlet.flush()
    os._exit(0)


if __name__ == "__main__":
    main()
