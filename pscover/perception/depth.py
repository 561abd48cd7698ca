"""From a depth image to heights above the table.

Through a pinhole camera, the inverse depth of a plane is an affine function of the pixel: 1/z = a + b x + c y. So the table
is found by a robust fit to inverse depths, without knowing the camera. Heights along the optical axis follow at once;
heights perpendicular to the table need the camera's intrinsics.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from os import PathLike
from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike, NDArray

from pscover.errors import InvalidImage, InvalidSettings
from pscover.files import opened
from pscover.images import PIXEL_LIMIT, read_labels

BYTE_LIMIT = 2**30
FloatImage = NDArray[np.float32]
FloatArray = NDArray[np.float64]
BoolImage = NDArray[np.bool_]
SAMPLES, TRIALS = 4000, 300
"""Pixels and triples of pixels that are tried for the plane."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Intrinsics:
    """A pinhole camera: focal lengths and principal point, in pixels.

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
    """The table as inverse depth: 1/z = offset + slope_x * x + slope_y * y, in 1/m, at pixel (x, y)."""

    offset: float
    slope_x: float
    slope_y: float

    def inverse_depth(self, shape: tuple[int, int]) -> FloatArray:
        """1/z of the table at every pixel, shape (H, W)."""
        rows, columns = np.arange(shape[0])[:, None], np.arange(shape[1])[None]
        return np.asarray(self.offset + self.slope_x * columns + self.slope_y * rows, dtype=float)

    def distance(self, camera: Intrinsics) -> float:
        """Distance of the camera from the plane in metres."""
        at_centre = self.offset + self.slope_x * camera.cx + self.slope_y * camera.cy
        return 1 / math.hypot(self.slope_x * camera.fx, self.slope_y * camera.fy, at_centre)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class HeightMap:
    """Heights above the table. Every buffer is read-only.

    Parameters
    ----------
    metres
        Height of each pixel, at least 0, holes filled, shape (H, W).
    holes
        Where the camera measured nothing and the nearest height was taken, shape (H, W).
    table
        The plane from which heights are measured.
    spread
        Median distance in metres between the table's pixels and the plane: how flat the fit found it.
    """

    metres: FloatImage
    holes: BoolImage
    table: TablePlane
    spread: float


def height_map(
    depth: ArrayLike,
    *,
    metres_per_unit: float = 0.001,
    camera: Intrinsics | None = None,
    table: TablePlane | None = None,
    inside: BoolImage | None = None,
    tolerance: float = 0.01,
    seed: int = 0,
) -> HeightMap:
    """Heights above the table, from depths along the optical axis.

    Parameters
    ----------
    depth
        Whole numbers or floats, shape (H, W); 0, negative, infinite and NaN mean that nothing was measured.
    metres_per_unit
        0.001 for the usual millimetres, 1 for metres.
    camera
        With it, heights are perpendicular to the table; without, along the optical axis, which is the same when the
        camera looks straight down.
    table
        The table, if known; otherwise the plane that most pixels of the region lie on, within `tolerance`, or below.
    inside
        The region in which the table is looked for, shape (H, W); by default the whole image.
    tolerance
        How far the table's pixels may lie from its plane, in metres.
    seed
        Of the random triples among which the plane is looked for.

    Raises
    ------
    InvalidImage
        If the depth has another shape or type, measures too little, or shows no plane.
    InvalidSettings
        If a number is not positive.

    Examples
    --------
    >>> depth = np.full((40, 60), 1000)
    >>> depth[10:20, 10:20] = 950
    >>> heights = height_map(depth)
    >>> round(float(heights.metres[15, 15]), 3), round(float(heights.metres[5, 5]), 3)
    (0.05, 0.0)
    """
    for name, value in (("metres_per_unit", metres_per_unit), ("tolerance", tolerance)):
        if not (math.isfinite(value) and value > 0):
            raise InvalidSettings(f"{name}: expected a positive number, got {value!r}")
    z = _metres(depth, metres_per_unit)
    known = z > 0
    look = known if inside is None else known & _region(inside, z.shape)
    if np.count_nonzero(look) < 3:
        raise InvalidImage(f"depth: expected at least 3 measured pixels in the region, got {np.count_nonzero(look)}")
    plane = table or _fit(z, look, tolerance, np.random.default_rng(seed))
    inverse = plane.inverse_depth((z.shape[0], z.shape[1]))
    if not (inverse[look] > 0).all():
        raise InvalidImage("depth: the table's plane passes behind the camera inside the image; check the plane, or scale")
    below = 1 / np.maximum(inverse, 1e-6)
    # Along a ray, depths are in proportion to distances from the camera, so to distances from the plane.
    height = (below - z) if camera is None else (below - z) / below * plane.distance(camera)
    flat = np.abs(height[look])
    metres = _filled(np.maximum(height, 0), known).astype(np.float32)
    holes = ~known
    metres.setflags(write=False)
    holes.setflags(write=False)
    spread = float(np.median(flat[flat < tolerance])) if (flat < tolerance).any() else math.inf
    return HeightMap(metres=metres, holes=holes, table=plane, spread=spread)


def read_depth(path: str | PathLike[str]) -> NDArray[np.int32] | NDArray[np.float64]:
    """A depth image: a grey PNG (16 bits as a rule) or a .npy array, shape (H, W), in its own units.

    Raises
    ------
    InvalidImage
        If the file is missing, damaged, too large or of another kind.
    """
    if Path(path).suffix.lower() != ".npy":
        return read_labels(path)
    with opened(Path(path), BYTE_LIMIT, InvalidImage) as file:
        try:
            version = np.lib.format.read_magic(file)
            reader = np.lib.format.read_array_header_1_0 if version == (1, 0) else np.lib.format.read_array_header_2_0
            shape, _, kind = reader(file)
            if len(shape) != 2 or math.prod(shape) > PIXEL_LIMIT or kind.kind not in "iuf":
                raise InvalidImage(
                    f"{path}: expected numbers of shape (H, W), at most {PIXEL_LIMIT} pixels, got {kind} of shape {shape}"
                )
            file.seek(0)
            return np.asarray(np.lib.format.read_array(file, allow_pickle=False), dtype=np.float64)
        except InvalidImage:
            raise
        except Exception as problem:
            # A damaged header raises whatever the parser of its text raises.
            raise InvalidImage(f"{path}: expected a .npy array of depths, got something damaged: {problem}") from None


def _metres(depth: ArrayLike, metres_per_unit: float) -> FloatArray:
    """Depths in metres, 0 where nothing was measured."""
    given = np.asarray(depth)
    if given.ndim != 2 or given.dtype.kind not in "iuf":
        raise InvalidImage(f"depth: expected numbers of shape (H, W), got {given.dtype} of shape {given.shape}")
    if given.size > PIXEL_LIMIT:
        raise InvalidImage(f"depth: expected at most {PIXEL_LIMIT} pixels, got shape {given.shape}; scale it down")
    z = given.astype(float) * metres_per_unit
    return np.where(np.isfinite(z) & (z > 0), z, 0.0)


def _region(inside: BoolImage, shape: tuple[int, ...]) -> BoolImage:
    if inside.shape != shape:
        raise InvalidImage(f"depth: expected a region of the depth's shape {shape}, got {inside.shape}")
    return inside


def _fit(z: FloatArray, look: BoolImage, tolerance: float, rng: np.random.Generator) -> TablePlane:
    """The plane with most pixels near it, among those through three random pixels, then least squares on these pixels.

    Pixels farther than the plane count against it: the table is the lowest thing there is, so a plane that lies on a heap
    loses to the one below it.
    """
    rows, columns = np.nonzero(look)
    if len(rows) > SAMPLES:
        some = rng.choice(len(rows), SAMPLES, replace=False)
        rows, columns = rows[some], columns[some]
    depth = z[rows, columns]
    terms = np.stack([np.ones(len(rows)), columns, rows], axis=1).astype(float)
    best, most = None, -len(rows) - 1
    for triple in rng.integers(0, len(rows), (TRIALS, 3)):
        corner = terms[triple]
        if abs(np.linalg.det(corner)) < 1e-6:
            continue
        coefficients = np.linalg.solve(corner, 1 / depth[triple])
        inverse = terms @ coefficients
        if inverse.min() <= 0:
            continue
        gap = 1 / inverse - depth
        score = int(np.count_nonzero(np.abs(gap) < tolerance)) - int(np.count_nonzero(gap < -tolerance))
        if score > most:
            best, most = coefficients, score
    if best is None:
        raise InvalidImage("depth: expected a table, a plane in front of the camera, got measured pixels that span none")
    for _ in range(3):
        near = np.abs(1 / np.maximum(terms @ best, 1e-9) - depth) < tolerance
        if np.count_nonzero(near) < 3 or np.linalg.matrix_rank(terms[near]) < 3:
            break
        best = np.linalg.lstsq(terms[near], 1 / depth[near], rcond=None)[0]
    return TablePlane(offset=float(best[0]), slope_x=float(best[1]), slope_y=float(best[2]))


def _filled(height: FloatArray, known: BoolImage) -> FloatArray:
    if known.all():
        return height
    from scipy.ndimage import distance_transform_edt

    rows, columns = distance_transform_edt(~known, return_distances=False, return_indices=True)
    return np.asarray(height[rows, columns])
