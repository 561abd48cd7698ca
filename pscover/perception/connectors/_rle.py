"""Run-length encoded masks, as COCO and the Segment Anything mask generators write them.

The pixels of an image of shape (H, W) are numbered down the first column, then down the second (column-major: pixel
(x, y) has number x H + y). `counts` are lengths of runs, alternately outside and inside, beginning outside (perhaps with 0);
they sum to H W. *Uncompressed*, they are a list of numbers. *Compressed*, they are text: a number is written in digits of
five bits, lowest first, as the characters "0" to "o" (bit 5 says that more digits follow, bit 4 of the last digit is the
sign), and from the fourth count on as the difference from the count two before.

Text from files is decoded here and not by pycocotools, because that one trusts it: given counts that end early, it
answers with uninitialised memory. Text to be written is made by pycocotools.
"""

from __future__ import annotations

from typing import Annotated

import msgspec
import numpy as np
from numpy.typing import NDArray

from pscover.errors import InvalidImage, MissingDependency
from pscover.images import PIXEL_LIMIT
from pscover.perception.connectors._collect import Collector, agreed, trimmed
from pscover.perception.connectors._documents import NUMBER_LIMIT
from pscover.perception.mask import Mask

Side = Annotated[int, msgspec.Meta(ge=1, le=PIXEL_LIMIT)]
Run = Annotated[int, msgspec.Meta(ge=0, le=PIXEL_LIMIT)]

MOST_DIGITS = 7
"""A count up to `PIXEL_LIMIT` has six digits of five bits."""


class Rle(msgspec.Struct):
    """A mask as a document has it: [height, width] and the runs."""

    size: tuple[Side, Side]
    counts: str | list[Run]


def decoded(rle: Rle, asked: tuple[int, int] | None, collector: Collector, place: str) -> Mask | None:
    """The mask, or None if it has no pixel.

    Parameters
    ----------
    rle
        Not to be trusted.
    asked
        The size that the image must have, or None.
    collector
        Accounts for the work.
    place
        Of the mask, for messages.

    Raises
    ------
    InvalidImage
        If the runs do not fill the image.
    """
    height, width = agreed(rle.size, asked, place)
    counts = from_text(rle.counts, place) if isinstance(rle.counts, str) else np.array(rle.counts, dtype=np.int64)
    total = int(counts.sum())
    if total != height * width:
        raise InvalidImage(f"{place}: expected counts that sum to {height * width}, the image's pixels, got {total}")
    ends = np.cumsum(counts)
    inside = np.flatnonzero(counts[1::2]) * 2 + 1
    if len(inside) == 0:
        collector.look_at(0)
        return None
    left, right = int(ends[inside[0] - 1]) // height, (int(ends[inside[-1]]) - 1) // height
    collector.look_at(height * (right - left + 1))
    # Only columns that the mask reaches: the runs before and after are cut to them.
    borders = np.clip(ends, left * height, (right + 1) * height)
    runs = np.diff(borders, prepend=left * height)
    columns = np.repeat(np.arange(len(runs)) % 2 == 1, runs).reshape(-1, height)
    return trimmed(columns.T, 0, left)


def from_text(text: str, place: str) -> NDArray[np.int64]:
    """The counts in compressed text.

    Raises
    ------
    InvalidImage
        If a character is no digit, a number is cut off, or a count is negative or beyond `PIXEL_LIMIT`.

    Examples
    --------
    >>> from_text("5220003", "counts").tolist()
    [5, 2, 2, 2, 2, 2, 5]
    """
    if len(text) > NUMBER_LIMIT:
        raise InvalidImage(f"{place}: expected at most {NUMBER_LIMIT} characters of counts, got {len(text)}")
    digits = np.frombuffer(text.encode("utf-16-le", "surrogatepass"), dtype="<u2").astype(np.int64) - 48
    wrong = np.flatnonzero((digits < 0) | (digits > 63))
    if len(wrong):
        at = int(wrong[0])
        raise InvalidImage(f"{place}: character {at}: expected a digit from '0' to 'o', got {text[at : at + 1]!r}")
    last = np.flatnonzero(digits < 32)
    if len(digits) and (len(last) == 0 or last[-1] != len(digits) - 1):
        raise InvalidImage(f"{place}: expected the rest of a count, got the end of the text: it is cut off")
    first = np.concatenate([[0], last[:-1] + 1]) if len(last) else last
    lengths = last - first + 1
    if (lengths > MOST_DIGITS).any():
        raise InvalidImage(f"{place}: expected counts of at most {MOST_DIGITS} digits, got {int(lengths.max())}")
    if len(last) == 0:
        return np.zeros(0, dtype=np.int64)
    position = np.arange(len(digits)) - np.repeat(first, lengths)
    counts = np.add.reduceat((digits & 31) << (5 * position), first)
    counts -= np.where(digits[last] & 16, 1 << (5 * lengths), 0)
    counts[1::2] = np.cumsum(counts[1::2])
    counts[2::2] = np.cumsum(counts[2::2])
    wrong = np.flatnonzero((counts < 0) | (counts > PIXEL_LIMIT))
    if len(wrong):
        at = int(wrong[0])
        raise InvalidImage(f"{place}: count {at}: expected a number from 0 to {PIXEL_LIMIT}, got {int(counts[at])}")
    return np.asarray(counts, dtype=np.int64)


def counts_of(mask: Mask, shape: tuple[int, int]) -> list[int]:
    """The runs of a mask in an image of some shape, uncompressed.

    Examples
    --------
    >>> counts_of(Mask.of([[0, 0, 0], [0, 1, 1], [0, 0, 1]]), (3, 3))
    [4, 1, 2, 2]
    """
    height, width = shape
    rows, columns = mask.window
    slab = np.zeros((columns.stop - columns.start, height), dtype=np.bool_)
    slab[:, rows] = mask.bits.T
    changes = np.flatnonzero(np.diff(slab.ravel(), prepend=False, append=False)) + height * columns.start
    borders = np.concatenate([[0], changes, [height * width]])
    counts: list[int] = np.diff(borders).tolist()
    # A mask that reaches the last pixel ends with a run inside.
    return counts[:-1] if counts[-1] == 0 else counts


def text_of(counts: list[int], shape: tuple[int, int]) -> str:
    """The compressed form of runs.

    Raises
    ------
    MissingDependency
        Without pycocotools.
    """
    try:
        from pycocotools import mask as coco
    except ImportError:
        raise MissingDependency.for_extra("writing compressed masks", ["pycocotools"], "coco") from None
    text: bytes = coco.frPyObjects({"size": list(shape), "counts": counts}, *shape)["counts"]
    return text.decode("ascii")
