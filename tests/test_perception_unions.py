"""Masks with scores: garments, their parts, and several of them as one."""

from __future__ import annotations

from pathlib import Path
from typing import ClassVar

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

pytest.importorskip("cv2")
pytest.importorskip("skimage")

from pscover.perception.annotations import read_annotations
from pscover.perception.cleanup import CleanUp, to_labels
from pscover.perception.marks import read_marks, tally
from pscover.perception.mask import Mask
from pscover.perception.perceive import perceive
from pscover.perception.segmenter import Segmentation
from pscover.perception.unions import without_unions

SHAPE = (30, 40)
ROOT = Path(__file__).parents[1]
SHARED = ROOT.parent / "shared"
LEFT, RIGHT, BOTH = (5, 15, 5, 20), (15, 25, 5, 20), (5, 25, 5, 20)
SMALL = CleanUp(min_segment_area=20, gap=1)


def box(edges: tuple[int, int, int, int], score: float) -> Mask:
    top, bottom, left, right = edges
    bits = np.zeros(SHAPE, dtype=np.bool_)
    bits[top:bottom, left:right] = True
    return Mask.of(bits, score=score)


def lab(*painted: tuple[tuple[int, int, int, int], float]) -> NDArray[np.float32]:
    """Lab in which boxes have the given a."""
    image = np.full((*SHAPE, 3), 50, dtype=np.float32)
    for (top, bottom, left, right), a in painted:
        image[top:bottom, left:right, 1] = a
    return image


def scores(masks: list[Mask]) -> list[float]:
    return [mask.score for mask in masks]


def test_a_union_of_two_colours_goes_however_good_its_score() -> None:
    masks = [box(BOTH, 0.99), box(LEFT, 0.8), box(RIGHT, 0.7)]
    assert scores(without_unions(masks, SHAPE, lab((LEFT, 60), (RIGHT, -60)))) == [0.8, 0.7]


def test_a_union_of_one_colour_goes_by_the_scores() -> None:
    assert scores(without_unions([box(BOTH, 0.93), box(LEFT, 0.99), box(RIGHT, 0.98)], SHAPE, lab())) == [0.99, 0.98]
    assert scores(without_unions([box(BOTH, 0.99), box(LEFT, 0.93), box(RIGHT, 0.92)], SHAPE)) == [0.99, 0.93, 0.92]


def test_a_good_sleeve_does_not_unmake_its_shirt() -> None:
    assert scores(without_unions([box(BOTH, 0.6), box((5, 9, 5, 20), 0.99)], SHAPE, lab())) == [0.6, 0.99]


def test_parts_that_overlap_do_not_count_twice() -> None:
    upper, lower = (5, 18, 5, 20), (12, 25, 5, 20)
    assert len(without_unions([box(BOTH, 0.9), box(upper, 0.91), box(lower, 0.89)], SHAPE, lab())) == 3


def test_of_two_alike_the_better_stays() -> None:
    assert scores(without_unions([box(BOTH, 0.9), box((5, 24, 5, 20), 0.95)], SHAPE)) == [0.95]
    assert without_unions([], SHAPE) == []


def test_a_heap_gives_way_to_piles_that_give_way_to_garments() -> None:
    garments = [(top, top + 5, left, left + 10) for left in (5, 15) for top in (5, 10)]
    piles = [(5, 15, left, left + 10) for left in (5, 15)]
    masks = [box((5, 15, 5, 25), 0.97), *(box(pile, 0.95) for pile in piles), *(box(each, 0.99) for each in garments)]
    assert scores(without_unions(masks, SHAPE, lab())) == [0.99] * 4


def test_only_masks_with_scores_are_judged() -> None:
    cloth = box(BOTH, 1).pixels(SHAPE)
    glove = [box(BOTH, 1.0), box(LEFT, 1.0), box(RIGHT, 1.0)]
    assert to_labels(glove, cloth, SMALL, image=lab()).image.max() == 1, "the paper's glove and fingers"
    judged = [box(BOTH, 0.9), box(LEFT, 0.99), box(RIGHT, 0.99)]
    assert to_labels(judged, cloth, SMALL, image=lab()).image.max() == 2
    assert to_labels(judged, cloth, SMALL).image.max() == 2, "also without a photo"


@given(st.integers(0, 2**32 - 1))
@settings(max_examples=40, deadline=None)
def test_no_pixel_of_a_dropped_union_is_lost_to_nothing(seed: int) -> None:
    """Of every nested family something stays: each dropped mask holds, or nearly agrees with, one that is kept."""
    rng = np.random.default_rng(seed)
    masks = []
    for _ in range(int(rng.integers(1, 9))):
        top, left = (int(each) for each in rng.integers(0, (20, 30)))
        masks.append(box((top, top + int(rng.integers(2, 10)), left, left + int(rng.integers(2, 10))), float(rng.random())))
    kept = without_unions(masks, SHAPE, rng.normal(50, 20, (*SHAPE, 3)).astype(np.float32))
    places = [next(k for k, mask in enumerate(masks) if mask is one) for one in kept]
    assert places == sorted(set(places))
    for mask in masks:
        assert any(np.any(mask.pixels(SHAPE) & one.pixels(SHAPE)) for one in kept)


def test_uncovered_cloth_is_told_apart_by_colour() -> None:
    shape = (60, 80)
    cloth = np.zeros(shape, dtype=np.bool_)
    cloth[10:50, 10:70] = True
    image = np.full((*shape, 3), 50, dtype=np.float32)
    image[:, 40:, 1] = -60
    for masks in ([], [Mask.of(np.pad(np.ones((2, 2)), ((55, 3), (75, 3))), score=0.9)]):
        found = to_labels(masks, cloth, CleanUp(min_segment_area=100), image=image)
        assert found.image.max() == 2
        assert found.image[30, 20] != found.image[30, 60]
        assert found.scores == (0.0, 0.0)
        assert to_labels(masks, cloth, CleanUp(min_segment_area=100)).image.max() == 1, "without an image: as connected"


class Recorded:
    """A segmenter that knows the answer."""

    name: ClassVar[str] = "recorded"
    requires: ClassVar[tuple[str, ...]] = ()
    extra: ClassVar[str] = ""

    def __init__(self, masks: tuple[Mask, ...]) -> None:
        self.masks = masks

    def segment(self, photo: NDArray[np.uint8], cloth: NDArray[np.bool_]) -> Segmentation:
        return Segmentation(masks=self.masks)


@pytest.mark.parametrize(
    ("record", "photo", "found"),
    [("244_color_12", "tshirts_244_color.jpg", 6), ("491_color_12", "tshirts_491_color.jpg", 2)],
)
def test_real_records_of_a_heap_isolate_its_garments(record: str, photo: str, found: int) -> None:
    """Largest first alone isolated 1 of 6 and 0 of 2."""
    records = SHARED / "sam_records" / f"{record}.json"
    if not records.is_file() or not (SHARED / "photos" / photo).is_file():
        pytest.skip("records and photos are not shipped: put them into ../shared")
    (marked,) = (each for each in read_marks(ROOT / "instances" / "photos" / "marks.json") if each.file == photo)
    segmenter = Recorded(read_annotations(records).masks)
    seen = perceive(SHARED / "photos" / photo, segmenter=segmenter, roi=marked.roi)
    assert len(tally(seen.labels, marked).found) == found
