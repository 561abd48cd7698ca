"""Where to look: a polygon around the work surface, and the parts of the picture that the camera did not fill."""

from __future__ import annotations

import math
import re
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from pscover.errors import InvalidSettings
from pscover.perception.colour import Photo, opencv

BoolImage = NDArray[np.bool_]
Polygon = Sequence[tuple[float, float]]
VOID_LEVEL = 4
"""A channel value up to which a pixel is black; JPEG moves true zeros by a few steps."""
VOID_SIDE = 0.5
"""A void lies along at least this share of one side of the picture."""
CORNER_LIMIT = 10_000


def parse_polygon(text: str) -> tuple[tuple[float, float], ...]:
    """A polygon from its corners "x,y x,y x,y ...", separated by spaces or semicolons.

    Raises
    ------
    InvalidSettings
        If a corner is not two finite numbers, or there are fewer than three.

    Examples
    --------
    >>> parse_polygon("0,0 10,0 10,5.5")
    ((0.0, 0.0), (10.0, 0.0), (10.0, 5.5))
    """
    corners = []
    for word in re.split(r"[\s;]+", text.strip()):
        parts = word.split(",")
        try:
            x, y = map(float, parts)
        except ValueError:
            raise InvalidSettings(f'roi: expected corners "x,y x,y x,y ...", got {word!r}') from None
        corners.append((x, y))
    return check_polygon(corners)


def check_polygon(corners: Polygon) -> tuple[tuple[float, float], ...]:
    """The corners as pairs of floats.

    Raises
    ------
    InvalidSettings
        If there are fewer than three or one is not finite.
    """
    if not 3 <= len(corners) <= CORNER_LIMIT:
        raise InvalidSettings(f"roi: expected 3 to {CORNER_LIMIT} corners, got {len(corners)}")
    checked = []
    for k, corner in enumerate(corners):
        pair = tuple(map(float, corner))
        if len(pair) != 2 or not all(map(math.isfinite, pair)) or max(map(abs, pair)) > 1e6:
            raise InvalidSettings(f"roi: corner {k}: expected x and y in pixels, got {corner!r}")
        checked.append((pair[0], pair[1]))
    return tuple(checked)


def region(polygon: Polygon | None, shape: tuple[int, int]) -> BoolImage:
    """Which pixels lie inside a polygon, shape (H, W); all of them for None.

    Parameters
    ----------
    polygon
        Corners (x, y) in pixels, in order; the last is joined to the first.
    shape
        Height and width of the image.

    Raises
    ------
    InvalidSettings
        If it is no polygon, or no pixel of the image lies inside.

    Examples
    --------
    >>> region([(1, 0), (2, 0), (2, 1), (1, 1)], (3, 4)).astype(int).tolist()
    [[0, 1, 1, 0], [0, 1, 1, 0], [0, 0, 0, 0]]
    """
    if polygon is None:
        return np.ones(shape, dtype=np.bool_)
    corners = np.round(np.array(check_polygon(polygon))).astype(np.int32)
    canvas = np.zeros(shape, dtype=np.uint8)
    opencv("a region of interest").fillPoly(canvas, [corners.reshape(-1, 1, 2)], 1)
    if not canvas.any():
        raise InvalidSettings(f"roi: no pixel of the {shape[1]} x {shape[0]} image lies inside {list(map(tuple, polygon))}")
    return canvas.astype(np.bool_)


def void(photo: Photo) -> BoolImage:
    """Which pixels the camera did not fill: black bars along a side, as a depth camera's registered colour has them.

    A picture with such bars has black holes too, where the depth is unknown; they count as well. Without bars
    nothing is void, and black cloth stays cloth.

    Examples
    --------
    >>> photo = np.full((4, 6, 3), 200, dtype=np.uint8)
    >>> photo[0], photo[2, 3] = 0, 0
    >>> void(photo).astype(int).tolist()
    [[1, 1, 1, 1, 1, 1], [0, 0, 0, 0, 0, 0], [0, 0, 0, 1, 0, 0], [0, 0, 0, 0, 0, 0]]
    """
    black = photo.max(axis=2) <= VOID_LEVEL
    barred = any(side.mean() >= VOID_SIDE for side in (black[0], black[-1], black[:, 0], black[:, -1]))
    return black if barred and black.mean() < VOID_SIDE else np.zeros_like(black)


def filled(photo: Photo, unknown: BoolImage) -> Photo:
    """The photo with unknown pixels coloured like the nearest known one."""
    if not unknown.any() or unknown.all():
        return photo
    from scipy.ndimage import distance_transform_edt

    rows, columns = distance_transform_edt(unknown, return_distances=False, return_indices=True)
    return np.ascontiguousarray(photo[rows, columns])
