"""A plan from the linear relaxation over all poses: take the pose that it takes most of, and relax what is left again.

After each step the entries are truncated at what each garment still needs, which is what makes the relaxation tight (these
are the knapsack-cover inequalities of the poses taken so far: Carr, Fleischer, Leung, Phillips 2000), and poses are priced
again, so that those join that fit what is left (diving with column generation: Sadykov, Vanderbeck and others 2019).
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from pscover.grasping.all_poses import AllPoses, IntArray, Over
from pscover.grasping.pricing import Prices, extremes, joined, relaxation

FloatArray = NDArray[np.float64]
ROUNDS = 1
"""How often poses are priced before one is taken."""
NEAR = 0.1
"""Reduced costs up to this, with that of a part's best pose as 0, let a pose in from the start."""
WHOLE = 1e-6
"""Nearer to 1 than this counts as taken."""
MET = 1e-9
"""A row scaled to 1 counts as met when it is missed by no more than this."""


def dive(poses: AllPoses, prices: Prices, over: Over = lambda: False) -> IntArray | None:
    """Poses, at most one a part, that meet every requirement; None if the dive finds none, or is over first.

    Examples
    --------
    >>> from pscover.grasping.all_poses import all_poses
    >>> from pscover.grasping.ellipse import Ellipse
    >>> from pscover.grasping.pricing import price
    >>> from pscover.grasping.sampling import Sampling
    >>> from pscover.scene import Scene
    >>> scene = Scene.of(np.kron([[1, 0, 2]], np.ones((20, 60), dtype=int)))
    >>> poses = all_poses(scene, Sampling(), Ellipse(), np.array([0.7, 0.7]))
    >>> len(dive(poses, price(poses, scene.garments)))
    2
    """
    garments = len(prices.multipliers)
    need = np.zeros(garments)
    need[np.unique(np.concatenate([np.zeros(0, dtype=np.int64), *poses.garments]))] = 1.0
    chosen = [_promising(poses, prices, part) for part in range(poses.parts)]
    taken: dict[int, int] = {}
    left = poses
    while (need > MET).any():
        picked = {} if over() else _relaxed(left, garments, chosen, over)
        if not picked:
            return None
        for part, pose in picked.items():
            taken[part] = pose
            need[poses.garments[part]] -= poses.worth[part][:, pose]
        left = _left(poses, need, taken)
        chosen = [
            numbers if len(open_) else np.zeros(0, dtype=np.int64)
            for numbers, open_ in zip(chosen, left.garments, strict=True)
        ]
    return np.sort(_needed(poses, garments, taken))


def _relaxed(left: AllPoses, garments: int, chosen: list[IntArray], over: Over) -> dict[int, int]:
    """By part, the pose that the relaxation takes most of, and those that it takes whole."""
    relaxed = relaxation(left, garments, chosen)
    for _ in range(ROUNDS):
        if relaxed is None or over() or not joined(left, chosen, relaxed):
            break
        relaxed = relaxation(left, garments, chosen)
    if relaxed is None or relaxed.x.max(initial=0.0) <= WHOLE:
        return {}
    part = np.repeat(np.arange(left.parts), [len(numbers) for numbers in chosen])
    pose = np.concatenate(chosen)
    taken = {int(relaxed.x.argmax()), *np.flatnonzero(relaxed.x > 1 - WHOLE).tolist()}
    return {int(part[k]): int(pose[k]) for k in taken}


def _promising(poses: AllPoses, prices: Prices, part: int) -> IntArray:
    """The extreme poses of a part of which little speaks against that a cheapest plan holds them."""
    numbers = extremes(poses, part)
    reduced = 1.0 - prices.multipliers[poses.garments[part]] @ poses.worth[part][:, numbers]
    promising: IntArray = numbers[reduced - prices.least[part] <= NEAR]
    return promising


def _left(poses: AllPoses, need: FloatArray, taken: dict[int, int]) -> AllPoses:
    """The poses of the other parts, worth to each garment what it still needs at most."""
    garments, worth = [], []
    for part, (listed, entries) in enumerate(zip(poses.garments, poses.worth, strict=True)):
        rows = np.flatnonzero(need[listed] > MET) if part not in taken else np.zeros(0, dtype=np.int64)
        least = need[listed[rows]][:, None]
        garments.append(listed[rows])
        worth.append(np.minimum(entries[rows], least) / least)
    return replace(poses, garments=tuple(garments), worth=tuple(worth))


def _needed(poses: AllPoses, garments: int, taken: dict[int, int]) -> IntArray:
    """The numbers of the poses without which some requirement is not met, the least useful left out first."""
    supply = np.zeros(garments)
    entries = {part: poses.worth[part][:, pose] for part, pose in taken.items()}
    for part, values in entries.items():
        supply[poses.garments[part]] += values
    numbers = []
    for part, values in sorted(entries.items(), key=lambda item: float(item[1].sum())):
        without = supply[poses.garments[part]] - values
        if (without >= 1.0 - MET).all():
            supply[poses.garments[part]] = without
        else:
            numbers.append(int(poses.starts()[part]) + taken[part])
    return np.array(numbers, dtype=np.int64)
