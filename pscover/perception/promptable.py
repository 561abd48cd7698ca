"""What guided prompting asks of a model: embed a photo once, then decode points into masks of low resolution.

A SAM-like model sees a square of `side` pixels (1024) into which the photo is scaled, top left, and answers with logits on
a grid of `side` / 4 cells (256). `Frame` is the one place that knows how the three are related.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from pscover.errors import InvalidImage
from pscover.perception.colour import opencv

FloatArray = NDArray[np.float32]
PIXELS_PER_CELL = 4
"""The decoder of SAM answers at a quarter of the model's resolution (Kirillov et al. 2023, appendix A)."""
PIXEL_MEAN = (123.675, 116.28, 103.53)
PIXEL_DEVIATION = (58.395, 57.12, 57.375)


@dataclass(frozen=True, slots=True, kw_only=True)
class Frame:
    """How a photo lies in the model's square.

    Parameters
    ----------
    height, width
        Of the photo in pixels.
    side
        Of the model's square in pixels.
    """

    height: int
    width: int
    side: int = 1024

    @property
    def scaled(self) -> tuple[int, int]:
        """Height and width of the photo inside the square: its longer side fills the square.

        Examples
        --------
        >>> Frame(height=480, width=640).scaled, Frame(height=480, width=640).cells
        ((768, 1024), (192, 256))
        """
        scale = self.side / max(self.height, self.width)
        return max(1, int(self.height * scale + 0.5)), max(1, int(self.width * scale + 0.5))

    @property
    def cells(self) -> tuple[int, int]:
        """Rows and columns of the grid of logits that show the photo."""
        height, width = self.scaled
        return math.ceil(height / PIXELS_PER_CELL), math.ceil(width / PIXELS_PER_CELL)

    @property
    def cell(self) -> tuple[float, float]:
        """Width and height of a cell in pixels of the photo, (x, y)."""
        height, width = self.scaled
        return PIXELS_PER_CELL * self.width / width, PIXELS_PER_CELL * self.height / height

    def square(self, photo: NDArray[np.uint8]) -> FloatArray:
        """The photo as the encoder wants it: scaled, normalised, padded with zeros, shape (3, side, side)."""
        cv2 = opencv("segmenting with SAM")
        height, width = self.scaled
        shrinks = height < self.height
        scaled = cv2.resize(photo, (width, height), interpolation=cv2.INTER_AREA if shrinks else cv2.INTER_LINEAR)
        square = np.zeros((3, self.side, self.side), dtype=np.float32)
        for channel, (mean, deviation) in enumerate(zip(PIXEL_MEAN, PIXEL_DEVIATION, strict=True)):
            square[channel, :height, :width] = (scaled[:, :, channel].astype(np.float32) - mean) / deviation
        return square

    def in_square(self, points: NDArray[np.float64]) -> FloatArray:
        """Points (x, y) of the photo in the model's square, shape (n, 2)."""
        height, width = self.scaled
        return np.asarray(points * np.array([width / self.width, height / self.height]), dtype=np.float32)

    def in_photo(self, cells: NDArray[np.float64]) -> NDArray[np.float64]:
        """The middles of cells, given as (row, column), as points (x, y) of the photo, shape (n, 2)."""
        points = (cells[:, ::-1] + 0.5) * np.array(self.cell)
        return np.asarray(np.minimum(points, [self.width - 1.0, self.height - 1.0]), dtype=np.float64)

    def shrink(self, pixels: NDArray[np.bool_]) -> FloatArray:
        """The share of each cell that is true, shape `cells`."""
        cv2 = opencv("segmenting with SAM")
        rows, columns = self.cells
        coarse = self.height > rows
        how = cv2.INTER_AREA if coarse else cv2.INTER_LINEAR
        return np.asarray(cv2.resize(pixels.astype(np.float32), (columns, rows), interpolation=how), dtype=np.float32)

    def enlarge(self, logits: FloatArray) -> tuple[int, int, NDArray[np.bool_]]:
        """Where logits are positive, in pixels of the photo: interpolated linearly, and only around the positive cells.

        Returns
        -------
        tuple
            Top, left and the pixels of a window that holds them all.
        """
        cv2 = opencv("segmenting with SAM")
        rows, columns = (np.flatnonzero((logits > 0).any(axis=axis)) for axis in (1, 0))
        if len(rows) == 0:
            return 0, 0, np.zeros((0, 0), dtype=np.bool_)
        wide, high = self.cell
        top, bottom = max(0, math.floor((rows[0] - 1) * high)), min(self.height, math.ceil((rows[-1] + 2) * high))
        left, right = max(0, math.floor((columns[0] - 1) * wide)), min(self.width, math.ceil((columns[-1] + 2) * wide))
        # Pixel middles fall between cell middles: (x + 1/2) / wide - 1/2.
        back = np.array([[1 / wide, 0, (left + 0.5) / wide - 0.5], [0, 1 / high, (top + 0.5) / high - 0.5]])
        flags = cv2.INTER_LINEAR | cv2.WARP_INVERSE_MAP
        fine = cv2.warpAffine(logits, back, (right - left, bottom - top), flags=flags, borderMode=cv2.BORDER_REPLICATE)
        return top, left, np.asarray(fine > 0, dtype=np.bool_)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Decoded:
    """The model's answer to n points: k masks each.

    Parameters
    ----------
    logits
        Positive inside the mask, shape (n, k, rows, columns); the grid shows the photo alone, without the padding.
    iou
        The model's own guess of each mask's intersection over union with the truth, shape (n, k).
    """

    logits: FloatArray
    iou: FloatArray


class Embedded(Protocol):
    """A photo that the model has looked at."""

    @property
    def frame(self) -> Frame:
        """Where the photo lies in the model's square."""
        ...

    def decode(self, points: NDArray[np.float64]) -> Decoded:
        """Masks for points (x, y) in pixels of the photo, shape (n, 2); each point is a prompt of its own."""
        ...


class Promptable(Protocol):
    """A model that takes points."""

    def embed(self, photo: NDArray[np.uint8]) -> Embedded:
        """Look at an RGB photo, shape (H, W, 3): the costly part, once a photo."""
        ...


def checked(photo: NDArray[np.uint8], cloth: NDArray[np.bool_]) -> tuple[NDArray[np.uint8], NDArray[np.bool_]]:
    """A photo and its cloth map, after a look at their shapes and types.

    Raises
    ------
    InvalidImage
        Unless they are (H, W, 3) of 8 bits and (H, W) of booleans.
    """
    if photo.ndim != 3 or photo.shape[2] != 3 or photo.dtype != np.uint8 or photo.size == 0:
        raise InvalidImage(f"photo: expected shape (H, W, 3) of uint8, got {photo.shape} of {photo.dtype}")
    if cloth.shape != photo.shape[:2] or cloth.dtype != np.bool_:
        raise InvalidImage(f"cloth map: expected shape {photo.shape[:2]} of bool, got {cloth.shape} of {cloth.dtype}")
    return np.ascontiguousarray(photo), cloth
