"""Candidate grasps, drawn at random from each part of the partition (paper, section 4)."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from pscover.errors import InvalidSettings
from pscover.grasping.partition import Partition, partition
from pscover.scene import Scene

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.int32]


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Grasps:
    """Grasps that may go into a plan.

    Parameters
    ----------
    poses
        x and y in pixels, theta in radians from the x axis towards the y axis (clockwise as seen, for y runs down),
        shape (grasps, 3).
    part
        The part of the partition that each was drawn from, shape (grasps,).
    """

    poses: FloatArray
    part: IntArray

    def __len__(self) -> int:
        return len(self.part)

    def only(self, kept: NDArray[np.bool_]) -> Grasps:
        """Those that a mask marks."""
        return Grasps(poses=self.poses[kept], part=self.part[kept])


@dataclass(frozen=True, slots=True, kw_only=True)
class Sampling:
    """How candidates are drawn; the defaults are the paper's.

    Parameters
    ----------
    points
        k, how many pixels are drawn from each part, without replacement; all of them where there are fewer.
    orientations
        l, equally spaced angles in [-pi/2, pi/2) at each point.
    reach
        r in pixels, the gripper's radius, which defines the partition.

    Raises
    ------
    InvalidSettings
        If a number is outside its domain.
    """

    points: int = 5
    orientations: int = 6
    reach: float = 20.0

    def __post_init__(self) -> None:
        for name, value in (("points", self.points), ("orientations", self.orientations)):
            if value < 1:
                raise InvalidSettings(f"{name}: expected a whole number of at least 1, got {value!r}")
        if not 0 <= self.reach <= 1000:
            raise InvalidSettings(f"reach: expected a number of pixels from 0 to 1000, got {self.reach!r}")

    def angles(self) -> FloatArray:
        """The orientations in radians, ascending.

        Examples
        --------
        >>> np.degrees(Sampling().angles()).round().tolist()
        [-90.0, -60.0, -30.0, 0.0, 30.0, 60.0]
        """
        return -math.pi / 2 + math.pi * np.arange(self.orientations) / self.orientations

    def draw(self, scene: Scene, seed: int | np.random.Generator = 0) -> Grasps:
        """Candidates of a scene: for each part, each drawn point, each orientation.

        Parameters
        ----------
        scene
            What lies on the surface.
        seed
            Of the draw, or the generator itself.

        Returns
        -------
        Grasps
            In order of parts, then of pixels row by row, then of angles.

        Examples
        --------
        >>> grasps = Sampling(points=1, orientations=2).draw(Scene.of([[0, 1], [0, 0]]))
        >>> grasps.poses.round(2).tolist(), grasps.part.tolist()
        ([[1.0, 0.0, -1.57], [1.0, 0.0, 0.0]], [0, 0])
        """
        found = partition(scene, self.reach)
        pixels, part = self._points(found, np.random.default_rng(seed))
        y, x = np.divmod(pixels, scene.shape[1])
        angles = self.angles()
        points = np.repeat(np.stack((x, y), axis=1).astype(np.float64), len(angles), axis=0)
        theta = np.tile(angles, len(pixels))
        return Grasps(poses=np.column_stack((points, theta)), part=np.repeat(part, len(angles)))

    def _points(self, found: Partition, generator: np.random.Generator) -> tuple[NDArray[np.int64], IntArray]:
        """The drawn pixels as flat indices, and their parts."""
        flat = found.parts.ravel()
        pixels = np.flatnonzero(flat >= 0)
        owner = flat[pixels]
        # Two bytes are sorted by radix, in linear time.
        order = np.argsort(owner.astype(np.uint16) if len(found) < 2**16 else owner, kind="stable")
        sizes = np.bincount(owner, minlength=len(found))
        ends = np.cumsum(sizes)
        drawn = [np.sort(generator.choice(int(size), min(self.points, int(size)), replace=False)) for size in sizes]
        taken = np.array([len(chosen) for chosen in drawn], dtype=np.int64)
        places = np.concatenate([np.zeros(0, dtype=np.int64), *drawn]) + np.repeat(ends - sizes, taken)
        return pixels[order[places]], np.repeat(np.arange(len(found), dtype=np.int32), taken)
