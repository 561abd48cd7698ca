"""Where a camera stands, and where points of the world appear in its image."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from pscover.sim.settings import TABLE, Sensor

FloatArray = NDArray[np.float64]


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Projection:
    """A pinhole camera.

    Parameters
    ----------
    eye
        Where it is, metres, shape (3,).
    axes
        Unit vectors to the right, down and forward in the image, shape (3, 3).
    focal
        Pixels.
    shape
        Rows and columns.
    """

    eye: FloatArray
    axes: FloatArray
    focal: float
    shape: tuple[int, int]

    def screen(self, points: FloatArray) -> FloatArray:
        """Column, row (of pixels' centres) and distance along the optical axis, shape (points, 3)."""
        seen = (points - self.eye) @ self.axes.T
        rows, columns = self.shape
        result = np.empty_like(seen)
        depth = np.where(seen[:, 2] > 1e-3, seen[:, 2], 1.0)
        result[:, 0] = (columns - 1) / 2 + self.focal * seen[:, 0] / depth
        result[:, 1] = (rows - 1) / 2 + self.focal * seen[:, 1] / depth
        result[:, 2] = np.where(seen[:, 2] > 1e-3, seen[:, 2], -1.0)
        return result

    def point(self, x: float, y: float, depth: float) -> tuple[float, float, float]:
        """The place in the world of a pixel at a distance along the optical axis."""
        rows, columns = self.shape
        local = np.array([(x - (columns - 1) / 2) / self.focal, (y - (rows - 1) / 2) / self.focal, 1.0]) * depth
        px, py, pz = (self.eye + local @ self.axes).tolist()
        return px, py, pz

    def finer(self, factor: int) -> Projection:
        """The same view in more pixels."""
        rows, columns = self.shape
        return Projection(eye=self.eye, axes=self.axes, focal=self.focal * factor, shape=(rows * factor, columns * factor))


@dataclass(frozen=True, slots=True, kw_only=True)
class Overhead:
    """From above the table's middle: the table fills the image exactly.

    Parameters
    ----------
    rows, columns
        Of the image.
    height
        Metres above the table.
    """

    rows: int = 282
    columns: int = 470
    height: float = 1.3

    @classmethod
    def of(cls, sensor: Sensor) -> Overhead:
        """As the world's camera stands."""
        return cls(rows=sensor.rows, columns=sensor.columns, height=sensor.height)

    def projection(self) -> Projection:
        """The pinhole camera."""
        axes = np.eye(3)
        axes[2, 2] = -1.0
        eye = np.array([TABLE[0] / 2, TABLE[1] / 2, self.height])
        return Projection(eye=eye, axes=axes, focal=self.columns / TABLE[0] * self.height, shape=(self.rows, self.columns))


@dataclass(frozen=True, slots=True, kw_only=True)
class Oblique:
    """From the front, looking down at the table, the fingers and the basket.

    Parameters
    ----------
    rows, columns
        Of the image.
    azimuth, elevation
        Degrees: from the front towards the right, and above the table's plane.
    distance
        Metres from the point looked at.
    target
        That point, metres.
    """

    rows: int = 360
    columns: int = 640
    azimuth: float = -18.0
    elevation: float = 38.0
    distance: float = 2.0
    target: tuple[float, float, float] = (0.66, 0.3, 0.1)

    def projection(self) -> Projection:
        """The pinhole camera."""
        turn, rise = math.radians(self.azimuth), math.radians(self.elevation)
        away = np.array([math.sin(turn) * math.cos(rise), math.cos(turn) * math.cos(rise), math.sin(rise)])
        forward = -away
        right = np.array([math.cos(turn), -math.sin(turn), 0.0])
        # In a frame with y down in the image the world is left-handed: down = right x forward there.
        down = np.cross(right, forward)
        if down[2] > 0:
            down = -down
        eye = np.array(self.target) + self.distance * away
        axes = np.stack((right, down, forward))
        return Projection(eye=eye, axes=axes, focal=1.25 * self.columns, shape=(self.rows, self.columns))
