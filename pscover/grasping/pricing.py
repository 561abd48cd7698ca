"""What the covering rows are worth when every pose may be chosen: the linear relaxation by column generation.

    minimise  sum_i x_i + M sum_j s_j   subject to   sum_i w_ij x_i + s_j >= 1,   sum_{i in part} x_i <= 1,   x, s >= 0

over some poses is solved again and again; each time the pose of the least reduced cost 1 - sum_j y_j w_ij of every part is
looked for among all of them, and joins if it is worth it (Dantzig and Wolfe 1960; Gilmore and Gomory 1961).

**The bound.** For all multipliers y >= 0 every plan costs at least

    L(y) = sum_j y_j r_j + sum over parts of min(0, least reduced cost in the part),

and every plan that holds pose i of part P at least L(y) - min(0, least of P) + (1 - sum_j y_j w_ij). A goal forgives what
is short by its tolerance, so r_j, the least that a plan brings to row j, is a hair below 1. All poses are priced for it, so
it holds over all of them, however few the relaxation was solved with.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csc_array

from pscover.grasping.all_poses import AllPoses, IntArray, Over
from pscover.grasping.relaxation import minimise

FloatArray = NDArray[np.float64]
ROUNDS = 60
"""Most relaxations solved; a handful is usual."""
WORTH = 1e-7
"""Reduced costs nearer to 0 than this are what the engine's tolerance leaves."""
DEAR = 100.0
"""M, in plans that take a grasp from every part: much more, so that small shortfalls tell that there is no plan."""
SAFE = 1e-9
"""Relative margin for rounding in bounds."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Prices:
    """Multipliers and what they prove.

    Parameters
    ----------
    multipliers
        y, shape (garments,).
    value
        L(y).
    least
        min(0, least reduced cost) of each part, shape (parts,).
    out_of_reach
        Whether some garment needs more than the best pose of every part together gives it: then there is no plan.
    """

    multipliers: FloatArray
    value: float
    least: FloatArray
    out_of_reach: bool

    @property
    def bound(self) -> float:
        """No plan of poses on the grid has fewer grasps; infinite if there is none.

        There is none either if it would have more grasps than there are parts, of which each gives at most one.
        """
        return np.inf if self.out_of_reach or self.value > len(self.least) + WORTH else self.value

    def floors(self, poses: AllPoses, part: int) -> FloatArray:
        """A plan that holds the pose costs at least so much, for each of the part's poses, shape (poses of the part,)."""
        reduced = 1.0 - self.multipliers[poses.garments[part]] @ poses.worth[part]
        floors: FloatArray = (self.value - self.least[part] + reduced) - SAFE * (1.0 + abs(self.value))
        return floors


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Relaxed:
    """An optimum of the relaxation over some poses.

    Parameters
    ----------
    value
        Of the objective.
    x
        How much of each chosen pose is taken, part by part.
    y, z
        Prices of garments and of parts, >= 0.
    """

    value: float
    x: FloatArray
    y: FloatArray
    z: FloatArray


def price(poses: AllPoses, garments: int, over: Over = lambda: False) -> Prices | None:
    """Multipliers near the best; None if it was over before there were any.

    Parameters
    ----------
    poses
        Every pose.
    garments
        How many garments the scene has.
    over
        Asked from round to round whether to stop with the best multipliers so far.

    Examples
    --------
    >>> from pscover.grasping.all_poses import all_poses
    >>> from pscover.grasping.ellipse import Ellipse
    >>> from pscover.grasping.sampling import Sampling
    >>> from pscover.scene import Scene
    >>> scene = Scene.of(np.kron([[1, 0, 2]], np.ones((20, 60), dtype=int)))
    >>> poses = all_poses(scene, Sampling(), Ellipse(), np.array([0.7, 0.7]))
    >>> prices = price(poses, scene.garments)
    >>> round(prices.bound, 3)
    2.0
    """
    best = _proven(poses, np.zeros(garments), _is_out_of_reach(poses, garments))
    chosen = [extremes(poses, part) for part in range(poses.parts)]
    for turn in range(ROUNDS):
        if not any(len(numbers) for numbers in chosen):
            break
        if over():
            return best if turn else None
        relaxed = relaxation(poses, garments, chosen)
        if relaxed is None:
            break
        found = _proven(poses, relaxed.y, best.out_of_reach)
        best = found if found.value > best.value else best
        if found.value > relaxed.value - WORTH * (1.0 + relaxed.value) or not joined(poses, chosen, relaxed):
            break
    return best


