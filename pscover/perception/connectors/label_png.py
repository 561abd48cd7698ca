"""Label images: a grey PNG of 8 or 16 bits in which a pixel's value names its garment, 0 being the surface.

Label maps hold one label a pixel. Masks that overlap are painted largest first, so that small ones lie on top; of equal
ones the later lies on top. A mask keeps its number in the order of the masks, from 1, also where others are hidden.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy import ndimage

from pscover.encoding import MOST_LABEL, encode_labels
from pscover.errors import InvalidImage
from pscover.files import write_bytes
from pscover.images import PNG_SIGNATURE, read_labels
from pscover.perception.connectors._collect import MASK_LIMIT, Collector, agreed, trimmed
from pscover.perception.connectors.contract import AnnotationFormat, Annotations, Request

TABLE_LIMIT = 2**24


def masks_of_labels(labels: NDArray[np.integer], source: str, shape: tuple[int, int] | None = None) -> Annotations:
    """A mask for each label of a map, in ascending order of labels.

    Parameters
    ----------
    labels
        Whole numbers, shape (H, W); 0 is the surface.
    source
        Begins every message.
    shape
        The size that the image must have, or None.

    Raises
    ------
    InvalidImage
        For negative labels, another size, or more masks than the limits allow.

    Examples
    --------
    >>> [(mask.left, mask.area) for mask in masks_of_labels(np.array([[0, 7, 7], [0, 0, 300]]), "two").masks]
    [(1, 2), (2, 1)]
    """
    size = agreed((labels.shape[0], labels.shape[1]), shape, source)
    lowest, highest = int(labels.min()), int(labels.max())
    if lowest < 0:
        y, x = np.argwhere(labels == lowest)[0]
        raise InvalidImage(f"{source}: pixel x={x}, y={y}: expected a label from 0, got {lowest}")
    if highest > MOST_LABEL:
        labels = _renumbered(labels, highest, source).reshape(size)
    collector = Collector(source)
    windows = ndimage.find_objects(labels.astype(np.int32))
    found = [(label, window) for label, window in enumerate(windows, start=1) if window is not None]
    collector.reserve(len(found), sum((rows.stop - rows.start) * (cols.stop - cols.start) for _, (rows, cols) in found))
    for label, window in found:
        collector.add(trimmed(labels[window] == label, window[0].start, window[1].start))
    return collector.annotations(size)


def _renumbered(labels: NDArray[np.integer], highest: int, source: str) -> NDArray[np.integer]:
    """The rank of each pixel's label among those present, 0 staying 0: labels may be large, their number may not."""
    if highest <= TABLE_LIMIT:
        present = np.zeros(highest + 1, dtype=np.bool_)
        present[labels] = True
        present[0] = False
        count = int(np.count_nonzero(present))
        ranks: NDArray[np.integer] = np.cumsum(present, dtype=np.int32) * present
        if count <= MASK_LIMIT:
            return np.asarray(ranks[labels])
    else:
        values, inverse = np.unique(labels, return_inverse=True)
        count = len(values)
        if count <= MASK_LIMIT:
            return np.asarray(inverse + int(values[0] != 0))
    raise InvalidImage(f"{source}: expected at most {MASK_LIMIT} labels, got {count}")


def painted(annotations: Annotations) -> NDArray[np.int32]:
    """One label a pixel: mask k has the label k + 1, smaller masks lie on larger ones."""
    labels = np.zeros(annotations.shape, dtype=np.int32)
    areas = np.array([mask.area for mask in annotations.masks])
    for k in np.argsort(-areas, kind="stable"):
        mask = annotations.masks[k]
        labels[mask.window][mask.bits] = k + 1
    return labels


def write_labels(labels: ArrayLike, path: str | Path) -> None:
    """Write a label map as a PNG, whole or not at all; `pscover.images.read_labels` reads the same labels back.

    Raises
    ------
    InvalidImage
        If they are anything but whole numbers from 0 to 65535 of shape (H, W).
    PscoverError
        If the file cannot be written.
    """
    write_bytes(path, encode_labels(labels))


def _read(request: Request) -> Annotations:
    return masks_of_labels(read_labels(request.path), str(request.path), request.shape)


annotation_format = AnnotationFormat(
    name="label-png",
    recognises=lambda sample: sample.head.startswith((PNG_SIGNATURE, b"\xff\xd8\xff")),
    read=_read,
    encode=lambda annotations: encode_labels(painted(annotations)),
    suffixes=(".png",),
)
