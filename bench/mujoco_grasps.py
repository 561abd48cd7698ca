"""Where on a scene of cloth `mujoco_check.py` grasps: three kinds of places, chosen at random."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal, get_args

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import distance_transform_edt, maximum_filter, minimum_filter

from pscover.sim import World

Kind = Literal["middle", "border", "rim"]
KINDS: tuple[Kind, ...] = get_args(Kind)
SEEN = 200
"""Pixels of a garment that must be seen for a grasp in its middle."""
BESIDE = (2.0, 6.0)
"""Pixels of bare table between a grasp at a rim and the nearest garment."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Grasp:
    """One grasp: the seed of a scene, and where on a garment."""

    scene: int
    kind: Kind


def place(world: World, kind: Kind) -> tuple[float, float, float]:
    """A random grasp of a kind: metres of the seen surface, and an angle; the same for a scene whenever it is asked."""
    generator = np.random.default_rng([world.seed, KINDS.index(kind), 119])
    labels, depth = world.surface.labels(world.cloth, world.view)
    spots = {"middle": _middles, "border": _borders, "rim": _rims}[kind](labels)
    row, column = spots[generator.integers(len(spots))].tolist()
    seen = float(depth[row, column])
    x, y, _ = world.view.point(column, row, seen if np.isfinite(seen) else world.settings.sensor.height)
    return round(x, 6), round(y, 6), round(float(generator.uniform(-np.pi / 2, np.pi / 2)), 6)


def _middles(labels: NDArray[np.int32]) -> NDArray[np.int64]:
    """The pixel of each garment that is furthest from all others."""
    seen = [label for label in np.unique(labels).tolist() if label and (labels == label).sum() >= SEEN]
    inside = [distance_transform_edt(np.pad(labels == label, 1))[1:-1, 1:-1] for label in seen]
    return np.array([np.unravel_index(int(depth.argmax()), depth.shape) for depth in inside])


def _borders(labels: NDArray[np.int32]) -> NDArray[np.int64]:
    """Pixels beside one of another garment."""
    return np.argwhere((minimum_filter(labels, 3) > 0) & (minimum_filter(labels, 3) < maximum_filter(labels, 3)))


def _rims(labels: NDArray[np.int32]) -> NDArray[np.int64]:
    """Pixels of the table a little beside a garment."""
    away = distance_transform_edt(labels == 0)
    return np.argwhere((away >= BESIDE[0]) & (away <= BESIDE[1]))
