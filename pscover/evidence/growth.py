"""How times grow with the garments: painted scenes are segmented for real, and every engine solves what was seen.

A case is a scene; its row says what was seen in it, its timing what every stage took. Garments lie apart, or a number of
groups in which any two overlap (the paper's third experiment). The table is the paper's up to 35 garments and grows with
them from there on.
"""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import cache
from typing import Any

import numpy as np

from pscover.evidence.executors import Executors, lasting
from pscover.evidence.sweep import Done, Store, Sweep, run_sweep
from pscover.evidence.timed import Engine, Run, timed
from pscover.generate.garments import garments
from pscover.generate.paint import paint
from pscover.grasping.candidates import candidates
from pscover.infeasibility import unreachable
from pscover.instance import Instance
from pscover.scene import Scene

TABLE = (282, 470)
"""Pixels of the paper's workspace."""
FULL = 35
"""The most garments of the paper, which fill it."""
SPARE = 1.15
"""A larger table has so much more room a garment, for random places leave gaps."""
MEMBERS = 3
"""Garments of a group."""
ENGINES = ("scipy/pairwise", "highs/clique", "auto/clique")
"""The paper's set-up, the default, and the engine of our own."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Case:
    """A scene, who looks at it, and who plans for it.

    Parameters
    ----------
    garments, groups
        How many.
    seed
        Of the scene, of its paint and of the draw of candidates.
    segmenter
        Its name.
    engines
        BACKEND/FORMULATION each.
    """

    garments: int
    groups: int = 0
    seed: int
    segmenter: str = "classical"
    engines: tuple[str, ...] = ENGINES


@dataclass(frozen=True, slots=True, kw_only=True)
class Seen:
    """What follows from a case on any machine.

    Parameters
    ----------
    segments
        Garments found in the photo.
    out_of_reach
        Those that no plan can remove as surely as required; they are left out of the requirements, for the engines would
        be done at once.
    candidates, entries, cliques
        Of the instance.
    digest
        Of its content.
    """

    segments: int
    out_of_reach: int
    candidates: int
    entries: int
    cliques: int
    digest: str


@dataclass(frozen=True, slots=True, kw_only=True)
class Took:
    """What follows from the machine, too: CPU seconds.

    Parameters
    ----------
    segmentation
        From photo to scene.
    candidates
        From scene to instance.
    runs
        Of the engines.
    """

    segmentation: float
    candidates: float
    runs: tuple[Run, ...]


@dataclass(frozen=True, slots=True, kw_only=True)
class Growth:
    """Measures a case.

    Parameters
    ----------
    limit
        CPU seconds for each engine.
    """

    limit: float

    def __call__(self, case: Case) -> Done[Seen, Took]:
        """Paint, look, draw candidates, solve in every way."""
        from pscover.perception.perceive import Settings, perceive

        photo = paint(scene(case), case.seed)
        _warmed(case.segmenter)
        # A finer grid than the paper's says nothing; a coarser one would merge the garments of a large table.
        settings = Settings(pixel_limit=max(Settings().pixel_limit, photo.shape[0] * photo.shape[1]))
        began = time.process_time()
        seen = perceive(photo, segmenter=case.segmenter, settings=settings)
        looked = time.process_time()
        drawn = candidates(seen.scene, seed=case.seed)
        done = time.process_time()
        instance, left_out = within_reach(drawn)
        return Done(
            row=Seen(
                segments=seen.scene.garments,
                out_of_reach=left_out,
                candidates=instance.candidates,
                entries=int(instance.probability.nnz),
                cliques=len(instance.conflicts),
                digest=instance.digest,
            ),
            timing=Took(
                segmentation=looked - began,
                candidates=done - looked,
                runs=tuple(timed(instance, Engine.parse(engine), self.limit) for engine in case.engines),
            ),
        )


def sweep(name: str, limit: float) -> Sweep[Case, Seen, Took]:
    """The sweep of that name with so many CPU seconds an engine."""
    settings: dict[str, Any] = {"limit": limit, "members": MEMBERS, "spare": SPARE, "clock": "CPU seconds", "threads": 1}
    return Sweep(name=name, run=Growth(limit=limit), case=Case, row=Seen, timing=Took, settings=settings)


def scene(case: Case) -> Scene:
    """Where the garments of a case lie.

    Examples
    --------
    >>> scene(Case(garments=5, seed=0)).shape, scene(Case(garments=70, seed=0)).shape
    ((282, 470), (428, 713))
    """
    side = math.sqrt(SPARE * case.garments / FULL) if case.garments > FULL else 1.0
    size = (round(TABLE[0] * side), round(TABLE[1] * side))
    return garments(case.garments, seed=case.seed, size=size, groups=groups_of(case.garments, case.groups))


def groups_of(count: int, groups: int) -> tuple[int, ...]:
    """Sizes of that many groups of three, the last one smaller where garments run out.

    Examples
    --------
    >>> groups_of(35, 2), groups_of(35, 12)[-2:]
    ((3, 3), (3, 2))
    """
    return tuple(min(MEMBERS, count - MEMBERS * k) for k in range(groups))


def within_reach(instance: Instance) -> tuple[Instance, int]:
    """The instance without the requirements that no plan can meet, and their number.

    Examples
    --------
    >>> found, left_out = within_reach(Instance.of([[0.8, 0.0], [0.0, 0.5]], required=0.7))
    >>> found.required.tolist(), left_out
    ([0.7, 0.0], 1)
    """
    beyond = [found.element for found in unreachable(instance)]
    required = np.array(instance.required)
    required[beyond] = 0.0
    required.flags.writeable = False
    return replace(instance, required=required), len(beyond)


def climb(
    store: Store[Case, Seen, Took],
    sizes: Sequence[int],
    seeds: Sequence[int],
    engines: Sequence[str],
    executors: Executors,
    done: Callable[[Case, Seen], None],
) -> list[Case]:
    """Measure size after size; an engine that reached its limit at one is left out of those after it.

    Returns
    -------
    list[Case]
        Those that were measured.
    """
    measured: list[Case] = []
    left = tuple(engines)
    with lasting(executors) as places:
        for size in sorted(set(sizes)):
            cases = [Case(garments=size, seed=seed, engines=left) for seed in seeds]
            run_sweep(store, cases, places, done)
            measured += cases
            took = [store.timing(case) for case in cases]
            cut_off = {run.engine for timing in took if timing is not None for run in timing.runs if run.is_cut_off}
            left = tuple(engine for engine in left if engine not in cut_off)
    store.sort(measured)
    return measured


@cache
def _warmed(segmenter: str) -> None:
    """Let imports and weights be loaded before anything is timed."""
    from pscover.perception.perceive import perceive

    perceive(paint(garments(2, seed=0)), segmenter=segmenter)
