"""What PNG and JPEG files are made of: sizes before anything is decoded, and copies that hold pixels alone.

Comments, colour profiles, previews and the like are left out of the copies: decoders stumble over them, and some say so on
standard error.
"""

from __future__ import annotations

import struct
import zlib
from dataclasses import dataclass
from os import PathLike

from pscover.errors import InvalidImage

PIXEL_LIMIT = 2**26
"""Images of more pixels (8192 x 8192) are refused."""
PNG_SIGNATURE = b"\x89PNG\r\n\x1a\n"
JPEG_SIGNATURE = b"\xff\xd8\xff"
START_OF_FRAME = frozenset(range(0xC0, 0xD0)) - {0xC4, 0xC8, 0xCC}
START_OF_SCAN, JFIF, ADOBE, EXIF = 0xDA, 0xE0, 0xEE, 0xE1
TABLES = frozenset({0xC4, 0xCC, 0xDB, 0xDD})
"""Huffman and arithmetic tables, quantisation, restart interval."""
PLAIN_JFIF = b"\xff\xe0\x00\x10JFIF\x00\x01\x01\x00\x00\x01\x00\x01\x00\x00"
ORIENTATION = 0x0112
UPRIGHT = 1


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

    @classmethod
    def of(cls, data: bytes, path: str | PathLike[str]) -> PngHeader:
        """The header of a PNG; raises `InvalidImage` if it is cut off."""
        if len(data) < 33 or data[12:16] != b"IHDR":
            raise InvalidImage(f"{path}: the PNG is cut off before the end of its header")
        width, height, bits, colour_type, _, _, interlace = struct.unpack(">IIBBBBB", data[16:29])
        return cls(width, height, bits, colour_type, interlace)

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


@dataclass(frozen=True, slots=True)
class Pixels:
    """An image file that holds pixels alone.

    Parameters
    ----------
    file
        A whole PNG or JPEG.
    content
        Of a PNG, its compressed pixels.
    width, height
        As its header declares them.
    orientation
        How to turn it upright, as EXIF numbers it from 1 (upright) to 8.
    """

    file: bytes
    content: bytes
    width: int
    height: int
    orientation: int


def png_pixels(data: bytes, path: str | PathLike[str]) -> Pixels:
    """The pixels of a PNG, after a look at every chunk: decoders fill what is missing with zeros and say nothing.

    Raises
    ------
    InvalidImage
        If it is cut off or damaged.
    """
    header = PngHeader.of(data, path)
    at, content, kept, orientation = len(PNG_SIGNATURE), [], [PNG_SIGNATURE], UPRIGHT
    while at + 12 <= len(data):
        (length,) = struct.unpack(">I", data[at : at + 4])
        kind, end = data[at + 4 : at + 8], at + 8 + length
        if end + 4 > len(data):
            break
        if zlib.crc32(data[at + 4 : end]) != struct.unpack(">I", data[end : end + 4])[0]:
            raise InvalidImage(f"{path}: the PNG is damaged (checksum of the part {kind!r} at byte {at})")
        if kind in (b"IHDR", b"PLTE", b"IDAT", b"IEND"):
            kept.append(data[at : end + 4])
        if kind == b"IDAT":
            content.append(data[at + 8 : end])
        if kind == b"eXIf":
            orientation = turned(data[at + 8 : end])
        if kind == b"IEND":
            return Pixels(b"".join(kept), b"".join(content), header.width, header.height, orientation)
        at = end + 4
    raise InvalidImage(f"{path}: the PNG is cut off at byte {len(data)}")


def jpeg_pixels(data: bytes, path: str | PathLike[str]) -> Pixels:
    """The pixels of a JPEG.

    Raises
    ------
    InvalidImage
        If it is cut off or damaged before its pixels begin, or has no end.
    """
    at, kept, orientation, size = 2, [data[:2]], UPRIGHT, (0, 0)
    framed = False
    while at + 4 <= len(data) and data[at] == 0xFF:
        marker = data[at + 1]
        if marker == 0xFF or marker == 0x01 or 0xD0 <= marker <= 0xD8:
            at += 1 if marker == 0xFF else 2
            continue
        end = at + 2 + int.from_bytes(data[at + 2 : at + 4], "big")
        if marker in START_OF_FRAME and not framed and at + 9 <= len(data):
            height, width = struct.unpack(">HH", data[at + 5 : at + 9])
            size, framed = (width, height), True
        if marker == START_OF_SCAN:
            if not framed or b"\xff\xd9" not in data[at:]:
                break
            return Pixels(b"".join(kept) + data[at:], b"", *size, orientation)
        if marker in START_OF_FRAME or marker in TABLES or (marker == ADOBE and data[at + 4 : at + 9] == b"Adobe"):
            kept.append(data[at:end])
        elif marker == JFIF and data[at + 4 : at + 8] == b"JFIF":
            kept.append(PLAIN_JFIF)
        elif marker == EXIF and data[at + 4 : at + 10] == b"Exif\0\0":
            orientation = turned(data[at + 10 : end])
        at = end
    raise InvalidImage(f"{path}: the JPEG is cut off or damaged")


def turned(exif: bytes) -> int:
    """The orientation that EXIF data say, 1 (upright) where they say none.

    Examples
    --------
    >>> turned(b"II*\\0" + struct.pack("<IHHHIHH", 8, 1, 0x112, 3, 1, 6, 0)), turned(b"MM")
    (6, 1)
    """
    order = {b"II*\0": "<", b"MM\0*": ">"}.get(exif[:4])
    if order is None or len(exif) < 10:
        return UPRIGHT
    (start,) = struct.unpack(order + "I", exif[4:8])
    entries = struct.unpack(order + "H", exif[start : start + 2])[0] if start + 2 <= len(exif) else 0
    for at in range(start + 2, min(start + 2 + 12 * entries, len(exif) - 11), 12):
        tag, _, _, value = struct.unpack(order + "HHIH", exif[at : at + 10])
        if tag == ORIENTATION:
            return int(value) if 1 <= value <= 8 else UPRIGHT
    return UPRIGHT


def check_size(width: int, height: int, path: str | PathLike[str]) -> None:
    """Raise `InvalidImage` for an empty image or one beyond `PIXEL_LIMIT`."""
    if width == 0 or height == 0:
        raise InvalidImage(f"{path}: expected at least one pixel, got {width} x {height}")
    if width * height > PIXEL_LIMIT:
        raise InvalidImage(f"{path}: expected at most {PIXEL_LIMIT} pixels, got {width} x {height}; scale it down")
