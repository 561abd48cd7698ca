"""Grasps whose points are close together exclude each other."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from pscover.cliques import Cliques, merge_edges
from pscover.errors import InvalidSettings
from pscover.grasping.sampling import Grasps


@dataclass(frozen=True, slots=True, kw_only=True)
class CloserThan:
    """Two grasps conflict when their points are at most so far apart.

    Parameters
    ----------
    pixels
        The distance. By default the length of the paper's gripper, at which two grasps of any orientation stay clear of
        each other.

    Raises
    ------
    InvalidSettings
        If the distance is negative or not finite.
    """

    pixels: float = 40.0

    def __post_init__(self) -> None:
        if not 0 <= self.pixels < math.inf:
            raise InvalidSettings(f"pixels: expected a distance of at least 0, got {self.pixels!r}")

    def cliques(self, grasps: Grasps, axes: tuple[float, float]) -> Cliques:
        """The close pairs, as cliques of points all close to each other.

        Examples
        --------
        >>> poses = np.array([[0.0, 0, 0], [3.0, 0, 0], [6.0, 0, 0]])
        >>> grasps = Grasps(poses=poses, part=np.arange(3, dtype=np.int32))
        >>> [clique.tolist() for clique in CloserThan(pixels=3).cliques(grasps, (40, 12))]
        [[0, 1], [1, 2]]
        """
        from scipy.spatial import cKDTree

        # Grasps at one point have the same neighbours: the cover is found among points, then each brings its grasps.
        points, point = np.unique(grasps.poses[:, :2], axis=0, return_inverse=True)
        point = point.ravel()
        if len(points) == 0:
            return Cliques.of()
        close = merge_edges(cKDTree(points).query_pairs(self.pixels, output_type="ndarray"))
        alone = np.setdiff1d(np.arange(len(points)), close.members)
        groups = [*close, *alone[:, None]]
        order = np.argsort(point, kind="stable")
        at = np.split(order, np.cumsum(np.bincount(point, minlength=len(points)))[:-1])
        members = [np.concatenate([at[p] for p in group]) for group in groups]
        return Cliques.of(clique for clique in members if len(clique) >= 2)
