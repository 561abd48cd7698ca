"""Many trials, on any `concurrent.futures.Executor`: processes of this machine, or the workers of a cluster."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import replace

from pscover.evidence.executors import Executors, run_each
from pscover.experiment.store import Store
from pscover.experiment.trial import Outcome, Timing, Trial, run

Done = Callable[[Outcome], None]


def trials(base: Trial, policies: Sequence[str], seeds: Iterable[int]) -> list[Trial]:
    """Every policy on every scene, scene by scene, so that a run that is cut off has compared some scenes fully.

    Examples
    --------
    >>> [(trial.policy, trial.seed) for trial in trials(Trial(policy=""), ("random", "segment"), (4, 5))]
    [('random', 4), ('segment', 4), ('random', 5), ('segment', 5)]
    """
    return [replace(base, policy=policy, seed=seed) for seed in seeds for policy in policies]


def run_all(listed: Sequence[Trial], store: Store, executors: Executors, done: Done) -> None:
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

    def keep(trial: Trial, ended: tuple[Outcome, Timing]) -> None:
        store.save(*ended)
        done(ended[0])

    run_each(left, run, executors, keep, lambda trial: f"{trial.policy} on scene {trial.seed}")
