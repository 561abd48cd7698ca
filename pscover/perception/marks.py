"""Ground truth by eye: one click inside each garment of a photo, and what a segmentation makes of them."""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass
from os import PathLike
from pathlib import Path
from typing import Annotated

import msgspec
import numpy as np
from numpy.typing import NDArray

from pscover.errors import InvalidImage
from pscover.files import read_bytes

BYTE_LIMIT = 2**24
Coordinate = Annotated[int, msgspec.Meta(ge=0, le=2**16)]
Point = tuple[Coordinate, Coordinate]


class Click(msgspec.Struct, frozen=True, forbid_unknown_fields=True, kw_only=True):
    """A pixel inside a garment of that name."""

    name: str
    x: Coordinate
    y: Coordinate


class MarkedPhoto(msgspec.Struct, frozen=True, forbid_unknown_fields=True, kw_only=True):
    """What the eye sees in one photo.

    Parameters
    ----------
    file
        The photo's name.
    width, height
        Its size in pixels.
    roi
        Corners of the region of interest.
    background
        A pixel of the empty surface.
    garments
        One click in each garment that the eye tells apart inside the region.
    same_colour
        Names of garments of one colour that touch: colour alone cannot tell them apart.
    note
        Remarks.
    """

    file: str
    width: Coordinate
    height: Coordinate
    roi: tuple[Point, ...]
    background: Point
    garments: tuple[Click, ...]
    same_colour: tuple[tuple[str, str], ...] = ()
    note: str = ""

    @property
    def distinct(self) -> frozenset[str]:
        """Names of the garments that touch no other of their colour."""
        return frozenset(g.name for g in self.garments) - {name for pair in self.same_colour for name in pair}


class MarksFile(msgspec.Struct, frozen=True, forbid_unknown_fields=True, kw_only=True):
    """The file `marks.json`."""

    format: Annotated[str, msgspec.Meta(pattern="^pscover-marks$")]
    version: Annotated[int, msgspec.Meta(ge=1, le=1)]
    about: str
    photos: tuple[MarkedPhoto, ...]


@dataclass(frozen=True, slots=True, kw_only=True)
class Tally:
    """Marks against segments.

    Parameters
    ----------
    found
        Names of garments whose mark lies in a segment that holds no other mark.
    merged
        Names of those that share a segment.
    missed
        Names of those whose mark lies on the surface.
    segments
        How many there are.
    extra
        How many hold no mark: parts of a garment that is split, or things that are no garment.
    """

    found: tuple[str, ...]
    merged: tuple[str, ...]
    missed: tuple[str, ...]
    segments: int
    extra: int


def read_marks(path: str | PathLike[str]) -> tuple[MarkedPhoto, ...]:
    """The marks of a file.

    Raises
    ------
    InvalidImage
        If it cannot be read or says something else.
    """
    try:
        return msgspec.json.decode(read_bytes(Path(path), BYTE_LIMIT, InvalidImage), type=MarksFile).photos
    except (msgspec.DecodeError, UnicodeDecodeError, RecursionError) as error:
        raise InvalidImage(f"{path}: expected marks: {error}") from None


def tally(labels: NDArray[np.int32], photo: MarkedPhoto) -> Tally:
    """Which garments a label image of the photo's size tells apart.

    Parameters
    ----------
    labels
        0 is the surface, shape (H, W).
    photo
        The marks.

    Raises
    ------
    InvalidImage
        If the sizes differ.

    Examples
    --------
    >>> clicks = tuple(Click(name=name, x=x, y=0) for name, x in [("shirt", 0), ("sock", 1), ("tie", 2), ("hat", 3)])
    >>> photo = MarkedPhoto(file="", width=5, height=1, roi=(), background=(4, 0), garments=clicks)
    >>> tally(np.array([[1, 2, 2, 0, 5]], dtype=np.int32), photo)
    Tally(found=('shirt',), merged=('sock', 'tie'), missed=('hat',), segments=3, extra=1)
    """
    if labels.shape != (photo.height, photo.width):
        raise InvalidImage(
            f"labels: expected the size {photo.width} x {photo.height} of {photo.file}, "
            f"got {labels.shape[1]} x {labels.shape[0]}"
        )
    under = {click.name: int(labels[click.y, click.x]) for click in photo.garments}
    marks = Counter(under.values())
    segments = np.unique(labels[labels > 0])
    return Tally(
        found=tuple(name for name, label in under.items() if label and marks[label] == 1),
        merged=tuple(name for name, label in under.items() if label and marks[label] > 1),
        missed=tuple(name for name, label in under.items() if not label),
        segments=len(segments),
        extra=len(set(segments.tolist()) - set(under.values())),
    )
