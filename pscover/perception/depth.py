"""From a depth image to heights above the table.

Heights along the optical axis need the table's plane alone; heights perpendicular to the table need the camera too.
"""

from __future__ import annotations

import math
import warnings
from dataclasses import dataclass
from itertools import pairwise
from os import PathLike
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from pscover.errors import InvalidImage, InvalidSettings
from pscover.files import opened
from pscover.images import PIXEL_LIMIT, read_labels
from pscover.perception.colour import opencv
from pscover.perception.grid import Grid
from pscover.perception.table_plane import BEHIND, Intrinsics, TablePlane, fit_table, sampled

BYTE_LIMIT = 2**30
FloatImage = NDArray[np.float32]
BoolImage = NDArray[np.bool_]
MILLIMETRES, METRES = 0.001, 1.0
NEAREST, FARTHEST = 1e-3, 1e3
"""Depths in metres outside these count as not measured."""
JUDGED = 4000
"""About so many pixels say how flat the table is."""
TOP = 99
"""Percentile of a garment's heights that is its top: single wrong pixels do not count."""


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
        The plane from which heights are measured, in pixels of the depth image.
    fitted
        Whether the plane was found in the image; False if it was given.
    spread
        Median distance in metres between the table's pixels and the plane: how flat the table is seen. Infinite if no
        pixel lies near the plane.
    source
        Path of the depth image, or "depth".
    metres_per_unit
        How its numbers were taken.
    camera
        With it, heights are perpendicular to the table; without, along the optical axis.
    """

    metres: FloatImage
    holes: BoolImage
    table: TablePlane
    fitted: bool
    spread: float
    source: str
    metres_per_unit: float
    camera: Intrinsics | None

    @property
    def hole_share(self) -> float:
        """Pixels that were filled, as a share of all."""
        return float(np.count_nonzero(self.holes)) / self.holes.size


@dataclass(frozen=True, slots=True, kw_only=True)
class GarmentHeight:
    """How high a garment lies, in metres: the 99th percentile of its pixels, and their mean."""

    top: float
    mean: float


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Depth:
    """A depth image that belongs to a photo, pixel by pixel, and how its numbers are meant.

    Parameters
    ----------
    image
        Path of a grey PNG of 16 bits or of a .npy array, or numbers of shape (H, W); as large as the photo.
    metres_per_unit, camera, table, tolerance
        See `height_map`.

    Raises
    ------
    InvalidSettings
        If a number is not positive.

    Examples
    --------
    >>> depth = Depth(image=np.full((40, 60), 800, dtype=np.uint16), table=TablePlane.level(0.9))
    >>> heights = depth.heights(Grid.over((40, 60)))
    >>> round(float(heights.metres[0, 0]), 3), heights.fitted
    (0.1, False)
    """

    image: str | PathLike[str] | ArrayLike
    metres_per_unit: float | None = None
    camera: Intrinsics | None = None
    table: TablePlane | None = None
    tolerance: float = 0.01

    def __post_init__(self) -> None:
        _check_positive(self.metres_per_unit, self.tolerance)

    @classmethod
    def of(cls, given: Depth | str | PathLike[str] | ArrayLike) -> Depth:
        """The depth itself, or that of a path or an array with every setting as by default."""
        return given if isinstance(given, Depth) else cls(image=given)

    def heights(self, grid: Grid, inside: BoolImage | None = None) -> HeightMap:
        """Heights on the grid over the photo; the table is looked for inside the region, of the grid's shape.

        Raises
        ------
        InvalidImage
            As `read_depth` and `height_map`; messages name the file.
        """
        path = self.image if isinstance(self.image, str | PathLike) else None
        return height_map(
            self.image if path is None else read_depth(path),  # type: ignore[arg-type]
            metres_per_unit=self.metres_per_unit,
            camera=self.camera,
            table=self.table,
            inside=inside,
            grid=grid,
            tolerance=self.tolerance,
            source="depth" if path is None else str(path),
        )


def height_map(
    depth: ArrayLike,
    *,
    metres_per_unit: float | None = None,
    camera: Intrinsics | None = None,
    table: TablePlane | None = None,
    inside: BoolImage | None = None,
    grid: Grid | None = None,
    tolerance: float = 0.01,
    seed: int = 0,
    source: str = "depth",
) -> HeightMap:
    """Heights above the table, from depths along the optical axis; `Frame.depth` of `pscover.robot` as it is.

    Parameters
    ----------
    depth
        Whole numbers or floats, shape (H, W); 0, negative, infinite and NaN mean that nothing was measured, and so do
        depths below 1 mm and above 1 km.
    metres_per_unit
        By default 0.001 for whole numbers and 1 for floats: millimetres and metres, as depth cameras give them (ROS
        REP 118).
    camera
        With it, heights are perpendicular to the table; without, along the optical axis, which is the same when the
        camera looks straight down.
    table
        The table, if known, in pixels of the depth image; otherwise the plane is found that much of the region lies on,
        within `tolerance`, and as little as possible below.
    inside
        The region in which the table is looked for, shape (H, W), or of the grid's shape; by default the whole image.
    grid
        A coarser grid over the depth image: heights are made on it. By default the image's own pixels.
    tolerance
        How far the table's pixels may lie from its plane, in metres.
    seed
        Of the random triples among which the plane is looked for.
    source
        What messages and the record call the image.

    Raises
    ------
    InvalidImage
        If the depth has another shape or type, measures too little, or shows no plane.
    InvalidSettings
        If a number is not positive.
    MissingDependency
        Without OpenCV, if there are holes to fill or the grid is coarser.

    Examples
    --------
    >>> depth = np.full((40, 60), 1.0)
    >>> depth[10:20, 10:20] = 0.95
    >>> depth[12:14, 12:14] = np.nan
    >>> heights = height_map(depth)
    >>> round(float(heights.metres[13, 13]), 3), round(float(heights.metres[5, 5]), 3), int(heights.holes.sum())
    (0.05, 0.0, 4)
    """
    _check_positive(metres_per_unit, tolerance)
    given = _numbers(depth, source)
    unit = metres_per_unit or (METRES if given.dtype.kind == "f" else MILLIMETRES)
    whole = (given.shape[0], given.shape[1])
    over = grid or Grid(photo_shape=whole, shape=whole)
    if over.photo_shape != whole:
        raise InvalidImage(
            f"{source}: expected a depth image of the photo's size {over.photo_shape[1]} x {over.photo_shape[0]}, got "
            f"{whole[1]} x {whole[0]}; depth must be registered to the photo, pixel by pixel"
        )
    z, known = _on_grid(*_metres(given, unit), over)
    look = known if inside is None else known & _region(inside, over.shape, source)
    enough = 3 if table is None else 1
    if (measured := np.count_nonzero(look)) < enough:
        raise InvalidImage(
            f"{source}: expected at least {enough} measured pixels in the region, got {measured}, at {unit:g} m a unit; "
            "check the scale and the region"
        )
    try:
        plane = table or fit_table(z, look, tolerance=tolerance, seed=seed).off_grid(over)
    except InvalidImage as problem:
        raise InvalidImage(f"{source}: {problem}") from None
    inverse = plane.on_grid(over).inverse_depth(over.shape)
    if inverse.min() <= BEHIND and not (inverse[look] > BEHIND).all():
        raise InvalidImage(f"{source}: the table's plane passes behind the camera inside the image; check plane and scale")
    below = 1 / np.maximum(inverse, BEHIND)
    # Along a ray, depths are in proportion to distances from the camera, so to distances from the plane.
    height = (below - z) if camera is None else (below - z) / below * np.float32(plane.distance(camera))
    flat = np.abs(height[sampled(look, JUDGED)])
    flat = flat[flat < tolerance]
    metres, holes = _filled(np.maximum(height, 0), known), ~known
    metres.setflags(write=False)
    holes.setflags(write=False)
    return HeightMap(
        metres=metres,
        holes=holes,
        table=plane,
        fitted=table is None,
        spread=float(np.median(flat)) if len(flat) else math.inf,
        source=source,
        metres_per_unit=unit,
        camera=camera,
    )


def garment_heights(heights: HeightMap, segments: NDArray[np.int32], garments: int) -> tuple[GarmentHeight, ...]:
    """How high each garment lies.

    Parameters
    ----------
    heights
        Of the scene's shape.
    segments
        The garment's index at each pixel, -1 on the surface, shape (H, W).
    garments
        How many there are; each has at least one pixel.

    Examples
    --------
    >>> heights = height_map(np.full((3, 4), 0.8), table=TablePlane.level(1))
    >>> [round(garment.top, 3) for garment in garment_heights(heights, np.zeros((3, 4), dtype=np.int32), 1)]
    [0.2]
    """
    order = np.argsort(segments, axis=None, kind="stable")
    ends = np.searchsorted(segments.ravel()[order], np.arange(garments + 1))
    own = [heights.metres.ravel()[order[start:end]] for start, end in pairwise(ends)]
    return tuple(GarmentHeight(top=float(np.percentile(pixels, TOP)), mean=float(pixels.mean())) for pixels in own)


def read_depth(path: str | PathLike[str]) -> NDArray[Any]:
    """A depth image: a grey PNG (16 bits as a rule) or a .npy array, shape (H, W), whole numbers or floats in its own units.

    Raises
    ------
    InvalidImage
        If the file is missing, damaged, too large or of another kind.
    """
    if Path(path).suffix.lower() != ".npy":
        return read_labels(path, "depths")
    with opened(Path(path), BYTE_LIMIT, InvalidImage) as file, warnings.catch_warnings():
        # NumPy warns of headers that Python 2 has written; they are read all the same.
        warnings.simplefilter("ignore")
        try:
            version = np.lib.format.read_magic(file)
            reader = np.lib.format.read_array_header_1_0 if version == (1, 0) else np.lib.format.read_array_header_2_0
            shape, _, kind = reader(file)
            if len(shape) != 2 or math.prod(shape) > PIXEL_LIMIT or kind.kind not in "iuf":
                raise InvalidImage(
                    f"{path}: expected numbers of shape (H, W), at most {PIXEL_LIMIT} pixels, got {kind} of shape {shape}"
                )
            file.seek(0)
            return np.asarray(np.lib.format.read_array(file, allow_pickle=False))
        except InvalidImage:
            raise
        except Exception as problem:
            # A damaged header raises whatever the parser of its text raises.
            raise InvalidImage(f"{path}: expected a .npy array of depths, got something damaged: {problem}") from None


def _check_positive(metres_per_unit: float | None, tolerance: float) -> None:
    for name, value in (("metres_per_unit", metres_per_unit), ("tolerance", tolerance)):
        if value is not None and not (math.isfinite(value) and value > 0):
            raise InvalidSettings(f"{name}: expected a positive number, got {value!r}")


def _numbers(depth: ArrayLike, source: str) -> NDArray[Any]:
    try:
        given = np.asarray(depth)
    except ValueError as problem:
        raise InvalidImage(f"{source}: expected numbers of shape (H, W), got {problem}") from None
    if given.ndim != 2 or given.dtype.kind not in "iuf":
        raise InvalidImage(f"{source}: expected numbers of shape (H, W), got {given.dtype} of shape {given.shape}")
    if given.size > PIXEL_LIMIT:
        raise InvalidImage(f"{source}: expected at most {PIXEL_LIMIT} pixels, got shape {given.shape}; scale it down")
    return given


def _metres(given: NDArray[Any], unit: float) -> tuple[FloatImage, BoolImage]:
    """Depths in metres, 0 where nothing was measured, and where something was."""
    with np.errstate(over="ignore", invalid="ignore"):
        z = given.astype(np.float32)
        z *= np.float32(unit)
    # NaN compares as false.
    known = (z >= NEAREST) & (z <= FARTHEST)
    z[~known] = 0
    return z, known


def _on_grid(z: FloatImage, known: BoolImage, grid: Grid) -> tuple[FloatImage, BoolImage]:
    """Each pixel of the grid the mean of the measured ones among those it covers, if that is half of them."""
    if grid.shape == grid.photo_shape:
        return z, known
    cv2 = opencv("depth on a coarser grid")
    share = cv2.resize(known.astype(np.float32), grid.shape[::-1], interpolation=cv2.INTER_AREA)
    total = cv2.resize(z, grid.shape[::-1], interpolation=cv2.INTER_AREA)
    enough = np.asarray(share >= 0.5)
    return np.where(enough, total / np.maximum(share, 0.5), 0).astype(np.float32), enough


def _region(inside: BoolImage, shape: tuple[int, ...], source: str) -> BoolImage:
    if inside.shape != shape:
        raise InvalidImage(f"{source}: expected a region of the depth's shape {shape}, got {inside.shape}")
    return inside


def _filled(height: FloatImage, known: BoolImage) -> FloatImage:
    """Heights with those of the nearest measured pixels in the holes."""
    if known.all():
        return height
    cv2 = opencv("filling the holes of a depth image")
    _, nearest = cv2.distanceTransformWithLabels(
        (~known).astype(np.uint8), cv2.DIST_L2, cv2.DIST_MASK_5, labelType=cv2.DIST_LABEL_PIXEL
    )
    value = np.zeros(int(nearest.max()) + 1, dtype=np.float32)
    value[nearest[known]] = height[known]
    holes = ~known
    height[holes] = value[nearest[holes]]
    return height
