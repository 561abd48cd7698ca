"""The candidates that a plan is made of, and how far what is proven of them reaches.

Out of all poses some are left out, for one of two reasons:

- another pose of the same part is worth at least as much to every garment. Put in its place it keeps the plan a plan, since
  two poses of one part exclude each other anyway (the proof stands in `pscover.presolve.clique_dominance`);
- every plan that holds the pose costs at least `Pool.floor` (`pscover.grasping.pricing`).

So a plan of poses on the grid costs at least the smaller of the floor and what is proven of the pool.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from pscover.grasping.all_poses import AllPoses, IntArray, Over
from pscover.grasping.conflict_partition import SamePart
from pscover.grasping.predictor import Predictor
from pscover.grasping.pricing import Prices
from pscover.grasping.sampling import Grasps
from pscover.grasping.skyline import skyline
from pscover.instance import Instance, Meta
from pscover.scene import Scene

FloatArray = NDArray[np.float64]
Candidates = Literal["sampled", "all"]
GROWTH = 2
"""How much further to look each time, while few of the poses looked at are worth choosing."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Scope:
    """What a plan's bound is about.

    Parameters
    ----------
    candidates
        "sampled": the bound holds over the drawn candidates. "all": over every pose of the grid.
    poses
        How many they are.
    floor
        A plan with a pose that was left out of the instance has at least so many grasps.
    """

    candidates: Candidates
    poses: int
    floor: float = math.inf

    def __str__(self) -> str:
        return "these candidates" if self.candidates == "sampled" else f"all {self.poses:,} poses of the grid"


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Selection:
    """Poses to choose from.

    Parameters
    ----------
    numbers
        Their numbers among all poses, ascending.
    floor
        See `Scope`.
    """

    numbers: IntArray
    floor: float


def select(poses: AllPoses, prices: Prices, most: int, ceiling: float = math.inf, over: Over = lambda: False) -> Selection:
    """About so many of the poses that cheap plans may hold, or all that are worth choosing if they are fewer.

    Parameters
    ----------
    poses, prices
        Every pose, and what it is priced with.
    most
        How many to select, within a factor of 2.
    ceiling
        Poses that only plans dearer than this hold are of no use.
    over
        Asked whether to look no further; what was looked at by then is kept.

    Examples
    --------
    >>> from pscover.grasping.all_poses import all_poses
    >>> from pscover.grasping.ellipse import Ellipse
    >>> from pscover.grasping.pricing import price
    >>> from pscover.grasping.sampling import Sampling
    >>> scene = Scene.of(np.kron([[1, 1, 0, 2]], np.ones((40, 20), dtype=int)))
    >>> poses = all_poses(scene, Sampling(), Ellipse(), np.array([0.7, 0.7]))
    >>> found = select(poses, price(poses), most=1000)
    >>> len(poses), len(found.numbers), found.floor
    (14400, 2, inf)
    """
    floors, ranks = _by_part(poses, prices.floors), _by_part(poses, prices.ranks)
    of_use = [here <= ceiling for here in floors]
    ranked = np.sort(np.concatenate([np.zeros(0), *(here[use] for here, use in zip(ranks, of_use, strict=True))]))
    looked, limit, starts = most, -math.inf, poses.starts()
    fronts = [np.zeros(0, dtype=np.int64)] * poses.parts
    numbers = np.zeros(0, dtype=np.int64)
    while len(ranked):
        before, limit = limit, float(ranked[min(looked, len(ranked)) - 1])
        more = [np.flatnonzero(use & (here > before) & (here <= limit)) for here, use in zip(ranks, of_use, strict=True)]
        fronts = [_front(poses, part, np.append(fronts[part], more[part])) for part in range(poses.parts)]
        numbers = np.sort(np.concatenate([start + front for start, front in zip(starts, fronts, strict=False)]))
        if limit >= ranked[-1] or len(numbers) > most / 2 or over():
            break
        looked *= GROWTH
    left_out = [
        here[~use | (rank > limit)].min(initial=math.inf) for here, use, rank in zip(floors, of_use, ranks, strict=True)
    ]
    floor = min(left_out, default=math.inf) if math.isfinite(prices.bound) else math.inf
    return Selection(numbers=numbers, floor=float(floor))


def _by_part(poses: AllPoses, of: Callable[[int], FloatArray]) -> list[FloatArray]:
    return [of(part) for part in range(poses.parts)]


def _front(poses: AllPoses, part: int, numbers: IntArray) -> IntArray:
    """Those of some poses of a part that no other one of them replaces; none that covers nothing."""
    if not len(numbers):
        return numbers
    worth = poses.worth[part][:, numbers]
    kept = numbers[skyline(worth, poses.total[part][numbers])]
    useful: IntArray = kept[poses.total[part][kept] > 0]
    return useful


def instance_of(
    scene: Scene, poses: AllPoses, numbers: IntArray, predictor: Predictor, required: NDArray[np.float64]
) -> Instance:
    """The problem of choosing from some of the poses; `numbers` are ascending and the instance keeps their order."""
    grasps = Grasps(poses=poses.poses(numbers), part=poses.part_of(numbers))
    return Instance.of(
        predictor.probability(scene, grasps.poses),
        required,
        conflicts=SamePart().cliques(grasps, predictor.axes),
        meta=Meta(name=scene.source, source=scene.source, elements=scene.names, poses=grasps.poses),
    )
