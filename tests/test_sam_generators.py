"""Somebody else's models as segmenters: records in their three forms, and detections."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from pscover.errors import InvalidImage
from pscover.perception.generators import Generated, masks_of_generated

PHOTO = np.zeros((4, 6, 3), dtype=np.uint8)
CLOTH = np.ones((4, 6), dtype=np.bool_)
BITS = np.zeros((4, 6), dtype=np.bool_)
BITS[1:3, 2:5] = True
RUNS = {"size": [4, 6], "counts": [9, 2, 2, 2, 2, 2, 5]}


class Compact:
    """Masks that are unpacked on request, as `supervision.CompactMask`."""

    def __len__(self) -> int:
        return 1

    def __getitem__(self, k: int) -> NDArray[np.bool_]:
        return BITS

    def to_dense(self) -> NDArray[np.bool_]:
        return BITS[None]


@dataclass
class Detections:
    """What `supervision.Detections` looks like."""

    mask: Any
    xyxy: NDArray[np.float64] = field(default_factory=lambda: np.zeros((1, 4)))
    confidence: NDArray[np.float64] | None = None
    data: dict[str, Any] = field(default_factory=dict)


class Model:
    """A generator that answers with what it was given."""

    def __init__(self, answer: Any) -> None:
        self.answer = answer

    def generate(self, image: NDArray[np.uint8]) -> Any:
        image[:] = 255
        return self.answer


@pytest.mark.parametrize(
    "answer",
    [
        [{"segmentation": BITS, "area": 6}],
        [{"segmentation": RUNS}],
        Detections(mask=BITS[None]),
        Detections(mask=Compact()),
        Detections(mask=None, data={"rle_masks": [RUNS]}),
    ],
    ids=["booleans", "runs", "detections", "compact", "runs in detections"],
)
def test_every_form_gives_the_same_mask(answer: Any) -> None:
    photo = PHOTO.copy()
    found = Generated(generator=Model(answer)).segment(photo, CLOTH)
    (mask,) = found.masks
    assert np.array_equal(mask.pixels((4, 6)), BITS)
    assert [stage.name for stage in found.stages] == ["generator"]
    assert not photo.any(), "the caller's photo was drawn into"


def test_compressed_runs_of_pycocotools() -> None:
    coder = pytest.importorskip("pycocotools.mask")
    (mask,) = masks_of_generated([{"segmentation": coder.encode(np.asfortranarray(BITS.astype(np.uint8)))}], (4, 6))
    assert np.array_equal(mask.pixels((4, 6)), BITS)


def test_no_masks_are_no_trouble() -> None:
    assert masks_of_generated([], (4, 6)) == ()
    assert masks_of_generated(Detections(mask=None, xyxy=np.zeros((0, 4))), (4, 6)) == ()


@pytest.mark.parametrize("answer", [None, 3, "masks", [1], [{"mask": BITS}], [{"segmentation": BITS[1:]}]])
def test_what_is_no_masks_of_the_photo_is_refused(answer: Any) -> None:
    with pytest.raises(InvalidImage, match="expected"):
        Generated(generator=lambda _: answer).segment(PHOTO, CLOTH)
