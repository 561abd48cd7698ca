"""The near side of an isolated engine: run it in a process of its own, which can be ended when the time is over.

Engines do not keep their time limits, and some cannot be interrupted at all; a process can. Worker processes are started
when first needed, kept idle for the next solve, and killed when an engine overruns. Any number of threads may solve at
once, each with a worker of its own. No signal handler is installed and no module of the caller is imported again.
"""

from __future__ import annotations

import atexit
import importlib
import itertools
import json
import os
import queue
import subprocess
import sys
import threading
import time
from collections.abc import Callable
from dataclasses import replace
from typing import Any

from pscover import registry
from pscover.backend import Backend, SlowToStart
from pscover.clock import Clock
from pscover.errors import EngineFailed
from pscover.instance import IntArray
from pscover.model import Model
from pscover.result import Answer, Progress, Settings, Status, Stop
from pscover.worker import READY, Failure, Halt, Job, Prepare, Reply, failure, receive, send

BOOT = "import sys, json; sys.path[:] = json.loads(sys.argv[1]); from pscover.worker import main; main()"
IDLE_LIMIT = 4
HALT_PATIENCE = 0.25
"""Seconds an engine that was asked to stop has before its process is ended."""

_numbers = itertools.count()


class Worker:
    """One worker process, kept for one engine, and the two threads that talk to it; `boot` is the program it runs."""

    def __init__(self, engine: Backend, boot: str | None = None) -> None:
        self.engine = engine
        self.path = _import_path()
        environment = dict(os.environ, OPENBLAS_NUM_THREADS="1", OMP_NUM_THREADS="1")
        try:
            self.process = subprocess.Popen(
                # -P: a json.py in the current folder must not be taken for Python's.
                [sys.executable, "-P", "-c", boot or BOOT, json.dumps(self.path)],
                stdin=subprocess.PIPE,
                stdout=subprocess.PIPE,
                stderr=subprocess.DEVNULL,
                bufsize=0,
                start_new_session=True,
                env=environment,
            )
        except OSError as error:
            raise EngineFailed(f"no process could be started for backend {engine.name!r}: {error}") from None
        self.is_ready = False
        self.inbox: queue.SimpleQueue[Reply | None] = queue.SimpleQueue()
        self.outbox: queue.SimpleQueue[Any] = queue.SimpleQueue()
        assert self.process.stdin is not None
        assert self.process.stdout is not None
        self._pipes = (self.process.stdin, self.process.stdout)
        self._threads = [
            threading.Thread(target=self._speak, args=(self.process.stdin.fileno(),), daemon=True),
            threading.Thread(target=self._listen, args=(self.process.stdout.fileno(),), daemon=True),
        ]
        for thread in self._threads:
            thread.start()
        self.outbox.put(Prepare(engine.requires))

    def _speak(self, fd: int) -> None:
        while (message := self.outbox.get()) is not None:
            try:
                send(fd, message)
            except OSError:
                return
            except Exception as error:
                self.inbox.put(Reply(READY, failure(error)))

    def _listen(self, fd: int) -> None:
        while True:
            try:
                self.inbox.put(receive(fd))
            except (EOFError, OSError):
                self.inbox.put(None)
                return
            except Exception as error:
                self.inbox.put(Reply(READY, failure(error)))

    def end(self) -> None:
        """Kill the process and let the threads run out."""
        self.process.kill()
        self.process.wait()
        self.outbox.put(None)
        for thread, pipe in zip(self._threads, self._pipes, strict=True):
            thread.join(timeout=1.0)
            # Closed under a thread that still pickles a large model, the number could soon be that of another file.
            if not thread.is_alive():
                pipe.close()

    def disown(self) -> None:
        """Let go of a process that is another's child, after a fork."""
        self.process.returncode = 0
        for pipe in self._pipes:
            pipe.close()


def _import_path() -> list[str]:
    """Where modules are looked for; what is no text Python itself passes over."""
    return [place for place in sys.path if isinstance(place, str)]


_idle: list[Worker] = []
_lock = threading.Lock()


def _hire(engine: Backend) -> Worker:
    """An idle worker of this engine, or a new one: some engines cannot be loaded into one process."""
    path = _import_path()
    with _lock:
        stale = [worker for worker in _idle if worker.process.poll() is not None or worker.path != path]
        _idle[:] = [worker for worker in _idle if worker not in stale]
        fit = next((worker for worker in _idle if worker.engine.name == engine.name), None)
        if fit is not None:
            _idle.remove(fit)
    for worker in stale:
        worker.end()
    return fit or Worker(engine)


def _release(worker: Worker) -> None:
    with _lock:
        _idle.append(worker)
        surplus = _idle.pop(0) if len(_idle) > IDLE_LIMIT else None
    if surplus is not None:
        surplus.end()


@atexit.register
def shut_down() -> None:
    """End all idle workers; runs by itself when the interpreter exits."""
    with _lock:
        workers, _idle[:] = list(_idle), []
    for worker in workers:
        worker.end()


