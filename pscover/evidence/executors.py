"""Where many independent computations run: processes of this machine, or the workers of a Dask cluster."""

from __future__ import annotations

import multiprocessing
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import Executor, Future, ProcessPoolExecutor, as_completed
from concurrent.futures.process import BrokenProcessPool
from contextlib import AbstractContextManager, ExitStack, contextmanager, nullcontext, suppress
from typing import TypeVar

from pscover.errors import EngineFailed, InvalidSettings, MissingDependency

C = TypeVar("C")
V = TypeVar("V")
Executors = Callable[[], AbstractContextManager[Executor]]
ANSWER = 10.0
"""Seconds that a scheduler has to answer."""
ATTEMPTS = 3
"""How often a case is begun when its worker dies."""
NAMED = 3
"""So many of the cases over which workers died are named."""


@contextmanager
def processes(jobs: int) -> Iterator[Executor]:
    """Processes of this machine.

    Raises
    ------
    InvalidSettings
        For fewer than one.
    """
    if jobs < 1:
        raise InvalidSettings(f"jobs: expected at least 1, got {jobs}")
    # Spawned: a fork copies the locks of whatever threads the caller has.
    pool = ProcessPoolExecutor(max_workers=jobs, mp_context=multiprocessing.get_context("spawn"))
    try:
        yield pool
    finally:
        pool.shutdown(wait=True, cancel_futures=True)


@contextmanager
def cluster(address: str) -> Iterator[Executor]:
    """The workers of a Dask scheduler; each must have pscover installed.

    Raises
    ------
    MissingDependency
        Without `distributed`.
    InvalidSettings
        If no scheduler answers at the address.
    """
    try:
        from distributed import Client
    except ImportError:
        raise MissingDependency.for_extra("a scheduler", ["distributed"], "cluster") from None
    try:
        client = Client(address, timeout=ANSWER)
    except (OSError, ValueError) as problem:
        raise InvalidSettings(f"scheduler: expected one at {address!r}, got no answer ({problem})") from None
    try:
        yield client.get_executor(pure=False, retries=ATTEMPTS)
    finally:
        with suppress(Exception):
            client.close()


@contextmanager
def lasting(executors: Executors) -> Iterator[Executors]:
    """Makes one executor and gives it again and again, for starting workers takes long; a new one once its workers died.

    Examples
    --------
    >>> from concurrent.futures import ThreadPoolExecutor
    >>> with lasting(lambda: ThreadPoolExecutor(1)) as again:
    ...     with again() as first:
    ...         pass
    ...     with again() as second:
    ...         print(second is first, second.submit(int).result())
    True 0
    """
    with ExitStack() as stack:
        held: list[Executor] = []

        def current() -> AbstractContextManager[Executor]:
            if held:
                try:
                    held[-1].submit(int).result()
                except Exception as problem:
                    if not is_death(problem):
                        raise
                    held.clear()
            if not held:
                held.append(stack.enter_context(executors()))
            return nullcontext(held[-1])

        yield current


def run_each(
    cases: Sequence[C],
    run: Callable[[C], V],
    executors: Executors,
    keep: Callable[[C, V], None],
    named: Callable[[C], str] = str,
) -> None:
    """Run a function on every case, and hand over each value as soon as it is there; cases whose worker died run again.

    Parameters
    ----------
    cases, run
        What is computed; both must be picklable for processes and clusters.
    executors
        Makes an executor; called again if its workers died.
    keep
        Called in the caller's thread with the case and its value, in the order in which they end.
    named
        What a case is called in errors.

    Raises
    ------
    EngineFailed
        If workers died again and again over the same cases; everything else has been kept.
    Exception
        What a case raised, after all others have been run and kept.

    Examples
    --------
    >>> from concurrent.futures import ThreadPoolExecutor
    >>> found = {}
    >>> run_each([1, 2, 3], str, lambda: ThreadPoolExecutor(2), found.__setitem__)
    >>> sorted(found.items())
    [(1, '1'), (2, '2'), (3, '3')]
    """
    left, problems = list(cases), list[BaseException]()
    for _ in range(ATTEMPTS):
        if not left:
            break
        left = _attempt(left, run, executors, keep, problems)
    if problems:
        raise problems[0]
    if left:
        names = ", ".join(named(case) for case in left[:NAMED])
        raise EngineFailed(f"workers died {ATTEMPTS} times over {len(left)} cases ({names}, ...); is there enough memory?")


def _attempt(
    cases: Sequence[C],
    run: Callable[[C], V],
    executors: Executors,
    keep: Callable[[C, V], None],
    problems: list[BaseException],
) -> list[C]:
    """Run cases, and return those whose workers died."""
    lost: list[C] = []
    with executors() as executor:
        futures: dict[Future[V], C] = {}
        for case in cases:
            try:
                futures[executor.submit(run, case)] = case
            except BrokenProcessPool:
                # The first worker died before the last case was handed over.
                lost.append(case)
        try:
            for future in as_completed(futures):
                try:
                    value = future.result()
                except Exception as problem:
                    if is_death(problem):
                        lost.append(futures[future])
                    else:
                        problems.append(problem)
                    continue
                keep(futures[future], value)
        except BaseException:
            for future in futures:
                future.cancel()
            raise
    return lost


def is_death(problem: BaseException) -> bool:
    """Whether a worker died, rather than a case failed; Dask's exceptions are known by name, for Dask is optional."""
    return isinstance(problem, BrokenProcessPool) or type(problem).__name__ in ("KilledWorker", "CommClosedError")
