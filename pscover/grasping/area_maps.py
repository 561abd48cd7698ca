"""How many pixels of a garment lie under the gripper, for every pose on the grid at once.

An ellipse on the pixel grid is a stack of runs, one a row (or one a column, where these are fewer). With running sums along
them, the pixels of a garment under the ellipse are a difference of two look-ups a run, for all points of a window together.
This is the convolution of the garment's mask with the ellipse in whole numbers, so that nothing is rounded: the running sums
may wrap around, their differences do not, for no ellipse has as many pixels as the numbers have values.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pscover.grasping.ellipse import Ellipse
from pscover.scene import Scene

FloatArray = NDArray[np.float64]
Run = tuple[int, int, int]
"""Line, first and last place of consecutive pixels."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class AreaMap:
    """The areas of one garment under the ellipse, around the garment; elsewhere they are 0.

    Parameters
    ----------
    garment
        Its index in the scene.
    top, left
        The image's pixel at which the window begins.
    areas
        Pixels of the garment under the ellipse at each orientation and point, shape (orientations, height, width), whole
        numbers without sign.
    """

    garment: int
    top: int
    left: int
    areas: NDArray[Any]

    def at(self, angle: int, y: NDArray[np.intp], x: NDArray[np.intp]) -> NDArray[Any]:
        """The areas at pixels of the image, inside the window or not."""
        y, x = y - self.top, x - self.left
        _, height, width = self.areas.shape
        inside = (y >= 0) & (y < height) & (x >= 0) & (x < width)
        if inside.all():
            found: NDArray[Any] = self.areas[angle, y, x]
            return found
        found = np.zeros(len(y), dtype=self.areas.dtype)
        found[inside] = self.areas[angle, y[inside], x[inside]]
        return found


def area_maps(scene: Scene, ellipse: Ellipse, angles: FloatArray) -> Iterator[AreaMap]:
    """The area map of each garment, in their order.

    Parameters
    ----------
    scene
        What lies on the surface.
    ellipse
        The gripper's footprint.
    angles
        Orientations in radians, shape (orientations,).

    Yields
    ------
    AreaMap
        With exactly the areas that `Ellipse.areas` counts at whole pixels.

    Notes
    -----
    The work is proportional to the areas of the garments' bounding boxes, each widened by half the ellipse, times the
    number of runs of all orientations.

    Examples
    --------
    >>> scene = Scene.of([[0, 1, 1, 0]])
    >>> [found] = area_maps(scene, Ellipse(major=2, minor=1), np.array([0.0, np.pi / 2]))
    >>> found.areas[:, 0, :].tolist()
    [[1, 2, 2, 1], [0, 1, 1, 0]]
    """
    from scipy import ndimage

    patterns = [ellipse.offsets(float(angle)) for angle in angles]
    reach = max((int(max(np.abs(dx).max(), np.abs(dy).max())) for dx, dy in patterns if len(dx)), default=0)
    kind = np.uint16 if max((len(dx) for dx, _ in patterns), default=0) < 2**16 else np.uint32
    footprints = [_footprint(dx, dy) for dx, dy in patterns]
    boxes = ndimage.find_objects(scene.segments + 1, max_label=scene.garments)
    height, width = scene.shape
    for garment, (rows, columns) in enumerate(boxes):
        top, bottom = max(0, rows.start - reach), min(height, rows.stop + reach)
        left, right = max(0, columns.start - reach), min(width, columns.stop + reach)
        mask = np.pad(scene.segments[top:bottom, left:right] == garment, reach)
        along_rows, along_columns = _running(mask, kind), _running(np.ascontiguousarray(mask.T), kind)
        areas = np.zeros((len(angles), bottom - top, right - left), dtype=kind)
        for found, (runs, is_turned) in zip(areas, footprints, strict=True):
            _add_runs(found.T if is_turned else found, along_columns if is_turned else along_rows, runs, reach)
        yield AreaMap(garment=garment, top=top, left=left, areas=areas)


def _footprint(dx: NDArray[np.int64], dy: NDArray[np.int64]) -> tuple[list[Run], bool]:
    """The pattern as runs, and whether they run down columns."""
    by_row, by_column = _runs(dy, dx), _runs(dx, dy)
    return (by_column, True) if len(by_column) < len(by_row) else (by_row, False)


def _runs(line: NDArray[np.int64], place: NDArray[np.int64]) -> list[Run]:
    order = np.lexsort((place, line))
    line, place = line[order], place[order]
    ends = np.flatnonzero((np.diff(line) != 0) | (np.diff(place) != 1))
    first = np.concatenate(([0], ends + 1))[: len(line)]
    last = np.concatenate((ends, [len(line) - 1]))[: len(line)]
    return [(int(line[a]), int(place[a]), int(place[b])) for a, b in zip(first, last, strict=True)]


def _running(mask: NDArray[np.bool_], kind: type[np.unsignedinteger[Any]]) -> NDArray[Any]:
    """Sums along the second axis before each place."""
    sums = np.zeros((mask.shape[0], mask.shape[1] + 1), dtype=kind)
    np.cumsum(mask, axis=1, dtype=kind, out=sums[:, 1:])
    return sums


def _add_runs(areas: NDArray[Any], sums: NDArray[Any], runs: list[Run], reach: int) -> None:
    """Add, at every point of the window, the pixels of all runs; `sums` are those of the window widened by `reach`."""
    height, width = areas.shape
    for line, first, last in runs:
        rows = sums[reach + line : reach + line + height]
        areas += rows[:, reach + last + 1 : reach + last + 1 + width]
        areas -= rows[:, reach + first : reach + first + width]
