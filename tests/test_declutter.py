"""The cycle goes on when something fails, ends when it must, and says what happened."""

from __future__ import annotations

import itertools
import threading
from dataclasses import dataclass, field, replace
from typing import ClassVar

import numpy as np
import pytest

from pscover import EngineFailed, InvalidImage, InvalidSettings, MissingDependency, UnknownName
from pscover.execution.declutter import Patience, declutter
from pscover.execution.events import (
    Captured,
    Decided,
    Empty,
    Ended,
    Event,
    FrameLost,
    Judged,
    MotionFailed,
    Moved,
    PolicyFailed,
    Reason,
    Retried,
    ScaleDoubted,
)
from pscover.execution.hands import Hands, Hung, within
from pscover.execution.ledger import Ledger
from pscover.execution.sight import Sight
from pscover.execution.tabletop import ColourEyes, Tabletop, small_table
from pscover.policies._cycle import Cycle
from pscover.policies.consolidation import Consolidation
from pscover.policies.height import Height
from pscover.policies.hybrid_height import HybridHeight
from pscover.policies.random import Random
from pscover.policies.segment import Segment
from pscover.policy import Decision, Pick, Place, Policy, Transport, trip
from pscover.robot import Camera, Frame, Pose, Robot, RobotFailed, Sorter

EYES = ColourEyes()


def run(table: Tabletop, policy: Policy | None = None, **options: object) -> list[Event]:
    return list(declutter(table, table, policy or Segment(), eyes=EYES, **options))  # type: ignore[arg-type]


def ending(events: list[Event]) -> Reason:
    assert isinstance(events[-1], Ended)
    assert sum(isinstance(event, Ended) for event in events) == 1
    return events[-1].reason


def count(events: list[Event], *kinds: type[object]) -> int:
    return sum(isinstance(event, kinds) for event in events)


@dataclass(slots=True, kw_only=True, eq=False)
class Faulty(Tabletop):
    """A table top whose robot and camera fail as they are told.

    Parameters
    ----------
    fails
        How many picks fail at first.
    beyond
        Picks to the right of this column fail always.
    lost
        How many captures fail, after the first.
    slippery
        Labels that are never held.
    says
        What the scale says: "truth", "nothing", "much", "nonsense".
    """

    fails: int = 0
    beyond: float = np.inf
    lost: int = 0
    slippery: frozenset[int] = frozenset()
    says: str = "truth"
    captured: int = 0
    tried: list[Pose] = field(default_factory=list)

    def capture(self) -> Frame:
        self.captured += 1
        if self.captured > 1 and self.lost:
            self.lost -= 1
            raise RobotFailed("no frame")
        return Tabletop.capture(self)

    def pick(self, pose: Pose) -> None:
        self.tried.append(pose)
        if self.fails or pose.x > self.beyond:
            self.fails = max(0, self.fails - 1)
            raise RobotFailed("out of reach")
        Tabletop.pick(self, pose)
        self.garments += [garment for garment in self.held if garment.label in self.slippery]
        self.held = [garment for garment in self.held if garment.label not in self.slippery]

    def weight(self) -> float | None:
        match self.says:
            case "nothing":
                return 0.0
            case "much":
                return 3.0
            case "nonsense":
                return float("nan")
            case _:
                return Tabletop.weight(self)


def faulty(**faults: object) -> Faulty:
    table = small_table()
    return Faulty(shape=table.shape, garments=table.garments, **faults)  # type: ignore[arg-type]


def test_the_table_top_is_a_robot_and_a_camera() -> None:
    table: object = small_table()
    assert isinstance(table, Robot)
    assert isinstance(table, Sorter)
    assert isinstance(table, Camera)


def test_events_come_in_order_and_end_when_the_table_is_clear() -> None:
    events = run(small_table())
    assert ending(events) is Reason.CLEAR
    kinds = [type(event) for event in events]
    assert kinds[:6] == [Captured, Decided, Moved, Moved, Captured, Judged]
    assert count(events, Decided) == count(events, Judged) >= 2
    judged = [event for event in events if isinstance(event, Judged)]
    assert all(event.emptier for event in judged)
    assert judged[-1].cloth == 0


