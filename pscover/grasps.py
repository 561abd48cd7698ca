"""Grasps: the chosen candidates of an instance, where they are in the photo and what each removes."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

from pscover.instance import Instance
from pscover.perception.grid import Grid
from pscover.seen import Seen


@dataclass(frozen=True, slots=True, kw_only=True)
class Removal:
    """What a grasp does to one garment.

    Parameters
    ----------
    garment
        Its index in the scene.
    name
        What it is called.
    probability
        p_ij, that the grasp removes it.
    """

    garment: int
    name: str
    probability: float


@dataclass(frozen=True, slots=True, kw_only=True)
class Grasp:
    """One grasp of a plan.

    Parameters
    ----------
    candidate
        Its index in the instance.
    x, y
        Where, in pixels of the photo, or of the labels where there was no photo.
    theta
        Orientation of the jaw's length in radians, from the x axis towards the y axis.
    distance
        To the basket, in the same pixels.
    removes
        What it will probably remove, the most probable first.
    """

    candidate: int
    x: float
    y: float
    theta: float
    distance: float
    removes: tuple[Removal, ...]


def ordered(seen: Seen, instance: Instance, chosen: Sequence[int]) -> tuple[Grasp, ...]:
    """The chosen candidates as grasps, by increasing distance to the basket; equally far ones by their index."""
    grasps = [_grasp(seen.grid, seen.basket, instance, i) for i in sorted(chosen)]
    return tuple(sorted(grasps, key=lambda grasp: grasp.distance))


def _grasp(grid: Grid, basket: tuple[float, float], instance: Instance, candidate: int) -> Grasp:
    p: Any = instance.probability
    span = slice(p.indptr[candidate], p.indptr[candidate + 1])
    removes = [
        Removal(garment=int(j), name=instance.meta.element(int(j)), probability=float(probability))
        for j, probability in zip(p.indices[span], p.data[span], strict=True)
    ]
    poses = instance.meta.poses
    assert poses is not None
    column, row, theta = (float(value) for value in poses[candidate])
    x, y = grid.to_photo(column, row)
    return Grasp(
        candidate=candidate,
        x=x,
        y=y,
        theta=theta,
        distance=math.hypot(x - basket[0], y - basket[1]),
        removes=tuple(sorted(removes, key=lambda removal: -removal.probability)),
    )
