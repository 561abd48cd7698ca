"""Colours in CIE Lab, where distances look alike to the eye, and OpenCV where it is needed."""

from __future__ import annotations

from types import ModuleType
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from pscover.errors import InvalidImage, MissingDependency

Photo = NDArray[np.uint8]
FloatImage = NDArray[np.float32]
FLAT_CHROMA = 3.0
"""A photo whose a and b stay below this nearly everywhere has no colours, only greys."""


def opencv(user: str) -> ModuleType:
    """OpenCV, for something called `user`.

    Raises
    ------
    MissingDependency
        With the pip line.
    """
    try:
        import cv2
    except ImportError:
        raise MissingDependency.for_extra(user, ["opencv-python-headless"], "perception") from None
    module: ModuleType = cv2
    return module


def rgb(photo: ArrayLike) -> Photo:
    """A photo given as an array: 8-bit RGB of shape (H, W, 3), or 8-bit grey of shape (H, W).

    Raises
    ------
    InvalidImage
        If it is anything else.

    Examples
    --------
    >>> rgb(np.full((2, 3), 7, dtype=np.uint8)).shape
    (2, 3, 3)
    """
    given: NDArray[Any] = np.asarray(photo)
    if given.dtype == np.uint8 and given.ndim == 2:
        given = np.repeat(given[:, :, None], 3, axis=2)
    if given.dtype != np.uint8 or given.ndim != 3 or given.shape[2] != 3:
        raise InvalidImage(f"photo: expected 8-bit RGB of shape (H, W, 3), got {given.dtype} of shape {given.shape}")
    if given.size == 0:
        raise InvalidImage(f"photo: expected at least one pixel, got shape {given.shape}")
    return np.ascontiguousarray(given)


def lab(photo: Photo) -> FloatImage:
    """CIE Lab (D65): L from 0 to 100, a and b about -128 to 127, shape (H, W, 3).

    Examples
    --------
    >>> lab(np.array([[[255, 255, 255], [0, 0, 0]]], dtype=np.uint8))[0, :, 0].round().tolist()
    [100.0, 0.0]
    """
    cv2 = opencv("perception")
    image = cv2.cvtColor(np.multiply(photo, np.float32(1 / 255), dtype=np.float32), cv2.COLOR_RGB2LAB)
    return np.asarray(image, dtype=np.float32)


def smooth_lab(photo: Photo, side: int) -> FloatImage:
    """Lab of the photo after a median filter of that side (odd; 1 for none), which evens out texture and keeps edges."""
    return lab(photo if side == 1 else np.asarray(opencv("perception").medianBlur(photo, side), dtype=np.uint8))


def is_grey(image: FloatImage) -> bool:
    """Whether a Lab image has no colours, so that lightness is all there is to go by."""
    chroma = np.abs(image[::4, ::4, 1:])
    return bool(np.quantile(chroma, 0.99) < FLAT_CHROMA)
