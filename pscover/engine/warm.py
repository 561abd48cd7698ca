"""Getting kernels ready without holding anybody up: from disk in a thread, compiled in processes of their own at first."""

from __future__ import annotations

import atexit
import gc
import hashlib
import os
import subprocess
import sys
import tempfile
import threading
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

from pscover.engine.jit import sources

if TYPE_CHECKING:
    from .problem import Problem

COMPILE = """
import sys
part, *sys.path[:] = sys.argv[1:]
from pscover.engine.warm import compile_in_turn
compile_in_turn(int(part))
"""
KINDNESS = 10
"""How much a compiling process steps back behind the one that plans meanwhile (nice)."""
OBJECTS = 50_000
"""A compiling process looks for garbage after so many new objects: there is little, and looking takes its time."""


def prepare() -> None:
    """Load or compile every kernel."""
    for part in _parts():
        part.prepare()


def is_on_disk() -> bool:
    """Whether every kernel has been compiled before, by this version of the sources and of numba."""
    return all(part.is_on_disk for part in _parts())


class Part(NamedTuple):
    """Kernels that share most of what they are made of, and what calls each of them, on a problem of one row."""

    kernels: tuple[Any, ...]
    prepare: Callable[[], object]

    @property
    def is_on_disk(self) -> bool:
        """Whether they have been compiled before."""
        try:
            return all(kernel._cache._cache_file._load_index() for kernel in self.kernels)
        except AttributeError:
            return False


PARTS = 2
"""In so many parts kernels are compiled side by side: each takes about as long."""


def _parts() -> tuple[Part, Part]:
    """What looks for plans, and what proves how good they are."""
    from . import facets, greedy, replaced, rowwise, subgradient, sweep, tables, weighting

    plans = greedy.start, weighting.search, replaced.thin
    bounds = subgradient.climb, rowwise.move, facets.lift, tables.go_back, sweep.expand, sweep.undominated
    return Part(plans, _look_for_a_plan), Part(bounds, _prove)


def _look_for_a_plan() -> None:
    from . import greedy, replaced, state, weighting

    problem = _one_row()
    plan = state.empty(problem, 0)
    greedy.choose(problem, plan, problem.cost)
    weighting.search(problem, plan, 100, 2)
    replaced.stand_ins(problem)


def _prove() -> None:
    import numpy as np

    from . import facets, rowwise, subgradient, sweep

    problem = _one_row()
    multipliers = subgradient.multipliers(problem)
    subgradient.ascend(problem, multipliers, 1, 2.0)
    shares = rowwise.shares(problem, multipliers.y)
    rowwise.improve(problem, shares, 1, 2.0)
    facets.lift(np.full(2, 0.6), np.array([1, -1], dtype=np.int32), np.arange(2, dtype=np.int32), np.zeros(1), 1.0)
    sweep.Sweep(problem, shares, np.zeros(3, dtype=np.bool_), 0.0, 1.0).turn(100_000, 2.0)


def _one_row() -> Problem:
    """A problem of three candidates, two of which exclude each other."""
    import numpy as np
    from scipy.sparse import csr_array

    from pscover.model import CoverForm
    from pscover.presolve.components import components

    from .problem import problem_of

    W, P = csr_array(np.array([[0.5, 0.6, 0.7]])), csr_array(np.array([[1.0, 1.0, 0.0]]))
    form = CoverForm(c=np.ones(3), W=W, P=P, allowed=np.ones(3, dtype=np.bool_))
    components(form)  # for what it imports
    return problem_of(form)[0]


def compile_in_turn(number: int) -> None:
    """All that a compiling process does: compile a part at low priority, unless another has while this one waited for it."""
    if hasattr(os, "nice"):
        os.nice(KINDNESS)
    part = _parts()[number]
    turn = _turn(part)
    if not part.is_on_disk:
        gc.set_threshold(OBJECTS)
        part.prepare()
    if turn is not None:
        os.close(turn)


def _turn(part: Part) -> int | None:
    """Wait until no other process compiles the part; a lock that ends with the process. None where the system has none."""
    try:
        import fcntl

        kernel = part.kernels[0]
        digest = hashlib.sha256(f"{sources()} {kernel._cache.cache_path} {kernel.__name__}".encode()).hexdigest()
        path = Path(tempfile.gettempdir()) / f"pscover-{os.getuid()}-{digest[:16]}.lock"
        lock = os.open(path, os.O_RDWR | os.O_CREAT | os.O_NOFOLLOW, 0o600)
        fcntl.flock(lock, fcntl.LOCK_EX)
    except (ImportError, AttributeError, OSError):
        return None
    return lock


def _compiling(number: int) -> subprocess.Popen[bytes]:
    none, line = subprocess.DEVNULL, [sys.executable, "-c", COMPILE, str(number), *sys.path]
    return subprocess.Popen(line, stdin=none, stdout=none, stderr=none)


class Warming:
    """Kernels on their way to be ready, in the background.

    Attributes
    ----------
    error
        What went wrong, if something did.
    """

    def __init__(self) -> None:
        self.error: BaseException | None = None
        self._done = threading.Event()
        self._loading = threading.Event()
        self._thread = threading.Thread(target=self._run, daemon=True)
        self._thread.start()
        atexit.register(self._settle)

    @property
    def is_done(self) -> bool:
        """Whether the kernels can be called without delay."""
        return self._done.is_set()

    def wait(self, seconds: float) -> bool:
        """Wait at most so long; whether the kernels are ready."""
        return self._done.wait(seconds)

    def _run(self) -> None:
        try:
            if not is_on_disk():
                # Compiling here would keep the caller's thread from running; what the processes compile is found on disk.
                compiling = [_compiling(number) for number in range(PARTS)]
                for process in compiling:
                    process.wait()
            self._loading.set()
            prepare()
        except BaseException as error:
            self.error = error
        finally:
            self._done.set()

    def _settle(self) -> None:
        """Let a load end before the interpreter does; a compiling process goes on by itself."""
        if self._loading.is_set():
            self._thread.join()


_warming: Warming | None = None
_lock = threading.Lock()


def warming() -> Warming:
    """The kernels of this process, started to get ready at the first call."""
    global _warming
    with _lock:
        if _warming is None:
            _warming = Warming()
        return _warming
