"""The table in a depth image: a plane, found as what most of the picture lies on and nothing lies under.

Through a pinhole camera, the inverse depth of a plane is an affine function of the pixel: 1/z = a + b x + c y. So the table
is found by a robust fit to inverse depths, without knowing the camera.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from pscover.errors import InvalidImage, InvalidSettings
from pscover.perception.grid import Grid

FloatImage = NDArray[np.float32]
FloatArray = NDArray[np.float64]
BoolImage = NDArray[np.bool_]
TRIALS, FINALISTS = 400, 12
"""Planes through three pixels that are tried on some pixels, and the best of them that are tried on more."""
SOME, SAMPLES = 250, 2500
"""How many pixels those are."""
SLIVER = 1e-3
"""Triples that span a smaller share of the picture say little."""
SINGULAR = 1e-9
"""Pixels so near to one line give no plane."""
ROUNDS = 5
NEAR, LINES = 2.5, 24
"""Pixels within so many deviations of the noise are the table's, and the lines of the picture that tell the noise."""
HALF_NORMAL = 0.6745
"""Median of the absolute value of a standard normal variable."""
BEHIND = 1e-9
"""The least inverse depth: a plane beyond it passes behind the camera."""
STEEPEST = 1e9
"""Planes of larger numbers are no tables, and single precision does not hold them."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Intrinsics:
    """A pinhole camera: focal lengths and principal point, in pixels of the depth image.

    Raises
    ------
    InvalidSettings
        If a number is not finite or a focal length is not positive.
    """

    fx: float
    fy: float
    cx: float
    cy: float

    def __post_init__(self) -> None:
        if not all(map(math.isfinite, (self.fx, self.fy, self.cx, self.cy))) or self.fx <= 0 or self.fy <= 0:
            raise InvalidSettings(f"intrinsics: expected positive focal lengths and a finite principal point, got {self}")


@dataclass(frozen=True, slots=True, kw_only=True)
class TablePlane:
    """The table as inverse depth: 1/z = offset + slope_x * x + slope_y * y, in 1/m, at pixel (x, y) of the depth image.

    Raises
    ------
    InvalidSettings
        If a number is not finite or beyond 1e9, or all are 0.
    """

    offset: float
    slope_x: float = 0.0
    slope_y: float = 0.0

    def __post_init__(self) -> None:
        numbers = (self.offset, self.slope_x, self.slope_y)
        if not all(abs(number) <= STEEPEST for number in numbers) or not any(numbers):
            raise InvalidSettings(f"table: expected three numbers of at most {STEEPEST:g} (1/m), not all 0, got {numbers}")

    @classmethod
    def level(cls, metres: float) -> TablePlane:
        """A table so far below a camera that looks straight down.

        Examples
        --------
        >>> TablePlane.level(0.8)
        TablePlane(offset=1.25, slope_x=0.0, slope_y=0.0)
        """
        if not (math.isfinite(metres) and metres > 0):
            raise InvalidSettings(f"table: expected a positive distance in metres, got {metres!r}")
        return cls(offset=1 / metres)

    def inverse_depth(self, shape: tuple[int, int]) -> FloatImage:
        """1/z of the table at every pixel, shape (H, W)."""
        rows, columns = np.arange(shape[0])[:, None], np.arange(shape[1])[None]
        across, down = self.offset + self.slope_x * columns, self.slope_y * rows
        return np.asarray(across.astype(np.float32) + down.astype(np.float32))

    def distance(self, camera: Intrinsics) -> float:
        """Distance of the camera from the plane in metres."""
        at_centre = self.offset + self.slope_x * camera.cx + self.slope_y * camera.cy
        return 1 / math.hypot(self.slope_x * camera.fx, self.slope_y * camera.fy, at_centre)

    def depth_at(self, x: float, y: float) -> float:
        """Depth of the plane at a pixel in metres; infinite where it passes behind the camera."""
        inverse = self.offset + self.slope_x * x + self.slope_y * y
        return 1 / inverse if inverse > BEHIND else math.inf

    def on_grid(self, grid: Grid) -> TablePlane:
        """The plane in pixels of the grid over the depth image."""
        (x0, y0), (x1, y1) = grid.to_photo(0, 0), grid.to_photo(1, 1)
        return self._moved(x0, y0, x1 - x0, y1 - y0)

    def off_grid(self, grid: Grid) -> TablePlane:
        """The inverse of `on_grid`.

        Examples
        --------
        >>> grid = Grid(photo_shape=(20, 40), shape=(10, 20))
        >>> plane = TablePlane(offset=1, slope_x=0.5)
        >>> plane.on_grid(grid).slope_x, plane.on_grid(grid).off_grid(grid) == plane
        (1.0, True)
        """
        (x0, y0), (x1, y1) = grid.from_photo(0, 0), grid.from_photo(1, 1)
        return self._moved(x0, y0, x1 - x0, y1 - y0)

    def _moved(self, x0: float, y0: float, step_x: float, step_y: float) -> TablePlane:
        """The plane by other pixels, whose pixel (x, y) is (x0 + step_x * x, y0 + step_y * y) of these."""
        offset = self.offset + self.slope_x * x0 + self.slope_y * y0
        return TablePlane(offset=offset, slope_x=self.slope_x * step_x, slope_y=self.slope_y * step_y)


def fit_table(z: FloatImage, look: BoolImage, *, tolerance: float, seed: int) -> TablePlane:
    """The plane that much of the region lies on, a little of it above, and as little as possible below.

    Planes through three random pixels are scored: a pixel counts less the farther above the plane it lies, and against the
    plane if it lies below, for nothing lies under a table. The best is fitted by least squares to the pixels that the noise
    alone can have brought there, so that thin cloth lifts the table as little as can be.

    Parameters
    ----------
    z
        Depths in metres, shape (H, W).
    look
        Pixels to look at, all of them measured, shape (H, W).
    tolerance
        How far the table's pixels may lie from its plane, in metres.
    seed
        Of the random triples.

    Raises
    ------
    InvalidImage
        If the pixels span no plane.
    """
    places = sampled(look, SAMPLES)
    depth = z[places].astype(float)
    half = max(look.shape) / 2
    terms = np.stack([np.ones(len(depth)), places[1] / half - 1, places[0] / half - 1], axis=1)
    start = _drawn(terms, depth, tolerance, np.random.default_rng(seed))
    best = _refined(start, terms, depth, min(tolerance, max(NEAR * _noise(z, look), tolerance / 5)))
    slope_x, slope_y = best[1] / half, best[2] / half
    return TablePlane(offset=float(best[0] - best[1] - best[2]), slope_x=float(slope_x), slope_y=float(slope_y))


def sampled(look: BoolImage, most: int) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
    """Rows and columns of some `most` of the pixels that are set, evenly over the picture; of all if they are few."""
    step = max(1, int(math.sqrt(np.count_nonzero(look) / most)))
    rows, columns = np.nonzero(look[::step, ::step])
    if len(rows) < most / 8 and step > 1:
        # They lie in lines or specks that the steps miss.
        rows, columns = np.nonzero(look)
        every = max(1, len(rows) // most)
        return rows[::every], columns[::every]
    return rows * step, columns * step


def _drawn(terms: FloatArray, depth: FloatArray, tolerance: float, rng: np.random.Generator) -> FloatArray:
    """The best of many planes through three pixels."""
    triples = rng.integers(0, len(depth), (TRIALS, 3))
    corners = terms[triples]
    span = np.abs(np.linalg.det(corners))
    wide = span > SLIVER if (span > SLIVER).any() else span > SLIVER**3
    if not wide.any():
        raise InvalidImage("expected a table, a plane in front of the camera, got measured pixels that span none")
    planes = np.linalg.solve(corners[wide], (1 / depth[triples[wide]])[:, :, None])[:, :, 0]
    some = rng.integers(0, len(depth), SOME)
    first = _scores(planes, terms[some], depth[some], tolerance)
    finalists = planes[np.argsort(first)[-FINALISTS:]]
    scores = _scores(finalists, terms, depth, tolerance)
    if not np.isfinite(scores).any():
        raise InvalidImage("expected a table, a plane in front of the camera, got depths that no such plane explains")
    return np.asarray(finalists[int(scores.argmax())])


def _scores(planes: FloatArray, terms: FloatArray, depth: FloatArray, tolerance: float) -> FloatArray:
    """How well each plane explains the pixels, shape (planes,); minus infinity for one that passes behind the camera.

    A pixel costs as much as its height in tolerances, at most 1, and twice that below the plane.
    """
    inverse = planes.astype(np.float32) @ terms.astype(np.float32).T
    above = 1 / np.maximum(inverse, BEHIND)
    above -= depth.astype(np.float32)
    above /= np.float32(tolerance)
    np.clip(above, -1, 1, out=above)
    points = np.minimum(-above, 2 * above).sum(axis=1)
    return np.where(inverse.min(axis=1) > BEHIND, points, -np.inf)


def _noise(z: FloatImage, look: BoolImage) -> float:
    """Standard deviation of a depth, as pixels beside each other show it; infinite where there are none."""
    every = max(1, look.shape[0] // LINES)
    rows, both = z[::every], look[::every, 1:] & look[::every, :-1]
    steps = np.abs(np.diff(rows, axis=1))[both]
    return float(np.median(steps)) / (HALF_NORMAL * math.sqrt(2)) if len(steps) else math.inf


def _refined(plane: FloatArray, terms: FloatArray, depth: FloatArray, reach: float) -> FloatArray:
    """Least squares over the pixels within reach of the plane, several times."""
    inverse_depth = 1 / depth
    for _ in range(ROUNDS):
        near = np.abs(1 / np.maximum(terms @ plane, BEHIND) - depth) < reach
        own = terms[near]
        normal = own.T @ own
        if len(own) < 3 or abs(np.linalg.det(normal)) < SINGULAR * len(own) ** 3:
            break
        plane = np.asarray(np.linalg.solve(normal, own.T @ inverse_depth[near]), dtype=float)
    return plane
