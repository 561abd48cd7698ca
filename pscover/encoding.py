"""Images as the content of PNG and JPEG files; `pscover.images` reads them back."""

from __future__ import annotations

import struct
import zlib

import numpy as np
from numpy.typing import ArrayLike, NDArray

from pscover.errors import InvalidImage
from pscover.image_parts import PNG_SIGNATURE
from pscover.perception.colour import opencv

MOST_LABEL = 2**16 - 1
"""The largest label that a PNG holds."""


def encode_labels(labels: ArrayLike) -> bytes:
    """A label map as a grey PNG (ISO/IEC 15948), of 8 bits if no label is above 255, else of 16; needs no image library.

    Parameters
    ----------
    labels
        Whole numbers from 0 to 65535, shape (H, W).

    Raises
    ------
    InvalidImage
        If they are anything else.

    Examples
    --------
    >>> encode_labels([[0, 300]])[:4]
    b'\\x89PNG'
    """
    given = np.asarray(labels)
    if given.ndim != 2 or given.size == 0 or given.dtype.kind not in "biu":
        raise InvalidImage(f"labels: expected whole numbers of shape (H, W), got {given.dtype} of shape {given.shape}")
    lowest, highest = int(given.min()), int(given.max())
    if lowest < 0 or highest > MOST_LABEL:
        wrong = lowest if lowest < 0 else highest
        raise InvalidImage(f"labels: expected numbers from 0 to {MOST_LABEL}, which a PNG holds, got {wrong}")
    height, width = given.shape
    wide = 1 if highest < 256 else 2
    # Each row begins with the number of its filter; 0 is none.
    rows = np.zeros((height, 1 + wide * width), dtype=np.uint8)
    rows[:, 1:] = np.ascontiguousarray(given, dtype=f">u{wide}").view(np.uint8).reshape(height, wide * width)
    header = struct.pack(">IIBBBBB", width, height, 8 * wide, 0, 0, 0, 0)
    parts = ((b"IHDR", header), (b"IDAT", zlib.compress(rows.tobytes())), (b"IEND", b""))
    return PNG_SIGNATURE + b"".join(_chunk(kind, content) for kind, content in parts)


def encode_photo(photo: NDArray[np.uint8], suffix: str, user: str, quality: int = 95) -> bytes:
    """A photo as a PNG or JPEG.

    Parameters
    ----------
    photo
        RGB, shape (H, W, 3).
    suffix
        ".png", ".jpg" or ".jpeg".
    user
        What it is for, in messages.
    quality
        Of a JPEG, up to 100.

    Raises
    ------
    InvalidImage
        If it cannot be encoded.
    MissingDependency
        Without OpenCV.

    Examples
    --------
    >>> encode_photo(np.zeros((2, 3, 3), dtype=np.uint8), ".jpg", "an example")[:3].hex()
    'ffd8ff'
    """
    cv2 = opencv(user)
    options = () if suffix == ".png" else (cv2.IMWRITE_JPEG_QUALITY, quality)
    done, content = cv2.imencode(suffix, np.ascontiguousarray(photo[:, :, ::-1]), options)
    if not done:
        raise InvalidImage(f"{user}: OpenCV cannot make a {suffix} of shape {photo.shape}")
    return bytes(content.tobytes())


def _chunk(kind: bytes, content: bytes) -> bytes:
    return struct.pack(">I", len(content)) + kind + content + struct.pack(">I", zlib.crc32(kind + content))
