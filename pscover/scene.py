"""What lies on the surface: an image in which every pixel carries the label of the garment seen there.

Every segmenter ends in a `Scene`, and the planner starts from one. Pixel (x, y) is column x, row y, both from 0; x runs
right and y runs down.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from os import PathLike
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from pscover.errors import InvalidImage
from pscover.images import PIXEL_LIMIT, read_labels, read_photo

LABEL_LIMIT = 2**31 - 1


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Scene:
    """A labelled image of the surface. Build it with `Scene.of` or `Scene.read`; every buffer is read-only.

    Parameters
    ----------
    labels
        Shape (H, W); 0 is the surface, any other value names a segment. Values need not be contiguous.
    values
        The label of each garment, ascending: garment j of the instance is the segment `labels == values[j]`.
    segments
        Shape (H, W): the garment's index j at each pixel, -1 on the surface.
    pixels_per_cm
        Scale of the image. The paper's is 4.7.
    basket
        Where garments are taken, (x, y) in pixels; it may lie outside the image.
    names
        What to call each garment.
    source
        Where the labels came from.
    photo
        What the camera saw, shape (H, W, 3), RGB, or None. For pictures only: no plan depends on it.
    """

    labels: NDArray[np.int32]
    values: NDArray[np.int32]
    segments: NDArray[np.int32]
    pixels_per_cm: float
    basket: tuple[float, float]
    names: tuple[str, ...]
    source: str = ""
    photo: NDArray[np.uint8] | None = None

    @classmethod
    def of(
        cls,
        labels: ArrayLike,
        *,
        pixels_per_cm: float = 4.7,
        basket: tuple[float, float] | None = None,
        names: Sequence[str] = (),
        source: str = "",
        photo: ArrayLike | None = None,
    ) -> Scene:
        """Copy, check and freeze: the one door through which label arrays become a scene.

        Parameters
        ----------
        labels
            Whole numbers, shape (H, W); 0 is the surface.
        pixels_per_cm
            Scale of the image; the paper's by default (a workspace of 1.0 m x 0.6 m is 470 x 282 pixels).
        basket
            (x, y) in pixels; by default the middle of the right edge, ((W - 1), (H - 1) / 2).
        names
            One a garment in ascending order of labels; by default "garment <label>".
        source
            Where the labels came from.
        photo
            Shape (H, W, 3), 8 bits, RGB.

        Returns
        -------
        Scene

        Raises
        ------
        InvalidImage
            With what was expected and what was found.

        Examples
        --------
        >>> scene = Scene.of([[0, 7, 7], [0, 0, 300]])
        >>> scene.garments, scene.values.tolist(), scene.segments.tolist()
        (2, [7, 300], [[-1, 0, 0], [-1, -1, 1]])
        >>> scene.basket, scene.names
        ((2.0, 0.5), ('garment 7', 'garment 300'))
        """
        grid = _grid(labels, source)
        height, width = grid.shape
        values, segments = _index(grid)
        if names and len(names) != len(values):
            raise InvalidImage(f"names: expected {len(values)}, one a garment, got {len(names)}")
        if not (math.isfinite(pixels_per_cm) and pixels_per_cm > 0):
            raise InvalidImage(f"pixels_per_cm: expected a positive number, got {pixels_per_cm!r}")
        at = (width - 1.0, (height - 1) / 2) if basket is None else (float(basket[0]), float(basket[1]))
        if not all(map(math.isfinite, at)):
            raise InvalidImage(f"basket: expected finite pixel coordinates (x, y), got {at}")
        picture = None if photo is None else _picture(photo, grid.shape)
        for buffer in (grid, values, segments, picture):
            if buffer is not None:
                buffer.setflags(write=False)
        return cls(
            labels=grid,
            values=values,
            segments=segments,
            pixels_per_cm=float(pixels_per_cm),
            basket=at,
            names=tuple(map(str, names)) if names else tuple(f"garment {value}" for value in values),
            source=source,
            photo=picture,
        )

    @classmethod
    def read(
        cls,
        labels: str | PathLike[str],
        *,
        photo: str | PathLike[str] | None = None,
        pixels_per_cm: float = 4.7,
        basket: tuple[float, float] | None = None,
        names: Sequence[str] = (),
    ) -> Scene:
        """A scene from a label PNG (grey, 8 or 16 bits) and, for pictures, the photo it was made from.

        Raises
        ------
        InvalidImage
            If a file is missing, damaged, of another kind, or of another size than the other.
        MissingDependency
            Without OpenCV.
        """
        return cls.of(
            read_labels(labels),
            pixels_per_cm=pixels_per_cm,
            basket=basket,
            names=names,
            source=str(labels),
            photo=None if photo is None else read_photo(photo),
        )

    @property
    def garments(self) -> int:
        """The number of garments (segments)."""
        return len(self.values)

    @property
    def shape(self) -> tuple[int, int]:
        """Height and width in pixels."""
        height, width = self.labels.shape
        return height, width

    def areas(self) -> NDArray[np.int64]:
        """Visible area of each garment in pixels, shape (garments,)."""
        return np.bincount(self.segments.ravel() + 1, minlength=self.garments + 1)[1:].astype(np.int64)


def _grid(labels: ArrayLike, source: str) -> NDArray[np.int32]:
    """The labels as a private (H, W) int32 array."""
    place = f"{source}: " if source else ""
    try:
        given = np.asarray(labels)
    except ValueError as error:
        raise InvalidImage(f"{place}labels: expected whole numbers of shape (H, W), got {error}") from None
    if given.ndim != 2:
        hint = "; a colour image is no label image" if given.ndim == 3 else ""
        raise InvalidImage(f"{place}labels: expected shape (H, W), got {given.shape}{hint}")
    if given.size == 0:
        raise InvalidImage(f"{place}labels: expected at least one pixel, got shape {given.shape}")
    if given.size > PIXEL_LIMIT:
        raise InvalidImage(f"{place}labels: expected at most {PIXEL_LIMIT} pixels, got shape {given.shape}; scale it down")
    if given.dtype.kind not in "iub":
        raise InvalidImage(f"{place}labels: expected whole numbers, got {given.dtype}; convert with .astype(int)")
    lowest, highest = int(given.min()), int(given.max())
    if lowest < 0 or highest > LABEL_LIMIT:
        wrong = lowest if lowest < 0 else highest
        y, x = np.argwhere(given == wrong)[0]
        raise InvalidImage(f"{place}labels: pixel x={x}, y={y}: expected a label from 0 to {LABEL_LIMIT}, got {wrong}")
    return np.array(given, dtype=np.int32, order="C")


def _index(grid: NDArray[np.int32]) -> tuple[NDArray[np.int32], NDArray[np.int32]]:
    """Labels present (without 0), and the index of each pixel's label among them."""
    highest = int(grid.max())
    if highest > 16 * grid.size:
        # A table over all possible labels would dwarf the image.
        values, inverse = np.unique(grid, return_inverse=True)
        without = int(values[0] == 0)
        return values[without:], (inverse.reshape(grid.shape) - without).astype(np.int32)
    present = np.zeros(highest + 1, dtype=np.bool_)
    present[grid] = True
    present[0] = False
    values = np.flatnonzero(present).astype(np.int32)
    table = np.full(highest + 1, -1, dtype=np.int32)
    table[values] = np.arange(len(values))
    return values, table[grid]


def _picture(photo: ArrayLike, shape: tuple[int, ...]) -> NDArray[Any]:
    given = np.asarray(photo)
    if given.dtype != np.uint8 or given.ndim != 3 or given.shape[2] != 3:
        raise InvalidImage(f"photo: expected 8-bit RGB of shape (H, W, 3), got {given.dtype} of shape {given.shape}")
    if given.shape[:2] != shape:
        raise InvalidImage(
            f"photo: expected the labels' size {shape[1]} x {shape[0]}, got {given.shape[1]} x {given.shape[0]}; "
            "crop or scale one of them"
        )
    return np.array(given)
