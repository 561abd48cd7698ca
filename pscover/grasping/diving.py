"""A plan from the linear relaxation over all poses: take the pose that it takes most of, and relax what is left again.

After each step the entries are truncated at what each garment still needs, which is what makes the relaxation tight (these
are the knapsack-cover inequalities of the poses taken so far: Carr, Fleischer, Leung, Phillips 2000), and poses are priced
again, so that those join that fit what is left (diving with column generation: Sadykov, Vanderbeck and others 2019).
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from pscover.grasping.all_poses import AllPoses, IntArray, Over
from pscover.grasping.columns import WORTH, Columns, best_poses, relaxation
from pscover.grasping.pricing import Prices

FloatArray = NDArray[np.float64]
ROUNDS = 1
"""How often poses are priced before one is taken."""
NEAR = 0.1
"""Reduced costs up to this, with that of a part's best pose as 0, let a pose in from the start."""
WHOLE = 0.2
"""Nearer to 1 than this counts as taken."""
NOTHING = 1e-6
"""Taken less than this, a pose counts as not taken."""
MET = 1e-9
"""A row scaled to 1 counts as met when it is missed by no more than this."""


def dive(poses: AllPoses, prices: Prices, over: Over = lambda: False) -> IntArray | None:
    """Poses, at most one a part, that meet every requirement; None if the dive finds none, or is over first.

    Parameters
    ----------
    poses, prices
        Every pose, and prices of the garments' rows.
    over
        Asked from step to step whether to give up.

    Examples
    --------
    >>> from pscover.grasping.all_poses import all_poses
    >>> from pscover.grasping.ellipse import Ellipse
    >>> from pscover.grasping.pricing import price
    >>> from pscover.grasping.sampling import Sampling
    >>> from pscover.scene import Scene
    >>> scene = Scene.of(np.kron([[1, 0, 2]], np.ones((20, 60), dtype=int)))
    >>> poses = all_poses(scene, Sampling(), Ellipse(), np.array([0.7, 0.7]))
    >>> len(dive(poses, price(poses)))
    2
    """
    need = np.zeros(poses.rows)
    need[poses.wanted()] = 1.0
    columns = _promising(poses, prices)
    taken: dict[int, int] = {}
    while (need > MET).any():
        columns, picked = (columns, {}) if over() else _relaxed(poses, columns, need, set(taken), over)
        if not picked:
            return None
        for part, pose in picked.items():
            taken[part] = pose
            need[poses.garments[part]] -= poses.worth[part][:, pose]
        need[need <= MET] = 0.0
        columns = columns.where(~np.isin(columns.part, list(picked)))
    return np.sort(_needed(poses, taken))


def _relaxed(
    poses: AllPoses, columns: Columns, need: FloatArray, taken: set[int], over: Over
) -> tuple[Columns, dict[int, int]]:
    """The columns with those that are worth it; by part, the pose taken most, and those taken whole."""
    wanted, is_left = np.flatnonzero(need), np.ones(poses.parts, dtype=np.bool_)
    is_left[list(taken)] = False
    relaxed = relaxation(_truncated(columns, need), wanted, poses.parts)
    for _ in range(ROUNDS):
        if relaxed is None or over():
            break
        best, gains = best_poses(poses, relaxed.y, need)
        more = columns.joined(poses, best, is_left & (gains > 1.0 + relaxed.z + WORTH))
        if more is None:
            break
        columns = more
        relaxed = relaxation(_truncated(columns, need), wanted, poses.parts, relaxed.basis)
    if relaxed is None or relaxed.x.max(initial=0.0) <= NOTHING:
        return columns, {}
    picked = {int(relaxed.x.argmax()), *np.flatnonzero(relaxed.x > 1 - WHOLE).tolist()}
    return columns, {int(columns.part[k]): int(columns.pose[k]) for k in picked}


def _promising(poses: AllPoses, prices: Prices) -> Columns:
    """The extreme poses of each part of which little speaks against that a cheapest plan holds them."""
    columns = Columns.extremes(poses)
    reduced = 1.0 - prices.multipliers @ columns.worth
    return columns.where(reduced - prices.least[columns.part] <= NEAR)


def _truncated(columns: Columns, need: FloatArray) -> Columns:
    """With what the poses are worth to what rows still need at most, as a part of it."""
    rows = need > 0
    worth = np.zeros_like(columns.worth)
    worth[rows] = np.minimum(columns.worth[rows], need[rows, None]) / need[rows, None]
    return Columns(part=columns.part, pose=columns.pose, worth=worth)


def _needed(poses: AllPoses, taken: dict[int, int]) -> IntArray:
    """The numbers of the poses without which some requirement is not met, the least useful left out first."""
    supply = np.zeros(poses.rows)
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
