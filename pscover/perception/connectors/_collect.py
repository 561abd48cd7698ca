"""Gathering masks from an untrusted source, within limits on their number, their boxes and the pixels looked at."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from pscover.errors import InvalidImage
from pscover.images import PIXEL_LIMIT
from pscover.perception.connectors.contract import Annotations
from pscover.perception.mask import Mask

MASK_LIMIT = 2**14
"""Files of more masks are refused."""

BOX_LIMIT = 2**28
"""The boxes of all masks of a file may have this many pixels together, each a byte of memory."""

WORK_LIMIT = 2**31
"""Decoding may take as much work as looking at so many pixels: 250 masks of whole 4K images, or 4 900 of 640 x 480."""

LEAST_WORK = 2**17
"""What a mask or an outline of it costs at least, however small it is, in pixels."""


def checked_shape(shape: tuple[int, int], place: str) -> tuple[int, int]:
    """Height and width, if an image may have them.

    Raises
    ------
    InvalidImage
        For an empty image or one beyond `PIXEL_LIMIT`.
    """
    height, width = shape
    if min(shape) < 1:
        raise InvalidImage(f"{place}: expected at least one pixel, got {width} x {height}")
    if height * width > PIXEL_LIMIT:
        raise InvalidImage(f"{place}: expected at most {PIXEL_LIMIT} pixels, got {width} x {height}; scale it down")
    return height, width


def agreed(found: tuple[int, int] | None, asked: tuple[int, int] | None, place: str) -> tuple[int, int]:
    """The image's height and width from what the annotations say and what the caller knows.

    Raises
    ------
    InvalidImage
        If the two differ, none is known, or the size is beyond the limits.
    """
    shape = found or asked
    if shape is None:
        raise InvalidImage(f"{place}: expected the size of the image, got none in the file; pass shape=(height, width)")
    if found and asked and found != asked:
        raise InvalidImage(
            f"{place}: expected masks for the image's size {asked[1]} x {asked[0]}, got {found[1]} x {found[0]}; "
            "crop or scale one of them"
        )
    return checked_shape(shape, place)


def trimmed(bits: NDArray[np.bool_], top: int, left: int) -> Mask | None:
    """The mask in a part of an image whose first pixel is at (top, left), or None without a pixel."""
    if not bits.any():
        return None
    mask = Mask.of(bits)
    return replace(mask, top=mask.top + top, left=mask.left + left)


def union(masks: list[Mask]) -> Mask | None:
    """All pixels of several masks, or None without a mask."""
    if len(masks) < 2:
        return masks[0] if masks else None
    top, left = min(mask.top for mask in masks), min(mask.left for mask in masks)
    bottom = max(mask.top + mask.bits.shape[0] for mask in masks)
    right = max(mask.left + mask.bits.shape[1] for mask in masks)
    bits = np.zeros((bottom - top, right - left), dtype=np.bool_)
    for mask in masks:
        rows, columns = mask.window
        bits[rows.start - top : rows.stop - top, columns.start - left : columns.stop - left] |= mask.bits
    bits.setflags(write=False)
    return replace(masks[0], top=top, left=left, bits=bits)


class Collector:
    """Masks of one image in the making.

    Parameters
    ----------
    source
        Where they come from; begins every message.
    """

    def __init__(self, source: str) -> None:
        self.source = source
        self._masks: list[Mask] = []
        self._kept = 0
        self._looked_at = 0

    def look_at(self, pixels: int) -> None:
        """Account for a mask, or a part of one, whose decoding is about to take as much work as so many pixels.

        Raises
        ------
        InvalidImage
            Beyond `WORK_LIMIT`.
        """
        self._looked_at += max(pixels, LEAST_WORK)
        if self._looked_at > WORK_LIMIT:
            raise InvalidImage(
                f"{self.source}: expected masks that take at most {WORK_LIMIT} pixels of work to decode, got more; "
                "leave out masks, or outlines of many corners"
            )

    def reserve(self, count: int, pixels: int) -> None:
        """Account for masks that are about to be made, whose boxes have so many pixels together.

        Raises
        ------
        InvalidImage
            Beyond `MASK_LIMIT` or `BOX_LIMIT`.
        """
        if len(self._masks) + count > MASK_LIMIT:
            raise InvalidImage(f"{self.source}: expected at most {MASK_LIMIT} masks, got more")
        if self._kept + pixels > BOX_LIMIT:
            raise InvalidImage(
                f"{self.source}: expected masks whose boxes have at most {BOX_LIMIT} pixels together, got more; "
                "scale the image down, or leave out masks of the whole surface"
            )

    def add(self, mask: Mask | None, *, score: float = 1.0, name: str = "") -> None:
        """Keep a mask. One without a pixel shows nothing and is left out.

        Raises
        ------
        InvalidImage
            As `reserve`.
        """
        if mask is None:
            return
        self.reserve(1, mask.bits.size)
        self._kept += mask.bits.size
        self._masks.append(replace(mask, score=min(max(score, 0.0), 1.0), name=name))

    def annotations(self, shape: tuple[int, int], image: str = "") -> Annotations:
        """What was kept."""
        return Annotations(masks=tuple(self._masks), shape=shape, source=self.source, image=image)
