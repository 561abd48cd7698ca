"""The grid on which perception works: the photo scaled down until the gripper is about as many pixels wide as in the paper.

More pixels than that cost time and change no grasp. What is found on the grid is reported in pixels of the photo.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any, TypeVar

import numpy as np
from numpy.typing import NDArray

from pscover.errors import InvalidSettings
from pscover.perception.colour import Photo, opencv

PAPER_PIXELS_PER_CM = 4.7
SPARE = 1.25
"""A photo up to this much finer than the paper's is left as it is: scaling by so little blurs and saves nothing."""
Values = TypeVar("Values", bound=np.generic)


@dataclass(frozen=True, slots=True, kw_only=True)
class Grid:
    """How the grid lies over the photo. Pixel (x, y) is a square whose centre is (x, y).

    Parameters
    ----------
    photo_shape
        Height and width of the photo in pixels.
    shape
        Height and width of the grid.
    """

    photo_shape: tuple[int, int]
    shape: tuple[int, int]

    @classmethod
    def over(
        cls, photo_shape: tuple[int, int], *, pixels_per_cm: float = PAPER_PIXELS_PER_CM, pixel_limit: int = 400_000
    ) -> Grid:
        """The grid for a photo of that size.

        Parameters
        ----------
        photo_shape
            Height and width in pixels.
        pixels_per_cm
            Scale of the photo. Where it is more than 1.25 times the paper's 4.7, the grid has 4.7 pixels a centimetre.
        pixel_limit
            The most pixels the grid may have.

        Raises
        ------
        InvalidSettings
            If a number is not positive.

        Examples
        --------
        >>> Grid.over((480, 640)).shape, Grid.over((1080, 1920), pixels_per_cm=18.8).shape
        ((480, 640), (270, 480))
        """
        if not (math.isfinite(pixels_per_cm) and pixels_per_cm > 0):
            raise InvalidSettings(f"pixels_per_cm: expected a positive number, got {pixels_per_cm!r}")
        if pixel_limit < 1:
            raise InvalidSettings(f"pixel_limit: expected at least 1, got {pixel_limit!r}")
        height, width = photo_shape
        factor = PAPER_PIXELS_PER_CM / pixels_per_cm if pixels_per_cm > SPARE * PAPER_PIXELS_PER_CM else 1.0
        factor = min(factor, math.sqrt(pixel_limit / (height * width)))
        shape = max(1, round(height * factor)), max(1, round(width * factor))
        return cls(photo_shape=photo_shape, shape=photo_shape if factor >= 1 else shape)

    @property
    def factor(self) -> float:
        """Pixels of the grid a pixel of the photo, along either axis; at most 1."""
        (height, width), (tall, wide) = self.photo_shape, self.shape
        return math.sqrt(tall * wide / (height * width))

    def to_photo(self, x: float, y: float) -> tuple[float, float]:
        """Where a point of the grid lies in the photo.

        Examples
        --------
        >>> Grid(photo_shape=(20, 40), shape=(10, 20)).to_photo(0, 9)
        (0.5, 18.5)
        """
        (height, width), (tall, wide) = self.photo_shape, self.shape
        return (x + 0.5) * width / wide - 0.5, (y + 0.5) * height / tall - 0.5

    def from_photo(self, x: float, y: float) -> tuple[float, float]:
        """Where a point of the photo lies on the grid; the inverse of `to_photo`."""
        (height, width), (tall, wide) = self.photo_shape, self.shape
        return (x + 0.5) * wide / width - 0.5, (y + 0.5) * tall / height - 0.5

    def scaled(self, photo: Photo) -> Photo:
        """The photo on the grid: each pixel the mean of those it covers."""
        if self.shape == self.photo_shape:
            return photo
        cv2 = opencv("perception")
        return np.asarray(cv2.resize(photo, self.shape[::-1], interpolation=cv2.INTER_AREA), dtype=np.uint8)

    def nearest(self, image: NDArray[Values]) -> NDArray[Values]:
        """An image of the photo's size on the grid, by nearest pixels: for labels and masks."""
        return _pick(image, self.shape)

    def enlarged(self, image: NDArray[Values]) -> NDArray[Values]:
        """An image of the grid's size at the photo's size, by nearest pixels: for labels and masks."""
        return _pick(image, self.photo_shape)


def _pick(image: NDArray[Any], shape: tuple[int, int]) -> NDArray[Any]:
    if image.shape[:2] == shape:
        return image
    rows, columns = (
        ((np.arange(size) + 0.5) * of / size).astype(np.intp) for size, of in zip(shape, image.shape[:2], strict=True)
    )
    return np.ascontiguousarray(image[rows][:, columns])
