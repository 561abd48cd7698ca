"""Reading label images and photos, distrustfully: nothing is decoded before its header has been believed.

A label image is a grey PNG of 8 or 16 bits whose values are labels. Formats that change values (JPEG), hide them behind
colours (palettes) or scale them (1, 2 or 4 bits) are refused with the reason.

Pillow decodes: it raises errors or says nothing, where OpenCV's decoders print warnings on standard error.
"""

from __future__ import annotations

import io
from os import PathLike
from pathlib import Path
from typing import TYPE_CHECKING, TypeVar

import numpy as np
from numpy.typing import NDArray

from pscover.errors import InvalidImage, MissingDependency
from pscover.files import read_bytes
from pscover.image_parts import (
    JPEG_SIGNATURE,
    PIXEL_LIMIT,
    PNG_SIGNATURE,
    Pixels,
    PngHeader,
    check_size,
    jpeg_pixels,
    png_pixels,
)

if TYPE_CHECKING:
    from PIL.Image import Image

__all__ = ["BYTE_LIMIT", "JPEG_SIGNATURE", "PIXEL_LIMIT", "PNG_SIGNATURE", "decode_labels", "read_labels", "read_photo"]

BYTE_LIMIT = 2**28
COLOUR_TYPES = {0: "grey", 2: "colour (RGB)", 3: "palette", 4: "grey with alpha", 6: "colour with alpha (RGBA)"}
Values = TypeVar("Values", np.int32, np.uint8)
STRIP = 256
"""Rows that are copied at a time: a whole copy more would double the memory of a large photo."""


def read_labels(path: str | PathLike[str], what: str = "labels") -> NDArray[np.int32]:
    """The values of a grey PNG of 8 or 16 bits, shape (H, W).

    Parameters
    ----------
    path
        Of the file.
    what
        What messages call its values.

    Raises
    ------
    InvalidImage
        If the file is missing, no PNG, damaged, larger than `PIXEL_LIMIT` says, or not grey of 8 or 16 bits.
    MissingDependency
        Without Pillow.
    """
    return decode_labels(_bytes(path), path, what)


def decode_labels(data: bytes, path: str | PathLike[str], what: str = "labels") -> NDArray[np.int32]:
    """The values in the bytes of a PNG that `path` names in messages; otherwise as `read_labels`."""
    if data.startswith(JPEG_SIGNATURE):
        raise InvalidImage(f"{path}: this is a JPEG, which does not keep values exact; save the {what} as a 16-bit PNG")
    if not data.startswith(PNG_SIGNATURE):
        raise InvalidImage(f"{path}: expected a PNG file with {what}, got something else ({data[:8]!r}...)")
    header = PngHeader.of(data, path)
    if header.colour_type != 0 or header.bits < 8:
        kind = COLOUR_TYPES.get(header.colour_type, f"colour type {header.colour_type}")
        raise InvalidImage(
            f"{path}: expected a grey PNG of 8 or 16 bits whose values are {what}, got {kind} of {header.bits} bits; "
            f"save the array of {what} itself, not a picture of it"
        )
    check_size(header.width, header.height, path)
    pixels = png_pixels(data, path)
    header.check_content(pixels.content, path)
    image = _opened(pixels, path, what)
    return _in_strips(image, np.empty((header.height, header.width), dtype=np.int32))


def read_photo(path: str | PathLike[str]) -> NDArray[np.uint8]:
    """A JPEG or PNG photo as RGB, upright as its EXIF data say, shape (H, W, 3).

    A JPEG that is damaged between its beginning and its end is shown as far as it can be, as every decoder does.

    Raises
    ------
    InvalidImage
        If the file is missing, neither JPEG nor PNG, damaged, or larger than `PIXEL_LIMIT` says.
    MissingDependency
        Without Pillow.
    """
    data = _bytes(path)
    if data.startswith(PNG_SIGNATURE):
        header = PngHeader.of(data, path)
        check_size(header.width, header.height, path)
        pixels = png_pixels(data, path)
    elif data.startswith(JPEG_SIGNATURE):
        pixels = jpeg_pixels(data, path)
        check_size(pixels.width, pixels.height, path)
    else:
        raise InvalidImage(f"{path}: expected a JPEG or PNG photo, got something else ({data[:8]!r}...)")
    image = _opened(pixels, path, "photo")
    return _upright(_in_strips(image, np.empty((pixels.height, pixels.width, 3), dtype=np.uint8)), pixels.orientation)


def _opened(pixels: Pixels, path: str | PathLike[str], what: str) -> Image:
    """The image, decoded."""
    try:
        from PIL.JpegImagePlugin import JpegImageFile
        from PIL.PngImagePlugin import PngImageFile
    except ImportError:
        raise MissingDependency.for_extra(f"reading {what}", ["pillow"], "perception") from None
    kind = PngImageFile if pixels.file.startswith(PNG_SIGNATURE) else JpegImageFile
    name = "PNG" if kind is PngImageFile else "JPEG"
    try:
        image = kind(io.BytesIO(pixels.file))
        if image.size != (pixels.width, pixels.height):
            raise ValueError("it declares two sizes")
        image.load()
    except MemoryError:
        raise
    except Exception as problem:
        # A damaged file raises whatever the parser of its part raises.
        raise InvalidImage(f"{path}: the {name} cannot be decoded; it is damaged ({problem})") from None
    return image


def _in_strips(image: Image, out: NDArray[Values]) -> NDArray[Values]:
    """The image's pixels, as labels (H, W) or as RGB (H, W, 3)."""
    height, width = out.shape[:2]
    for top in range(0, height, STRIP):
        below = min(height, top + STRIP)
        strip = image.crop((0, top, width, below))
        if out.ndim == 2:
            out[top:below] = np.asarray(strip)
        elif image.mode.startswith("I"):
            # 16 bits of grey, which Pillow would cut off at 255.
            out[top:below] = (np.asarray(strip) >> 8)[:, :, None]
        else:
            out[top:below] = np.asarray(strip.convert("RGB"))
    return out


def _upright(photo: NDArray[np.uint8], orientation: int) -> NDArray[np.uint8]:
    """The photo as the camera was held (EXIF 2.32, tag 0x0112)."""
    turned = photo.transpose(1, 0, 2) if orientation >= 5 else photo
    if orientation in (3, 4, 7, 8):
        turned = turned[::-1]
    if orientation in (2, 3, 6, 7):
        turned = turned[:, ::-1]
    return np.ascontiguousarray(turned)


def _bytes(path: str | PathLike[str]) -> bytes:
    """The whole file, by Python's own I/O, which takes every path that the system takes."""
    data = read_bytes(Path(path), BYTE_LIMIT, InvalidImage)
    if not data:
        raise InvalidImage(f"{path}: expected an image, got an empty file")
    return data