def test_an_empty_table_is_clear_at_once() -> None:
    assert [type(event) for event in run(Tabletop(shape=(60, 80), garments=[]))] == [Captured, Ended]


def test_equal_seeds_give_equal_runs() -> None:
    def actions(seed: int) -> list[object]:
        return [event.action for event in run(small_table(), Random(), seed=seed) if isinstance(event, Moved)]

    assert actions(5) == actions(5)
    assert actions(5) != actions(6)


def test_failed_picks_are_survived() -> None:
    table = faulty(fails=3)
    events = run(table)
    assert ending(events) is Reason.CLEAR
    assert count(events, MotionFailed) == 3
    assert len(table.baskets) == 3
    for event, following in itertools.pairwise(events):
        assert not (isinstance(event, MotionFailed) and isinstance(following, Moved)), "nothing is held after a failed pick"


def test_a_robot_that_always_fails_ends_the_run() -> None:
    table = faulty(fails=10**6)
    events = run(table, patience=Patience(failures=4))
    assert ending(events) is Reason.BROKEN
    assert count(events, MotionFailed) == 4


def test_lost_frames_are_survived_up_to_a_limit() -> None:
    events = run(faulty(lost=2))
    assert ending(events) is Reason.CLEAR
    assert count(events, FrameLost) == 2
    assert ending(run(faulty(lost=3))) is Reason.BLIND


def test_a_frame_of_another_shape_is_a_lost_one() -> None:
    table = small_table()

    class Shrinking:
        captured = 0

        def capture(self) -> Frame:
            self.captured += 1
            frame = table.capture()
            return Frame(rgb=frame.rgb[::2]) if self.captured == 2 else frame

    events = list(declutter(table, Shrinking(), Random(), eyes=EYES))
    assert count(events, FrameLost) == 1
    assert ending(events) is Reason.CLEAR


def test_what_is_no_frame_is_a_lost_one() -> None:
    table = small_table()

    class Broken:
        def capture(self) -> Frame:
            return None  # type: ignore[return-value]

    assert ending(list(declutter(table, Broken(), Random(), eyes=EYES))) is Reason.BLIND


def test_a_garment_out_of_reach_is_left_and_the_run_ends() -> None:
    labels = np.zeros((60, 200), dtype=int)
    labels[10:50, 10:50], labels[10:50, 140:180] = 1, 2
    table = Faulty(shape=labels.shape, garments=Tabletop.of(labels).garments, beyond=100)
    events = run(table, patience=Patience(failures=100))
    assert ending(events) is Reason.STUCK
    assert [label for _, label in table.baskets] == [1]
    assert count(events, Retried) <= 1


def test_a_place_where_grasps_come_to_nothing_is_left_for_others() -> None:
    table = faulty(slippery=frozenset({3}))
    events = run(table, Height(), patience=Patience(tries=2, place_cm=3))
    assert ending(events) is Reason.STUCK
    assert sorted(label for _, label in table.baskets) == [1, 2]
    first = [pose for pose in table.tried if (pose.x, pose.y) == (table.tried[0].x, table.tried[0].y)]
    assert 2 <= len(first) <= 6, "the highest point is tried again only after all places were given up"


def test_a_table_that_never_clears_is_bounded() -> None:
    table = faulty(slippery=frozenset({1, 2, 3}), says="much")
    assert ending(run(table, Random(), patience=Patience(stalled_trips=6))) is Reason.STUCK
    table = faulty(slippery=frozenset({1, 2, 3}), says="much")
    events = run(table, Random(), patience=Patience(most_transports=5, stalled_trips=99))
    assert ending(events) is Reason.LIMIT
    assert sum(isinstance(event, Moved) and isinstance(event.action, Transport) for event in events) == 5


def test_empty_grasps_are_not_carried_unless_asked_for() -> None:
    class Misses:
        name: ClassVar[str] = "misses"
        needs_depth: ClassVar[bool] = False

        def next(self, sight: Sight, state: object | None, random: np.random.Generator) -> Decision:
            return Decision(actions=trip(Pose(x=60, y=2)), state="missed")

    events = run(small_table(), Misses(), patience=Patience(stalled_trips=3))
    assert count(events, Empty) == 3
    assert not any(isinstance(event, Moved) and isinstance(event.action, Transport) for event in events)
    carried = run(small_table(), Misses(), patience=Patience(stalled_trips=3, empty_kilograms=0.0))
    assert sum(isinstance(event, Moved) and isinstance(event.action, Transport) for event in carried) == 3


