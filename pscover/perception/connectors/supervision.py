"""Objects like the `Detections` of the package supervision, to which the outputs of many models can be converted.

The package itself is not needed: an object with `mask` (booleans of shape (N, H, W), a `CompactMask`, or None) and perhaps
`confidence` and `data` is taken. Where `mask` is None, `data["rle_masks"]` may have run-length encoded masks, and
`data["class_name"]` the names.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, Protocol

import numpy as np

from pscover.errors import InvalidImage
from pscover.perception.connectors._collect import Collector, agreed
from pscover.perception.connectors.contract import Annotations
from pscover.perception.connectors.sam_records import mask_of, number


class Detections(Protocol):
    """What is needed of a `supervision.Detections`."""

    @property
    def mask(self) -> Any:
        """Masks of shape (N, H, W), or None."""

    @property
    def xyxy(self) -> Any:
        """Boxes, shape (N, 4)."""


def masks_of_detections(
    detections: Detections, *, shape: tuple[int, int] | None = None, source: str = "detections"
) -> Annotations:
    """The masks of detections.

    Parameters
    ----------
    detections
        Of one image; not changed.
    shape
        Height and width of the image, needed only where there may be no detection.
    source
        What to call the detections in messages.

    Raises
    ------
    InvalidImage
        If the detections have boxes without masks, or masks that are none.

    Examples
    --------
    >>> from types import SimpleNamespace
    >>> two = np.array([[[1, 1, 0]], [[0, 0, 1]]], dtype=bool)
    >>> found = masks_of_detections(SimpleNamespace(mask=two, xyxy=np.zeros((2, 4)), confidence=np.array([0.9, 0.5])))
    >>> found.shape, [(mask.area, mask.score) for mask in found.masks]
    ((1, 3), [(2, 0.9), (1, 0.5)])
    """
    data = getattr(detections, "data", None)
    data = data if isinstance(data, Mapping) else {}
    masks = getattr(detections, "mask", None)
    if masks is None:
        masks = data.get("rle_masks")
    boxes = getattr(detections, "xyxy", None)
    count = 0 if boxes is None else len(boxes)
    if masks is None:
        if count:
            raise InvalidImage(f"{source}: expected masks, got {count} boxes without; use a model that segments")
        masks = ()
    elif boxes is not None and len(masks) != count:
        raise InvalidImage(f"{source}: expected a mask for each of {count} boxes, got {len(masks)}")
    collector = Collector(source)
    scores = _each(getattr(detections, "confidence", None), len(masks), f"{source}: confidence")
    names = _each(data.get("class_name"), len(masks), f"{source}: class_name")
    for k in range(len(masks)):
        # One at a time: a compact mask is unpacked by its index, so that no stack of whole images is made.
        mask, shape = mask_of(masks[k], shape, collector, f"{source}: mask {k}")
        score = number(scores[k], f"{source}: confidence[{k}]")
        collector.add(mask, score=1.0 if score is None else score, name="" if names[k] is None else str(names[k]))
    return collector.annotations(agreed(shape, None, source))


def _each(given: Any, count: int, place: str) -> list[Any]:
    values: list[Any] = [None] * count if given is None else np.asarray(given).tolist()
    if len(values) != count:
        raise InvalidImage(f"{place}: expected {count}, one a mask, got {len(values)}")
    return values
