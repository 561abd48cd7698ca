"""Reading label images and photos, distrustfully: nothing is decoded before its header has been believed.

A label image is a grey PNG of 8 or 16 bits whose values are labels. Formats that change values (JPEG), hide them behind
colours (palettes) or scale them (1, 2 or 4 bits) are refused with the reason.
"""

from __future__ import annotations

import struct
import zlib
from dataclasses import dataclass
from os import PathLike
from pathlib import Path
from types import ModuleType

import numpy as np
from numpy.typing import NDArray

from pscover.errors import InvalidImage, MissingDependency
from pscover.files import read_bytes

PIXEL_LIMIT = 2**26
"""Images of more pixels (8192 x 8192) are refused."""
BYTE_LIMIT = 2**28
PNG_SIGNATURE = b"\x89PNG\r\n\x1a\n"
JPEG_SIGNATURE = b"\xff\xd8\xff"
COLOUR_TYPES = {0: "grey", 2: "colour (RGB)", 3: "palette", 4: "grey with alpha", 6: "colour with alpha (RGBA)"}
START_OF_FRAME = frozenset(range(0xC0, 0xD0)) - {0xC4, 0xC8, 0xCC}


def read_labels(path: str | PathLike[str]) -> NDArray[np.int32]:
    """The labels of a grey PNG of 8 or 16 bits, shape (H, W).

    Raises
    ------
    InvalidImage
        If the file is missing, no PNG, damaged, larger than `PIXEL_LIMIT` says, or not grey of 8 or 16 bits.
    MissingDependency
        Without OpenCV.
    """
    return decode_labels(_bytes(path), path)


def decode_labels(data: bytes, path: str | PathLike[str]) -> NDArray[np.int32]:
    """The labels in the bytes of a PNG that `path` names in messages; otherwise as `read_labels`."""
    if data.startswith(JPEG_SIGNATURE):
        raise InvalidImage(
            f"{path}: this is a JPEG, which does not keep label values exact; save the labels as a 16-bit PNG"
        )
    if not data.startswith(PNG_SIGNATURE):
        raise InvalidImage(f"{path}: expected a PNG file with labels, got something else ({data[:8]!r}...)")
    header = _png_header(data, path)
    if header.colour_type != 0 or header.bits < 8:
        kind = COLOUR_TYPES.get(header.colour_type, f"colour type {header.colour_type}")
        raise InvalidImage(
            f"{path}: expected a grey PNG of 8 or 16 bits whose values are labels, got {kind} of {header.bits} bits; "
            "save the label array itself, not a picture of it"
        )
    header.check_size(path)
    header.check_content(_png_content(data, path), path)
    cv2 = _opencv("reading label images")
    labels = cv2.imdecode(np.frombuffer(data, dtype=np.uint8), cv2.IMREAD_UNCHANGED)
    if labels is None or labels.shape != (header.height, header.width):
        raise InvalidImage(f"{path}: the PNG cannot be decoded; it is damaged")
    return np.asarray(labels, dtype=np.int32)


def read_photo(path: str | PathLike[str]) -> NDArray[np.uint8]:
    """A JPEG or PNG photo as RGB, shape (H, W, 3).

    Raises
    ------
    InvalidImage
        If the file is missing, neither JPEG nor PNG, damaged, or larger than `PIXEL_LIMIT` says.
    MissingDependency
        Without OpenCV.
    """
    data = _bytes(path)
    if data.startswith(PNG_SIGNATURE):
        _png_header(data, path).check_size(path)
        _png_content(data, path)
    elif data.startswith(JPEG_SIGNATURE):
        _check_size(*_jpeg_size(data, path), path)
    else:
        raise InvalidImage(f"{path}: expected a JPEG or PNG photo, got something else ({data[:8]!r}...)")
    cv2 = _opencv("reading photos")
    photo = cv2.imdecode(np.frombuffer(data, dtype=np.uint8), cv2.IMREAD_COLOR)
    if photo is None:
        raise InvalidImage(f"{path}: the photo cannot be decoded; it is damaged")
    return np.ascontiguousarray(photo[:, :, ::-1])


