"""Any engine under a limit of CPU seconds: what it had told by then counts, and its process is ended.

Wall time says little on a machine that others use too, and engines do not keep their limits. Here an engine runs in a worker
process of its own, whose CPU time Linux lets anybody read. All engines but those that plan by the clock are told no limit.
"""

from __future__ import annotations

import atexit
import itertools
import math
import queue
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
from scipy.sparse import csr_array

from pscover.backend import Backend
from pscover.errors import EngineFailed, PscoverError
from pscover.evidence.cpu_clock import CpuClock
from pscover.evidence.study.clocked import PLANNERS, boot
from pscover.isolate import Worker
from pscover.model import Model
from pscover.result import Answer, Observer, Progress, Settings, Status, Stop, ignore
from pscover.worker import READY, Failure, Job

GLANCE = 0.02
"""Wall seconds between two looks at the clock of an engine."""
PATIENCE = 0.1
"""CPU seconds beyond the limit after which the process is ended."""
STARTING = 600.0
"""Wall seconds that a worker may take to start, to import its engine and to solve a problem of one candidate."""

_numbers = itertools.count()
_idle: dict[str, list[tuple[Worker, CpuClock]]] = {}


@dataclass(slots=True, kw_only=True)
class Metered:
    """A backend that is another one on a clock of CPU seconds; it lasts for one solve, however often that calls it.

    Parameters
    ----------
    engine
        Who does the work.
    limit
        CPU seconds of its process and of those that it starts, for all calls together.
    spent
        Those used so far; of a call whose process was ended, at most the limit.
    nodes
        Of all calls so far, as the engine counts them; None if it did not say in one of them.
    """

    engine: Backend
    limit: float
    spent: float = 0.0
    nodes: int | None = field(default=0)

    @property
    def name(self) -> str:
        """Of the engine."""
        return self.engine.name

    @property
    def exact(self) -> bool:
        """As the engine."""
        return self.engine.exact

    isolated = False
    """The worker is started here."""

    @property
    def requires(self) -> tuple[str, ...]:
        """As the engine."""
        return self.engine.requires

    @property
    def extra(self) -> str:
        """As the engine."""
        return self.engine.extra

    def refuses(self, model: Model) -> str | None:
        """As the engine."""
        return self.engine.refuses(model)

    def solve(self, model: Model, settings: Settings, observe: Observer) -> Answer:
        """Solve until the engine is done or its CPU seconds are spent."""
        left = self.limit - self.spent
        if left <= 0:
            self.nodes = None
            return Answer(status=Status.UNKNOWN, chosen=None, bound=-math.inf, stop=Stop.TIME)
        worker, clock = _hire(self.engine)
        settings = replace(settings, time=left if self.engine.name in PLANNERS else math.inf)
        began = clock()
        last = Progress(seconds=0.0, objective=math.inf, bound=-math.inf)

        def note(progress: Progress) -> bool:
            nonlocal last
            last = progress if progress.chosen is not None else replace(progress, chosen=last.chosen)
            return observe(progress)

        try:
            answer = _run(worker, clock, Job(next(_numbers), self.engine, model, settings, math.inf), left, note)
        except BaseException:
            worker.end()
            raise
        self.spent += min(left, clock() - began)
        self.nodes = None if self.nodes is None or answer is None or answer.nodes is None else self.nodes + answer.nodes
        if answer is None:
            worker.end()
            status = Status.UNKNOWN if last.chosen is None else Status.FEASIBLE
            return Answer(status=status, chosen=last.chosen, bound=last.bound, stop=Stop.TIME)
        _idle.setdefault(self.engine.name, []).append((worker, clock))
        return answer


def _run(worker: Worker, clock: CpuClock, job: Job, limit: float, observe: Observer) -> Answer | None:
    """The engine's answer; None once its CPU seconds are spent."""
    began = clock()
    # An engine that keeps to its time is given a moment to say what it has.
    patience = PATIENCE if job.settings.time < math.inf else 0.0
    worker.outbox.put(job)
    while True:
        content = _heard(worker, job)
        if isinstance(content, Answer):
            return content
        if isinstance(content, Progress):
            observe(content)
        elif clock() - began > limit + patience:
            return None


def _heard(worker: Worker, job: Job) -> Progress | Answer | None:
    """What the worker says next of the job; None if it is silent for a moment."""
    try:
        reply = worker.inbox.get(timeout=GLANCE)
    except queue.Empty:
        return None
    if reply is None:
        raise EngineFailed(f"the process of backend {worker.engine.name!r} died (exit code {worker.process.wait()})")
    content: Any = reply.content
    if isinstance(content, Failure):
        raise content.error or EngineFailed(f"backend {worker.engine.name!r} failed: {content.line}")
    return content if reply.number == job.number else None


def _hire(engine: Backend) -> tuple[Worker, CpuClock]:
    """A worker that has solved something with this engine before, so that no import is on anybody's clock."""
    waiting = _idle.setdefault(engine.name, [])
    while waiting:
        worker, clock = waiting.pop()
        if worker.process.poll() is None:
            return worker, clock
        worker.end()
    worker = Worker(engine, boot(engine.name))
    first = worker.inbox.get(timeout=STARTING)
    if first is None or first.number != READY:
        worker.end()
        raise EngineFailed(f"no process could be started for backend {engine.name!r}")
    clock = CpuClock(worker.process.pid)
    first_job = Job(next(_numbers), engine, _smallest(), Settings(time=STARTING), math.inf)
    _run(worker, clock, first_job, STARTING, ignore)
    if clock() == 0:
        worker.end()
        raise PscoverError("a limit of CPU seconds: expected a system that tells those of other processes, as Linux does")
    return worker, clock


@atexit.register
def shut_down() -> None:
    """End all idle workers; runs by itself when the interpreter exits."""
    for waiting in _idle.values():
        while waiting:
            worker, _ = waiting.pop()
            worker.end()


def _smallest() -> Model:
    """One candidate, one element."""
    one = np.ones(1)
    row = csr_array(np.ones((1, 1)))
    return Model(c=one, A=row, lo=one, hi=one, ub=one, integer=np.ones(1, dtype=np.bool_), candidates=1)
