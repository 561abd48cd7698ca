"""Soft light on a heap of cloth: a lamp that throws shadows, and a sky that hardly reaches into folds."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from scipy.ndimage import gaussian_filter

from pscover.engine.jit import kernel
from pscover.sim.cloth import FloatArray

CELL = 0.003
"""Metres of a cell of the height map."""
LAMP = (-0.42, -0.36, 0.83)
"""Direction towards the lamp, of unit length nearly: from the upper left of the image."""
SOFT = 0.012
"""Metres by which the edge of a shadow is blurred."""


class Light(NamedTuple):
    """What reaches each place of the table from above.

    Parameters
    ----------
    height
        Of the uppermost cloth, metres, shape (rows, columns) in cells of `CELL`.
    sky, lamp
        Parts of the light of sky and lamp that arrive, in [0, 1].
    towards
        Direction to the lamp, shape (3,).
    """

    height: FloatArray
    sky: FloatArray
    lamp: FloatArray
    towards: FloatArray


def light(height: FloatArray) -> Light:
    """The light on a height map."""
    towards = np.array(LAMP) / np.linalg.norm(LAMP)
    sky = np.zeros_like(height)
    for cells in (1.2, 3.0, 8.0):
        sky += np.maximum(0.0, gaussian_filter(height, cells, mode="nearest") - height) / (cells * CELL)
    lamp = np.empty_like(height)
    _shadows(height, towards, lamp)
    return Light(height, np.exp(-1.1 * sky), gaussian_filter(lamp, 1.0, mode="nearest"), towards)


@kernel
def _shadows(height: FloatArray, towards: FloatArray, out: FloatArray) -> None:
    """March from each cell towards the lamp."""
    rows, columns = height.shape
    level = math.sqrt(towards[0] ** 2 + towards[1] ** 2)
    dx, dy, rise = towards[0] / level, towards[1] / level, towards[2] / level
    for row in range(rows):
        for column in range(columns):
            most = 0.0
            for k in range(1, 22):
                way = 1.6 * k
                x, y = int(column + dx * way + 0.5), int(row + dy * way + 0.5)
                if x < 0 or y < 0 or x >= columns or y >= rows:
                    break
                above = height[y, x] - height[row, column] - rise * way * CELL
                most = max(most, above / (SOFT * (0.4 + 0.05 * k)))
            out[row, column] = 1.0 - min(1.0, most)