@pytest.mark.parametrize("says", ["nothing", "much", "nonsense"])
@pytest.mark.parametrize("policy", [Segment(), Consolidation(), Random()])
def test_a_scale_that_lies_is_found_out(says: str, policy: Policy) -> None:
    table = faulty(says=says)
    events = run(table, policy)
    assert ending(events) is Reason.CLEAR
    assert len(table.baskets) == 3
    assert count(events, ScaleDoubted) == (1 if says == "nothing" else 0)


def test_a_policy_that_fails_is_stood_in_for() -> None:
    class Fails:
        name: ClassVar[str] = "fails"
        needs_depth: ClassVar[bool] = False

        def next(self, sight: Sight, state: object | None, random: np.random.Generator) -> Decision:
            raise EngineFailed("the engine died")

    events = run(small_table(), Fails())
    assert ending(events) is Reason.CLEAR
    assert count(events, PolicyFailed) == count(events, Decided)
    assert {event.policy for event in events if isinstance(event, Decided)} == {"random"}


def test_a_planner_without_time_still_clears_the_table() -> None:
    table = small_table()
    assert ending(run(table, Segment(cycle=Cycle(seconds=1e-3)))) is Reason.CLEAR
    assert len(table.baskets) == 3


@dataclass(slots=True, kw_only=True, eq=False)
class Flat:
    """A camera without depth after the first few frames."""

    table: Tabletop
    deep: int

    def capture(self) -> Frame:
        self.deep -= 1
        frame = self.table.capture()
        return frame if self.deep >= 0 else Frame(rgb=frame.rgb)


def test_depth_that_goes_missing_is_told() -> None:
    pytest.importorskip("cv2")
    from pscover.execution.sight import PhotoEyes

    table, camera = small_table(), Flat(table=small_table(), deep=1)
    events = list(declutter(table, camera, Height(), eyes=PhotoEyes(), patience=Patience(most_transports=2)))
    failed = next(event for event in events if isinstance(event, PolicyFailed))
    assert "expected depth" in failed.message


def test_a_policy_of_depth_is_not_begun_without_depth() -> None:
    table = faulty()
    with pytest.raises(InvalidSettings, match="expected frames with depth"):
        list(declutter(table, Flat(table=table, deep=0), Height(), eyes=EYES))
    assert table.tried == []


def test_a_motion_that_hangs_ends_the_run() -> None:
    table, release = small_table(), threading.Event()

    class Hangs(Tabletop):
        def transport(self) -> None:
            release.wait(30)

    hanging = Hangs(shape=table.shape, garments=table.garments)
    events = run(hanging, patience=Patience(watchdog=0.2))
    release.set()
    assert ending(events) is Reason.HUNG
    assert "transport" in str(events[-1])


def test_other_exceptions_of_a_driver_pass_through() -> None:
    class Buggy(Tabletop):
        def pick(self, pose: Pose) -> None:
            raise ZeroDivisionError

    table = small_table()
    for watchdog in (np.inf, 5.0):
        with pytest.raises(ZeroDivisionError):
            run(Buggy(shape=table.shape, garments=table.garments), patience=Patience(watchdog=watchdog))


def test_a_basket_by_name_needs_an_arm_with_several() -> None:
    table = small_table()

    class OneBasket:
        pick, place, transport, weight = table.pick, table.place, table.transport, table.weight

    hands = Hands(robot=OneBasket(), camera=table)
    with pytest.raises(InvalidSettings, match="transport_to"):
        hands.do(Transport(basket="white"))


def test_the_caller_may_stop_and_go_on_later() -> None:
    table = small_table()
    first = []
    for event in declutter(table, table, Segment(), eyes=EYES):
        first.append(event)
        if isinstance(event, Judged):
            break
    ledger = Ledger()
    for event in first:
        ledger = ledger.after(event, 9.4)
    assert ledger.transports == 1
    rest = run(table, ledger=ledger)
    assert ending(rest) is Reason.CLEAR
    assert len(table.baskets) == 3


