"""A folder as Segment Anything's script `amg.py` writes it: one PNG a mask, and `metadata.csv` with a line for each.

The PNG of the mask in line `id` is `<id>.png`: grey, 0 outside, of the image's size. The score is `predicted_iou`.
"""

from __future__ import annotations

import csv
import io
import math
import re
import struct
from pathlib import Path

from pscover.errors import InvalidImage
from pscover.files import read_bytes
from pscover.images import BYTE_LIMIT, PIXEL_LIMIT, decode_labels
from pscover.perception.connectors._collect import MASK_LIMIT, Collector, agreed, trimmed
from pscover.perception.connectors.contract import AnnotationFormat, Annotations, Request

TABLE = "metadata.csv"
TABLE_LIMIT = 2**24


def _read(request: Request) -> Annotations:
    collector, shape = Collector(str(request.path)), request.shape
    for number, score in _lines(request.path / TABLE):
        path = request.path / f"{number}.png"
        data = read_bytes(path, BYTE_LIMIT, InvalidImage)
        if len(data) >= 24:
            width, height = struct.unpack(">II", data[16:24])
            collector.look_at(min(width * height, PIXEL_LIMIT))
        pixels = decode_labels(data, path)
        shape = agreed((pixels.shape[0], pixels.shape[1]), shape, str(path))
        collector.add(trimmed(pixels != 0, 0, 0), score=score)
    return collector.annotations(agreed(shape, None, str(request.path)))


def _lines(path: Path) -> list[tuple[int, float]]:
    """Number and score of each mask."""
    content = read_bytes(path, TABLE_LIMIT, InvalidImage)
    try:
        lines = list(csv.reader(io.StringIO(content.decode(), newline="")))
    except (UnicodeDecodeError, csv.Error) as error:
        raise InvalidImage(f"{path}: expected a table of comma-separated values, got an error: {error}") from None
    header = lines[0] if lines else []
    if "id" not in header:
        raise InvalidImage(f"{path}: line 1: expected column names with 'id', got {','.join(header)[:60]!r}")
    rows = [(k, line) for k, line in enumerate(lines[1:], start=2) if line]
    if len(rows) > MASK_LIMIT:
        raise InvalidImage(f"{path}: expected at most {MASK_LIMIT} masks, got {len(rows)}")
    at = header.index("id")
    scored = header.index("predicted_iou") if "predicted_iou" in header else None
    return [(_number(line, at, path, k), _score(line, scored, path, k)) for k, line in rows]


def _number(line: list[str], at: int, path: Path, row: int) -> int:
    text = line[at] if at < len(line) else ""
    # The number becomes part of a path.
    if not re.fullmatch(r"[0-9]{1,9}", text):
        raise InvalidImage(f"{path}: line {row}: expected a whole number as id, got {text[:60]!r}")
    return int(text)


def _score(line: list[str], at: int | None, path: Path, row: int) -> float:
    if at is None:
        return 1.0
    text = line[at] if at < len(line) else ""
    try:
        score = float(text)
    except ValueError:
        score = math.nan
    if not math.isfinite(score):
        raise InvalidImage(f"{path}: line {row}: expected a number as predicted_iou, got {text[:60]!r}")
    return score


annotation_format = AnnotationFormat(name="sam-folder", recognises=lambda sample: not sample.head, read=_read)