@dataclass(frozen=True, slots=True)
class PngHeader:
    """What a PNG declares of itself.

    Parameters
    ----------
    width, height
        In pixels.
    bits
        A channel.
    colour_type, interlace
        As numbered in the PNG specification (ISO/IEC 15948), section 11.2.2.
    """

    width: int
    height: int
    bits: int
    colour_type: int
    interlace: int

    def check_size(self, path: str | PathLike[str]) -> None:
        """Raise `InvalidImage` for an empty image or one beyond `PIXEL_LIMIT`."""
        _check_size(self.width, self.height, path)

    def check_content(self, content: bytes, path: str | PathLike[str]) -> None:
        """Raise `InvalidImage` unless the compressed data of a grey image hold exactly its pixels."""
        if self.interlace:
            return
        expected = self.height * (1 + self.width * self.bits // 8)
        try:
            # One byte more than expected is enough to see that there are too many, however far they would inflate.
            got = len(zlib.decompressobj().decompress(content, expected + 1))
        except zlib.error as error:
            raise InvalidImage(f"{path}: the PNG's pixel data are damaged ({error})") from None
        if got != expected:
            amount = "more" if got > expected else "fewer"
            raise InvalidImage(f"{path}: the PNG holds {amount} pixels than its header declares; it is cut off or damaged")


def _bytes(path: str | PathLike[str]) -> bytes:
    """The whole file, by Python's own I/O, which takes every path that the system takes."""
    data = read_bytes(Path(path), BYTE_LIMIT, InvalidImage)
    if not data:
        raise InvalidImage(f"{path}: expected an image, got an empty file")
    return data


def _png_header(data: bytes, path: str | PathLike[str]) -> PngHeader:
    if len(data) < 33 or data[12:16] != b"IHDR":
        raise InvalidImage(f"{path}: the PNG is cut off before the end of its header")
    width, height, bits, colour_type, _, _, interlace = struct.unpack(">IIBBBBB", data[16:29])
    return PngHeader(width, height, bits, colour_type, interlace)


def _png_content(data: bytes, path: str | PathLike[str]) -> bytes:
    """The compressed pixel data, after a look at every chunk: decoders fill what is missing with zeros and say nothing."""
    at, content = len(PNG_SIGNATURE), []
    while at + 12 <= len(data):
        (length,) = struct.unpack(">I", data[at : at + 4])
        kind, end = data[at + 4 : at + 8], at + 8 + length
        if end + 4 > len(data):
            break
        if zlib.crc32(data[at + 4 : end]) != struct.unpack(">I", data[end : end + 4])[0]:
            raise InvalidImage(f"{path}: the PNG is damaged (checksum of the part {kind!r} at byte {at})")
        if kind == b"IDAT":
            content.append(data[at + 8 : end])
        if kind == b"IEND":
            return b"".join(content)
        at = end + 4
    raise InvalidImage(f"{path}: the PNG is cut off at byte {len(data)}")


def _jpeg_size(data: bytes, path: str | PathLike[str]) -> tuple[int, int]:
    """Width and height as the frame header declares them."""
    at = 2
    while at + 9 <= len(data) and data[at] == 0xFF:
        marker = data[at + 1]
        if marker in START_OF_FRAME:
            height, width = struct.unpack(">HH", data[at + 5 : at + 9])
            if b"\xff\xd9" not in data[at:]:
                break
            return width, height
        alone = marker == 0xFF or marker == 0x01 or 0xD0 <= marker <= 0xD8
        at += 1 if marker == 0xFF else 2 if alone else 2 + int.from_bytes(data[at + 2 : at + 4], "big")
    raise InvalidImage(f"{path}: the JPEG is cut off or damaged")


def _check_size(width: int, height: int, path: str | PathLike[str]) -> None:
    if width == 0 or height == 0:
        raise InvalidImage(f"{path}: expected at least one pixel, got {width} x {height}")
    if width * height > PIXEL_LIMIT:
        raise InvalidImage(f"{path}: expected at most {PIXEL_LIMIT} pixels, got {width} x {height}; scale it down")


def _opencv(user: str) -> ModuleType:
    try:
        import cv2
    except ImportError:
        raise MissingDependency.for_extra(user, ["opencv-python-headless"], "perception") from None
    module: ModuleType = cv2
    return module
