"""Outlines of garments lying flat, in centimetres, and how they are painted into pixels."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

FloatArray = NDArray[np.float64]
Mask = NDArray[np.bool_]

TSHIRT = ((0, -28), (22, -28), (22, 11), (32, 8), (36, 19), (19, 27), (9, 28), (6, 23), (0, 22))
SHORTS = ((0, 2), (3, -20), (22, -18), (17, 20), (0, 20))
UNDERWEAR = ((0, -12), (6, -11), (18, 4), (18, 12), (0, 12))
SOCK = ((-6, -12), (10, -12), (13, -8), (10, -3), (3, -1), (3, 16), (-6, 16))
SCARF = ((-9, -40), (9, -40), (9, 40), (-9, 40))
TOWEL = ((-17, -22), (17, -22), (17, 22), (-17, 22))


def _mirrored(half: tuple[tuple[int, int], ...]) -> FloatArray:
    right = np.array(half, dtype=np.float64)
    return np.concatenate((right, right[::-1] * (-1, 1)))


SHAPES: dict[str, FloatArray] = {
    "t-shirt": _mirrored(TSHIRT),
    "shorts": _mirrored(SHORTS),
    "sock": np.array(SOCK, dtype=np.float64),
    "scarf": np.array(SCARF, dtype=np.float64),
    "towel": np.array(TOWEL, dtype=np.float64),
    "underwear": _mirrored(UNDERWEAR),
}
"""Closed polygons by kind; a seventh kind, "heap", is drawn at random: a crumpled garment."""
KINDS = (*SHAPES, "heap")


@dataclass(frozen=True, slots=True, eq=False)
class Outline:
    """A garment's outline.

    Parameters
    ----------
    kind
        One of `KINDS`.
    corners
        Closed polygon around the origin, shape (corners, 2); any scale.
    """

    kind: str
    corners: FloatArray

    @classmethod
    def random(cls, generator: np.random.Generator) -> Outline:
        """A garment of a random kind, turned, creased and with the soft edges of cloth.

        Examples
        --------
        >>> Outline.random(np.random.default_rng(0)).kind
        'underwear'
        """
        kind = str(generator.choice(KINDS))
        corners = _heap(generator) if kind == "heap" else SHAPES[kind] * generator.uniform(0.85, 1.15, size=2)
        soft = _softened(corners)
        span = np.ptp(soft, axis=0).max()
        turn = generator.uniform(0, 2 * math.pi)
        rotation = np.array([[math.cos(turn), -math.sin(turn)], [math.sin(turn), math.cos(turn)]])
        bent = soft + 0.02 * span * _waves(soft / span, generator)
        return cls(kind, (bent - bent.mean(axis=0)) @ rotation.T)

    def mask(self, area: float) -> Mask:
        """The outline filled with about `area` pixels, cut to its bounding box."""
        scaled = self.corners * math.sqrt(area / polygon_area(self.corners))
        low = np.floor(scaled.min(axis=0))
        width, height = (np.ceil(scaled.max(axis=0)) - low + 1).astype(int)
        filled = _filled(scaled - low, height, width)
        rows, columns = np.flatnonzero(filled.any(axis=1)), np.flatnonzero(filled.any(axis=0))
        return filled[rows[0] : rows[-1] + 1, columns[0] : columns[-1] + 1]


def polygon_area(corners: FloatArray) -> float:
    """Area enclosed by a polygon without crossings.

    Examples
    --------
    >>> polygon_area(np.array([[0.0, 0], [2, 0], [2, 3], [0, 3]]))
    6.0
    """
    x, y = corners.T
    return abs(float(np.dot(x, np.roll(y, -1)) - np.dot(y, np.roll(x, -1)))) / 2


def _heap(generator: np.random.Generator) -> FloatArray:
    """A star-shaped polygon: radii that vary smoothly with the angle."""
    angle = np.linspace(0, 2 * math.pi, 36, endpoint=False)
    radius = np.ones_like(angle)
    for order in range(2, 6):
        radius += generator.normal(0, 0.35 / order) * np.cos(order * angle + generator.uniform(0, 2 * math.pi))
    radius = 20 * np.clip(radius, 0.5, 1.8)
    return np.column_stack((radius * np.cos(angle), radius * np.sin(angle)))


def _softened(corners: FloatArray) -> FloatArray:
    """Corners cut twice (Chaikin's scheme): cloth has no sharp ones."""
    for _ in range(2):
        following = np.roll(corners, -1, axis=0)
        corners = np.stack((0.87 * corners + 0.13 * following, 0.13 * corners + 0.87 * following), axis=1).reshape(-1, 2)
    return corners


def _waves(points: FloatArray, generator: np.random.Generator) -> FloatArray:
    """A smooth random displacement of points of unit size."""
    moved = np.zeros_like(points)
    for _ in range(4):
        direction, phase = generator.normal(0, 6, size=2), generator.uniform(0, 2 * math.pi)
        moved += np.sin(points @ direction + phase)[:, None] * generator.normal(0, 1, size=2)
    return moved


def _filled(corners: FloatArray, height: int, width: int) -> Mask:
    """Pixels whose centres lie inside a polygon, by the even-odd rule, row by row."""
    inside = np.zeros((height, width), dtype=np.bool_)
    first, second = corners, np.roll(corners, -1, axis=0)
    columns = np.arange(width)
    for row in range(height):
        crossed = (first[:, 1] > row) != (second[:, 1] > row)
        a, b = first[crossed], second[crossed]
        x = a[:, 0] + (row - a[:, 1]) / (b[:, 1] - a[:, 1]) * (b[:, 0] - a[:, 0])
        inside[row] = (np.searchsorted(np.sort(x), columns) % 2).astype(np.bool_)
    return inside
