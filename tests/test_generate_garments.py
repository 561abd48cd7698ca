"""Random scenes keep what they promise."""

from __future__ import annotations

import itertools
from typing import Any

import numpy as np
import pytest
from scipy import ndimage

from pscover import InvalidSettings
from pscover.generate.garments import GAP, VISIBLE, garments
from pscover.generate.outlines import KINDS, Outline
from pscover.generate.paper_series import COUNTS, series


@pytest.mark.parametrize("seed", range(4))
def test_thirty_five_lie_apart_on_the_papers_workspace(seed: int) -> None:
    scene = garments(35, seed)
    areas = scene.areas()
    assert scene.garments == 35
    # Pixels of a filled polygon differ from its area by about half its perimeter.
    assert areas.min() > 340
    assert areas.max() < 3300
    for j in range(35):
        near = ndimage.binary_dilation(scene.segments == j, np.ones((3, 3)), iterations=GAP)
        assert set(np.unique(scene.segments[near])) <= {-1, j}


def test_a_larger_scene_begins_with_the_smaller() -> None:
    scenes = [garments(count, seed=2) for count in (5, 10, 20)]
    for small, large in itertools.pairwise(scenes):
        on = small.labels > 0
        assert (large.labels[on] == small.labels[on]).all()
        assert large.names[: small.garments] == small.names


def test_a_scene_is_its_arguments() -> None:
    first, again, other = (garments(8, seed, layout="piled").labels for seed in (1, 1, 2))
    assert (first == again).all()
    assert (first != other).any()


@pytest.mark.parametrize("count", [10, 35, 80])
def test_in_a_pile_each_stays_visible(count: int) -> None:
    scene = garments(count, seed=1, layout="piled")
    assert scene.garments == count
    assert scene.areas().min() >= VISIBLE
    _, islands = ndimage.label(scene.labels > 0, np.ones((3, 3)))
    assert islands < count / 2


@pytest.mark.parametrize("groups", [(2,), (3, 3, 3), (4, 2, 3, 2)])
def test_groups_overlap_and_keep_apart(groups: tuple[int, ...]) -> None:
    scene = garments(20, seed=0, groups=groups)
    assert scene.garments == 20
    assert scene.areas().min() >= VISIBLE
    blobs, count = ndimage.label(scene.labels > 0, np.ones((3, 3)))
    assert count >= len(groups) + 20 - sum(groups)
    member_of = np.concatenate((np.repeat(np.arange(len(groups)), groups), len(groups) + np.arange(20 - sum(groups))))
    for blob in range(1, count + 1):
        inside = np.unique(scene.segments[(blobs == blob) & (scene.segments >= 0)])
        assert len(set(member_of[inside])) == 1


def test_a_thousand_on_a_floor() -> None:
    scene = garments(1000, size=(2350, 2820))
    assert scene.garments == 1000
    assert scene.names[999].endswith(" 1000")


def test_outlines_have_the_area_asked_for() -> None:
    kinds = set()
    for seed in range(40):
        outline = Outline.random(np.random.default_rng(seed))
        kinds.add(outline.kind)
        mask = outline.mask(1500.0)
        assert abs(int(mask.sum()) - 1500) < 150
        assert mask[0].any()
        assert mask[:, -1].any()
    assert kinds == set(KINDS)


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        ({"count": -1}, "count: expected a whole number"),
        ({"count": 3, "size": (0, 5)}, "size"),
        (
            {"count": 3, "size": (282, 1_000_000)},
            "at most 67108864 pixels, got height 282 x width 1000000 = 282000000; choose",
        ),
        ({"count": 3, "layout": "heaped"}, "layout: expected 'apart' or 'piled', got 'heaped'"),
        ({"count": 3, "groups": (4,)}, "sum to at most 3"),
        ({"count": 3, "groups": (1,)}, "at least 2"),
        ({"count": 3, "groups": (2,), "layout": "piled"}, "with layout 'piled'"),
        ({"count": 30, "size": (60, 60)}, "finds no place on 60 x 60 pixels"),
        ({"count": 60, "size": (60, 60), "layout": "piled"}, "finds no place"),
        ({"count": 2, "size": (8, 8)}, "garment 1 finds no place"),
    ],
)
def test_what_cannot_be_laid(arguments: dict[str, Any], words: str) -> None:
    with pytest.raises(InvalidSettings, match=words):
        garments(**arguments)


def test_the_papers_series() -> None:
    found = dict(series())
    assert [instance.elements for instance in found.values()] == list(COUNTS)
    assert next(iter(found)) == "garments-05"


def test_painted_garments_are_found_where_they_lie() -> None:
    """Where garments keep apart, colour tells them from the table: what is segmented is what was placed."""
    pytest.importorskip("cv2")
    pytest.importorskip("skimage")
    from pscover.generate.paint import paint
    from pscover.perception.perceive import perceive

    scene = garments(8, seed=3)
    found = perceive(paint(scene, seed=1)).scene.labels > 0
    truth = scene.labels > 0
    assert (found & truth).sum() / (found | truth).sum() > 0.9


def test_the_same_seed_paints_the_same_photo() -> None:
    from pscover.generate.paint import paint

    scene = garments(4, seed=0)
    assert (paint(scene, 1) == paint(scene, 1)).all()
    assert (paint(scene, 1) != paint(scene, 2)).any()
    with pytest.raises(InvalidSettings, match="seed"):
        paint(scene, -1)
