"""Many trials, on any `concurrent.futures.Executor`: processes of this machine, or the workers of a cluster."""

from __future__ import annotations

import multiprocessing
from collections.abc import Callable, Iterable, Iterator, Sequence
from concurrent.futures import Executor, Future, ProcessPoolExecutor, as_completed
from concurrent.futures.process import BrokenProcessPool
from contextlib import AbstractContextManager, contextmanager, suppress
from dataclasses import replace

from pscover.errors import EngineFailed, InvalidSettings, MissingDependency
from pscover.experiment.store import Store
from pscover.experiment.trial import Outcome, Timing, Trial, run

Done = Callable[[Outcome], None]
ANSWER = 10.0
"""Seconds that a scheduler has to answer."""
ATTEMPTS = 3
"""How often a trial is begun when its worker dies."""


def trials(base: Trial, policies: Sequence[str], seeds: Iterable[int]) -> list[Trial]:
    """Every policy on every scene, scene by scene, so that a run that is cut off has compared some scenes fully.

    Examples
    --------
    >>> [(trial.policy, trial.seed) for trial in trials(Trial(policy=""), ("random", "segment"), (4, 5))]
    [('random', 4), ('segment', 4), ('random', 5), ('segment', 5)]
    """
    return [replace(base, policy=policy, seed=seed) for seed in seeds for policy in policies]


def run_all(
    listed: Sequence[Trial], store: Store, executors: Callable[[], AbstractContextManager[Executor]], done: Done
) -> None:
    """Run the trials that the store does not hold yet, and keep each as soon as it ends.

    Parameters
    ----------
    listed
        The trials.
    store
        Where outcomes are kept.
    executors
        Makes an executor; called again if its workers died.
    done
        Called after each trial has been kept, those of before first.

    Raises
    ------
    EngineFailed
        If workers died again and again over the same trials; everything else has been kept.
    Exception
        What a trial raised, after all others have been run and kept.
    """
    left: list[Trial] = []
    for trial in listed:
        outcome = store.outcome(trial.policy, trial.seed)
        if outcome is None:
            left.append(trial)
        else:
            done(outcome)
    problems: list[BaseException] = []
    for _ in range(ATTEMPTS):
        if not left:
            break
        left = _attempt(left, store, executors, done, problems)
    if problems:
        raise problems[0]
    if left:
        names = ", ".join(f"{trial.policy} on scene {trial.seed}" for trial in left[:3])
        raise EngineFailed(f"workers died {ATTEMPTS} times over {len(left)} trials ({names}, ...); is there enough memory?")


def _attempt(
    left: Sequence[Trial],
    store: Store,
    executors: Callable[[], AbstractContextManager[Executor]],
    done: Done,
    problems: list[BaseException],
) -> list[Trial]:
    """Run trials, and return those whose workers died."""
    lost: list[Trial] = []
    with executors() as executor:
        futures: dict[Future[tuple[Outcome, Timing]], Trial] = {}
        for trial in left:
            try:
                futures[executor.submit(run, trial)] = trial
            except BrokenProcessPool:
                # The first worker died before the last trial was handed over.
                lost.append(trial)
        try:
            for future in as_completed(futures):
                try:
                    outcome, timing = future.result()
                except Exception as problem:
                    if _is_death(problem):
                        lost.append(futures[future])
                    else:
                        problems.append(problem)
                    continue
                store.save(outcome, timing)
                done(outcome)
        except BaseException:
            for future in futures:
                future.cancel()
            raise
    return lost


def _is_death(problem: BaseException) -> bool:
    """Whether a worker died, rather than a trial failed; Dask's exception is known by its name, for Dask is optional."""
    return isinstance(problem, BrokenProcessPool) or type(problem).__name__ in ("KilledWorker", "CommClosedError")


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
