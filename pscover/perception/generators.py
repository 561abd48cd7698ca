"""Any model that segments a photo by itself, as a segmenter.

Mask generators of the SAM family (SAM 2, FastSAM, HQ-SAM, ...) have a method `generate(image)` that returns records; other
models' results convert to `supervision.Detections`. Either is taken by its shape: none of these packages is imported.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, ClassVar, Protocol, runtime_checkable

import numpy as np
from numpy.typing import NDArray

from pscover.errors import InvalidImage
from pscover.perception.connectors.sam_records import masks_of_records
from pscover.perception.connectors.supervision import masks_of_detections
from pscover.perception.mask import Mask
from pscover.perception.promptable import checked
from pscover.perception.segmenter import Segmentation
from pscover.perception.stopwatch import Stopwatch


@runtime_checkable
class Generator(Protocol):
    """What is asked of a mask generator."""

    def generate(self, image: NDArray[np.uint8]) -> Any:
        """Records, or detections, for an RGB photo of shape (H, W, 3)."""
        ...


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Generated:
    """A segmenter made of somebody else's model.

    Parameters
    ----------
    generator
        An object with a method `generate(image)`, or a function of the image. Either returns the records of a mask
        generator (a list of mappings with `segmentation` as booleans or run-length encoded) or a `supervision.Detections`.

    Examples
    --------
    >>> def dark(image):
    ...     return [{"segmentation": image[:, :, 0] < 128, "predicted_iou": 0.9}]
    >>> photo = np.array([[[9, 9, 9], [200, 0, 0]]], dtype=np.uint8)
    >>> found = Generated(generator=dark).segment(photo, np.ones((1, 2), dtype=bool))
    >>> [(mask.left, mask.area, mask.score) for mask in found.masks]
    [(0, 1, 0.9)]
    """

    generator: Generator | Callable[[NDArray[np.uint8]], Any]

    name: ClassVar[str] = "generated"
    requires: ClassVar[tuple[str, ...]] = ()
    extra: ClassVar[str] = ""

    def segment(self, photo: NDArray[np.uint8], cloth: NDArray[np.bool_]) -> Segmentation:
        """The generator's masks; the cloth map is not shown to it.

        Raises
        ------
        InvalidImage
            If photo or cloth map have the wrong shape or type, or what the generator returns are no masks of the photo.
        """
        photo, _ = checked(photo, cloth)
        generate = self.generator.generate if isinstance(self.generator, Generator) else self.generator
        watch = Stopwatch()
        with watch.stage("generator"):
            # A copy: models that draw into their input would change the caller's photo.
            result = generate(photo.copy())
        return Segmentation(masks=masks_of_generated(result, photo.shape[:2]), stages=watch.stages)


def masks_of_generated(result: Any, shape: tuple[int, int]) -> tuple[Mask, ...]:
    """The masks in what a generator returned: records or detections; those without a pixel are left out.

    Parameters
    ----------
    result
        A sequence of records, or an object like `supervision.Detections`, whose `mask` may be a stack of booleans, a
        `CompactMask`, or None with run-length encoded masks in `data["rle_masks"]`.
    shape
        Height and width of the photo.

    Raises
    ------
    InvalidImage
        If they are no masks of this photo.
    """
    if hasattr(result, "mask") and hasattr(result, "xyxy"):
        return masks_of_detections(result, shape=shape, source="the generator's detections").masks
    if isinstance(result, Sequence) and not isinstance(result, (str, bytes)):
        records: Sequence[Mapping[str, Any]] = result
        return masks_of_records(records, shape=shape, source="the generator's records").masks
    raise InvalidImage(
        f"generator: expected a list of records or an object like supervision.Detections, got {type(result).__name__}"
    )