def _forget() -> None:
    """After a fork, in the child: the idle workers are the parent's, and no thread is left to release the lock."""
    global _lock
    _lock = threading.Lock()
    workers, _idle[:] = list(_idle), []
    for worker in workers:
        worker.disown()


if hasattr(os, "register_at_fork"):
    os.register_at_fork(after_in_child=_forget)


def warm_up(backend: str | Backend | None = None) -> None:
    """Get an engine ready now, so that the first solve under a short deadline need not wait for it.

    The engine starts in the background: a process of its own is up after about 0.4 s, and some engines take seconds to
    import; kernels are loaded in about a second, and compiled when they are needed for the first time on a machine.

    Parameters
    ----------
    backend
        The engine, by name or made by hand. By default the one that `pscover.plan` takes, and what else that needs is
        imported before this returns.

    Raises
    ------
    UnknownName, MissingDependency
        As for `solve`.
    """
    if backend is None:
        for module in ("pscover.planning", "pscover.inputs"):
            importlib.import_module(module)
        registry.formulation("clique")
        backend = registry.planning_backend()
        if backend == "auto":
            importlib.import_module("pscover.engine.block")
    engine = registry.backend(backend) if isinstance(backend, str) else backend
    if isinstance(engine, SlowToStart):
        engine.warm_up()
    if engine.isolated:
        _release(_hire(engine))


def run(backend: Backend, model: Model, settings: Settings, observe: Callable[[Progress], bool], clock: Clock) -> Answer:
    """`backend.solve` in a worker process, ended at the deadline of `clock`.

    Returns
    -------
    Answer
        The engine's, or if it had to be ended, the best plan and bound that it had reported by then.

    Raises
    ------
    EngineFailed
        If the engine raised or its process died, and it had reported no plan.
    """
    worker = _hire(backend)
    number = next(_numbers)
    deadline = time.monotonic() + min(max(0.9 * clock.left, clock.left - 0.1), 1e9)
    last = Progress(seconds=0.0, objective=float("inf"), bound=float("-inf"))
    best: IntArray | None = None
    ended_by = Stop.FINISHED
    patience = clock.left + 0.02
    end = time.monotonic() + min(patience, 1e9)
    try:
        worker.outbox.put(Job(number, backend, model, settings, deadline))
        while True:
            try:
                reply = worker.inbox.get(timeout=max(0.0, end - time.monotonic()))
            except queue.Empty:
                ended_by = Stop.TIME if ended_by is Stop.FINISHED else ended_by
                break
            if reply is None:
                return _after_death(worker, best, last, backend)
            worker.is_ready = True
            content = reply.content
            if content is None or reply.number not in (number, READY):
                continue
            if isinstance(content, Answer):
                _release(worker)
                return content if ended_by is Stop.FINISHED else replace(content, stop=ended_by)
            if isinstance(content, Failure):
                return _after_failure(worker, content, best, last, backend)
            last = content
            best = content.chosen if content.chosen is not None else best
            # After the end only what has arrived is taken note of: a slow observer must not hold up the plan.
            if ended_by is Stop.FINISHED and time.monotonic() < end and observe(content):
                ended_by = Stop.OBSERVER
                worker.outbox.put(Halt(number))
                end = min(end, time.monotonic() + HALT_PATIENCE)
    except KeyboardInterrupt:
        ended_by = Stop.INTERRUPT
    except BaseException:
        worker.end()
        raise
    if worker.is_ready:
        worker.end()
        _replace(worker.engine)
    else:
        # Still starting: it will find its job overdue and be of use for the next solve.
        _release(worker)
    return _partial(best, last, ended_by, "")


def _replace(engine: Backend) -> None:
    with _lock:
        is_needed = all(worker.engine.name != engine.name for worker in _idle)
    if is_needed:
        _release(Worker(engine))


def _partial(best: IntArray | None, last: Progress, stop: Stop, message: str) -> Answer:
    status = Status.UNKNOWN if best is None else Status.FEASIBLE
    return Answer(status=status, chosen=best, bound=last.bound, stop=stop, message=message)


def _after_death(worker: Worker, best: IntArray | None, last: Progress, backend: Backend) -> Answer:
    code = worker.process.wait()
    worker.end()
    return _salvage(f"the process of backend {backend.name!r} died (exit code {code})", best, last)


def _after_failure(worker: Worker, failed: Failure, best: IntArray | None, last: Progress, backend: Backend) -> Answer:
    if failed.error is not None:
        _release(worker)
        raise failed.error
    worker.end()
    what = f"backend {backend.name!r} failed: {failed.line}"
    if "__main__" in failed.line:
        what += "; an isolated backend must be importable: define it in a module of its own, or set isolated = False"
    return _salvage(what, best, last)


def _salvage(what: str, best: IntArray | None, last: Progress) -> Answer:
    if best is None:
        raise EngineFailed(what)
    return _partial(best, last, Stop.FINISHED, what)
