"""One mask of a segmentation, stored as the box it fits into."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from pscover.errors import InvalidImage

BoolArray = NDArray[np.bool_]


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Mask:
    """A set of pixels; masks of one image may overlap, nest and leave gaps.

    Parameters
    ----------
    top, left
        Row and column of the box's first pixel in the image.
    bits
        Which pixels of the box belong to the mask, shape (box height, box width), read-only; some in every outer row and
        column.
    score
        How good its maker thinks it is, in [0, 1]; 1 where nothing is known.
    name
        What it shows, or "".
    """

    top: int
    left: int
    bits: BoolArray
    score: float = 1.0
    name: str = ""

    @classmethod
    def of(cls, pixels: ArrayLike, *, score: float = 1.0, name: str = "") -> Mask:
        """A mask from a whole image of booleans (or of numbers, non-zero meaning inside), shape (H, W).

        Raises
        ------
        InvalidImage
            If the array has not two dimensions or no pixel is inside.

        Examples
        --------
        >>> mask = Mask.of([[0, 0, 0], [0, 1, 1], [0, 0, 1]])
        >>> mask.top, mask.left, mask.bits.astype(int).tolist(), mask.area
        (1, 1, [[1, 1], [0, 1]], 3)
        """
        inside = np.asarray(pixels) != 0
        if inside.ndim != 2:
            raise InvalidImage(f"mask: expected shape (H, W), got {inside.shape}")
        rows, columns = np.flatnonzero(inside.any(axis=1)), np.flatnonzero(inside.any(axis=0))
        if len(rows) == 0:
            raise InvalidImage("mask: expected at least one pixel inside")
        top, left = int(rows[0]), int(columns[0])
        bits = np.array(inside[top : rows[-1] + 1, left : columns[-1] + 1])
        bits.setflags(write=False)
        return cls(top=top, left=left, bits=bits, score=float(score), name=name)

    @property
    def area(self) -> int:
        """Pixels inside."""
        return int(np.count_nonzero(self.bits))

    @property
    def window(self) -> tuple[slice, slice]:
        """Where the box lies in the image: `image[mask.window]` has the shape of `bits`."""
        height, width = self.bits.shape
        return slice(self.top, self.top + height), slice(self.left, self.left + width)

    def pixels(self, shape: tuple[int, int]) -> BoolArray:
        """The mask as a whole image, shape (H, W)."""
        whole = np.zeros(shape, dtype=np.bool_)
        whole[self.window] = self.bits
        return whole
