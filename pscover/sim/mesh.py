"""Flat outlines as triangles about as wide as the spacing of the particles, and the smooth surface that they stand for."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import coo_array, csr_array
from scipy.spatial import Delaunay

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.int32]


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Mesh:
    """Triangles in the plane.

    Parameters
    ----------
    corners
        Shape (corners, 2), metres.
    triangles
        Shape (triangles, 3), all with the same sense of rotation.
    """

    corners: FloatArray
    triangles: IntArray

    @property
    def sides(self) -> tuple[IntArray, IntArray]:
        """Each side once, and the corners opposite to it, -1 where there is no second; both of shape (sides, 2)."""
        t = self.triangles
        ends = np.sort(np.concatenate((t[:, [0, 1]], t[:, [1, 2]], t[:, [2, 0]])), axis=1)
        apex = np.concatenate((t[:, 2], t[:, 0], t[:, 1]))
        order = np.lexsort((ends[:, 1], ends[:, 0]))
        ends, apex = ends[order], apex[order]
        first = np.ones(len(ends), dtype=np.bool_)
        first[1:] = (ends[1:] != ends[:-1]).any(axis=1)
        at = np.flatnonzero(first)
        opposite = np.full((len(at), 2), -1, dtype=np.int32)
        opposite[:, 0] = apex[at]
        twice = np.diff(np.append(at, len(ends))) == 2
        opposite[twice, 1] = apex[at[twice] + 1]
        return ends[at].astype(np.int32), opposite


def triangulated(outline: FloatArray, spacing: float) -> Mesh:
    """A mesh of an outline: its boundary in steps of about `spacing`, a hexagonal grid inside.

    Examples
    --------
    >>> mesh = triangulated(np.array([[0, 0], [0.1, 0], [0.1, 0.2], [0, 0.2]]), 0.02)
    >>> ends, opposite = mesh.sides
    >>> lengths = np.linalg.norm(np.diff(mesh.corners[ends], axis=1), axis=2)
    >>> bool(0.008 < lengths.min() < lengths.max() < 0.04)
    True
    """
    rim = _rim(outline, spacing)
    points = np.concatenate((rim, _grid(outline, spacing)))
    triangles = Delaunay(points).simplices
    area = _twice_area(points[triangles]) / 2
    kept = inside(outline, points[triangles].mean(axis=1)) & (np.abs(area) > 0.02 * spacing**2)
    triangles = np.where((area < 0)[:, None], triangles[:, ::-1], triangles)[kept]
    used, index = np.unique(triangles, return_inverse=True)
    return Mesh(corners=points[used], triangles=index.reshape(triangles.shape).astype(np.int32))


def _rim(outline: FloatArray, spacing: float) -> FloatArray:
    following = np.roll(outline, -1, axis=0)
    steps = np.maximum(1, np.round(np.linalg.norm(following - outline, axis=1) / spacing)).astype(int)
    parts = [a + (b - a) * (np.arange(n) / n)[:, None] for a, b, n in zip(outline, following, steps, strict=True)]
    kept: list[FloatArray] = []
    for point in np.concatenate(parts):
        if not kept or np.linalg.norm(np.array(kept) - point, axis=1).min() > 0.5 * spacing:
            kept.append(point)
    return np.array(kept)


def _grid(outline: FloatArray, spacing: float) -> FloatArray:
    low, high = outline.min(axis=0) - spacing, outline.max(axis=0) + spacing
    rows = np.arange(low[1], high[1], spacing * np.sqrt(3) / 2)
    columns = np.arange(low[0], high[0], spacing)
    x = columns[None, :] + (np.arange(len(rows)) % 2)[:, None] * spacing / 2
    points = np.column_stack((x.ravel(), np.repeat(rows, len(columns))))
    points = points[inside(outline, points)]
    return points[distance(outline, points) > 0.55 * spacing]


def _twice_area(corners: FloatArray) -> FloatArray:
    a, b = corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]
    return a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0]


def inside(outline: FloatArray, points: FloatArray) -> NDArray[np.bool_]:
    """Which points lie in a closed polygon, shape (points,)."""
    x, y = points[:, 0], points[:, 1]
    result = np.zeros(len(points), dtype=np.bool_)
    for (ax, ay), (bx, by) in zip(outline, np.roll(outline, 1, axis=0), strict=True):
        if ay != by:
            result ^= ((ay > y) != (by > y)) & (x < (bx - ax) * (y - ay) / (by - ay) + ax)
    return result


def distance(outline: FloatArray, points: FloatArray) -> FloatArray:
    """How far each point lies from a closed polygon's line, shape (points,)."""
    result = np.full(len(points), np.inf)
    for a, b in zip(np.roll(outline, 1, axis=0), outline, strict=True):
        along = np.clip((points - a) @ (b - a) / max(1e-12, float((b - a) @ (b - a))), 0, 1)
        result = np.minimum(result, np.linalg.norm(points - a - along[:, None] * (b - a), axis=1))
    return result


