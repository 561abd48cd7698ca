"""The poses that a linear relaxation chooses from, and others that join them as they are worth it.

    minimise  sum_i x_i + M s   subject to   sum_i w_ij x_i + s >= 1,   sum_{i in part} x_i <= 1,   x, s >= 0

over some poses is solved again and again; each time the pose of the least reduced cost 1 - sum_j y_j w_ij of every part is
looked for among all of them, and joins if it is worth it (Dantzig and Wolfe 1960; Gilmore and Gomory 1961).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csc_array

from pscover.grasping.all_poses import AllPoses, IntArray
from pscover.grasping.relaxation import Basis, minimise

FloatArray = NDArray[np.float64]
WORTH = 1e-7
"""Reduced costs nearer to 0 than this are what the engine's tolerance leaves."""
DEAR = 100.0
"""M, in plans that take a grasp from every part: much more, so that small shortfalls tell that there is no plan."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Columns:
    """Some poses.

    Parameters
    ----------
    part, pose
        The part of each, and its number in the part.
    worth
        Their entries, shape (rows, columns).
    """

    part: IntArray
    pose: IntArray
    worth: FloatArray

    @classmethod
    def of(cls, poses: AllPoses, part: IntArray, pose: IntArray) -> Columns:
        """With the entries that all poses have."""
        worth = np.zeros((poses.rows, len(part)))
        for k, (p, i) in enumerate(zip(part.tolist(), pose.tolist(), strict=True)):
            worth[poses.garments[p], k] = poses.worth[p][:, i]
        return cls(part=part, pose=pose, worth=worth)

    @classmethod
    def extremes(cls, poses: AllPoses) -> Columns:
        """The poses of each part that are worth most to one of its garments, and to all."""
        chosen = [extremes(poses, part) for part in range(poses.parts)]
        part = np.repeat(np.arange(poses.parts), [len(numbers) for numbers in chosen])
        return cls.of(poses, part, np.concatenate([np.zeros(0, dtype=np.int64), *chosen]))

    def over(self, poses: AllPoses) -> Columns:
        """The same poses with entries of other rows."""
        return Columns.of(poses, self.part, self.pose)

    def where(self, kept: NDArray[np.bool_]) -> Columns:
        """Some of them."""
        return Columns(part=self.part[kept], pose=self.pose[kept], worth=self.worth[:, kept])

    def joined(self, poses: AllPoses, best: IntArray, improves: NDArray[np.bool_]) -> Columns | None:
        """With the best pose of each part where it improves the relaxation and is not among them; None if there is none.

        Parameters
        ----------
        poses
            Every pose.
        best
            By part, the number of its best pose.
        improves
            By part.
        """
        held = np.zeros(poses.parts, dtype=np.bool_)
        held[self.part[self.pose == best[self.part]]] = True
        part = np.flatnonzero(improves & ~held)
        if not len(part):
            return None
        more = Columns.of(poses, part, best[part])
        return Columns(
            part=np.concatenate((self.part, more.part)),
            pose=np.concatenate((self.pose, more.pose)),
            worth=np.hstack((self.worth, more.worth)),
        )


def best_poses(poses: AllPoses, y: FloatArray, need: FloatArray | None = None) -> tuple[IntArray, FloatArray]:
    """Of each part the pose that is worth most at prices of the rows, and how much that is.

    Parameters
    ----------
    poses
        Every pose.
    y
        Prices of a whole row.
    need
        The part of each row that is still to be met, if not all: entries count up to that. Rows without are passed over.
    """
    best, gain = np.zeros(poses.parts, dtype=np.int64), np.zeros(poses.parts)
    open_, rate = y > 0, y
    if need is not None:
        open_ = open_ & (need > 0)
        rate = np.divide(y, need, out=np.zeros(len(y)), where=open_)
    for part, (listed, worth) in enumerate(zip(poses.garments, poses.worth, strict=True)):
        own = open_[listed]
        if not own.any():
            continue
        rows, entries = listed[own], worth if own.all() else worth[own]
        if need is not None and (need[rows] < 1.0).any():
            entries = np.minimum(entries, need[rows, None])
        gains = rate[rows] @ entries
        best[part] = gains.argmax()
        gain[part] = gains[best[part]]
    return best, gain


def extremes(poses: AllPoses, part: int) -> IntArray:
    """The poses of a part that are worth most to one of its garments, and to all."""
    worth, total = poses.worth[part], poses.total[part]
    if not len(worth):
        return np.zeros(0, dtype=np.int64)
    together = worth.sum(axis=0)
    tie = 1e-3 / (1.0 + total.max()) * total
    return np.unique([(row + 1e-3 * together + tie).argmax() for row in (*worth, together)]).astype(np.int64)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Relaxed:
    """An optimum of the relaxation over some poses.

    Parameters
    ----------
    value
        Of the objective.
    x
        How much of each is taken.
    y, z
        Prices of rows and of parts, >= 0.
    basis
        For the next relaxation; its rows are those of the parts, and after them those wanted.
    """

    value: float
    x: FloatArray
    y: FloatArray
    z: FloatArray
    basis: Basis | None


def relaxation(columns: Columns, wanted: IntArray, parts: int, basis: Basis | None = None) -> Relaxed | None:
    """The relaxation over some poses; None if the engine has no optimum.

    Parameters
    ----------
    columns
        The poses.
    wanted
        The rows to meet, rising.
    parts
        How many parts there are.
    basis
        Of a relaxation over the first of the rows and of the poses.
    """
    rows, count = columns.worth.shape
    many = len(wanted)
    entries = columns.worth[wanted].T
    owner, row = np.nonzero(entries)
    # The slack and the rows of parts come first: what joins later is added at the end.
    at = np.concatenate((parts + np.arange(many), columns.part, parts + row))
    of = np.concatenate((np.zeros(many, dtype=np.int64), 1 + np.arange(count), 1 + owner))
    values = np.concatenate((-np.ones(many), np.ones(count), -entries[owner, row]))
    matrix = csc_array((values, (at, of)), shape=(parts + many, 1 + count))
    right = np.concatenate((np.ones(parts), -np.ones(many)))
    cost = np.concatenate(([DEAR * (1.0 + parts)], np.ones(count)))
    found = minimise(cost, matrix, right, basis)
    if found is None:
        return None
    y = np.zeros(rows)
    y[wanted] = found.prices[parts:]
    return Relaxed(value=found.value, x=found.x[1:], y=y, z=found.prices[:parts], basis=found.basis)
