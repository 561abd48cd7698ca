"""Merging of image regions, the most alike neighbours first.

Two regions are as different as the geometric mean of D, the distance of their mean features, and G, the mean height of the
step along the boundary they share. Shading over a fold has D but little G, a crease G but little D, a garment's edge both.
"""

from __future__ import annotations

import heapq
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from pscover.perception.colour import FloatImage

LabelImage = NDArray[np.int32]
FloatArray = NDArray[np.float64]


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Boundaries:
    """The boundaries between regions.

    Parameters
    ----------
    pairs
        Regions on either side, shape (boundaries, 2).
    length
        Pixel edges, shape (boundaries,).
    step
        Sum over those of the step's height, shape (boundaries,).
    """

    pairs: NDArray[np.int64]
    length: FloatArray
    step: FloatArray


def boundaries(regions: LabelImage, step: FloatImage) -> Boundaries:
    """The boundaries between regions other than 0; the height at a pixel edge is the mean of its two pixels'."""
    sides = (((slice(None), slice(None, -1)), (slice(None), slice(1, None))), ((slice(None, -1),), (slice(1, None),)))
    keys, heights = [], []
    base = int(regions.max(initial=0)) + 1
    for one, two in sides:
        a, b = regions[one], regions[two]
        edge = (a != b) & (a > 0) & (b > 0)
        a, b = a[edge].astype(np.int64), b[edge].astype(np.int64)
        keys.append(np.minimum(a, b) * base + np.maximum(a, b))
        heights.append((step[one][edge] + step[two][edge]) / 2)
    unique, back = np.unique(np.concatenate(keys), return_inverse=True)
    return Boundaries(
        pairs=np.stack([unique // base, unique % base], axis=1),
        length=np.bincount(back, minlength=len(unique)).astype(float),
        step=np.bincount(back, np.concatenate(heights), minlength=len(unique)).astype(float),
    )


def merge(regions: LabelImage, features: FloatImage, step: FloatImage, limit: float, small: float = 0.0) -> LabelImage:
    """Merge neighbours until the two most alike are `limit` apart.

    Parameters
    ----------
    regions
        0 is no region, shape (H, W).
    features
        What is compared, shape (H, W, channels).
    step
        How high the step in the features is at each pixel, shape (H, W).
    limit
        Where to stop, in units of the features.
    small
        Area in pixels below which regions merge more readily: the difference of two regions is multiplied by the fourth
        root of the smaller one's area over `small`. A scrap rarely is a garment.

    Returns
    -------
    LabelImage
        Each region carries the number of one of those that were merged into it, shape (H, W).

    Examples
    --------
    >>> regions = np.array([[1, 2, 3]], dtype=np.int32)
    >>> features = np.array([[[0.0], [1.0], [9.0]]], dtype=np.float32)
    >>> merge(regions, features, np.ones((1, 3), dtype=np.float32), limit=2.0).tolist()
    [[2, 2, 3]]
    """
    count = int(regions.max(initial=0)) + 1
    flat = regions.ravel()
    area = np.bincount(flat, minlength=count).astype(float)
    channels = features.reshape(-1, features.shape[2])
    total = np.stack([np.bincount(flat, channel, minlength=count) for channel in channels.T], axis=1)
    graph = _Graph(area.tolist(), list(total), boundaries(regions, step), small)
    return graph.merged(limit)[regions].astype(np.int32)


class _Graph:
    """Regions and boundaries while they are being merged; a heap entry is stale once either side has changed."""

    __slots__ = ("_area", "_changes", "_heap", "_into", "_near", "_small", "_total")

    def __init__(self, area: list[float], total: list[FloatArray], between: Boundaries, small: float) -> None:
        self._area, self._total, self._small = area, total, small
        self._near: list[dict[int, tuple[float, float]]] = [{} for _ in area]
        self._changes = [0] * len(area)
        self._into = list(range(len(area)))
        for (a, b), length, step in zip(between.pairs.tolist(), between.length.tolist(), between.step.tolist(), strict=True):
            self._near[a][b] = self._near[b][a] = (length, step)
        self._heap = [self._entry(a, b) for a, b in between.pairs.tolist()]
        heapq.heapify(self._heap)

    def merged(self, limit: float) -> NDArray[np.int64]:
        """Which region each one ends up in."""
        while self._heap and self._heap[0][0] < limit:
            _, a, b, stamp = heapq.heappop(self._heap)
            if stamp == self._changes[a] + self._changes[b] and b in self._near[a]:
                self._join(a, b)
        return np.array([self._root(k) for k in range(len(self._into))])

    def _entry(self, a: int, b: int) -> tuple[float, int, int, int]:
        length, step = self._near[a][b]
        difference = self._total[a] / self._area[a] - self._total[b] / self._area[b]
        square = float(difference @ difference)
        size = min(self._area[a], self._area[b])
        ease = (size / self._small) ** 0.25 if size < self._small else 1.0
        return ease * (square**0.5 * step / length) ** 0.5, a, b, self._changes[a] + self._changes[b]

    def _join(self, a: int, b: int) -> None:
        if len(self._near[a]) < len(self._near[b]):
            a, b = b, a
        self._area[a] += self._area[b]
        self._total[a] = self._total[a] + self._total[b]
        self._into[b] = a
        for c, (length, step) in self._near[b].items():
            del self._near[c][b]
            if c != a:
                before = self._near[a].get(c, (0.0, 0.0))
                self._near[a][c] = self._near[c][a] = (before[0] + length, before[1] + step)
        self._near[b] = {}
        self._changes[a] += 1
        for c in self._near[a]:
            heapq.heappush(self._heap, self._entry(min(a, c), max(a, c)))

    def _root(self, k: int) -> int:
        while self._into[k] != k:
            self._into[k] = self._into[self._into[k]]
            k = self._into[k]
        return k