def area(outline: FloatArray) -> float:
    """Of a closed polygon."""
    x, y = outline.T
    return float(abs(x @ np.roll(y, 1) - y @ np.roll(x, 1)) / 2)


def smoothed(mesh: Mesh) -> tuple[csr_array, IntArray]:
    """One step of Loop's subdivision: four triangles for each, rounded as cloth is.

    Returns
    -------
    weights, triangles
        The new corners are `weights @ corners`, for any quantity known at the corners; shape (new, old).

    Source: C. Loop, "Smooth subdivision surfaces based on triangles", 1987, with the boundary rules of cubic splines.
    """
    n = len(mesh.corners)
    ends, opposite = mesh.sides
    border = opposite[:, 1] < 0
    m = len(ends)
    new = n + np.arange(m)
    inner = ~border
    entries: list[tuple[NDArray[np.integer], NDArray[np.integer], FloatArray]] = [
        (new[border].repeat(2), ends[border].ravel(), np.full(2 * border.sum(), 0.5)),
        (new[inner].repeat(2), ends[inner].ravel(), np.full(2 * inner.sum(), 3 / 8)),
        (new[inner].repeat(2), opposite[inner].ravel(), np.full(2 * inner.sum(), 1 / 8)),
    ]
    on_rim = np.zeros(n, dtype=np.bool_)
    on_rim[ends[border]] = True
    degree = np.bincount(ends.ravel(), minlength=n)
    # Warren's weights.
    part = np.where(on_rim, 1 / 8, np.where(degree == 3, 3 / 16, 3 / (8 * np.maximum(degree, 1))))
    for at, to in (ends.T, ends.T[::-1]):
        counts = ~on_rim[at] | border
        entries.append((at[counts], to[counts], part[at[counts]]))
    taken = np.zeros(n)
    for at, _, weight in entries[3:]:
        np.add.at(taken, at, weight)
    entries.append((np.arange(n), np.arange(n), 1 - taken))
    rows, columns, weights = (np.concatenate(column) for column in zip(*entries, strict=True))
    matrix = csr_array(coo_array((weights, (rows, columns)), shape=(n + m, n)))
    key = ends[:, 0].astype(np.int64) * n + ends[:, 1]
    t = mesh.triangles

    def middle(a: IntArray, b: IntArray) -> IntArray:
        low, high = np.minimum(a, b).astype(np.int64), np.maximum(a, b)
        return (n + np.searchsorted(key, low * n + high)).astype(np.int32)

    ab, bc, ca = middle(t[:, 0], t[:, 1]), middle(t[:, 1], t[:, 2]), middle(t[:, 2], t[:, 0])
    a, b, c = t.T
    quarters = [(a, ab, ca), (ab, b, bc), (ca, bc, c), (ab, bc, ca)]
    return matrix, np.concatenate([np.column_stack(q) for q in quarters]).astype(np.int32)
