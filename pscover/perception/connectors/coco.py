"""COCO JSON: polygons (perhaps several an object), and both forms of run-length encoding.

A document has `images`, `annotations` and `categories`; a bare list of results (`image_id`, `segmentation`, `score`) is read
too. Of several images one is chosen by its file name or number. The name of a mask is that of its category. `bbox` is
(x, y, width, height) and, like `area` (which COCO takes from the polygons), not needed. Written masks are run-length
encoded, exactly: uncompressed by default, compressed by the format `coco-compressed`, which needs pycocotools.
"""

from __future__ import annotations

from collections.abc import Callable
from pathlib import PurePosixPath

import msgspec
import numpy as np

from pscover.errors import InvalidImage
from pscover.perception.connectors._collect import Collector, agreed, union
from pscover.perception.connectors._documents import decode, few_numbers, is_object, read_document
from pscover.perception.connectors._outlines import filled
from pscover.perception.connectors._rle import Rle, counts_of, decoded, text_of
from pscover.perception.connectors.contract import AnnotationFormat, Annotations, Request
from pscover.perception.mask import Mask

UNNAMED = "garment"
"""What written masks without a name are called."""

LISTED = 5


class Picture(msgspec.Struct):
    """An image of a document."""

    id: int | str
    file_name: str = ""
    width: int | None = None
    height: int | None = None


class Category(msgspec.Struct):
    """What objects may be."""

    id: int
    name: str = ""


class Item(msgspec.Struct):
    """An annotation or a result."""

    segmentation: msgspec.Raw
    image_id: int | str
    category_id: int | None = None
    score: float | None = None


class Document(msgspec.Struct):
    """A data set."""

    annotations: list[Item]
    images: list[Picture]
    categories: list[Category] = []


def _read(request: Request) -> Annotations:
    content, source = read_document(request.path), str(request.path)
    if content.lstrip()[:1] == b"[":
        items, prefix = decode(content, list[Item], source), f"{source}: $"
        pictures = [Picture(number) for number in dict.fromkeys(item.image_id for item in items)]
        names: dict[int, str] = {}
    else:
        document = decode(content, Document, source)
        items, pictures, prefix = document.annotations, document.images, f"{source}: $.annotations"
        names = {category.id: category.name for category in document.categories}
    picture = _chosen(pictures, request.image, source)
    size = (picture.height, picture.width) if picture.height is not None and picture.width is not None else None
    collector = Collector(source)
    shape = request.shape if size is None else agreed(size, request.shape, source)
    for k, item in enumerate(items):
        if item.image_id == picture.id:
            mask, shape = _mask(item, shape, collector, f"{prefix}[{k}].segmentation")
            name = "" if item.category_id is None else names.get(item.category_id, "")
            collector.add(mask, score=1.0 if item.score is None else item.score, name=name)
    return collector.annotations(agreed(shape, None, source), picture.file_name)


def _chosen(pictures: list[Picture], asked: str | int | None, source: str) -> Picture:
    names = ", ".join(picture.file_name or str(picture.id) for picture in pictures[:LISTED])
    known = f"{names}{', ...' if len(pictures) > LISTED else ''}" or "none"
    if asked is None:
        if len(pictures) != 1:
            raise InvalidImage(f"{source}: expected one image, got {len(pictures)} ({known}); say which, by its file name")
        return pictures[0]
    tests: tuple[Callable[[Picture], bool], ...] = (
        lambda picture: picture.id == asked,
        lambda picture: picture.file_name == asked,
        lambda picture: bool(picture.file_name) and PurePosixPath(picture.file_name).name == asked,
        lambda picture: str(picture.id) == asked,
    )
    for test in tests:
        found = [picture for picture in pictures if test(picture)]
        if len(found) > 1:
            raise InvalidImage(f"{source}: expected one image {asked!r}, got {len(found)}")
        if found:
            return found[0]
    raise InvalidImage(f"{source}: expected an image {asked!r}, got only {known}")


def _mask(
    item: Item, asked: tuple[int, int] | None, collector: Collector, place: str
) -> tuple[Mask | None, tuple[int, int]]:
    few_numbers(item.segmentation, place)
    if is_object(item.segmentation):
        rle = decode(item.segmentation, Rle, place)
        return decoded(rle, asked, collector, place), rle.size
    outlines = decode(item.segmentation, list[list[float]], place)
    if not outlines:
        raise InvalidImage(f"{place}: expected polygons or runs, got an empty list; a box is no mask")
    shape = agreed(None, asked, place)
    parts = []
    for k, outline in enumerate(outlines):
        if len(outline) % 2:
            raise InvalidImage(f"{place}[{k}]: expected x and y of each corner, got {len(outline)} numbers")
        parts.append(filled(np.reshape(outline, (-1, 2)), shape, collector, f"{place}[{k}]"))
    return _united([part for part in parts if part is not None], collector), shape


def _united(parts: list[Mask], collector: Collector) -> Mask | None:
    if len(parts) > 1:
        tops, lefts = [part.top for part in parts], [part.left for part in parts]
        height = max(part.top + part.bits.shape[0] for part in parts) - min(tops)
        collector.look_at(height * (max(part.left + part.bits.shape[1] for part in parts) - min(lefts)))
    return union(parts)


def _encoder(written: Callable[[list[int], tuple[int, int]], list[int] | str]) -> Callable[[Annotations], bytes]:
    """What writes a document, given what writes the runs."""

    def encode(annotations: Annotations) -> bytes:
        height, width = annotations.shape
        numbers = {
            name: k for k, name in enumerate(dict.fromkeys(mask.name or UNNAMED for mask in annotations.masks), start=1)
        }
        items = [
            {
                "id": k,
                "image_id": 1,
                "category_id": numbers[mask.name or UNNAMED],
                "bbox": [mask.left, mask.top, mask.bits.shape[1], mask.bits.shape[0]],
                "area": mask.area,
                "iscrowd": 0,
                "score": mask.score,
                "segmentation": {
                    "size": [height, width],
                    "counts": written(counts_of(mask, annotations.shape), (height, width)),
                },
            }
            for k, mask in enumerate(annotations.masks, start=1)
        ]
        document = {
            "images": [{"id": 1, "file_name": annotations.image, "width": width, "height": height}],
            "annotations": items,
            "categories": [{"id": number, "name": name} for name, number in numbers.items()],
        }
        try:
            return msgspec.json.encode(document) + b"\n"
        except UnicodeEncodeError as error:
            raise InvalidImage(f"expected names that are text in Unicode, got {error.object!r}") from None

    return encode


annotation_format = AnnotationFormat(
    name="coco",
    recognises=lambda sample: (
        (sample.document == "object" and "images" in sample.fields)
        or (sample.document == "list" and "image_id" in sample.fields)
    ),
    read=_read,
    encode=_encoder(lambda counts, shape: counts),
    suffixes=(".json",),
)

compressed_format = AnnotationFormat(
    name="coco-compressed", recognises=lambda sample: False, read=_read, encode=_encoder(text_of)
)
