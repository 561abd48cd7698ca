"""Label images as 16-bit grey PNG, written without an image library."""

from __future__ import annotations

import struct
import zlib
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pscover.errors import InvalidImage

MOST = 2**16 - 1


def encode_labels(labels: NDArray[np.integer[Any]]) -> bytes:
    """The content of a PNG whose grey values are the labels (ISO/IEC 15948).

    Parameters
    ----------
    labels
        Shape (H, W), from 0 to 65535.

    Raises
    ------
    InvalidImage
        If a label does not fit into 16 bits.

    Examples
    --------
    >>> encode_labels(np.array([[0, 300]]))[:4]
    b'\\x89PNG'
    """
    if labels.size and not 0 <= int(labels.min()) <= int(labels.max()) <= MOST:
        raise InvalidImage(f"labels: expected 0 to {MOST} in a PNG, got {int(labels.min())} to {int(labels.max())}")
    height, width = labels.shape
    # Each row begins with the number of its filter; 0 is none.
    rows = np.zeros((height, 1 + 2 * width), dtype=np.uint8)
    rows[:, 1:] = np.ascontiguousarray(labels, dtype=">u2").view(np.uint8).reshape(height, 2 * width)
    header = struct.pack(">IIBBBBB", width, height, 16, 0, 0, 0, 0)
    parts = ((b"IHDR", header), (b"IDAT", zlib.compress(rows.tobytes(), 9)), (b"IEND", b""))
    return b"\x89PNG\r\n\x1a\n" + b"".join(_chunk(kind, content) for kind, content in parts)


def _chunk(kind: bytes, content: bytes) -> bytes:
    return struct.pack(">I", len(content)) + kind + content + struct.pack(">I", zlib.crc32(kind + content))
