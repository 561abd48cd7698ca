"""A clock of CPU seconds for a process and its children, put in the place of Python's wall clocks.

On a machine that others use too, wall time says little: an engine that plans by the wall clock then gets a part of the
work it was promised. Linux lets any process read the CPU time of another; here that of a contestant and of its workers
is summed, and `time.monotonic` and `time.perf_counter` are replaced, in the contestant and in its workers, by this sum.
"""

from __future__ import annotations

import os
import time
from collections.abc import Callable
from pathlib import Path

RESCAN = 0.05
"""Wall seconds between two looks for new children."""
_wall = time.monotonic


def spent(pid: int) -> float:
    """CPU seconds of a running process, all its threads; 0 if there is none.

    Examples
    --------
    >>> spent(os.getpid()) > 0
    True
    """
    try:
        # The clock id of a process, as clock_getcpuclockid(3) makes it.
        return time.clock_gettime((~pid << 3) | 2)
    except OSError:
        return 0.0


def children(pid: int) -> list[int]:
    """Processes started by any thread of a process."""
    found: list[int] = []
    try:
        for listing in Path(f"/proc/{pid}/task").glob("*/children"):
            found += [int(child) for child in listing.read_text().split()]
    except OSError:
        pass
    return found


def reaped(pid: int) -> float:
    """CPU seconds of the children of a process that have ended and were waited for."""
    try:
        fields = Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()
    except OSError:
        return 0.0
    return (int(fields[13]) + int(fields[14])) / os.sysconf("SC_CLK_TCK")


class CpuClock:
    """Seconds of CPU of a process and of its children, never running backwards.

    Parameters
    ----------
    root
        The process.
    """

    def __init__(self, root: int) -> None:
        self.root = root
        self.family: list[int] = []
        self.gone = 0.0
        self.looked = -1.0
        self.last = 0.0

    def __call__(self) -> float:
        """Seconds so far."""
        now = _wall()
        if now - self.looked > RESCAN:
            self.looked, self.family, self.gone = now, children(self.root), reaped(self.root)
        self.last = max(self.last, self.gone + spent(self.root) + sum(spent(pid) for pid in self.family))
        return self.last


def install(root: int) -> Callable[[], float]:
    """Replace Python's clocks in this process; before anything else imports them by name."""
    clock = CpuClock(root)
    time.monotonic = clock
    time.perf_counter = clock
    return clock
