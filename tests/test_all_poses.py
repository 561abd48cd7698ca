"""All poses: areas, worth, dominance, prices and the bound, each against its definition or an enumeration."""

from __future__ import annotations

import itertools
import math
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra import numpy as arrays
from numpy.typing import NDArray
from scipy.sparse import csc_array

from pscover import Instance, Progress, Refused, Status, UnknownName, solve, verify, widening
from pscover.cli.app import app
from pscover.encoding import encode_labels
from pscover.generate.garments import garments
from pscover.grasping import relaxation
from pscover.grasping.all_poses import AllPoses, all_poses
from pscover.grasping.area_maps import area_maps
from pscover.grasping.candidates import candidates
from pscover.grasping.columns import Columns
from pscover.grasping.diving import dive
from pscover.grasping.ellipse import Ellipse
from pscover.grasping.pool import select
from pscover.grasping.pricing import price, tightened
from pscover.grasping.rounding import Cut, violated, with_cuts
from pscover.grasping.sampling import Sampling
from pscover.grasping.skyline import skyline
from pscover.plan_document import document
from pscover.planning import plan
from pscover.scene import Scene
from pscover.widening import whole

FloatArray = NDArray[np.float64]
ELLIPSES = (
    Ellipse(),
    Ellipse(major=7.3, minor=2.0, half=5),
    Ellipse(major=1, minor=1),
    Ellipse(major=30.5, minor=44, half=1),
)


@dataclass(frozen=True)
class Plain:
    """The ellipse as a predictor of which nothing is known."""

    ellipse: Ellipse

    @property
    def axes(self) -> tuple[float, float]:
        return self.ellipse.axes

    def probability(self, scene: Scene, poses: FloatArray) -> csc_array:
        return self.ellipse.probability(scene, poses)


def small() -> Scene:
    """Three touching garments of a few pixels."""
    return Scene.of([[1, 1, 1, 0, 2, 2], [1, 1, 3, 3, 2, 2], [0, 3, 3, 3, 0, 2], [0, 3, 0, 0, 0, 0]])


@pytest.mark.parametrize("ellipse", ELLIPSES)
def test_area_maps_count_what_the_predictor_counts(ellipse: Ellipse) -> None:
    scene = Scene.of(np.random.default_rng(1).integers(0, 4, (37, 52)))
    angles = Sampling(orientations=7).angles()
    y, x = (found.ravel() for found in np.indices(scene.shape))
    counted = np.zeros((7, scene.garments, len(x)))
    for found in area_maps(scene, ellipse, angles):
        for k in range(7):
            counted[k, found.garment] = found.at(k, y, x)
    for k, angle in enumerate(angles):
        poses = np.column_stack((x, y, np.full(len(x), angle))).astype(np.float64)
        assert (counted[k] == ellipse.areas(scene, poses).toarray()).all()


def test_sums_that_wrap_around_give_exact_areas() -> None:
    # A row of 2^16 pixels: the running sum is 0 again at its end.
    scene = Scene.of(np.ones((3, 2**16 + 10), dtype=int))
    [found] = area_maps(scene, Ellipse(major=20, minor=6), np.array([0.0]))
    x = np.arange(2**16 - 30, 2**16 + 10)
    poses = np.column_stack((x, np.ones(40), np.zeros(40))).astype(np.float64)
    assert (found.at(0, np.ones(40, dtype=int), x) == Ellipse(major=20, minor=6).areas(scene, poses).toarray()[0]).all()


@pytest.mark.parametrize("orientations", [6, 12, 36])
def test_sampled_grasps_are_among_all_poses_with_the_same_entries(orientations: int) -> None:
    scene, sampling = garments(4, seed=2, layout="piled"), Sampling(orientations=orientations)
    instance = candidates(scene, sampling=sampling)
    poses = all_poses(scene, sampling, Ellipse(), instance.required)
    assert poses is not None
    everything = poses.poses(np.arange(len(poses)))
    assert len(poses) == (scene.labels > 0).sum() * orientations
    assert len(np.unique(everything, axis=0)) == len(poses)
    assert instance.meta.poses is not None
    where = {tuple(pose): k for k, pose in enumerate(everything.tolist())}
    numbers = np.array([where[tuple(pose)] for pose in instance.meta.poses.tolist()])
    entries = instance.truncated_weights().toarray()
    of = poses.part_of(numbers)
    for i in range(0, instance.candidates, 7):
        part, inner = int(of[i]), int(numbers[i] - poses.starts()[of[i]])
        column = np.zeros(scene.garments)
        column[poses.garments[part]] = poses.worth[part][:, inner]
        assert (column == entries[:, i]).all()


