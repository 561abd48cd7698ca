"""NumPy files: `.npy` and `.npz` with a label map (H, W), or with masks (N, H, W) of which non-zero means inside.

Of an archive the array `masks` is read, or else `labels`, or else its only array. Stacks of masks are read one mask at a
time: 143 masks of 1024 x 768 pixels take 112 MB together, and packed they may take 300 times less. Nothing is ever
unpickled, and no more is read than the header declares and the limits allow.
"""

from __future__ import annotations

import re
import zipfile
from dataclasses import dataclass
from pathlib import Path
from typing import IO, Any

import numpy as np
from numpy.typing import NDArray

from pscover.errors import InvalidImage
from pscover.files import opened
from pscover.io.npz import LITERAL
from pscover.perception.connectors._collect import MASK_LIMIT, Collector, agreed, trimmed
from pscover.perception.connectors.contract import AnnotationFormat, Annotations, Request
from pscover.perception.connectors.label_png import masks_of_labels

NPY_SIGNATURE = b"\x93NUMPY"
ZIP_SIGNATURE = b"PK\x03\x04"
UNPACKED_LIMIT = 2**30
"""An array may have this many bytes; masks are read one at a time, label maps have at most `PIXEL_LIMIT` pixels."""

MEMBER_LIMIT = 1000
KINDS = re.compile(r"[<>|=](b1|[iu][1248])")


@dataclass(frozen=True, slots=True)
class Header:
    """What an array declares of itself."""

    dtype: np.dtype[Any]
    column_major: bool
    shape: tuple[int, ...]


def _read(request: Request) -> Annotations:
    with opened(request.path, UNPACKED_LIMIT, InvalidImage) as file:
        signature = file.read(6)
        file.seek(0)
        if signature == NPY_SIGNATURE:
            return _array(file, request, str(request.path))
        try:
            with zipfile.ZipFile(file) as archive:
                member = _member(archive, request.path)
                with archive.open(member) as stream:
                    return _array(stream, request, f"{request.path}: {member.filename.removesuffix('.npy')}")
        except (InvalidImage, MemoryError):
            raise
        except Exception as error:
            # A damaged archive makes zipfile and zlib raise errors of a dozen types.
            raise InvalidImage(f"{request.path}: expected NumPy's format, got a damaged file: {error}") from None


def _member(archive: zipfile.ZipFile, path: Path) -> zipfile.ZipInfo:
    """The array to read, which declares no more than the limits allow."""
    members = {member.filename.removesuffix(".npy"): member for member in archive.infolist()[:MEMBER_LIMIT]}
    only = list(members) if len(members) == 1 else []
    name = next((known for known in ["masks", "labels", *only] if known in members), None)
    if name is None:
        names = ", ".join(members)[:200] or "none"
        raise InvalidImage(f"{path}: expected an array 'masks' or 'labels', got {names}")
    member = members[name]
    if member.flag_bits & 1 or member.compress_type not in (zipfile.ZIP_STORED, zipfile.ZIP_DEFLATED):
        raise InvalidImage(f"{path}: {name}: expected a stored or deflated array, got another packing")
    if member.file_size > UNPACKED_LIMIT:
        raise InvalidImage(f"{path}: {name}: expected at most {UNPACKED_LIMIT} bytes unpacked, got {member.file_size}")
    return member


def _array(stream: IO[bytes], request: Request, place: str) -> Annotations:
    header = _header(stream, place)
    if header.column_major and len(header.shape) == 3:
        raise InvalidImage(f"{place}: expected masks in C order, got Fortran order; save np.ascontiguousarray(masks)")
    if len(header.shape) == 3:
        return _stack(stream, header, request, place)
    labels = _pixels(stream, header, (header.shape[0], header.shape[1]), request.shape, place)
    _expect_end(stream, place)
    return masks_of_labels(labels.astype(np.uint8) if labels.dtype == np.bool_ else labels, place, request.shape)


def _stack(stream: IO[bytes], header: Header, request: Request, place: str) -> Annotations:
    count, height, width = header.shape
    if count > MASK_LIMIT:
        raise InvalidImage(f"{place}: expected at most {MASK_LIMIT} masks, got {count}")
    shape = agreed((height, width), request.shape, place)
    collector = Collector(place)
    for k in range(count):
        collector.look_at(height * width)
        pixels = _pixels(stream, header, shape, request.shape, f"{place}[{k}]")
        collector.add(trimmed(pixels != 0, 0, 0))
    _expect_end(stream, place)
    return collector.annotations(shape)


def _header(stream: IO[bytes], place: str) -> Header:
    start = stream.read(8)
    major = start[6] if len(start) == 8 and start[:6] == NPY_SIGNATURE else 0
    if major not in (1, 2, 3):
        raise InvalidImage(f"{place}: expected an array in NumPy's format (.npy) of version 1 to 3, got {start!r}")
    length = int.from_bytes(stream.read(2 if major == 1 else 4), "little")
    text = stream.read(min(length, 10_000))
    found = LITERAL.fullmatch(text)
    if found is None:
        raise InvalidImage(f"{place}: expected a header with descr, fortran_order and shape, got {text[:60]!r}")
    kind, shape = found[1].decode("latin-1"), tuple(int(size) for size in re.findall(rb"\d+", found[3]))
    if not KINDS.fullmatch(kind):
        hint = "pickled objects are not read" if "O" in kind else "convert with .astype(int), or > 0.5 for masks"
        raise InvalidImage(f"{place}: expected whole numbers or booleans, got the type {kind!r}; {hint}")
    if len(shape) not in (2, 3):
        raise InvalidImage(f"{place}: expected labels of shape (H, W) or masks of shape (N, H, W), got {shape}")
    return Header(np.dtype(kind), found[2] == b"True", shape)


def _pixels(
    stream: IO[bytes], header: Header, shape: tuple[int, int], asked: tuple[int, int] | None, place: str
) -> NDArray[Any]:
    """The next image of the stream."""
    height, width = agreed(shape, asked, place)
    size = height * width * header.dtype.itemsize
    data = stream.read(size)
    if len(data) != size:
        raise InvalidImage(f"{place}: expected {size} bytes for {width} x {height} of {header.dtype}, got {len(data)}")
    pixels = np.frombuffer(data, dtype=header.dtype).reshape(shape, order="F" if header.column_major else "C")
    return pixels.astype(header.dtype.newbyteorder("="), copy=False)


def _expect_end(stream: IO[bytes], place: str) -> None:
    if stream.read(1):
        raise InvalidImage(f"{place}: expected as many bytes as the header declares, got more")


annotation_format = AnnotationFormat(
    name="numpy",
    recognises=lambda sample: sample.head.startswith((NPY_SIGNATURE, ZIP_SIGNATURE)),
    read=_read,
)
