"""Parts, candidates, probabilities and conflicts, each against its definition."""

from __future__ import annotations

import itertools
import math
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra import numpy as arrays
from numpy.typing import NDArray

from pscover import InvalidInstance, InvalidSettings, UnknownName
from pscover.cliques import merge_edges
from pscover.generate.garments import garments
from pscover.grasping.candidates import candidates
from pscover.grasping.conflict_distance import CloserThan
from pscover.grasping.conflict_ellipse import Overlapping, outlines
from pscover.grasping.conflict_partition import SamePart
from pscover.grasping.ellipse import Ellipse
from pscover.grasping.partition import partition
from pscover.grasping.sampling import Grasps, Sampling
from pscover.scene import Scene

AXES = (40.0, 12.0)
label_images = arrays.arrays(
    np.int32, arrays.array_shapes(min_dims=2, max_dims=2, max_side=9), elements=st.sampled_from([0, 0, 1, 2, 300])
)


def within(scene: Scene, x: int, y: int, reach: float) -> tuple[int, ...]:
    """S(x, y) by its definition."""
    rows, columns = np.indices(scene.shape)
    near = (rows - y) ** 2 + (columns - x) ** 2 <= reach**2
    return tuple(int(j) for j in np.unique(scene.segments[near & (scene.segments >= 0)]))


@given(label_images, st.sampled_from([0.0, 1.0, 1.5, 2.0, 3.7, 20.0]))
def test_a_part_holds_the_pixels_with_the_same_garments_within_reach(labels: NDArray[np.int32], reach: float) -> None:
    scene = Scene.of(labels)
    found = partition(scene, reach)
    assert ((found.parts >= 0) == (labels > 0)).all()
    for y, x in np.argwhere(labels > 0):
        assert found.reached[found.parts[y, x]] == within(scene, x, y, reach)
    assert len(set(found.reached)) == len(found)
    assert sorted(np.unique(found.parts[found.parts >= 0]).tolist()) == list(range(len(found)))


def test_parts_of_a_thousand_labels() -> None:
    labels = np.kron(np.arange(1, 1001).reshape(25, 40), np.ones((3, 3), dtype=int))
    scene = Scene.of(labels)
    found = partition(scene, 4.0)
    for y, x in np.random.default_rng(0).integers((0, 0), scene.shape, (60, 2)):
        assert found.reached[found.parts[y, x]] == within(scene, x, y, 4.0)


def test_points_are_drawn_from_every_part_without_repetition() -> None:
    scene = garments(12, seed=3, layout="piled")
    sampling = Sampling(points=4, orientations=3)
    found, grasps = partition(scene, sampling.reach), sampling.draw(scene, 7)
    sizes = np.bincount(found.parts[found.parts >= 0])
    x, y = grasps.poses[:, 0].astype(int), grasps.poses[:, 1].astype(int)
    assert (found.parts[y, x] == grasps.part).all()
    assert np.bincount(grasps.part, minlength=len(found)).tolist() == (3 * np.minimum(4, sizes)).tolist()
    assert len(np.unique(grasps.poses, axis=0)) == len(grasps)
    assert len(sizes) > 20
    assert sizes.min() < 4


def test_every_pixel_of_a_part_is_as_likely() -> None:
    scene = Scene.of(np.ones((4, 5), dtype=int))
    drawn = [Sampling(points=5, orientations=1).draw(scene, seed).poses for seed in range(1000)]
    x, y = np.concatenate(drawn)[:, :2].astype(int).T
    often = np.bincount(5 * y + x, minlength=20)
    # 1000 draws of 5 from 20: 250 each, standard deviation 13.7.
    assert often.min() > 250 - 5 * 13.7
    assert often.max() < 250 + 5 * 13.7


def test_a_draw_is_its_seed() -> None:
    scene = garments(5)
    first, again, other = (Sampling().draw(scene, seed).poses for seed in (4, 4, 5))
    assert (first == again).all()
    assert (first != other).any()


def test_angles_are_equally_spaced_from_minus_a_quarter_turn() -> None:
    assert np.allclose(Sampling(orientations=4).angles(), [-math.pi / 2, -math.pi / 4, 0, math.pi / 4])


