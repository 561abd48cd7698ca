"""What the empty surface looks like, as the user says it: a colour, a photo of the empty table, or "auto"."""

from __future__ import annotations

import re
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from pscover.errors import InvalidImage, InvalidSettings
from pscover.images import read_photo
from pscover.perception.colour import Photo

HEX = re.compile(r"#([0-9a-fA-F]{3}|[0-9a-fA-F]{6})")
TRIPLE = re.compile(r"\s*(\d+)\s*,\s*(\d+)\s*,\s*(\d+)\s*")


@dataclass(frozen=True, slots=True)
class Auto:
    """The colours found along most of the border of the region of interest."""


@dataclass(frozen=True, slots=True)
class Colour:
    """One colour, as red, green and blue from 0 to 255; shading over the picture is fitted to it.

    Raises
    ------
    InvalidSettings
        If a channel is out of range.
    """

    red: int
    green: int
    blue: int

    def __post_init__(self) -> None:
        for channel in (self.red, self.green, self.blue):
            if not 0 <= channel <= 255:
                raise InvalidSettings(f"background: expected red, green and blue from 0 to 255, got {channel}")


@dataclass(frozen=True, slots=True, eq=False)
class EmptyTable:
    """A photo of the surface without garments, from the same camera at the same place, RGB, shape (H, W, 3)."""

    photo: Photo


Background = Auto | Colour | EmptyTable


def parse_background(text: str | Background) -> Background:
    """A background from text: "auto", a colour ("R,G,B" or "#rrggbb"), or the path of a photo of the empty table.

    Raises
    ------
    InvalidSettings
        If it is none of these.
    InvalidImage
        If it is a path to something that is no photo.

    Examples
    --------
    >>> parse_background("#ff8000"), parse_background("12, 34, 56"), parse_background("auto")
    (Colour(red=255, green=128, blue=0), Colour(red=12, green=34, blue=56), Auto())
    """
    if not isinstance(text, str):
        return text
    if text.strip().lower() == "auto":
        return Auto()
    if triple := TRIPLE.fullmatch(text):
        # Four digits are out of range already; int() of thousands would only waste time.
        return Colour(*(int(channel[:4]) for channel in triple.groups()))
    if HEX.fullmatch(text.strip()):
        return _hexadecimal(text.strip()[1:])
    if not text.strip() or text.lstrip().startswith("#") or not _exists(text):
        raise InvalidSettings(
            'background: expected "auto", a colour (R,G,B or #rrggbb) or the path of a photo of the empty table, '
            f"got {text!r}"
        )
    return EmptyTable(read_photo(text))


def check_size(table: EmptyTable, shape: tuple[int, int]) -> None:
    """Raise `InvalidImage` unless the empty table has the photo's size."""
    got = table.photo.shape[:2]
    if got != shape:
        raise InvalidImage(
            f"background: expected a photo of the empty table of the photo's size {shape[1]} x {shape[0]}, "
            f"got {got[1]} x {got[0]}; both must come from the same camera at the same place"
        )


def _hexadecimal(digits: str) -> Colour:
    whole = digits if len(digits) == 6 else "".join(2 * digit for digit in digits)
    return Colour(*np.frombuffer(bytes.fromhex(whole), dtype=np.uint8).tolist())


def _exists(text: str) -> bool:
    try:
        return Path(text).exists()
    except (OSError, ValueError):
        return False
