"""The paper's analytic predictor: the more of a garment lies under the gripper, the surer it is removed (section 4)."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csc_array

from pscover.errors import InvalidSettings
from pscover.scene import Scene

FloatArray = NDArray[np.float64]
LOOKUPS = 2**21
"""Pixels looked up, and counters held, at a time: bounds the memory whatever the number of grasps and garments."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Ellipse:
    """p = a / (a + b), where a is how many of the garment's pixels lie in the ellipse under the gripper.

    Parameters
    ----------
    major
        d1, axis along theta in pixels: the length of the jaw.
    minor
        d2, axis across theta in pixels: its width.
    half
        b, the area in pixels at which the probability is one half.

    Raises
    ------
    InvalidSettings
        If a number is not positive, or an axis is beyond 2000 pixels.
    """

    major: float = 40.0
    minor: float = 12.0
    half: float = 100.0

    def __post_init__(self) -> None:
        for name, value, most in (("major", self.major, 2000), ("minor", self.minor, 2000), ("half", self.half, math.inf)):
            if not 0 < value <= most or math.isinf(value):
                raise InvalidSettings(f"{name}: expected a positive number of pixels, at most {most}, got {value!r}")

    @property
    def axes(self) -> tuple[float, float]:
        """Length along theta and width across it, in pixels."""
        return self.major, self.minor

    def probability(self, scene: Scene, poses: FloatArray) -> csc_array:
        """p_ij of each grasp for each garment, shape (garments, grasps); a pixel outside the image counts nothing.

        Parameters
        ----------
        scene
            What lies on the surface.
        poses
            x and y in pixels, theta in radians, shape (grasps, 3).

        Returns
        -------
        csc_array
            What is not stored is 0: no pixel of that garment is under the ellipse.

        Examples
        --------
        >>> scene = Scene.of(np.ones((50, 50), dtype=int))
        >>> p = Ellipse(major=10, minor=10, half=81).probability(scene, np.array([[25.0, 25.0, 0.0], [0.0, 0.0, 0.0]]))
        >>> p.toarray().round(3).tolist()
        [[0.5, 0.243]]
        """
        poses = np.asarray(poses, dtype=np.float64).reshape(-1, 3)
        areas = self.areas(scene, poses)
        return csc_array((areas.data / (areas.data + self.half), areas.indices, areas.indptr), shape=areas.shape)

    def areas(self, scene: Scene, poses: FloatArray) -> csc_array:
        """How many pixels of each garment lie under each grasp's ellipse, shape (garments, grasps)."""
        rows, columns, counts = [], [], []
        margin = math.ceil(max(self.axes) / 2) + 1
        padded = np.pad(scene.segments, margin, constant_values=-1)
        corner = np.floor(poses[:, :2])
        # Grasps that differ by whole pixels see the same pattern of offsets.
        pattern = np.column_stack((poses[:, 2], poses[:, :2] - corner))
        kinds, kind = np.unique(pattern, axis=0, return_inverse=True)
        order = np.argsort(kind.ravel(), kind="stable")
        for which, members in zip(kinds, np.split(order, np.cumsum(np.bincount(kind.ravel()))[:-1]), strict=False):
            dx, dy = self.offsets(*which)
            for block in _blocks(members, max(len(dx), scene.garments + 1)):
                found = _count(padded, corner[block].astype(np.int64) + margin, dx, dy, scene.garments)
                here, garment = np.nonzero(found)
                rows.append(garment)
                columns.append(block[here])
                counts.append(found[here, garment])
        shape = (scene.garments, len(poses))
        if not rows:
            return csc_array(shape, dtype=np.float64)
        data = np.concatenate(counts).astype(np.float64)
        return csc_array((data, (np.concatenate(rows), np.concatenate(columns))), shape=shape)

    def offsets(self, theta: float, x: float = 0.0, y: float = 0.0) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
        """Pixels whose centres lie in the ellipse around (x, y), as columns and rows; the rim belongs to it."""
        reach = math.ceil(max(self.axes) / 2)
        dy, dx = np.mgrid[-reach : reach + 2, -reach : reach + 2]
        along = (dx - x) * math.cos(theta) + (dy - y) * math.sin(theta)
        across = (dy - y) * math.cos(theta) - (dx - x) * math.sin(theta)
        # A hair of slack, so that rounding of the angle does not decide whether a pixel on the rim counts.
        inside = (2 * along / self.major) ** 2 + (2 * across / self.minor) ** 2 <= 1 + 1e-9
        return dx[inside], dy[inside]


def _blocks(members: NDArray[np.intp], each: int) -> list[NDArray[np.intp]]:
    size = max(1, LOOKUPS // each)
    return [members[start : start + size] for start in range(0, len(members), size)]


def _count(
    padded: NDArray[np.int32], points: NDArray[np.int64], dx: NDArray[np.int64], dy: NDArray[np.int64], garments: int
) -> NDArray[np.int64]:
    """Pixels of each garment at the offsets around each point, shape (points, garments)."""
    height, width = padded.shape
    # Points that lie off the image by more than the ellipse see nothing, wherever exactly they lie.
    off = ((points < 0) | (points >= (width, height))).any(axis=1)
    start = np.where(off, 0, points[:, 1] * width + points[:, 0])
    places = start[:, None] + (dy * width + dx)[None, :]
    np.clip(places, 0, padded.size - 1, out=places)
    keys = padded.ravel()[places].astype(np.int64)
    keys += 1 + (garments + 1) * np.arange(len(points))[:, None]
    counted = np.bincount(keys.ravel(), minlength=len(points) * (garments + 1)).reshape(len(points), garments + 1)
    counted[off] = 0
    return counted[:, 1:]
