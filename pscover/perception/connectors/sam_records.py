"""Records of a Segment Anything automatic mask generator: what its `generate(image)` returns, also in a JSON file.

A record has `segmentation` (an array of booleans, or either form of run-length encoding), `area`, `bbox` (x, y, width,
height), `predicted_iou`, `stability_score`, `point_coords` and `crop_box`. Masks overlap and come in no order. The score is
`predicted_iou`, cut to [0, 1]; a declared area that differs by more than 1 % from the decoded one means a damaged record;
boxes are not needed. A JSON object with `image` and `annotations`, as in the SA-1B data set, is read too.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Annotated, Any

import msgspec
import numpy as np

from pscover.errors import InvalidImage
from pscover.perception.connectors._collect import Collector, agreed, trimmed
from pscover.perception.connectors._documents import convert, decode, few_numbers, is_object, read_document
from pscover.perception.connectors._rle import Rle, decoded
from pscover.perception.connectors.contract import AnnotationFormat, Annotations, Request
from pscover.perception.mask import Mask

AREA_TOLERANCE = 0.01

Pixel = bool | Annotated[int, msgspec.Meta(ge=0, le=1)]


class Record(msgspec.Struct):
    """A record in a file."""

    segmentation: msgspec.Raw
    predicted_iou: float | None = None
    area: float | None = None


class Picture(msgspec.Struct):
    """The image of an SA-1B document."""

    width: int | None = None
    height: int | None = None
    file_name: str = ""


class Document(msgspec.Struct):
    """A document of the SA-1B data set."""

    annotations: list[Record]
    image: Picture


def masks_of_records(
    records: Sequence[Mapping[str, Any]], *, shape: tuple[int, int] | None = None, source: str = "records"
) -> Annotations:
    """The masks in records as a mask generator returns them.

    Parameters
    ----------
    records
        What `generate(image)` returned; whichever form the masks have.
    shape
        Height and width of the image, needed only where there may be no record.
    source
        What to call the records in messages.

    Raises
    ------
    InvalidImage
        With the record's number, what was expected and what was found.

    Examples
    --------
    >>> found = masks_of_records([{"segmentation": {"size": [2, 3], "counts": [2, 1, 3]}, "area": 1, "predicted_iou": 0.9}])
    >>> found.shape, found.masks[0].left, found.masks[0].score
    ((2, 3), 1, 0.9)
    """
    collector = Collector(source)
    for k, record in enumerate(records):
        place = f"{source}: record {k}"
        if not isinstance(record, Mapping) or "segmentation" not in record:
            raise InvalidImage(f"{place}: expected a mapping with 'segmentation', got {type(record).__name__}")
        mask, shape = mask_of(record["segmentation"], shape, collector, f"{place}: segmentation")
        area, score = (number(record.get(key), f"{place}: {key}") for key in ("area", "predicted_iou"))
        _check_area(mask, area, place)
        collector.add(mask, score=1.0 if score is None else score)
    return collector.annotations(agreed(shape, None, source))


def mask_of(
    segmentation: Any, asked: tuple[int, int] | None, collector: Collector, place: str
) -> tuple[Mask | None, tuple[int, int]]:
    """One mask in any of a generator's forms (None if it has no pixel), and the size of its image."""
    if isinstance(segmentation, Mapping):
        counts = segmentation.get("counts")
        if isinstance(counts, bytes):
            counts = counts.decode("latin-1")
        elif not isinstance(counts, str):
            counts = _plain(counts)
        rle = convert({"size": _plain(segmentation.get("size")), "counts": counts}, Rle, place)
        return decoded(rle, asked, collector, place), rle.size
    try:
        pixels = np.asarray(segmentation)
    except (TypeError, ValueError, RuntimeError) as error:
        raise InvalidImage(f"{place}: expected booleans of shape (H, W) or runs, got no array: {error}") from None
    if pixels.ndim != 2 or pixels.dtype.kind not in "biu":
        raise InvalidImage(f"{place}: expected booleans of shape (H, W) or runs, got {pixels.dtype} of shape {pixels.shape}")
    shape = agreed((pixels.shape[0], pixels.shape[1]), asked, place)
    return trimmed(pixels != 0, 0, 0), shape


def recorded(record: Record, asked: tuple[int, int] | None, collector: Collector, place: str) -> tuple[int, int]:
    """Add the mask of a record of a file; returns the size of its image."""
    inner = f"{place}.segmentation"
    few_numbers(record.segmentation, inner)
    if is_object(record.segmentation):
        rle = decode(record.segmentation, Rle, inner)
        mask, shape = decoded(rle, asked, collector, inner), rle.size
    else:
        rows = decode(record.segmentation, list[list[Pixel]], inner)
        if len({len(row) for row in rows}) != 1:
            raise InvalidImage(f"{inner}: expected rows of one length, got {sorted({len(row) for row in rows})[:4]}")
        mask, shape = mask_of(np.array(rows, dtype=np.bool_), asked, collector, inner)
    _check_area(mask, record.area, place)
    collector.add(mask, score=1.0 if record.predicted_iou is None else record.predicted_iou)
    return shape


def _read(request: Request) -> Annotations:
    content, source = read_document(request.path), str(request.path)
    collector, shape, image, prefix = Collector(source), request.shape, "", f"{source}: $"
    if content.lstrip()[:1] == b"{":
        document = decode(content, Document, source)
        records, image, prefix = document.annotations, document.image.file_name, f"{prefix}.annotations"
        if document.image.width and document.image.height:
            shape = agreed((document.image.height, document.image.width), shape, source)
    else:
        records = decode(content, list[Record], source)
    for k, record in enumerate(records):
        shape = recorded(record, shape, collector, f"{prefix}[{k}]")
    return collector.annotations(agreed(shape, None, source), image)


def _check_area(mask: Mask | None, declared: float | None, place: str) -> None:
    area = 0 if mask is None else mask.area
    if declared is not None and not abs(declared - area) <= max(1.0, AREA_TOLERANCE * area):
        raise InvalidImage(f"{place}: expected a mask with the record's area of {declared:g} pixels, got {area}: damaged")


def number(value: Any, place: str) -> float | None:
    """A number that may be NumPy's or torch's, or None; `InvalidImage` for anything else."""
    plain = value.item() if hasattr(value, "item") and getattr(value, "size", 1) == 1 else value
    return None if plain is None else convert(plain, float, place)


def _plain(value: Any) -> Any:
    """Arrays, and lists of NumPy's numbers, as lists of Python's."""
    if hasattr(value, "tolist"):
        return value.tolist()
    return [_plain(entry) for entry in value] if isinstance(value, (list, tuple)) else value


annotation_format = AnnotationFormat(
    name="sam-records",
    recognises=lambda sample: (
        (sample.document == "list" and "image_id" not in sample.fields)
        or (sample.document == "object" and "image" in sample.fields and "images" not in sample.fields)
    ),
    read=_read,
)
