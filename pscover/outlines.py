"""Outlines of label images as SVG paths, and pictures as data that a page can hold."""

from __future__ import annotations

import base64
from types import ModuleType
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pscover.encoding import encode_photo
from pscover.perception.colour import opencv

USER = "the report"
FINE = 3
"""Outlines run through a grid this much finer than the pixels, so that they show no steps."""
FINE_LIMIT = 2**20
"""Scenes of more pixels are outlined along their pixels."""
PHOTO_SIDE = 1600
"""A page holds photos of at most so many pixels a side."""


def outlines(labels: NDArray[np.int32]) -> list[str]:
    """The outline of each label 1, 2, ... as the `d` of an SVG path, holes included (fill rule evenodd).

    Parameters
    ----------
    labels
        Shape (H, W); 0 is not outlined. Pixel (x, y) is the square around (x, y).

    Raises
    ------
    MissingDependency
        Without OpenCV.

    Examples
    --------
    >>> labels = np.zeros((4, 6), dtype=np.int32)
    >>> labels[1:3, 1:5] = 2
    >>> first, second = outlines(labels)
    >>> first, second[0], second[-1], second.count("M")
    ('', 'M', 'Z', 1)
    """
    from scipy import ndimage

    cv2 = opencv(USER)
    scale = FINE if labels.size <= FINE_LIMIT else 1
    paths = []
    for number, window in enumerate(ndimage.find_objects(labels), start=1):
        if window is None:
            paths.append("")
            continue
        rows, columns = window
        bits = np.pad((labels[window] == number).astype(np.uint8) * 255, 2)
        fine = cv2.resize(bits, None, fx=scale, fy=scale, interpolation=cv2.INTER_LINEAR)
        found, _ = cv2.findContours((fine > 127).astype(np.uint8), cv2.RETR_CCOMP, cv2.CHAIN_APPROX_NONE)
        paths.append("".join(_path(cv2, contour, scale, columns.start - 2, rows.start - 2) for contour in found))
    return paths


def _path(cv2: ModuleType, contour: NDArray[np.int32], scale: int, left: int, top: int) -> str:
    corners = cv2.approxPolyDP(contour, 0.3 * scale, True).reshape(-1, 2)
    # The centre of fine pixel u lies at (u + 0.5) / scale - 0.5 of the coarse ones.
    points = (corners + 0.5) / scale - 0.5 + (left, top)
    return "M" + "L".join(f"{x:.1f} {y:.1f}" for x, y in points.tolist()) + "Z"


def picture_data(photo: NDArray[np.uint8]) -> str:
    """A photo as a JPEG in a `data:` address, scaled down to what a page needs.

    Raises
    ------
    InvalidImage
        If it cannot be encoded.
    MissingDependency
        Without OpenCV.
    """
    cv2 = opencv(USER)
    height, width = photo.shape[:2]
    factor = PHOTO_SIDE / max(height, width)
    if factor < 1:
        size = max(1, round(width * factor)), max(1, round(height * factor))
        photo = cv2.resize(photo, size, interpolation=cv2.INTER_AREA)
    return _data(photo, 86)


def heights_data(shares: NDArray[np.floating[Any]]) -> str:
    """Heights as a JPEG in a `data:` address, in the colours of matplotlib's viridis.

    Parameters
    ----------
    shares
        Of the scale's top, from 0 to 1; what is higher gets the last colour, shape (H, W).

    Raises
    ------
    InvalidImage
        If it cannot be encoded.
    MissingDependency
        Without OpenCV.
    """
    cv2 = opencv(USER)
    height, width = shares.shape
    factor = PHOTO_SIDE / max(height, width)
    if factor < 1:
        size = max(1, round(width * factor)), max(1, round(height * factor))
        shares = cv2.resize(shares, size, interpolation=cv2.INTER_AREA)
    grey = np.round(255 * np.clip(shares, 0, 1)).astype(np.uint8)
    return _data(cv2.applyColorMap(grey, cv2.COLORMAP_VIRIDIS)[:, :, ::-1], 90)


def _data(photo: NDArray[np.uint8], quality: int) -> str:
    content = encode_photo(photo, ".jpg", USER, quality)
    return "data:image/jpeg;base64," + base64.b64encode(content).decode("ascii")
