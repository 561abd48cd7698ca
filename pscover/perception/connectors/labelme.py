"""LabelMe JSON: polygons, rectangles, circles, and masks as PNG.

Shapes with the same label and the same `group_id` are parts of one garment. A `mask` shape holds a grey PNG in base64,
cropped to the box between its two points, both inside. The name of a mask is the shape's label. The picture that
LabelMe may put into the file is passed over.
"""

from __future__ import annotations

import base64
import binascii
import struct
from collections.abc import Iterable

import msgspec
import numpy as np

from pscover.errors import InvalidImage
from pscover.images import decode_labels
from pscover.perception.connectors._collect import Collector, agreed, trimmed, union
from pscover.perception.connectors._documents import decode, few_numbers, read_document
from pscover.perception.connectors._outlines import disc, filled
from pscover.perception.connectors.contract import AnnotationFormat, Annotations, Request
from pscover.perception.mask import Mask

KNOWN = "polygon, rectangle, oriented_rectangle, circle or mask"

Point = tuple[float, float]


class Shape(msgspec.Struct):
    """What was drawn."""

    points: msgspec.Raw
    label: str = ""
    shape_type: str = "polygon"
    group_id: int | str | None = None
    mask: str | None = None


class Document(msgspec.Struct):
    """The annotations of one image."""

    shapes: list[Shape]
    imageHeight: int | None = None  # noqa: N815 - the document's own names
    imageWidth: int | None = None  # noqa: N815
    imagePath: str | None = None  # noqa: N815


def _read(request: Request) -> Annotations:
    source = str(request.path)
    document = decode(read_document(request.path), Document, source)
    known = document.imageHeight is not None and document.imageWidth is not None
    size = (document.imageHeight or 0, document.imageWidth or 0) if known else None
    shape = agreed(size, request.shape, source)
    collector = Collector(source)
    for group in _groups(document.shapes):
        parts = [_mask(document.shapes[k], shape, collector, f"{source}: $.shapes[{k}]") for k in group]
        drawn = [part for part in parts if part is not None]
        for part in drawn[1:]:
            # Joined, parts far from each other take the box around them.
            collector.look_at(part.bits.size)
        collector.reserve(1, _box(drawn))
        collector.add(union(drawn), name=document.shapes[group[0]].label)
    return collector.annotations(shape, document.imagePath or "")


def _groups(shapes: list[Shape]) -> Iterable[list[int]]:
    groups: dict[object, list[int]] = {}
    for k, shape in enumerate(shapes):
        key: object = k if shape.group_id is None else (shape.label, shape.group_id)
        groups.setdefault(key, []).append(k)
    return groups.values()


def _box(parts: list[Mask]) -> int:
    if not parts:
        return 0
    height = max(part.top + part.bits.shape[0] for part in parts) - min(part.top for part in parts)
    width = max(part.left + part.bits.shape[1] for part in parts) - min(part.left for part in parts)
    return int(height * width)


def _mask(drawn: Shape, shape: tuple[int, int], collector: Collector, place: str) -> Mask | None:
    spot = f"{place}.points"
    points = decode(few_numbers(drawn.points, spot), list[Point], spot)
    if drawn.shape_type in ("polygon", "oriented_rectangle"):
        return filled(np.reshape(points, (-1, 2)), shape, collector, spot)
    if drawn.shape_type not in ("rectangle", "circle", "mask"):
        raise InvalidImage(f"{place}.shape_type: expected {KNOWN}, got {drawn.shape_type[:60]!r}, which has no area")
    if len(points) != 2:
        raise InvalidImage(f"{spot}: expected two points of a {drawn.shape_type}, got {len(points)}")
    first, second = points
    if drawn.shape_type == "circle":
        return disc(first, second, shape, collector, spot)
    if drawn.shape_type == "rectangle":
        corners = [first, (second[0], first[1]), second, (first[0], second[1])]
        return filled(corners, shape, collector, spot)
    return _cropped(drawn.mask, first, second, shape, collector, place)


def _cropped(
    text: str | None, first: Point, second: Point, shape: tuple[int, int], collector: Collector, place: str
) -> Mask | None:
    """A mask whose pixels are given for the box from the first to the second point."""
    height, width = shape
    inside = 0 <= first[0] <= second[0] < width and 0 <= first[1] <= second[1] < height
    if not inside:
        raise InvalidImage(
            f"{place}.points: expected the upper left and the lower right pixel of a box within {width} x {height}, "
            f"got {first}, {second}"
        )
    left, top = round(first[0]), round(first[1])
    box = (min(round(second[1]), height - 1) - top + 1, min(round(second[0]), width - 1) - left + 1)
    if text is None:
        raise InvalidImage(f"{place}.mask: expected a PNG in base64, got none")
    try:
        data = base64.b64decode(text, validate=True)
    except (binascii.Error, ValueError) as error:
        raise InvalidImage(f"{place}.mask: expected a PNG in base64, got damaged text: {error}") from None
    # Looked at before anything is decoded: a small PNG may declare many pixels.
    declared = struct.unpack(">II", data[16:24])[::-1] if len(data) >= 24 else None
    if declared is not None and declared != box:
        raise InvalidImage(
            f"{place}.mask: expected a PNG of the points' box, {box[1]} x {box[0]}, got {declared[1]} x {declared[0]}"
        )
    collector.look_at(box[0] * box[1])
    return trimmed(decode_labels(data, f"{place}.mask") != 0, top, left)


annotation_format = AnnotationFormat(
    name="labelme",
    recognises=lambda sample: sample.document == "object" and "shapes" in sample.fields and "images" not in sample.fields,
    read=_read,
)
