"""Grasps from heights: where, and along which axis (paper, section 6)."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from pscover.errors import InvalidSettings
from pscover.execution.sight import Sight
from pscover.robot import Pose

FloatImage = NDArray[np.floating]


def check_radius(radius_cm: float) -> None:
    """Raise `InvalidSettings` unless a radius is a positive number of at most a metre."""
    if not 0 < radius_cm <= 100:
        raise InvalidSettings(f"radius_cm: expected a number above 0 and at most 100, got {radius_cm!r}")


def grasp_at_most(sight: Sight, score: FloatImage, radius: float) -> Pose | None:
    """The grasp at the free cloth pixel of the largest score, along the heights around it; None without such a pixel."""
    if not sight.free.any():
        return None
    y, x = np.unravel_index(int(np.where(sight.free, score, -np.inf).argmax()), score.shape)
    heights = np.where(sight.cloth, sight.heights, 0.0)
    return Pose(x=float(x), y=float(y), theta=major_axis(heights, float(x), float(y), radius))


def major_axis(heights: FloatImage, x: float, y: float, radius: float) -> float:
    """The direction in which the heights within a radius of a point spread most: the first principal axis.

    Parameters
    ----------
    heights
        Weights of the pixels, at least 0, shape (H, W).
    x, y, radius
        In pixels.

    Returns
    -------
    float
        Radians in [-pi/2, pi/2), from the x axis towards the y axis; 0 where no direction stands out.

    Examples
    --------
    >>> ridge = np.zeros((21, 21))
    >>> ridge[np.arange(21), np.arange(21)] = 1.0
    >>> round(math.degrees(major_axis(ridge, 10, 10, 8)))
    45
    """
    reach = math.ceil(radius)
    top, left = max(0, int(y) - reach), max(0, int(x) - reach)
    window = heights[top : int(y) + reach + 1, left : int(x) + reach + 1].astype(np.float64)
    rows, columns = np.indices(window.shape)
    dy, dx = rows + top - y, columns + left - x
    weight = np.where(dx**2 + dy**2 <= radius**2, window, 0.0)
    total = weight.sum()
    if total <= 0:
        return 0.0
    dx, dy = dx - (weight * dx).sum() / total, dy - (weight * dy).sum() / total
    xx, yy, xy = (float((weight * product).sum()) for product in (dx * dx, dy * dy, dx * dy))
    theta = 0.5 * math.atan2(2 * xy, xx - yy)
    return theta - math.pi if theta >= math.pi / 2 else theta


def disc_sums(heights: FloatImage, radius: float) -> NDArray[np.float64]:
    """The sum of the heights within a radius of each pixel, shape (H, W); beyond the edge they are 0."""
    from scipy.signal import oaconvolve

    reach = math.floor(radius)
    dy, dx = np.mgrid[-reach : reach + 1, -reach : reach + 1]
    disc = (dx**2 + dy**2 <= radius**2).astype(np.float64)
    sums: NDArray[np.float64] = oaconvolve(heights.astype(np.float64), disc, mode="same")
    return sums