@pytest.mark.parametrize("reach", [20.0, 4.0])
def test_any_predictor_and_any_reach(reach: float) -> None:
    scene, sampling = garments(4, seed=1, layout="piled", size=(70, 90)), Sampling(reach=reach, orientations=2)
    ellipse, required = Ellipse(half=30), np.array([0.7, 0.0, 0.5, 0.9])
    fast, slow = (all_poses(scene, sampling, predictor, required) for predictor in (ellipse, Plain(ellipse)))
    assert fast is not None
    assert slow is not None
    for part in range(fast.parts):
        dense = [np.zeros((4, len(found.total[part]))) for found in (fast, slow)]
        for found, into in zip((fast, slow), dense, strict=True):
            assert 1 not in found.garments[part]
            into[found.garments[part]] = found.worth[part]
        assert (dense[0] == dense[1]).all()
        assert fast.total[part] == pytest.approx(slow.total[part])


@given(arrays.arrays(np.int64, st.tuples(st.integers(0, 4), st.integers(0, 200)), elements=st.integers(0, 4)))
def test_the_skyline_is_what_nothing_else_reaches(points: NDArray[np.int64]) -> None:
    values = points.astype(np.float64)
    kept = skyline(values).tolist()
    for i in range(values.shape[1]):
        over = [k for k in kept if (values[:, k] >= values[:, i]).all()]
        assert over == [i] if i in kept else over


def random_poses(seed: int) -> AllPoses:
    """A few parts of a few poses, with entries of all kinds."""
    rng = np.random.default_rng(seed)
    parts, rows = int(rng.integers(1, 5)), int(rng.integers(1, 4))
    sizes = rng.integers(1, 5, parts)
    listed = [np.sort(rng.choice(rows, int(rng.integers(1, rows + 1)), replace=False)) for _ in range(parts)]
    raw = [rng.random((len(g), size)) * rng.choice([0.8, 1.3, 2.0]) for g, size in zip(listed, sizes, strict=True)]
    return AllPoses(
        pixels=np.arange(sizes.sum()),
        first=np.concatenate(([0], np.cumsum(sizes))),
        angles=np.zeros(1),
        width=100,
        garments=tuple(listed),
        worth=tuple(np.minimum(worth, 1.0) for worth in raw),
        total=tuple(worth.sum(axis=0) for worth in raw),
        needed=np.ones(1 + max(int(g.max()) for g in listed)),
    )


def plans(poses: AllPoses, rows: int) -> list[tuple[int, ...]]:
    """All plans that meet every requirement, by enumeration."""
    wanted = np.unique(np.concatenate(poses.garments))
    found = []
    for choice in itertools.product(*([None, *range(len(total))] for total in poses.total)):
        supply = np.zeros(rows)
        for part, pose in enumerate(choice):
            if pose is not None:
                supply[poses.garments[part]] += poses.worth[part][:, pose]
        if (supply[wanted] >= 1 - 1e-12).all():
            found.append(tuple(int(poses.starts()[part]) + pose for part, pose in enumerate(choice) if pose is not None))
    return found


@given(st.integers(0, 2**32 - 1))
@settings(deadline=None, max_examples=60)
def test_bounds_and_selections_against_all_plans(seed: int) -> None:
    poses = random_poses(seed)
    rows = 1 + max(int(g.max()) for g in poses.garments)
    feasible = plans(poses, rows)
    least = min(map(len, feasible), default=math.inf)
    plain = price(poses)
    assert plain is not None
    for prices in (plain, tightened(plain, math.inf)):
        assert prices.bound <= least + 1e-9
        for part in range(poses.parts):
            for pose, floor in enumerate(prices.floors(part)):
                number = int(poses.starts()[part]) + pose
                assert floor <= min((len(one) for one in feasible if number in one), default=math.inf)
        for most, ceiling in ((1, math.inf), (3, math.inf), (100, math.inf), (100, least - 1 if feasible else math.inf)):
            chosen = select(poses, prices, most, ceiling)
            within = [one for one in feasible if set(one) <= set(chosen.numbers.tolist())]
            assert min(min(map(len, within), default=math.inf), whole(chosen.floor)) <= least
            if most == 100 and ceiling == math.inf:
                assert chosen.floor == math.inf
                assert min(map(len, within), default=math.inf) == least
    found = dive(poses, plain)
    assert found is None or tuple(found.tolist()) in set(feasible)