def _is_out_of_reach(poses: AllPoses, garments: int) -> bool:
    """Whether some garment that is under a pose is not covered by the best pose of every part together."""
    supply = np.full(garments, 0.0)
    for part in range(poses.parts):
        supply[poses.garments[part]] += poses.worth[part].max(axis=1, initial=0.0)
    wanted = np.unique(np.concatenate([np.zeros(0, dtype=np.int64), *poses.garments]))
    return bool((supply[wanted] < poses.needed[wanted] - SAFE).any())


def extremes(poses: AllPoses, part: int) -> IntArray:
    """The poses of a part that are worth most to one of its garments, and to all."""
    worth, total = poses.worth[part], poses.total[part]
    if not len(worth):
        return np.zeros(0, dtype=np.int64)
    together = worth.sum(axis=0)
    tie = 1e-3 / (1.0 + total.max()) * total
    return np.unique([(row + 1e-3 * together + tie).argmax() for row in (*worth, together)]).astype(np.int64)


def _proven(poses: AllPoses, y: FloatArray, out_of_reach: bool) -> Prices:
    """L(y)."""
    gains = [float((y[g] @ w).max(initial=0.0)) for g, w in zip(poses.garments, poses.worth, strict=True)]
    least = np.minimum(0.0, 1.0 - np.array(gains, dtype=np.float64))
    value, size = float(y @ poses.needed + least.sum()), float(y.sum() - least.sum())
    return Prices(multipliers=y, value=value - 1e-12 * size, least=least, out_of_reach=out_of_reach)


def joined(poses: AllPoses, chosen: list[IntArray], relaxed: Relaxed) -> bool:
    """Add the best pose of each part where it improves the relaxation; whether any did."""
    grown = False
    for part, (garments, worth) in enumerate(zip(poses.garments, poses.worth, strict=True)):
        if not len(garments):
            continue
        gain = relaxed.y[garments] @ worth
        best = int(gain.argmax())
        if gain[best] > 1.0 + relaxed.z[part] + WORTH and best not in chosen[part]:
            chosen[part] = np.append(chosen[part], best)
            grown = True
    return grown


def relaxation(poses: AllPoses, garments: int, chosen: list[IntArray]) -> Relaxed | None:
    """The relaxation over the chosen poses; None if the engine has no optimum.

    Parameters
    ----------
    poses
        Every pose.
    garments
        How many garments the scene has.
    chosen
        For each part, poses by their number in it.
    """
    rows, columns, values, count = [], [], [], 0
    for part, numbers in enumerate(chosen):
        worth = poses.worth[part][:, numbers]
        row, column = np.nonzero(worth)
        rows += [poses.garments[part][row], np.full(len(numbers), garments + part)]
        columns += [count + column, count + np.arange(len(numbers))]
        values += [-worth[row, column], np.ones(len(numbers))]
        count += len(numbers)
    wanted = np.unique(np.concatenate(poses.garments))
    shape = (garments + poses.parts, count + len(wanted))
    rows.append(wanted)
    columns.append(count + np.arange(len(wanted)))
    values.append(-np.ones(len(wanted)))
    matrix = csc_array((np.concatenate(values), (np.concatenate(rows), np.concatenate(columns))), shape=shape)
    right = np.zeros(garments + poses.parts)
    right[wanted] = -1.0
    right[garments:] = 1.0
    cost = np.concatenate((np.ones(count), np.full(len(wanted), DEAR * (1.0 + poses.parts))))
    found = minimise(cost, matrix, right)
    if found is None:
        return None
    return Relaxed(value=found.value, x=found.x[:count], y=found.prices[:garments], z=found.prices[garments:])