@dataclass(slots=True, kw_only=True, eq=False)
class Jammed(Tabletop):
    """A robot that fails to reach the basket at first."""

    jams: float

    def transport(self) -> None:
        if self.jams:
            self.jams -= 1
            raise RobotFailed("the way is blocked")
        Tabletop.transport(self)


def jammed(jams: float) -> Jammed:
    labels = np.zeros((60, 80), dtype=np.int32)
    labels[10:50, 10:50] = 1
    return Jammed(shape=labels.shape, garments=Tabletop.of(labels).garments, jams=jams)


def test_what_is_still_in_the_gripper_is_not_cleared() -> None:
    table = jammed(3)
    assert ending(run(table)) is Reason.CLEAR
    assert table.baskets == [("", 1)]
    for patience, reason in ((Patience(), Reason.BROKEN), (Patience(failures=np.inf), Reason.STUCK)):  # type: ignore[arg-type]
        table = jammed(np.inf)
        events = run(table, patience=patience)
        assert ending(events) is reason
        assert "did not reach the basket" in str(events[-1])
        assert table.baskets == []


def test_a_black_picture_shows_no_clear_table() -> None:
    table = small_table()

    class Blinks:
        count = 0

        def capture(self) -> Frame:
            self.count += 1
            frame = table.capture()
            return Frame(rgb=np.zeros_like(frame.rgb)) if self.count % 2 else frame

    class Black:
        def cloth(self, frame: Frame) -> np.ndarray:
            return np.asarray(EYES.cloth(frame) & frame.rgb.any(axis=2))

        def __getattr__(self, name: str) -> object:
            return getattr(EYES, name)

    events = list(declutter(table, Blinks(), Segment(), eyes=Black()))  # type: ignore[arg-type]
    assert ending(events) is Reason.CLEAR
    assert len(table.baskets) == 3
    assert count(events, FrameLost) == count(events, Captured)


def test_cloth_is_looked_for_once_a_frame() -> None:
    table, looked = small_table(), list[Frame]()

    class Counting:
        def cloth(self, frame: Frame) -> np.ndarray:
            looked.append(frame)
            return EYES.cloth(frame)

        def __getattr__(self, name: str) -> object:
            return getattr(EYES, name)

    events = list(declutter(table, table, HybridHeight(pile_metres=0.03), eyes=Counting()))  # type: ignore[arg-type]
    assert ending(events) is Reason.CLEAR
    frames = [event.frame for event in events if isinstance(event, Captured)]
    assert list(map(id, looked)) == list(map(id, frames))


def test_an_image_that_is_none_is_a_lost_frame() -> None:
    table, broken = small_table(), [None, np.zeros((60, 120), dtype=np.uint8), np.zeros((0, 120, 3), dtype=np.uint8)]

    class Grey:
        def capture(self) -> Frame:
            return Frame(rgb=broken.pop()) if broken else table.capture()  # type: ignore[arg-type]

    events = list(declutter(table, Grey(), Segment(), eyes=EYES, patience=Patience(captures=4)))
    assert ending(events) is Reason.CLEAR
    assert count(events, FrameLost) == 3


def test_a_camera_may_fill_one_buffer_again_and_again() -> None:
    table = small_table()
    buffer = np.zeros((60, 120, 3), dtype=np.uint8)

    class Reuses:
        def capture(self) -> Frame:
            buffer[:] = table.capture().rgb
            return Frame(rgb=buffer)

    events = list(declutter(table, Reuses(), Segment(), eyes=EYES))
    assert all(event.changed for event in events if isinstance(event, Judged))


@pytest.mark.parametrize(
    ("depth", "message"),
    [
        (np.full((60, 120), 1300, dtype=np.uint16), "expected metres in floating point, got uint16"),
        (np.ones((60, 121), dtype=np.float32), "expected the shape of the image"),
        ([[1.0]], "expected a NumPy array, got list"),
    ],
)
def test_depth_that_is_none_is_named(depth: object, message: str) -> None:
    with pytest.raises(InvalidImage, match=message):
        Frame(rgb=small_table().capture().rgb, depth=depth)  # type: ignore[arg-type]