@given(st.integers(0, 2**32 - 1))
@settings(deadline=None, max_examples=60)
def test_every_plan_meets_rounded_sums(seed: int) -> None:
    poses, rng = random_poses(seed), np.random.default_rng(seed)
    columns = Columns.extremes(poses)
    cuts = violated(columns.worth, rng.random(len(columns.part)), poses.needed)
    cuts += [cut for sets in (poses.wanted()[:1].tolist(), poses.wanted().tolist()) for cut in rounded(sets, rng)]
    extended = with_cuts(poses, tuple(cuts))
    for one in plans(poses, poses.rows):
        number = np.array(one, dtype=np.int64)
        part = poses.part_of(number).astype(np.int64)
        held = Columns.of(extended, part, number - poses.starts()[part])
        assert (held.worth[poses.rows :].sum(axis=1) >= 1 - 1e-9).all()


def rounded(rows: list[int], rng: np.random.Generator) -> list[Cut]:
    """Rounded sums of some rows, each of which asks for 1."""
    part = rng.uniform(0.01, 1.0, 4)
    return [
        Cut(rows=tuple(rows), scale=float((k + f) / len(rows)), part=float(f), least=k + 1)
        for k, f in enumerate(part.tolist())
    ]


def test_three_garments_in_pairs_take_two_grasps() -> None:
    pairs = (np.array([0, 1]), np.array([0, 2]), np.array([1, 2]))
    poses = AllPoses(
        pixels=np.arange(3),
        first=np.arange(4),
        angles=np.zeros(1),
        width=3,
        garments=pairs,
        worth=(np.ones((2, 1)),) * 3,
        total=(np.full(1, 2.0),) * 3,
        needed=np.full(3, 1 - 1e-9),
    )
    plain = price(poses)
    assert plain is not None
    assert plain.bound == pytest.approx(1.5)
    assert tightened(plain, 1.0).bound == plain.bound
    tight = tightened(plain, math.inf)
    assert tight.bound == pytest.approx(2.0)
    assert [(cut.rows, cut.least) for cut in tight.cuts] == [((0, 1, 2), 2)]
    assert select(poses, tight, 100, 1.0).numbers.tolist() == []


def test_a_programme_goes_on_from_the_basis_of_a_smaller_one() -> None:
    rng = np.random.default_rng(1)
    matrix = csc_array(-rng.random((6, 30)) * (rng.random((6, 30)) < 0.5))
    part = relaxation.minimise(np.ones(20), csc_array(matrix[:4, :20]), -np.ones(4))
    assert part is not None
    assert part.basis is not None
    for begun in (part.basis, part.basis.without(np.array([1])), None):
        found = relaxation.minimise(np.ones(30), matrix, -np.ones(6), begun)
        assert found is not None
        assert found.value == pytest.approx(relaxation._by_scipy(np.ones(30), matrix, -np.ones(6)).value)  # type: ignore[union-attr]


def test_both_ways_to_a_linear_programme_agree() -> None:
    rng = np.random.default_rng(0)
    cost, matrix, right = np.ones(30), csc_array(-rng.random((6, 30)) * (rng.random((6, 30)) < 0.4)), -np.ones(6)
    first, second = relaxation.minimise(cost, matrix, right), relaxation._by_scipy(cost, matrix, right)
    assert first is not None
    assert second is not None
    assert first.value == pytest.approx(second.value)
    assert first.prices @ -right == pytest.approx(first.value)
    assert second.prices @ -right == pytest.approx(first.value)
    assert relaxation.minimise(np.ones(1), csc_array([[1.0]]), np.array([-1.0])) is None


@pytest.mark.parametrize("first", [1, 2000])
@pytest.mark.parametrize("required", [0.5, 0.8])
def test_a_plan_is_optimal_over_all_poses(monkeypatch: pytest.MonkeyPatch, first: int, required: float) -> None:
    monkeypatch.setattr(widening, "FIRST", first)
    scene, sampling = small(), Sampling(points=100, orientations=4, reach=1.5)
    gripper = Ellipse(major=3, minor=1.2, half=2)
    # As many points as there are pixels: the sampled candidates are all poses.
    everything = candidates(scene, sampling=sampling, predictor=gripper, required=required)
    exact = solve(everything)
    found = plan(scene, sampling=sampling, predictor=gripper, required=required, candidates="all")
    assert found.scope.poses == 4 * (scene.labels > 0).sum()
    assert exact.status is found.status
    if exact.has_plan:
        assert found.status is Status.OPTIMAL
        assert exact.objective == len(found.grasps) == found.bound
    else:
        assert found.bound == math.inf


def test_fewer_grasps_than_from_samples() -> None:
    scene = garments(6, seed=0, layout="piled")
    drawn, found = plan(scene), plan(scene, candidates="all", sampling=Sampling(orientations=12))
    assert (drawn.scope.candidates, found.scope.candidates) == ("sampled", "all")
    assert drawn.scope.poses == drawn.instance.candidates
    assert found.status is Status.OPTIMAL
    assert len(found.grasps) == found.bound <= len(drawn.grasps) - 2
    assert found.unmet == ()
    assert verify(found.instance, found.result).passed
    written = document(found)
    assert (written.candidates, written.poses, written.status) == ("all", found.scope.poses, "optimal")
    assert written.poses == 12 * (scene.labels > 0).sum()


