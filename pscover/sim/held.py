"""Which garments a jaw has lifted, told from where cloth is: one criterion for every engine."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from pscover.sim.cloth import Cloth, FloatArray
from pscover.sim.settings import Gripper

RISE = 0.10
"""Metres by which the middle of a garment must have risen."""
NEAR = 0.007
"""Metres: cloth is that thick on each side of its middle, so nearer to the jaw's room than this it is in it."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Jaw:
    """Where a jaw is.

    Parameters
    ----------
    x, y, z
        Middle between the tips, metres.
    theta
        Angle of the jaw's length against x, radians.
    gap
        Metres between the pads.
    """

    x: float
    y: float
    z: float
    theta: float
    gap: float

    def between(self, points: FloatArray, gripper: Gripper) -> NDArray[np.bool_]:
        """Which points lie between the pads, or nearer than `NEAR` to the room there; shape (points,)."""
        along, across = self._level(points)
        up = points[:, 2] - self.z
        inside: NDArray[np.bool_] = (along <= self.gap / 2 + NEAR) & (across <= gripper.width / 2 + NEAR)
        return inside & (up >= -NEAR) & (up <= gripper.height + NEAR)

    def below(self, points: FloatArray, gripper: Gripper) -> NDArray[np.bool_]:
        """Which points the fingers or the room between them may meet when they go down here; shape (points,)."""
        along, across = self._level(points)
        return np.asarray((along <= self.gap / 2 + gripper.finger + NEAR) & (across <= gripper.width / 2 + NEAR))

    def _level(self, points: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Distance from the middle along the jaw and across it."""
        cosine, sine = math.cos(self.theta), math.sin(self.theta)
        x, y = points[:, 0] - self.x, points[:, 1] - self.y
        return np.abs(cosine * x + sine * y), np.abs(cosine * y - sine * x)


def dense(cloth: Cloth, position: FloatArray, garment: int) -> FloatArray:
    """Particles of a garment and the middles of its edges, where all particles are at `position`; shape (points, 3).

    Particles stand as far apart as the pads are wide: with the middles no cloth goes unseen between them.
    """
    own = position[cloth.start[garment] : cloth.start[garment + 1]]
    edges = cloth.edge[cloth.edge_start[garment] : cloth.edge_start[garment + 1]]
    return np.concatenate((own, position[edges].mean(axis=1)))


def reached(cloth: Cloth, jaw: Jaw, gripper: Gripper) -> tuple[int, ...]:
    """Garments that the open jaw may meet when it goes down, ascending."""
    return tuple(
        g for g in np.flatnonzero(cloth.present).tolist() if jaw.below(dense(cloth, cloth.position, g), gripper).any()
    )


def risen(cloth: Cloth, before: FloatArray, after: FloatArray) -> tuple[int, ...]:
    """Garments whose middle has risen by `RISE`, ascending; positions of all particles, shape (particles, 3)."""
    heights = np.add.reduceat(after[:, 2] - before[:, 2], cloth.start[:-1]) / np.diff(cloth.start)
    return tuple(np.flatnonzero((heights >= RISE) & (cloth.present == 1)).tolist())


def held(cloth: Cloth, before: FloatArray, after: FloatArray, jaw: Jaw, gripper: Gripper) -> tuple[int, ...]:
    """Garments of which some cloth is between the pads and whose middle has risen by `RISE`, ascending.

    Parameters
    ----------
    cloth
        What belongs to which garment.
    before, after
        Positions of all particles before the grasp and after the lift, metres, shape (particles, 3).
    jaw
        After the lift.
    gripper
        Its measures.

    Examples
    --------
    >>> from pscover.sim.cloth import cloth
    >>> from pscover.sim.wardrobe import wardrobe
    >>> towel = cloth(wardrobe(0.65)[9:], 0.02)
    >>> before, after = towel.position, towel.position + (0, 0, 0.45)
    >>> at = Jaw(x=0.0, y=0.0, z=0.44, theta=0.0, gap=0.01)
    >>> held(towel, before, after, at, Gripper()), held(towel, before, before, at, Gripper())
    ((0,), ())
    """
    return tuple(g for g in risen(cloth, before, after) if jaw.between(dense(cloth, after, g), gripper).any())