def counted(scene: Scene, predictor: Ellipse, pose: NDArray[np.float64]) -> NDArray[np.int64]:
    """Pixels of each garment in the ellipse by its equation."""
    rows, columns = np.indices(scene.shape)
    dx, dy = columns - pose[0], rows - pose[1]
    along = dx * math.cos(pose[2]) + dy * math.sin(pose[2])
    across = -dx * math.sin(pose[2]) + dy * math.cos(pose[2])
    inside = (along / (predictor.major / 2)) ** 2 + (across / (predictor.minor / 2)) ** 2 <= 1 + 1e-9
    return np.array([int((inside & (scene.segments == j)).sum()) for j in range(scene.garments)])


@pytest.mark.parametrize("predictor", [Ellipse(), Ellipse(major=7, minor=3, half=10), Ellipse(major=5, minor=21)])
def test_probability_counts_the_pixels_under_the_ellipse(predictor: Ellipse) -> None:
    scene = garments(10, seed=1, size=(120, 160), layout="piled")
    generator = np.random.default_rng(0)
    x, y, theta = generator.integers(-30, 190, 150), generator.integers(-30, 150, 150), generator.uniform(-2, 2, 150)
    poses = np.column_stack((x.astype(float), y.astype(float), theta)).astype(np.float64)
    poses[100:, :2] += generator.uniform(0, 1, (50, 2))
    poses[:20, :2] = 0, 0
    poses[20:40, :2] = 159, 119
    expected = np.array([counted(scene, predictor, pose) for pose in poses]).T
    assert (expected > 0).any(axis=1).sum() >= 8
    found = predictor.probability(scene, poses)
    assert np.allclose(found.toarray(), expected / (expected + predictor.half), rtol=0, atol=1e-12)
    assert (found.data > 0).all()


def test_paper_ellipse_over_cloth_alone() -> None:
    scene = Scene.of(np.ones((60, 60), dtype=int))
    (p,) = Ellipse().probability(scene, np.array([[30.0, 30.0, 0.0]])).data
    area = p * 100 / (1 - p)
    assert abs(area - math.pi * 20 * 6) < 8


def test_memory_blocks_change_nothing(monkeypatch: pytest.MonkeyPatch) -> None:
    scene = garments(8, layout="piled")
    whole = candidates(scene)
    monkeypatch.setattr("pscover.grasping.ellipse.LOOKUPS", 1000)
    assert candidates(scene).digest == whole.digest


def grasps_of(scene: Scene) -> Grasps:
    return Sampling(points=2, orientations=3).draw(scene, 0)


def pairs_of(rule: Any, grasps: Grasps) -> set[tuple[int, int]]:
    return {(int(i), int(k)) for i, k in rule.cliques(grasps, AXES).pairs()}


def test_same_part_conflicts() -> None:
    grasps = grasps_of(garments(6, layout="piled"))
    both = itertools.combinations(range(len(grasps)), 2)
    assert pairs_of(SamePart(), grasps) == {(i, k) for i, k in both if grasps.part[i] == grasps.part[k]}


@pytest.mark.parametrize("pixels", [0.0, 5.0, 40.0])
def test_distance_conflicts(pixels: float) -> None:
    grasps = grasps_of(garments(6, layout="piled"))
    both = itertools.combinations(range(len(grasps)), 2)
    points = grasps.poses[:, :2]
    assert pairs_of(CloserThan(pixels=pixels), grasps) == {
        (i, k) for i, k in both if math.dist(points[i], points[k]) <= pixels
    }


def test_ellipse_conflicts() -> None:
    shapely = pytest.importorskip("shapely")
    grasps = grasps_of(garments(6, layout="piled"))
    shapes = [shapely.Polygon(outline) for outline in outlines(grasps.poses, AXES, 32)]
    both = itertools.combinations(range(len(grasps)), 2)
    expected = {(i, k) for i, k in both if shapes[i].intersects(shapes[k])}
    assert expected
    assert pairs_of(Overlapping(), grasps) == expected


def test_too_many_overlaps_are_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    pytest.importorskip("shapely")
    monkeypatch.setattr("pscover.grasping.conflict_ellipse.PAIR_LIMIT", 50)
    with pytest.raises(InvalidSettings, match="draw fewer points"):
        candidates(garments(5), conflicts="ellipse")


edges = st.lists(st.tuples(st.integers(0, 14), st.integers(0, 14)).filter(lambda e: e[0] != e[1]), max_size=60)


