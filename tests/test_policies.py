"""Every policy decides what its description says, and clears a table."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from numpy.typing import NDArray

from pscover import InvalidSettings, UnknownName, registry
from pscover.execution.declutter import Patience, declutter
from pscover.execution.events import Decided, Ended, Event, Moved, Reason
from pscover.execution.sight import PhotoEyes, Sight
from pscover.execution.tabletop import CAMERA, ColourEyes, Tabletop, colour, small_table
from pscover.generate.garments import garments
from pscover.policies._cycle import Cycle, Pending
from pscover.policies._depth import disc_sums, major_axis
from pscover.policies.consolidation import Consolidation
from pscover.policies.height import Height
from pscover.policies.hybrid_height import HybridHeight
from pscover.policies.random import Random
from pscover.policies.segment import Segment
from pscover.policies.segment_replan import SegmentReplan
from pscover.policies.volume import Volume
from pscover.policy import Pick, Place, Policy, Transport
from pscover.robot import Frame, Pose

EYES = ColourEyes()


def pile() -> Tabletop:
    """Eight garments, of which each that is put down later hides some of those below."""
    scene = garments(5, seed=3, size=(120, 200))
    over = []
    for k in range(3):
        mask = np.zeros(scene.shape, dtype=np.bool_)
        mask[20 + 20 * k : 60 + 20 * k, 30 + 35 * k : 90 + 35 * k] = True
        over.append(mask)
    return Tabletop.of(scene, over=over)


def made(name: str) -> Policy:
    """The policy with an engine that is quick, and needs no process of its own."""
    policy = registry.policy(name)
    if hasattr(policy, "cycle"):
        policy = replace(policy, cycle=replace(policy.cycle, backend="greedy", points=3))  # type: ignore[type-var]
    return policy


def cleared(policy: Policy, table: Tabletop, **options: object) -> list[Event]:
    return list(declutter(table, table, policy, eyes=EYES, **options))  # type: ignore[arg-type]


def first_pick(policy: Policy, sight: Sight, seed: int = 0) -> Pose:
    action = policy.next(sight, None, np.random.default_rng(seed)).actions[0]
    assert isinstance(action, Pick)
    return action.pose


def test_all_names() -> None:
    assert registry.names("policy") == (
        *("consolidation", "height", "hybrid-height", "hybrid-volume", "random"),
        *("segment", "segment-all", "segment-replan", "volume"),
    )


@pytest.mark.parametrize("name", registry.names("policy"))
def test_every_policy_clears_a_pile(name: str) -> None:
    table = pile()
    count = len(table.garments)
    events = cleared(made(name), table)
    assert isinstance(events[-1], Ended)
    assert events[-1].reason is Reason.CLEAR
    assert table.garments == []
    assert len(table.baskets) == count


@pytest.mark.parametrize("name", registry.names("policy"))
def test_equal_sights_and_seeds_give_equal_decisions(name: str) -> None:
    sight, policy = pile().sight(), made(name)
    one, other = (policy.next(sight, None, np.random.default_rng(7)) for _ in range(2))
    assert one.actions == other.actions
    assert len(one.actions) >= 2
    assert isinstance(one.actions[-1], Transport)


@pytest.mark.parametrize("name", registry.names("policy"))
def test_no_policy_grasps_where_grasps_have_failed(name: str) -> None:
    frame, policy = small_table().capture(), made(name)
    failed, radius = [(float(x), 30.0) for x in range(10, 60, 5)], 26.0
    for seed in range(2):
        pose = first_pick(policy, Sight(frame, EYES, failed, radius), seed)
        assert min(math.hypot(pose.x - x, pose.y - y) for x, y in failed) > radius


@pytest.mark.parametrize("name", registry.names("policy"))
def test_no_policy_grasps_on_an_empty_table(name: str) -> None:
    empty = Tabletop(shape=(60, 80), garments=[])
    assert made(name).next(empty.sight(), None, np.random.default_rng(0)).actions == ()


def test_random_grasps_are_uniform_on_the_cloth() -> None:
    labels = np.zeros((20, 40), dtype=int)
    labels[:, :10], labels[:, 30:] = 1, 2
    sight = Tabletop.of(labels).sight()
    poses = [first_pick(Random(), sight, seed) for seed in range(400)]
    assert all(pose.x < 10 or pose.x >= 30 for pose in poses)
    assert 140 < sum(pose.x < 10 for pose in poses) < 260
    assert 140 < sum(pose.theta < 0 for pose in poses) < 260
    assert min(pose.theta for pose in poses) < -1.5
    assert max(pose.theta for pose in poses) > 1.5


def heaped(heights: NDArray[np.float64]) -> Sight:
    """A table whose cloth has these heights."""
    rgb = np.full((*heights.shape, 3), 255, dtype=np.uint8)
    rgb[heights > 0] = 200, 0, 0
    return Sight(Frame(rgb=rgb, depth=(CAMERA - heights).astype(np.float32)), EYES)


def test_height_grasps_the_highest_point_along_the_ridge() -> None:
    heights = np.zeros((60, 80))
    steps = np.arange(-15, 16)
    for offset in (-1, 0, 1):
        heights[30 + steps // 2, 40 + steps + offset] = 0.05
    heights[30, 40] = 0.08
    heights[5:8, 5:8] = 0.07
    pose = first_pick(Height(), heaped(heights))
    assert (pose.x, pose.y) == (40, 30)
    assert pose.theta == pytest.approx(math.atan2(1, 2), abs=0.08)


def test_volume_prefers_a_broad_heap_to_a_narrow_peak() -> None:
    heights = np.zeros((80, 160))
    heights[40, 40] = 0.3
    heights[20:60, 100:140] = 0.05
    assert first_pick(Height(), heaped(heights)).x == 40
    pose = first_pick(Volume(), heaped(heights))
    assert (pose.x, pose.y) == pytest.approx((120, 40), abs=6)


def test_the_principal_axis_turns_with_the_heights() -> None:
    y, x = np.mgrid[-30:31, -30:31]
    for degrees in range(-90, 90, 10):
        theta = math.radians(degrees)
        ridge = np.abs(y * math.cos(theta) - x * math.sin(theta)) <= 3
        found = major_axis(ridge.astype(float), 30, 30, 20)
        assert -math.pi / 2 <= found < math.pi / 2
        assert math.degrees(abs(math.sin(found - theta))) < 3


def test_sums_over_discs_are_those_of_a_loop() -> None:
    heights = np.random.default_rng(0).random((12, 15))
    y, x = np.indices(heights.shape)
    expected = [[heights[(y - r) ** 2 + (x - c) ** 2 <= 4.5**2].sum() for c in range(15)] for r in range(12)]
    np.testing.assert_allclose(disc_sums(heights, 4.5), expected, atol=1e-9)


def segment_trips(policy: Policy, table: Tabletop) -> list[Decided]:
    return [event for event in cleared(policy, table) if isinstance(event, Decided)]


def test_segment_goes_by_increasing_distance_and_plans_once_while_nothing_else_moves() -> None:
    labels = np.zeros((80, 300), dtype=int)
    for k in range(4):
        labels[20:60, 20 + 70 * k : 60 + 70 * k] = k + 1
    decided = segment_trips(Segment(), Tabletop.of(labels))
    xs = [event.actions[0].pose.x for event in decided if isinstance(event.actions[0], Pick)]
    assert xs == sorted(xs, reverse=True)
    assert len(xs) == 4
    assert [event.plan is not None for event in decided] == [True, False, False, False]
    assert all(len(event.actions) == 2 for event in decided)


def test_a_grasp_is_skipped_when_its_surroundings_changed_and_only_then() -> None:
    table = small_table()
    random = np.random.default_rng(0)
    first = Segment().next(table.sight(), None, random)
    assert isinstance(first.state, Pending)
    target = first.state.targets[-1].pose
    frame = table.capture()
    far, near = frame.rgb.copy(), frame.rgb.copy()
    far[:8, :8] = 0
    near[round(target.y) - 6 : round(target.y) + 6, round(target.x) - 6 : round(target.x) + 6] = 0
    kept = Segment().next(Sight(Frame(rgb=far), EYES), first.state, random)
    assert kept.skipped == ()
    assert kept.plan is None
    gone = Segment().next(Sight(Frame(rgb=near), EYES), first.state, random)
    assert target in [skip.pose for skip in gone.skipped]
    assert all(skip.change > 400 for skip in gone.skipped)
    lenient = Segment(cycle=Cycle(threshold=1e9)).next(Sight(Frame(rgb=near), EYES), first.state, random)
    assert lenient.skipped == ()


def test_a_plan_that_is_used_up_or_overthrown_is_followed_by_a_new_one() -> None:
    table, random = small_table(), np.random.default_rng(0)
    first = Segment().next(table.sight(), None, random)
    black = Frame(rgb=np.zeros_like(table.capture().rgb))
    assert Segment().next(Sight(black, EYES), first.state, random).plan is not None
    assert isinstance(first.state, Pending)
    assert Segment().next(table.sight(), replace(first.state, targets=()), random).plan is not None
    assert Segment().next(table.sight(), "the state of somebody else", random).plan is not None


def test_replan_plans_for_every_grasp_and_keeps_what_is_left() -> None:
    table = small_table()
    decided = segment_trips(SegmentReplan(), table)
    assert all(event.plan is not None for event in decided)
    sight = small_table().sight()
    first = SegmentReplan().next(sight, None, np.random.default_rng(0))
    assert isinstance(first.state, Pending)
    second = SegmentReplan().next(sight, first.state, np.random.default_rng(1))
    assert second.plan is not None
    poses = second.plan.instance.meta.poses
    assert poses is not None
    for target in first.state.targets:
        assert (np.abs(poses - (target.pose.x, target.pose.y, target.pose.theta)).sum(axis=1) < 1e-9).any()


def test_replan_within_no_time_still_plans() -> None:
    made = SegmentReplan(cycle=Cycle(seconds=1e-9)).next(small_table().sight(), None, np.random.default_rng(0)).plan
    assert made is not None
    assert made.grasps
    assert made.strict is None or made.unmet


def test_plans_are_made_by_the_planning_engine() -> None:
    made = Segment().next(small_table().sight(), None, np.random.default_rng(0)).plan
    assert made is not None
    assert made.result.backend == registry.planning_backend()


def test_hybrid_takes_depth_above_the_height_and_segments_below() -> None:
    heights = np.zeros((60, 120))
    heights[10:50, 10:50] = 0.05
    heights[30, 30] = 0.11
    random = np.random.default_rng(0)
    by_depth = HybridHeight().next(heaped(heights), None, random)
    assert by_depth.plan is None
    assert by_depth.state is None
    assert first_pick(HybridHeight(), heaped(heights)) == first_pick(Height(), heaped(heights))
    heights[30, 30] = 0.09
    low = heaped(heights)
    by_segments = HybridHeight().next(low, None, random)
    assert by_segments.plan is not None


def test_hybrid_does_not_interrupt_a_cycle() -> None:
    labels = np.zeros((60, 200), dtype=int)
    labels[10:50, 10:50], labels[10:50, 140:180] = 1, 2
    table, random = Tabletop.of(labels), np.random.default_rng(0)
    first = HybridHeight().next(table.sight(), None, random)
    frame = table.capture()
    assert frame.depth is not None
    peak = frame.depth.copy()
    peak[30, 30] -= 0.2
    second = HybridHeight().next(Sight(Frame(rgb=frame.rgb, depth=peak), EYES), first.state, random)
    assert second.plan is None
    assert isinstance(second.state, Pending)


def test_consolidation_chains_from_far_to_near_within_the_threshold() -> None:
    labels = np.zeros((80, 300), dtype=int)
    for k in range(4):
        labels[20:60, 20 + 70 * k : 60 + 70 * k] = k + 1
    table = Tabletop.of(labels)
    actions = Consolidation().next(table.sight(), None, np.random.default_rng(0)).actions
    picks = [action.pose for action in actions if isinstance(action, Pick)]
    places = [(action.x, action.y) for action in actions if isinstance(action, Place)]
    assert len(picks) == 4
    assert [pose.x for pose in picks] == sorted(pose.x for pose in picks)
    assert places == [(pose.x, pose.y) for pose in picks[1:]]
    decision = Consolidation().next(table.sight(), None, np.random.default_rng(0))
    area = 40 * 40 / 4.7**2
    one = Consolidation(most_cm2=1.9 * area).next(table.sight(), None, np.random.default_rng(0))
    assert sum(isinstance(action, Pick) for action in one.actions) == 2
    assert isinstance(one.state, Pending)
    assert len(one.state.targets) == 2
    assert isinstance(decision.state, Pending)
    assert decision.state.targets == ()


def test_consolidation_needs_fewer_trips_than_segment() -> None:
    def trips(policy: Policy) -> int:
        table = Tabletop.of(garments(8, seed=1, size=(150, 250)))
        return sum(isinstance(e, Moved) and isinstance(e.action, Transport) for e in cleared(policy, table))

    assert trips(made("consolidation")) < trips(made("segment"))


def kinds(count: int) -> ColourEyes:
    """Odd labels are white laundry, even ones dark."""
    return ColourEyes(kinds=tuple((*colour(k), "white" if k % 2 else "dark") for k in range(1, count + 1)))


@pytest.mark.parametrize("name", ["segment", "consolidation", "segment-replan"])
def test_sorting_takes_every_class_to_its_basket(name: str) -> None:
    labels = np.zeros((100, 160), dtype=int)
    for k in range(6):
        labels[10 + 40 * (k // 3) : 50 + 40 * (k // 3), 20 + 40 * (k % 3) : 60 + 40 * (k % 3)] = k + 1
    table = Tabletop.of(labels)
    policy = registry.policy(name, {"baskets": '["white", "dark"]', "backend": "greedy"})
    events = list(declutter(table, table, policy, eyes=kinds(6)))
    assert isinstance(events[-1], Ended)
    assert events[-1].reason is Reason.CLEAR
    assert sorted(table.baskets) == sorted(("white" if k % 2 else "dark", k) for k in range(1, 7))


def test_classes_without_a_basket_go_to_the_common_one() -> None:
    labels = np.zeros((60, 200), dtype=int)
    labels[10:50, 10:50], labels[10:50, 140:180] = 1, 2
    table = Tabletop.of(labels)
    policy = registry.policy("segment", {"baskets": ["white"]})
    list(declutter(table, table, policy, eyes=kinds(2)))
    assert sorted(table.baskets) == [("", 2), ("white", 1)]


def test_photos_and_depth_are_looked_at_by_perception() -> None:
    pytest.importorskip("cv2")
    pytest.importorskip("skimage")
    rgb = np.full((120, 200, 3), 210, dtype=np.uint8)
    rgb[30:80, 30:80], rgb[40:90, 120:170] = (180, 30, 30), (20, 20, 160)
    depth = np.full((120, 200), 1.3, dtype=np.float32)
    depth[30:80, 30:80], depth[40:90, 120:170] = 1.28, 1.26
    sight = Sight(Frame(rgb=rgb, depth=depth), PhotoEyes())
    assert first_pick(Height(), sight).x >= 120
    assert len(Segment().next(sight, None, np.random.default_rng(0)).actions) == 2
    assert sight.classes == ("coloured", "coloured")


def test_settings_are_checked_and_named() -> None:
    for name, options in (
        ("segment", {"points": "0"}), ("segment", {"threshold": "-1"}), ("height", {"radius_cm": "0"}),
        ("hybrid-volume", {"pile_metres": "-0.1"}), ("consolidation", {"most_cm2": "0"}), ("segment", {"required": "1"}),
        ("segment", {"points": "many"}),
    ):  # fmt: skip
        with pytest.raises(InvalidSettings, match=next(iter(options))):
            registry.policy(name, options)
    for option in ("backend", "formulation"):
        with pytest.raises(UnknownName, match=f"unknown {option} 'higs'"):
            registry.policy("hybrid-height", {option: "higs"})
    with pytest.raises(InvalidSettings, match="candidates"):
        registry.policy("segment-replan", {"candidates": "all"})
    with pytest.raises(UnknownName, match="did you mean 'points'"):
        registry.policy("segment", {"pionts": "3"})
    assert registry.policy("segment-replan", {"points": "7"}).cycle.seconds == 2.0  # type: ignore[attr-defined]
    with pytest.raises(InvalidSettings, match="tries"):
        Patience(tries=0)


def test_depth_tells_garments_of_the_colour_of_the_table_where_settings_ask_for_it() -> None:
    pytest.importorskip("cv2")
    pytest.importorskip("skimage")
    from pscover.inputs import Look
    from pscover.perception.perceive import Settings

    rgb = np.full((120, 160, 3), 210, dtype=np.uint8)
    rgb += np.random.default_rng(0).integers(0, 3, rgb.shape, dtype=np.uint8)
    depth = np.full((120, 160), 1.0, dtype=np.float32)
    depth[30:80, 40:110] = 0.97
    frame = Frame(rgb=rgb, depth=depth)
    assert PhotoEyes().segments(frame).scene.garments == 0
    assert PhotoEyes(look=Look(settings=Settings(cloth_height_cm=1.0))).segments(frame).scene.garments == 1
