"""The far side of an isolated engine: a process that solves models for its parent until its input ends.

Messages are pickles behind an 8-byte length. The parent sends `Prepare`, `Job` and `Halt`; the worker says `READY` once
that is done and answers a job with any number of `Progress` and one `Answer` or `Failure`, each as a `Reply` with the job's
number. Engines may print what they like: their standard output goes nowhere.
"""

from __future__ import annotations

import contextlib
import importlib
import math
import os
import pickle
import queue
import struct
import threading
import time
import traceback
from dataclasses import dataclass, replace
from typing import Any

from pscover.backend import Backend
from pscover.errors import PscoverError
from pscover.model import Model
from pscover.result import Answer, Progress, Settings, Status, Stop

LENGTH = struct.Struct("<Q")
READY = -1
"""The job number of what a worker says of itself: first, that it is up and has imported what it was told to."""


@dataclass(frozen=True, slots=True)
class Job:
    """A model to solve; `deadline` is on the monotonic clock, which all processes of a machine share."""

    number: int
    backend: Backend
    model: Model
    settings: Settings
    deadline: float


@dataclass(frozen=True, slots=True)
class Prepare:
    """Import these modules before the first job; some take seconds."""

    modules: tuple[str, ...]


@dataclass(frozen=True, slots=True)
class Halt:
    """Ask the engine of job `number` to stop with the best plan it has."""

    number: int


@dataclass(frozen=True, slots=True)
class Failure:
    """The engine raised: `error` if it is one of pscover's, and the last line of its traceback."""

    error: PscoverError | None
    line: str


@dataclass(frozen=True, slots=True)
class Reply:
    """What a worker says of job `number`."""

    number: int
    content: Progress | Answer | Failure | None


def send(fd: int, message: Any) -> None:
    """Write one message to a file descriptor."""
    body = pickle.dumps(message, protocol=pickle.HIGHEST_PROTOCOL)
    rest = memoryview(LENGTH.pack(len(body)) + body)
    while rest:
        rest = rest[os.write(fd, rest) :]


def receive(fd: int) -> Any:
    """Read one message from a file descriptor; `EOFError` when the other side is gone."""
    (length,) = LENGTH.unpack(_read(fd, LENGTH.size))
    return pickle.loads(_read(fd, length))  # noqa: S301 - the other end of the pipe is our own process


def _read(fd: int, count: int) -> bytes:
    parts = []
    while count:
        part = os.read(fd, min(count, 1 << 20))
        if not part:
            raise EOFError
        parts.append(part)
        count -= len(part)
    return b"".join(parts)


def main() -> None:
    """Serve jobs from standard input until it ends."""
    outlet = os.dup(1)
    nowhere = os.open(os.devnull, os.O_WRONLY)
    os.dup2(nowhere, 1)
    jobs: queue.Queue[Job | Prepare] = queue.Queue()
    halted: set[int] = set()

    def listen() -> None:
        while True:
            try:
                message = receive(0)
            except EOFError:
                os._exit(0)
            except Exception as error:
                send(outlet, Reply(READY, failure(error)))
                continue
            if isinstance(message, Halt):
                halted.add(message.number)
            else:
                jobs.put(message)

    threading.Thread(target=listen, daemon=True).start()
    while True:
        job = jobs.get()
        if isinstance(job, Prepare):
            _prepare(job)
            send(outlet, Reply(READY, None))
            continue
        send(outlet, Reply(job.number, _serve(job, outlet, halted)))


def _prepare(wish: Prepare) -> None:
    for module in wish.modules:
        # A module that cannot be imported is the business of the job that needs it.
        with contextlib.suppress(Exception):
            importlib.import_module(module)


def _serve(job: Job, outlet: int, halted: set[int]) -> Answer | Failure:
    def observe(progress: Progress) -> bool:
        send(outlet, Reply(job.number, progress))
        return job.number in halted

    left = job.deadline - time.monotonic()
    if left <= 0:
        return Answer(status=Status.UNKNOWN, chosen=None, bound=-math.inf, stop=Stop.TIME)
    try:
        settings = replace(job.settings, time=min(job.settings.time, left))
        return job.backend.solve(job.model, settings, observe)
    except Exception as error:
        return failure(error)


def failure(error: Exception) -> Failure:
    """An exception as a message."""
    known = error if isinstance(error, PscoverError) else None
    return Failure(error=known, line=traceback.format_exception_only(error)[-1].strip())
