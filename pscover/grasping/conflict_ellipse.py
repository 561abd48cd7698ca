"""Grasps whose footprints overlap exclude each other."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from pscover.cliques import Cliques, merge_edges
from pscover.errors import InvalidSettings, MissingDependency
from pscover.grasping.sampling import Grasps

BLOCK = 1000
PAIR_LIMIT = 2_000_000
"""More overlapping pairs than this are refused: no engine solves models of so many conflicts."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Overlapping:
    """Two grasps conflict when the ellipses under the gripper overlap.

    Parameters
    ----------
    corners
        Each ellipse is tested as the inscribed polygon of so many corners; 32 make its area 0.6 % smaller.

    Raises
    ------
    InvalidSettings
        If there are fewer than 8 corners.
    """

    corners: int = 32

    def __post_init__(self) -> None:
        if self.corners < 8:
            raise InvalidSettings(f"corners: expected a whole number of at least 8, got {self.corners!r}")

    def cliques(self, grasps: Grasps, axes: tuple[float, float]) -> Cliques:
        """The overlapping pairs, as cliques of ellipses that all overlap each other.

        Raises
        ------
        MissingDependency
            Without Shapely.
        InvalidSettings
            If more than `PAIR_LIMIT` pairs overlap.

        Examples
        --------
        >>> poses = np.array([[0.0, 0, 0], [0.0, 11, 0], [0.0, 24, 0]])
        >>> grasps = Grasps(poses=poses, part=np.arange(3, dtype=np.int32))
        >>> [clique.tolist() for clique in Overlapping().cliques(grasps, (40, 12))]
        [[0, 1]]
        """
        try:
            import shapely
        except ImportError:
            raise MissingDependency.for_extra("conflict rule 'ellipse'", ["shapely"], "geometry") from None
        if len(grasps) == 0:
            return Cliques.of()
        shapes = shapely.polygons(outlines(grasps.poses, axes, self.corners))
        tree = shapely.STRtree(shapes)
        # Ellipses whose centres are a minor axis apart overlap for sure: too many are known before any is compared.
        from scipy.spatial import cKDTree

        centres = cKDTree(grasps.poses[:, :2])
        _check_count((int(centres.count_neighbors(centres, min(axes))) - len(shapes)) // 2, len(shapes))
        found = [np.zeros((0, 2), dtype=np.int32)]
        for start in range(0, len(shapes), BLOCK):
            first, second = tree.query(shapes[start : start + BLOCK], predicate="intersects")
            once = first + start < second
            found.append(np.column_stack((first[once] + start, second[once])).astype(np.int32))
            _check_count(sum(map(len, found)), len(shapes))
        return merge_edges(np.concatenate(found))


def _check_count(pairs: int, grasps: int) -> None:
    if pairs > PAIR_LIMIT:
        raise InvalidSettings(
            f"conflict rule 'ellipse': expected at most {PAIR_LIMIT} overlapping pairs, got more among {grasps} grasps; "
            "draw fewer points or orientations, or use the rule 'partition' or 'distance'"
        )


def outlines(poses: NDArray[np.float64], axes: tuple[float, float], corners: int) -> NDArray[np.float64]:
    """Polygons inscribed in the ellipses of grasps, shape (grasps, corners, 2), x and y in pixels.

    Examples
    --------
    >>> outlines(np.array([[10.0, 5.0, np.pi / 2]]), (4, 2), 4).round(9).tolist()
    [[[10.0, 7.0], [9.0, 5.0], [10.0, 3.0], [11.0, 5.0]]]
    """
    turn = 2 * np.pi * np.arange(corners) / corners
    along, across = axes[0] / 2 * np.cos(turn), axes[1] / 2 * np.sin(turn)
    cos, sin = np.cos(poses[:, 2:]), np.sin(poses[:, 2:])
    x = poses[:, :1] + along * cos - across * sin
    y = poses[:, 1:2] + along * sin + across * cos
    return np.stack((x, y), axis=2)