@given(edges, st.randoms(use_true_random=False))
def test_merged_edges_are_exactly_the_edges(listed: list[tuple[int, int]], random: Any) -> None:
    expected = {(min(edge), max(edge)) for edge in listed}
    cliques = merge_edges(listed)
    assert {(int(i), int(k)) for i, k in cliques.pairs()} == expected
    for clique in cliques:
        outside = set(range(15)) - set(clique.tolist())
        assert not any(all((min(v, c), max(v, c)) in expected for c in clique.tolist()) for v in outside)
    shuffled = [edge[::-1] for edge in listed]
    random.shuffle(shuffled)
    assert [c.tolist() for c in merge_edges(shuffled)] == [c.tolist() for c in cliques]


def test_merged_edges_of_disjoint_cliques_are_those() -> None:
    groups = [range(30), range(30, 60), range(60, 62)]
    listed = [pair for group in groups for pair in itertools.combinations(group, 2)]
    assert [clique.tolist() for clique in merge_edges(listed)] == [list(group) for group in groups]


@pytest.mark.parametrize("wrong", [[(1, 1)], [(0, -1)], [(0.5, 1.0)], [(0, 1, 2)], [1, 2]])
def test_what_is_no_edge(wrong: Any) -> None:
    with pytest.raises(InvalidInstance, match="conflict"):
        merge_edges(wrong)


def test_an_instance_of_a_scene() -> None:
    scene = garments(5)
    instance = candidates(scene, required=[0.1, 0.2, 0.3, 0.4, 0.5], seed=3)
    assert instance.required.tolist() == [0.1, 0.2, 0.3, 0.4, 0.5]
    assert instance.meta.elements == scene.names
    assert instance.meta.source == scene.source
    assert instance.meta.poses is not None
    assert instance.meta.poses.shape == (instance.candidates, 3)
    assert (np.diff(instance.probability.indptr) > 0).all()
    assert instance.digest == candidates(scene, required=[0.1, 0.2, 0.3, 0.4, 0.5], seed=3).digest


class Nothing:
    """Removes the first garment with the grasps of even x only."""

    axes = AXES

    def probability(self, scene: Scene, poses: NDArray[np.float64]) -> Any:
        from scipy.sparse import csc_array

        p = np.zeros((scene.garments, len(poses)))
        p[0, poses[:, 0] % 2 == 0] = 0.5
        return csc_array(p)


def test_grasps_that_remove_nothing_are_left_out() -> None:
    instance = candidates(garments(5), predictor=Nothing())
    assert instance.meta.poses is not None
    assert 0 < instance.candidates < 150
    assert (instance.meta.poses[:, 0] % 2 == 0).all()
    assert instance.conflicts.members.max() < instance.candidates


def test_rules_can_be_joined() -> None:
    scene = garments(5)
    one, other = candidates(scene), candidates(scene, conflicts=CloserThan(pixels=60))
    both = candidates(scene, conflicts=["partition", CloserThan(pixels=60)])
    assert len(both.conflicts) == len(one.conflicts) + len(other.conflicts)


def test_an_unknown_rule_is_named() -> None:
    with pytest.raises(UnknownName, match="did you mean 'ellipse'"):
        candidates(garments(5), conflicts="elipse")


@pytest.mark.parametrize(
    ("make", "options", "words"),
    [
        (Sampling, {"points": 0}, "points: expected a whole number"),
        (Sampling, {"orientations": -1}, "orientations"),
        (Sampling, {"reach": -1.0}, "reach: expected a number of pixels"),
        (Sampling, {"reach": float("nan")}, "reach"),
        (Ellipse, {"major": 0.0}, "major: expected a positive number"),
        (Ellipse, {"half": float("inf")}, "half"),
        (CloserThan, {"pixels": float("nan")}, "pixels: expected a distance"),
        (Overlapping, {"corners": 3}, "corners"),
    ],
)
def test_settings_outside_their_domain(make: Any, options: dict[str, Any], words: str) -> None:
    with pytest.raises(InvalidSettings, match=words):
        make(**options)


@settings(deadline=None)
@given(label_images, st.sampled_from(["partition", "distance"]))
def test_any_label_image_gives_an_instance(labels: NDArray[np.int32], rule: str) -> None:
    instance = candidates(Scene.of(labels), conflicts=rule)
    assert instance.elements == len(np.unique(labels[labels > 0]))
    reached = np.bincount(instance.probability.indices, minlength=instance.elements)
    assert (reached > 0).all()
