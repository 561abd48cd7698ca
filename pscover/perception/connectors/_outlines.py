"""Outlines to masks.

Coordinates are continuous: pixel (x, y) is the square from (x, y) to (x + 1, y + 1), as COCO and LabelMe mean them. A pixel
is inside an outline if its centre is, by the even-odd rule; a centre exactly on a left or upper edge is inside, on a right
or lower edge outside, so that outlines which share an edge share no pixel.

Outlines that were traced through the *centres* of the border pixels (`cv2.findContours` does so, and many exporters use
it) have thereby lost a rim: of real garment masks above 10 000 pixels the median comes back with 1.4 % less area, at an
intersection over union of 0.98 (at worst 0.96), which is what pycocotools makes of the same outlines; small masks lose
more. Run-length encoding is exact; prefer it where there is the choice.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

from pscover.errors import InvalidImage
from pscover.perception.connectors._collect import Collector, trimmed
from pscover.perception.mask import Mask

CROSSING_LIMIT = 2**22
"""An outline may cross this many rows, each edge counted by itself."""

CROSSING_WORK, PIXEL_WORK = 160, 4
"""What a crossing and a pixel of the box cost, in pixels of a run-length encoded mask."""

FARTHEST = 1e7
"""Coordinates beyond belong to no image."""


def filled(points: ArrayLike, shape: tuple[int, int], collector: Collector, place: str) -> Mask | None:
    """The pixels whose centres lie in a polygon, or None if there are none.

    Parameters
    ----------
    points
        Corners (x, y), shape (corners, 2); the last is joined to the first. Parts outside the image are cut off.
    shape
        Of the image.
    collector
        Accounts for the work.
    place
        Of the outline, for messages.

    Raises
    ------
    InvalidImage
        For fewer than three corners, coordinates that are not finite or beyond 10 million, or an outline that crosses more
        than `CROSSING_LIMIT` rows.

    Examples
    --------
    >>> filled([(1, 0), (3, 0), (3, 2), (1, 2)], (3, 4), Collector("a file"), "outline").pixels((3, 4)).astype(int).tolist()
    [[0, 1, 1, 0], [0, 1, 1, 0], [0, 0, 0, 0]]
    """
    corners = np.asarray(points, dtype=np.float64)
    if corners.ndim != 2 or corners.shape[1] != 2 or len(corners) < 3:
        raise InvalidImage(f"{place}: expected at least three corners (x, y), got shape {corners.shape}")
    _check_finite(corners, place)
    ahead = np.roll(corners, -1, axis=0)
    down = (corners[:, 1] < ahead[:, 1])[:, np.newaxis]
    upper, lower = np.where(down, corners, ahead), np.where(down, ahead, corners)
    first, end = (np.clip(np.ceil(y - 0.5), 0, shape[0]).astype(np.int64) for y in (upper[:, 1], lower[:, 1]))
    rows_each = end - first
    total = int(rows_each.sum())
    if total > CROSSING_LIMIT:
        raise InvalidImage(f"{place}: expected an outline that crosses at most {CROSSING_LIMIT} rows, got {total}")
    collector.look_at(CROSSING_WORK * total)
    edge = np.repeat(np.arange(len(corners)), rows_each)
    rows = np.arange(total) - np.repeat(np.cumsum(rows_each) - rows_each - first, rows_each)
    run, rise = lower[edge, 0] - upper[edge, 0], lower[edge, 1] - upper[edge, 1]
    crossing = upper[edge, 0] + (rows + 0.5 - upper[edge, 1]) * run / rise
    return _toggled(rows, crossing, shape, collector)


def disc(
    centre: tuple[float, float], on_rim: tuple[float, float], shape: tuple[int, int], collector: Collector, place: str
) -> Mask | None:
    """The pixels whose centres lie in a circle, given by its centre and a point on it; otherwise as `filled`."""
    corners = np.array([centre, on_rim], dtype=np.float64)
    _check_finite(corners, place)
    (x, y), radius = corners[0], float(np.hypot(*(corners[1] - corners[0])))
    first, end = (int(np.clip(np.ceil(edge - 0.5), 0, shape[0])) for edge in (y - radius, y + radius))
    rows = np.arange(first, end)
    half = np.sqrt(np.maximum(radius**2 - (rows + 0.5 - y) ** 2, 0.0))
    return _toggled(np.concatenate([rows, rows]), np.concatenate([x - half, x + half]), shape, collector)


def _check_finite(corners: NDArray[np.float64], place: str) -> None:
    wrong = np.flatnonzero(~(np.abs(corners) <= FARTHEST).all(axis=1))
    if len(wrong):
        at = int(wrong[0])
        got = tuple(corners[at].tolist())
        raise InvalidImage(
            f"{place}: point {at}: expected coordinates between -{FARTHEST:.0e} and {FARTHEST:.0e}, got {got}"
        )


def _toggled(
    rows: NDArray[np.int64], crossing: NDArray[np.float64], shape: tuple[int, int], collector: Collector
) -> Mask | None:
    """The pixels with an odd number of crossings to the left of their centres."""
    columns = np.clip(np.ceil(crossing - 0.5), 0, shape[1]).astype(np.int64)
    if len(rows) == 0 or columns.min() == columns.max():
        return None
    top, left = int(rows.min()), int(columns.min())
    height, width = int(rows.max()) - top + 1, int(columns.max()) - left
    collector.look_at(PIXEL_WORK * height * width)
    crossings = np.zeros((height, width + 1), dtype=np.uint8)
    np.add.at(crossings, (rows - top, columns - left), 1)
    # Sums modulo 256 keep what is odd.
    odd = np.bitwise_xor.accumulate(crossings & 1, axis=1)[:, :-1].astype(np.bool_)
    return trimmed(odd, top, left)