def test_a_garment_that_no_pose_removes_is_named() -> None:
    labels = np.zeros((100, 200), dtype=np.int32)
    labels[10:13, 10:60] = 1
    labels[50:90, 100:150] = 2
    found = plan(labels, candidates="all")
    assert (found.status, found.bound, found.unmet) == (Status.INFEASIBLE, math.inf, (0,))
    assert found.coverage[1] >= 0.7
    assert found.coverage[0] >= plan(labels).coverage[0]


def test_what_a_goal_forgives_is_no_proof_that_there_is_no_plan() -> None:
    ellipse, labels = Ellipse(major=8, minor=6), np.zeros((30, 30), dtype=int)
    labels[10:20, 10:20] = 1
    area = len(ellipse.offsets(0.0)[0])
    for short, bound in ((5e-10, 1.0), (1e-6, math.inf)):
        required = area / (area + ellipse.half) + short
        found = plan(labels, sampling=Sampling(orientations=1), predictor=ellipse, required=required, candidates="all")
        assert (found.bound, len(found.grasps), found.unmet == ()) == (bound, 1, short < 1e-9)


def test_nothing_to_remove() -> None:
    for scene, required in ((Scene.of(np.zeros((20, 30), dtype=int)), 0.7), (garments(3), 0.0)):
        found = plan(scene, candidates="all", required=required)
        assert (found.grasps, found.unmet, found.status) == ((), (), Status.OPTIMAL)


def test_candidates_are_drawn_when_the_time_is_too_short(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("pscover.planning.DRAWING", -1.0)
    found = plan(garments(5), candidates="all", time=60)
    assert found.scope.candidates == "sampled"
    assert found.status is found.result.status


def test_what_is_not_proven_over_all_poses_is_not_claimed(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(widening, "FIRST", 60)
    monkeypatch.setattr(widening, "WIDEST", 60)
    monkeypatch.setattr(widening, "dive", lambda *given: None)
    seen: list[float] = []
    scene = garments(10, seed=0, layout="piled")

    def observe(progress: Progress) -> bool:
        seen.append(progress.bound)
        return False

    found = plan(scene, candidates="all", time=20, observe=observe)
    assert found.scope.floor < math.inf
    assert found.bound <= found.scope.floor
    assert max(seen) <= found.scope.floor
    assert found.status in (Status.UNKNOWN, Status.FEASIBLE) or len(found.grasps) == found.bound


def test_refusals() -> None:
    for conflicts in ("ellipse", ("partition", "distance"), ()):
        with pytest.raises(Refused, match="'partition' alone"):
            plan(small(), candidates="all", conflicts=conflicts)
    with pytest.raises(UnknownName, match="conflict rule"):
        plan(small(), candidates="all", conflicts="partitions")
    with pytest.raises(Refused, match="fewest grasps, got 'elastic'"):
        plan(small(), candidates="all", formulation="elastic")
    with pytest.raises(UnknownName, match="'sampled'"):
        plan(small(), candidates="sample")  # type: ignore[arg-type]


def test_more_poses_than_memory_is_meant_for_are_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("pscover.grasping.all_poses.ENTRIES", 100)
    with pytest.raises(Refused, match="coarser grid"):
        plan(small(), candidates="all", sampling=Sampling(orientations=36))


def test_instances_keep_the_order_of_the_poses() -> None:
    found = plan(garments(5), candidates="all")
    assert found.instance.meta.poses is not None
    assert isinstance(found.instance, Instance)
    probability = Ellipse().probability(found.scene, found.instance.meta.poses)
    assert (probability != found.instance.probability).nnz == 0


def test_the_command_line_says_over_which_poses(tmp_path: Path) -> None:
    pytest.importorskip("cv2")
    table = tmp_path / "table.png"
    labels = np.zeros((80, 160), dtype=int)
    labels[20:60, 10:60], labels[20:60, 60:110] = 1, 2
    table.write_bytes(encode_labels(labels))
    arguments = ["plan", str(table), "--no-figure", "--candidates", "all", "--orientations", "12"]
    shown = CliRunner(env={"COLUMNS": "200"}).invoke(app, arguments)
    assert shown.exit_code == 0
    assert "proven optimal: no plan from all 48,000 poses of the grid needs fewer" in shown.stdout
    refused = CliRunner(env={"COLUMNS": "200"}).invoke(app, [*arguments, "--conflicts", "distance"])
    assert refused.exit_code == 2
    assert "use candidates 'sampled'" in refused.output