def test_a_weight_of_any_kind_of_number_counts() -> None:
    table = small_table()
    for says, heard in ((np.float32(0.5), 0.5), (np.int64(2), 2.0), (True, None), ("1", None), (-1, None)):

        class Scale:
            pick, place, transport = table.pick, table.place, table.transport

            def weight(self, says: object = says) -> float | None:
                return says  # type: ignore[return-value]

        assert Hands(robot=Scale(), camera=table).weight() == heard


@dataclass(frozen=True, slots=True, kw_only=True)
class Says:
    """A policy that says one thing."""

    name: ClassVar[str] = "says"
    needs_depth: ClassVar[bool] = False

    what: object

    def next(self, sight: Sight, state: object | None, random: np.random.Generator) -> Decision:
        return self.what  # type: ignore[return-value]


PICK = Pick(pose=Pose(x=30, y=30))


@pytest.mark.parametrize(
    "nonsense",
    [
        None,
        Decision(actions=(PICK,)),
        Decision(actions=(Transport(),)),
        Decision(actions=(PICK, Transport(), PICK, Transport())),
        Decision(actions=("pick", "transport")),  # type: ignore[arg-type]
        Decision(actions=trip(Pose(x=1e6, y=30))),
        Decision(actions=trip(Pose(x=30, y=-1))),
        Decision(actions=(PICK, Place(x=float("nan"), y=3), PICK, Transport())),
    ],
)
def test_a_policy_that_talks_nonsense_is_stood_in_for(nonsense: object) -> None:
    table = faulty()
    events = run(table, Says(what=nonsense))
    assert ending(events) is Reason.CLEAR
    assert count(events, PolicyFailed) == count(events, Decided)
    assert all(0 <= pose.x < 120 and 0 <= pose.y < 60 for pose in table.tried)


@pytest.mark.parametrize("error", [InvalidSettings("x"), UnknownName("x"), MissingDependency("x")])
def test_a_policy_that_is_set_up_wrongly_moves_nothing(error: Exception) -> None:
    class Wrong(Says):
        def next(self, sight: Sight, state: object | None, random: np.random.Generator) -> Decision:
            raise error

    table = faulty()
    with pytest.raises(type(error)):
        run(table, Wrong(what=None))
    assert table.tried == []


def test_a_table_may_have_to_be_quite_clear() -> None:
    assert ending(run(small_table(), patience=Patience(clear_cm2=0.0))) is Reason.CLEAR


def test_stopping_early_leaves_nothing_running() -> None:
    table, before = small_table(), threading.active_count()
    events = declutter(table, table, Segment(), eyes=EYES, patience=Patience(watchdog=1e12))
    for event in events:
        if isinstance(event, Moved):
            break
    events.close()  # type: ignore[attr-defined]
    assert threading.active_count() == before


def test_a_seed_below_zero_is_named() -> None:
    with pytest.raises(InvalidSettings, match="seed"):
        run(small_table(), seed=-1)


def test_the_ledger_counts_what_happened() -> None:
    table = faulty(fails=2)
    ledger, events = Ledger(), run(table, Consolidation())
    for event in events:
        ledger = ledger.after(event, 9.4)
    moved = [event.action for event in events if isinstance(event, Moved)]
    assert ledger.picks == sum(isinstance(action, Pick) for action in moved)
    assert ledger.transports == sum(isinstance(action, Transport) for action in moved)
    assert ledger.places == len(moved) - ledger.picks - ledger.transports
    assert ledger.failures == 2
    assert replace(ledger, failures_in_row=0) == ledger


def test_calls_within_a_time_limit_return_raise_or_hang() -> None:
    def fail() -> None:
        raise RobotFailed("x")

    assert within(lambda: None, 5.0, "nothing") is None
    with pytest.raises(RobotFailed):
        within(fail, 5.0, "fail")
    release = threading.Event()
    with pytest.raises(Hung, match=r"wait: no return within 0\.05 s"):
        within(lambda: release.wait(30), 0.05, "wait")
    release.set()
