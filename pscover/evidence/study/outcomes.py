"""Monte Carlo of what a plan brings about: where candidates succeed independently of each other, and where they do not.

In every world but `Overrated` each single candidate succeeds on each single element with its probability p_ij exactly; the
worlds differ in what happens together.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

import numpy as np
from numpy.typing import NDArray
from scipy.special import ndtr

from pscover.evidence.study.wilson import share_interval
from pscover.instance import FloatArray, Instance

BATCH = 1_000_000
"""Successes drawn at a time."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Entries:
    """The stored probabilities of a plan.

    Parameters
    ----------
    element, grasp
        Whose success each is: the element, and the place of the candidate in the plan.
    probability
        p_ij.
    required
        q_j of the element.
    """

    element: NDArray[np.int64]
    grasp: NDArray[np.int64]
    probability: FloatArray
    required: FloatArray

    @classmethod
    def of(cls, instance: Instance, chosen: tuple[int, ...]) -> Entries:
        """Of the chosen candidates."""
        part = instance.probability[:, list(chosen)].tocoo()
        element = part.row.astype(np.int64)
        return cls(
            element=element,
            grasp=part.col.astype(np.int64),
            probability=np.asarray(part.data, dtype=np.float64),
            required=instance.required[element],
        )


class World(Protocol):
    """How successes come about."""

    @property
    def name(self) -> str:
        """In tables."""
        ...

    def draw(self, entries: Entries, trials: int, random: np.random.Generator) -> NDArray[np.bool_]:
        """Successes, shape (trials, entries)."""
        ...


@dataclass(frozen=True, slots=True)
class Independent:
    """Every success is drawn for itself, as the paper assumes."""

    name: str = "independent"

    def draw(self, entries: Entries, trials: int, random: np.random.Generator) -> NDArray[np.bool_]:
        """Successes, shape (trials, entries)."""
        drawn: NDArray[np.bool_] = random.random((trials, len(entries.probability))) < entries.probability
        return drawn


@dataclass(frozen=True, slots=True)
class WholeGrasps:
    """One draw decides for all elements of a grasp: what succeeds on one succeeds on every likelier one."""

    name: str = "whole grasps"

    def draw(self, entries: Entries, trials: int, random: np.random.Generator) -> NDArray[np.bool_]:
        """Successes, shape (trials, entries)."""
        grasps = int(entries.grasp.max(initial=-1)) + 1
        drawn: NDArray[np.bool_] = random.random((trials, grasps))[:, entries.grasp] < entries.probability
        return drawn


@dataclass(frozen=True, slots=True)
class CommonCause:
    """A Gaussian copula with one factor for the whole trial, such as a camera out of calibration.

    Parameters
    ----------
    correlation
        In [0, 1], of the normal numbers behind the successes.
    """

    correlation: float = 0.5

    @property
    def name(self) -> str:
        """In tables."""
        return f"common cause {self.correlation:g}"

    def draw(self, entries: Entries, trials: int, random: np.random.Generator) -> NDArray[np.bool_]:
        """Successes, shape (trials, entries)."""
        factor = np.sqrt(self.correlation) * random.standard_normal((trials, 1))
        own = np.sqrt(1.0 - self.correlation) * random.standard_normal((trials, len(entries.probability)))
        drawn: NDArray[np.bool_] = ndtr(factor + own) < entries.probability
        return drawn


@dataclass(frozen=True, slots=True)
class Overrated:
    """Independent, but for each element the one grasp whose loss hurts most is worse than predicted.

    Parameters
    ----------
    deviation
        By how much its probability is lower.
    """

    deviation: float = 0.1

    @property
    def name(self) -> str:
        """In tables."""
        return f"one overrated by {self.deviation:g}"

    def draw(self, entries: Entries, trials: int, random: np.random.Generator) -> NDArray[np.bool_]:
        """Successes, shape (trials, entries)."""
        p = entries.probability
        worse = np.maximum(p - self.deviation, 0.0)
        with np.errstate(divide="ignore"):
            ratio = (1.0 - worse) / (1.0 - p)
        # Sorted by element and then by how much it hurts, the last of each element deviates.
        order = np.lexsort((ratio, entries.element))
        last = order[np.diff(entries.element[order], append=-1) != 0]
        real = p.copy()
        real[last] = worse[last]
        drawn: NDArray[np.bool_] = random.random((trials, len(p))) < real
        return drawn


WORLDS: tuple[World, ...] = (Independent(), WholeGrasps(), CommonCause(0.2), CommonCause(0.5), Overrated())


@dataclass(frozen=True, slots=True, kw_only=True)
class Outcome:
    """What many trials of a plan in one world brought.

    Parameters
    ----------
    world
        Its name.
    trials
        How many.
    covered
        Mean share of the elements with q_j > 0 that were covered.
    broken
        Share of those elements whose frequency lies below q_j beyond chance: so does the upper end of its 99.9 % Wilson
        interval.
    worst
        The largest q_j minus frequency; negative if all were covered more often than required.
    together
        Trials in which all of them were covered.
    """

    world: str
    trials: int
    covered: float
    broken: float
    worst: float
    together: int


STRICT = 0.999
"""Level of the interval of a single element: there are many elements."""


def simulate(instance: Instance, chosen: tuple[int, ...], world: World, trials: int, seed: int | list[int]) -> Outcome:
    """Try a plan many times.

    Examples
    --------
    >>> instance = Instance.of([[0.5, 0.5]], required=0.7)
    >>> found = [simulate(instance, (0, 1), world, 10_000, seed=0).together / 10_000 for world in WORLDS[:2]]
    >>> [round(share, 2) for share in found]
    [0.75, 0.75]
    """
    entries = Entries.of(instance, chosen)
    needed = instance.required > 0
    random = np.random.default_rng(seed)
    hits = np.zeros(instance.elements, dtype=np.int64)
    together, done = 0, 0
    while done < trials:
        batch = min(trials - done, max(1, BATCH // max(1, len(entries.probability))))
        covered = _covered(entries, world.draw(entries, batch, random), instance.elements)
        hits += covered.sum(axis=0)
        together += int(covered[:, needed].all(axis=1).sum())
        done += batch
    share = hits[needed] / trials
    required = instance.required[needed]
    high = np.array([share_interval(int(count), trials, STRICT).high for count in hits[needed]])
    return Outcome(
        world=world.name,
        trials=trials,
        covered=float(share.mean()) if len(share) else 1.0,
        broken=float((high < required).mean()) if len(share) else 0.0,
        worst=float((required - share).max(initial=-1.0)),
        together=together,
    )


def _covered(entries: Entries, success: NDArray[np.bool_], elements: int) -> NDArray[np.bool_]:
    """Which element is covered in which trial, shape (trials, elements)."""
    covered = np.zeros((len(success), elements), dtype=np.bool_)
    order = np.argsort(entries.element, kind="stable")
    some, starts = np.unique(entries.element[order], return_index=True)
    if len(some):
        covered[:, some] = np.logical_or.reduceat(success[:, order], starts, axis=1)
    return covered
