"""What else than the area under the gripper may tell whether a grasp removes a garment."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csc_array

from pscover.scene import Scene

FloatArray = NDArray[np.float64]
FEATURES = ("log area under the gripper", "log garment area", "garments seen", "distance to edge", "height")
"""In this order: the first two of cm2; how many garments lie under the gripper; how far in cm the point lies within the
garment, negative outside; metres above the table at the point, NaN where nothing is known."""


def features(scene: Scene, poses: FloatArray, areas: csc_array, heights: NDArray[np.floating] | None) -> FloatArray:
    """The features of each pair of a grasp and a garment under it.

    Parameters
    ----------
    scene
        What lies on the surface.
    poses
        x and y in pixels, theta, shape (grasps, 3).
    areas
        Pixels of each garment under each grasp, shape (garments, grasps): its stored entries are the pairs.
    heights
        Metres above the table, of the scene's shape, or None.

    Returns
    -------
    FloatArray
        In the order of the entries of `areas`, shape (pairs, len(FEATURES)).

    Examples
    --------
    >>> from pscover.grasping.ellipse import Ellipse
    >>> scene, poses = Scene.of(np.ones((47, 94), dtype=int)), np.array([[47.0, 23, 0.0]])
    >>> features(scene, poses, Ellipse().areas(scene, poses), None).round(2).tolist()
    [[2.82, 5.3, 1.0, 5.11, nan]]
    """
    scale = scene.pixels_per_cm
    seen = np.diff(areas.indptr)
    grasp, garment = np.repeat(np.arange(len(poses)), seen), areas.indices
    height, width = scene.shape
    x = np.clip(np.round(poses[:, 0]), 0, width - 1).astype(np.intp)
    y = np.clip(np.round(poses[:, 1]), 0, height - 1).astype(np.intp)
    metres = np.full(len(poses), math.nan) if heights is None else heights[y, x].astype(np.float64)
    return np.column_stack(
        (
            np.log(areas.data / scale**2),
            np.log(scene.areas()[garment] / scale**2),
            seen[grasp].astype(np.float64),
            _depths(scene, x[grasp], y[grasp], garment) / scale,
            metres[grasp],
        )
    ).reshape(-1, len(FEATURES))


def _depths(scene: Scene, x: NDArray[np.intp], y: NDArray[np.intp], garment: NDArray[np.integer]) -> FloatArray:
    """How far each point lies within a garment, in pixels; negative outside."""
    from scipy.ndimage import distance_transform_edt, find_objects

    depths = np.zeros(len(x))
    boxes = find_objects(scene.segments + 1)
    for j in np.unique(garment):
        pairs = np.flatnonzero(garment == j)
        row, column = y[pairs], x[pairs]
        # The garment and the points are all that matters. One pixel around them: the garment ends at the image's edge.
        top, left = min(boxes[j][0].start, row.min()), min(boxes[j][1].start, column.min())
        bottom, right = max(boxes[j][0].stop, row.max() + 1), max(boxes[j][1].stop, column.max() + 1)
        mask = np.pad(scene.segments[top:bottom, left:right] == j, 1)
        inside, outside = distance_transform_edt(mask), distance_transform_edt(~mask)
        row, column = row - top + 1, column - left + 1
        depths[pairs] = inside[row, column] - outside[row, column]
    return depths
