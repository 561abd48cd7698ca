"""From masks that overlap, nest and leave gaps to one label a pixel."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from pscover.errors import InvalidImage, InvalidSettings

pytest.importorskip("cv2")
pytest.importorskip("skimage")
from scipy.ndimage import label as components

from pscover.perception.cleanup import CleanUp, overlap, to_labels
from pscover.perception.mask import Mask
from pscover.perception.merging import merge
from pscover.perception.regions import absorb, contacts, pieces, renumbered

SHAPE = (30, 40)
EVERYWHERE = np.ones(SHAPE, dtype=np.bool_)
SMALL = CleanUp(min_segment_area=20, gap=1)


def box(top: int, bottom: int, left: int, right: int, *, score: float = 1.0, name: str = "") -> Mask:
    bits = np.zeros(SHAPE, dtype=np.bool_)
    bits[top:bottom, left:right] = True
    return Mask.of(bits, score=score, name=name)


def colours(*painted: tuple[Mask, tuple[float, float, float]]) -> NDArray[np.float32]:
    image = np.full((*SHAPE, 3), 50, dtype=np.float32)
    for mask, colour in painted:
        image[mask.pixels(SHAPE)] = colour
    return image


def cloth_of(*masks: Mask) -> NDArray[np.bool_]:
    cloth = np.zeros(SHAPE, dtype=np.bool_)
    for mask in masks:
        cloth |= mask.pixels(SHAPE)
    return cloth


def test_the_smaller_mask_lies_on_top() -> None:
    large, small = box(0, 20, 0, 20, name="shirt"), box(15, 25, 15, 25, name="sock")
    for order in ([large, small], [small, large]):
        found = to_labels(order, cloth_of(large, small), SMALL)
        assert found.names == ("shirt", "sock")
        assert found.image[17, 17] == 2
        assert found.image[5, 5] == 1
        assert found.image[29, 39] == 0


def test_nested_masks_are_redundant_unless_large_and_of_another_colour() -> None:
    shirt, sleeve = box(0, 20, 0, 30), box(0, 20, 0, 10)
    cloth = cloth_of(shirt)
    assert to_labels([shirt, sleeve], cloth, SMALL).image.max() == 1
    assert to_labels([shirt, sleeve], cloth, SMALL, image=colours()).image.max() == 1
    red = colours((sleeve, (50, 90, 10)))
    assert to_labels([shirt, sleeve], cloth, SMALL, image=red).image.max() == 2
    badge = box(5, 12, 5, 12)
    assert to_labels([shirt, badge], cloth, SMALL, image=colours((badge, (50, 90, 10)))).image.max() == 1


def test_a_mask_of_a_heap_gives_way_to_its_garments() -> None:
    heap = box(0, 20, 0, 30)
    parts = [box(0, 20, left, left + 5) for left in range(0, 30, 5)]
    striped = colours(*((part, (50, 40 * (k % 2), 0)) for k, part in enumerate(parts)))
    assert to_labels([heap, *parts], cloth_of(heap), SMALL, image=striped).image.max() == 6
    assert to_labels([heap, *parts], cloth_of(heap), SMALL, image=colours()).image.max() == 1, "fingers of one glove"


def test_duplicates_leave_the_one_with_the_better_score() -> None:
    found = to_labels([box(0, 10, 0, 10, score=0.5), box(0, 10, 0, 10, score=0.9)], cloth_of(box(0, 10, 0, 10)), SMALL)
    assert found.scores == (0.9,)


def test_masks_of_the_surface_go() -> None:
    cloth = cloth_of(box(0, 10, 0, 10))
    found = to_labels([box(0, 30, 0, 40), box(0, 10, 0, 10, name="sock")], cloth, SMALL)
    assert found.names == ("sock",)
    assert (found.image > 0).sum() == 100


def test_uncovered_cloth_becomes_segments_and_rims_do_not() -> None:
    shirt = box(1, 10, 1, 20, name="shirt")
    cloth = cloth_of(box(0, 11, 0, 21), box(20, 28, 20, 28))
    found = to_labels([shirt], cloth, SMALL)
    assert found.names == ("shirt", "")
    assert found.scores == (1.0, 0.0)
    assert (found.image == 1).sum() == 11 * 21
    assert (found.image == 2).sum() == 64


def test_fragments_go_to_the_neighbour_they_touch_most_or_vanish() -> None:
    left, right, scrap, alone = box(0, 10, 0, 10), box(0, 10, 13, 23), box(0, 6, 10, 13), box(20, 23, 30, 33)
    labels = to_labels([left, right], cloth_of(left, right, scrap, alone), CleanUp(min_segment_area=20, gap=0)).image
    assert labels[21, 31] == 0
    assert labels[3, 11] in (labels[3, 3], labels[3, 15])
    assert labels.max() == 2


def test_fragments_that_are_large_together_are_one_segment() -> None:
    stripes = [box(0, 12, left, left + 3) for left in range(0, 30, 3)]
    labels = to_labels(stripes, cloth_of(*stripes), CleanUp(min_segment_area=50)).image
    assert labels.max() == 1
    assert (labels > 0).sum() == 360


def test_a_mask_cut_apart_keeps_one_label() -> None:
    shirt, belt = box(0, 20, 0, 30), box(0, 20, 12, 18)
    labels = to_labels([shirt, belt], cloth_of(shirt), SMALL, image=colours((belt, (90, 60, 0)))).image
    assert labels.max() == 2
    labels = to_labels([shirt, box(0, 25, 12, 18)], cloth_of(shirt, box(0, 25, 12, 18)), SMALL).image
    assert labels[5, 5] == labels[5, 25] == 1
    assert labels[5, 15] == 2


@given(st.integers(0, 2**32 - 1))
@settings(max_examples=60, deadline=None)
def test_every_large_piece_of_cloth_is_labelled_and_nothing_else(seed: int) -> None:
    rng = np.random.default_rng(seed)
    cloth = np.zeros(SHAPE, dtype=np.bool_)
    masks = []
    for _ in range(int(rng.integers(0, 7))):
        top, left = rng.integers(0, (28, 38))
        mask = box(top, top + int(rng.integers(1, 20)), left, left + int(rng.integers(1, 25)), score=float(rng.random()))
        masks.append(mask)
        if rng.random() < 0.8:
            cloth |= mask.pixels(SHAPE)
    cloth &= rng.random(SHAPE) < rng.choice([0.7, 1.0])
    least, gap = int(rng.integers(0, 60)), int(rng.integers(0, 4))
    image = rng.normal(50, 20, (*SHAPE, 3)).clip(0, 100).astype(np.float32) if rng.random() < 0.5 else None
    found = to_labels(masks, cloth, CleanUp(min_segment_area=least, gap=gap), image=image)
    labels = found.image
    assert not (labels[~cloth]).any()
    for piece in range(1, components(cloth)[1] + 1):
        inside = components(cloth)[0] == piece
        assert (labels[inside] > 0).all() == (inside.sum() >= least), "all of it or nothing"
        assert (labels[inside] > 0).all() or not labels[inside].any()
    area = np.bincount(labels.ravel())[1:]
    assert len(area) == len(found.names) == len(found.scores)
    assert (area >= max(1, least)).all()
    assert (np.diff(area) <= 0).all()
    again = to_labels(masks, cloth, CleanUp(min_segment_area=least, gap=gap), image=image)
    assert (again.image == labels).all()


@given(st.integers(0, 2**32 - 1))
@settings(max_examples=40, deadline=None)
def test_contacts_and_pieces_by_brute_force(seed: int) -> None:
    rng = np.random.default_rng(seed)
    image = rng.integers(0, 4, (int(rng.integers(1, 8)), int(rng.integers(1, 8)))).astype(np.int32)
    counted: dict[tuple[int, int], int] = {}
    for y in range(image.shape[0]):
        for x in range(image.shape[1]):
            for v, u in ((y, x + 1), (y + 1, x)):
                if v < image.shape[0] and u < image.shape[1] and image[v, u] != image[y, x]:
                    pair = min(image[v, u], image[y, x]), max(image[v, u], image[y, x])
                    counted[pair] = counted.get(pair, 0) + 1
    found = contacts(image)
    assert {(a, b): n for a, b, n in zip(found.first, found.second, found.length, strict=True)} == counted
    expected = sum(components(image == value)[1] for value in (1, 2, 3))
    assert pieces(image).max(initial=0) == expected


def test_absorption_goes_by_the_longest_contact_and_through_fragments() -> None:
    labels = np.array([[1, 1, 3, 4, 0], [2, 3, 3, 2, 0], [2, 2, 2, 2, 0]], dtype=np.int32)
    fragment = np.array([False, False, False, True, True])
    # 3 touches 1 along two edges and 2 along four; 4 touches 3, 2 and the surface.
    assert absorb(labels, fragment).tolist() == [[1, 1, 2, 2, 0], [2, 2, 2, 2, 0], [2, 2, 2, 2, 0]]
    chain = np.array([[1, 2, 3, 0, 4]], dtype=np.int32)
    assert absorb(chain, np.array([False, False, True, True, True])).tolist() == [[1, 1, 1, 0, 0]]


def test_renumbering_by_area() -> None:
    labels, origin = renumbered(np.array([[2, 7, 7], [2, 0, 9]], dtype=np.int32))
    assert labels.tolist() == [[1, 2, 2], [1, 0, 3]]
    assert origin.tolist() == [2, 7, 9]


def test_overlap_of_boxes_that_do_not_meet() -> None:
    assert overlap(box(0, 3, 0, 3), box(3, 6, 0, 3)) == 0
    assert overlap(box(0, 4, 0, 4), box(2, 6, 3, 9)) == 2


def test_merging_stops_at_the_limit_and_favours_scraps() -> None:
    regions = np.repeat(np.array([[1, 1, 1, 2]], dtype=np.int32), 4, axis=0)
    features = np.where(regions == 1, 0.0, 10.0)[:, :, None].astype(np.float32)
    step = np.full(regions.shape, 10, dtype=np.float32)
    assert len(np.unique(merge(regions, features, step, limit=9.9))) == 2
    assert len(np.unique(merge(regions, features, step, limit=10.1))) == 1
    assert len(np.unique(merge(regions, features, step, limit=9.9, small=100))) == 1


def test_masks_beyond_the_image() -> None:
    with pytest.raises(InvalidImage, match=r"mask 0: expected a mask inside the 20 x 10 image, got 40 x 30 pixels at x=0"):
        to_labels([box(0, 30, 0, 40)], np.ones((10, 20), dtype=np.bool_))


@pytest.mark.parametrize(
    "name", ["min_segment_area", "off_cloth", "redundant", "group_cover", "part_share", "contrast", "gap"]
)
def test_settings_outside_their_domain(name: str) -> None:
    with pytest.raises(InvalidSettings, match=f"{name}: expected a number from 0"):
        CleanUp(**{name: -1})
