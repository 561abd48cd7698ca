"""The partition of the garment pixels by which garments are within the gripper's reach (paper, section 4).

S(x, y) is the set of garments with a pixel within distance r of (x, y); pixels with equal S form one part. The parts are
found exactly by refinement: start with one part, and split every part by "within reach of garment j or not", one garment
after the other, each in its own window of the image. A disc is a union of centred rectangles, and whether a rectangle
around a pixel meets a garment is four look-ups in the garment's summed-area table.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from pscover.scene import Scene


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Partition:
    """Garment pixels grouped by the garments within reach.

    Parameters
    ----------
    parts
        The number of the part at each pixel, shape (H, W); -1 on the surface. Numbered in the order in which the parts
        are met row by row.
    reached
        For each part, the garments within reach of its pixels, ascending.
    """

    parts: NDArray[np.int32]
    reached: tuple[tuple[int, ...], ...]

    def __len__(self) -> int:
        return len(self.reached)


def partition(scene: Scene, reach: float = 20.0) -> Partition:
    """Group the garment pixels of a scene by the set of garments within reach.

    Parameters
    ----------
    scene
        What lies on the surface.
    reach
        r in pixels, Euclidean, inclusive; the paper's gripper has 20 pixels (4.25 cm).

    Returns
    -------
    Partition

    Notes
    -----
    The work is proportional to the summed areas of the garments' bounding boxes, each widened by r, times the number of
    distinct row lengths of the disc (14 for r = 20).

    Examples
    --------
    >>> scene = Scene.of([[1, 1, 1, 0, 2]])
    >>> found = partition(scene, reach=2)
    >>> found.parts.tolist(), found.reached
    ([[0, 0, 1, -1, 1]], ((0,), (0, 1)))
    """
    margin = int(reach)
    rectangles = _rectangles(reach)
    height, width = scene.shape
    parts = np.where(scene.segments >= 0, 0, -1).astype(np.int32)
    refined = _Refinement()
    # SciPy's image functions take longer to import than many a scene to plan: only when there is one.
    from scipy import ndimage

    boxes = ndimage.find_objects(scene.segments + 1, max_label=scene.garments)
    for j, (rows, columns) in enumerate(boxes):
        top, bottom = max(0, rows.start - margin), min(height, rows.stop + margin)
        left, right = max(0, columns.start - margin), min(width, columns.stop + margin)
        window = np.s_[top:bottom, left:right]
        near = _dilate(scene.segments[window] == j, rectangles)
        near &= scene.segments[window] >= 0
        local = parts[window]
        local[near] = refined.split(local[near], j)
    return _numbered(parts, refined)


class _Refinement:
    """The tree of parts: each was split off a parent because one more garment is within reach."""

    def __init__(self) -> None:
        self.parent: list[int] = [-1]
        self.garment: list[int] = [-1]

    def split(self, parts: NDArray[np.int32], garment: int) -> NDArray[np.int32]:
        """New numbers for pixels that `garment` is within reach of; equal before is equal after."""
        count = len(self.parent)
        present = np.zeros(count, dtype=np.bool_)
        present[parts] = True
        old = np.flatnonzero(present)
        fresh = np.zeros(count, dtype=np.int32)
        fresh[old] = count + np.arange(len(old))
        self.parent.extend(old.tolist())
        self.garment.extend([garment] * len(old))
        return fresh[parts]

    def reached(self, part: int) -> tuple[int, ...]:
        """The garments within reach of a part, ascending."""
        found = []
        while part > 0:
            found.append(self.garment[part])
            part = self.parent[part]
        return tuple(reversed(found))


def _numbered(parts: NDArray[np.int32], refined: _Refinement) -> Partition:
    """The parts that are left, renumbered in the order in which they are met row by row."""
    flat = parts.ravel()
    pixels = np.flatnonzero(flat >= 0)
    first = np.full(len(refined.parent), len(flat), dtype=np.int64)
    # Written backwards, so that the first pixel of each part has the last word.
    first[flat[pixels[::-1]]] = pixels[::-1]
    left = np.flatnonzero(first < len(flat))
    left = left[np.argsort(first[left], kind="stable")]
    table = np.full(len(refined.parent) + 1, -1, dtype=np.int32)
    table[left] = np.arange(len(left))
    numbered = table[parts]
    numbered.setflags(write=False)
    return Partition(parts=numbered, reached=tuple(refined.reached(int(part)) for part in left))


def _rectangles(reach: float) -> list[tuple[int, int]]:
    """Half heights and half widths of the centred rectangles whose union is the disc's pixels."""
    tallest: dict[int, int] = {}
    for dy in range(int(reach) + 1):
        tallest[math.isqrt(int(reach * reach - dy * dy))] = dy
    return [(dy, dx) for dx, dy in tallest.items()]


def _dilate(mask: NDArray[np.bool_], rectangles: list[tuple[int, int]]) -> NDArray[np.bool_]:
    """Pixels whose disc meets the mask."""
    height, width = mask.shape
    margin = max(max(rectangle) for rectangle in rectangles)
    table = np.zeros((height + 2 * margin + 1, width + 2 * margin + 1), dtype=np.int32)
    inner = table[margin + 1 : margin + 1 + height, margin + 1 : margin + 1 + width]
    np.cumsum(np.cumsum(mask, axis=0, dtype=np.int32), axis=1, out=inner)
    table[margin + 1 : margin + 1 + height, margin + 1 + width :] = inner[:, -1:]
    table[margin + 1 + height :] = table[margin + height]
    near = np.zeros(mask.shape, dtype=np.bool_)
    for dy, dx in rectangles:
        top = table[margin - dy : margin - dy + height]
        bottom = table[margin + 1 + dy : margin + 1 + dy + height]
        left, right = slice(margin - dx, margin - dx + width), slice(margin + 1 + dx, margin + 1 + dx + width)
        near |= bottom[:, right] - bottom[:, left] != top[:, right] - top[:, left]
    return near
