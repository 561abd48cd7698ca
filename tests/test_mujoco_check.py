"""Grasps in our world and in MuJoCo: the criterion, what is carried over, the statistics, and resuming."""

from __future__ import annotations

import importlib.util
import json
import math
import sys
from pathlib import Path
from types import ModuleType

import numpy as np
import pytest

import pscover
from pscover.errors import MissingDependency
from pscover.experiment.agreement import Confusion, jaccard, over_groups, wilson
from pscover.sim.cloth import cloth
from pscover.sim.held import Jaw, held, reached, risen
from pscover.sim.settings import Gripper
from pscover.sim.wardrobe import wardrobe

SCRIPT = Path(__file__).parent.parent / "bench" / "mujoco_check.py"
GLOVE, SOCK = 5, 6


def jaw(z: float, *, gap: float = 0.01, theta: float = 0.0) -> Jaw:
    return Jaw(x=0.0, y=0.0, z=z, theta=theta, gap=gap)


# The criterion


def test_a_garment_is_held_if_it_is_between_the_pads_and_has_risen() -> None:
    both = cloth(wardrobe(0.65)[GLOVE : SOCK + 1], 0.02)
    before, after = both.position.copy(), both.position.copy()
    glove = both.garment == 0
    after[glove, 2] += 0.44
    assert held(both, before, after, jaw(0.43), Gripper()) == (0,)
    assert held(both, before, after, jaw(0.60), Gripper()) == (), "risen, but below the fingers: it hangs at something else"
    assert risen(both, before, after) == (0,)
    after[glove, 2] -= 0.36
    assert held(both, before, after, jaw(0.08), Gripper()) == (), "between the pads, but hardly risen"


def test_cloth_between_the_pads_is_found_though_no_particle_is_there() -> None:
    towel = cloth(wardrobe(0.65)[9:], 0.02)
    first, second = towel.position[towel.edge[0]]
    middle, along = (first + second) / 2, math.atan2(second[1] - first[1], second[0] - first[0])
    # Thinner than the edge is long, across it.
    thin = Gripper(width=0.002)
    at = Jaw(x=middle[0], y=middle[1], z=0.0, theta=along + math.pi / 2, gap=0.002)
    assert not at.between(towel.position[towel.edge[0]], thin).any()
    lifted = towel.position + np.array((0, 0, 0.45))
    assert held(towel, towel.position, lifted, Jaw(x=at.x, y=at.y, z=0.45, theta=at.theta, gap=0.002), thin) == (0,)


def test_the_open_jaw_reaches_further_along_than_across() -> None:
    towel = cloth(wardrobe(0.65)[9:], 0.02)
    beside = float(towel.position[:, 0].max()) + 0.05
    for theta, expected in ((0.0, (0,)), (math.pi / 2, ())):
        assert reached(towel, Jaw(x=beside, y=0.0, z=0.0, theta=theta, gap=0.085), Gripper()) == expected


def test_garments_that_are_gone_count_nowhere() -> None:
    towel = cloth(wardrobe(0.65)[9:], 0.02)
    towel.present[0] = 0
    lifted = towel.position + np.array((0, 0, 0.45))
    assert reached(towel, jaw(0.0), Gripper()) == held(towel, towel.position, lifted, jaw(0.44), Gripper()) == ()


# The statistics


def test_kappa_is_one_for_agreement_zero_for_chance_and_unknown_without_a_difference() -> None:
    assert Confusion(both=3, first=0, second=0, neither=4).kappa == 1.0
    assert Confusion(both=4, first=4, second=4, neither=4).kappa == 0.0
    assert Confusion(both=0, first=5, second=5, neither=0).kappa < 0
    assert math.isnan(Confusion(both=7, first=0, second=0, neither=0).kappa)
    assert math.isnan(Confusion.sum([]).kappa)


def test_what_is_outside_of_what_was_looked_at_does_not_count() -> None:
    assert Confusion.of({1, 9}, {9}, among={1, 2}) == Confusion(both=0, first=1, second=0, neither=1)


def test_shares_have_intervals_that_stay_shares() -> None:
    assert wilson(10, 10).high == pytest.approx(1.0)
    assert 0.7 < wilson(10, 10).low < 0.75
    assert wilson(0, 10).low == pytest.approx(0.0)
    assert math.isnan(wilson(0, 0).mean)
    assert jaccard({1}, ()) == 0.0


def test_the_bootstrap_draws_whole_groups() -> None:
    good, bad = Confusion(both=9, first=0, second=0, neither=1), Confusion(both=0, first=9, second=0, neither=1)
    interval = over_groups([[good], [bad]], lambda one: one.agreed / one.total, samples=500)
    assert (interval.low, interval.mean, interval.high) == (0.1, 0.55, 1.0), "nothing between a group and two alike"


# MuJoCo


@pytest.fixture(scope="module")
def check() -> ModuleType:
    pytest.importorskip("numba")
    if not SCRIPT.exists():
        pytest.skip("bench/mujoco_check.py is not beside the tests")
    spec = importlib.util.spec_from_file_location("mujoco_check", SCRIPT)
    assert spec is not None
    assert spec.loader is not None
    made = importlib.util.module_from_spec(spec)
    sys.modules["mujoco_check"] = made
    with pytest.MonkeyPatch.context() as patch:
        patch.syspath_prepend(str(SCRIPT.parent))
        spec.loader.exec_module(made)
    return made


def test_a_check_that_was_stopped_goes_on(check: ModuleType, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    made: list[object] = []

    def run(grasp: object) -> object:
        if len(made) == 2:
            raise KeyboardInterrupt
        made.append(grasp)
        lifted = check.Lifted(held=(1,), risen=(1, 2), gap=10.0)
        row = check.Row(
            x=0.1,
            y=0.2,
            theta=0.3,
            reached=(1, 3),
            simulated=(1, 2, 3),
            particles=90,
            ours=lifted,
            mujoco=check.Lifted(held=(1, 3), risen=(1, 3), gap=11.0),
            gripped=(1,),
            settled=7.0,
            steady=True,
        )
        return check.Done(row=row, timing=check.Seconds(ours=0.5, mujoco=30.0))

    monkeypatch.setattr(check, "compared", lambda cache: run)
    arguments = ["mujoco_check.py", "--scenes", "1", "--results", str(tmp_path)]
    monkeypatch.setattr(sys, "argv", arguments)
    with pytest.raises(KeyboardInterrupt):
        check.main()
    with (tmp_path / "results.jsonl").open("a") as file:
        file.write('{"case": {"sc')
    made.clear()
    check.main()
    lines = [json.loads(line) for line in (tmp_path / "results.jsonl").read_text().splitlines()]
    assert [line["case"]["kind"] for line in lines] == ["middle", "border", "rim"]
    assert [grasp.kind for grasp in made] == ["rim"], "what was done is not done again"  # type: ignore[attr-defined]
    shown = (tmp_path / "table.md").read_text()
    assert "| all | 3 | 0: 0.00 (0.00–0.56) | 3 of 6: 0.50" in shown
    assert "| 0 | rim | long sleeve, scarf | long sleeve | long sleeve, scarf | **no** | shorts / – |" in shown


def test_grasps_of_a_scene_lie_where_their_kind_says(check: ModuleType) -> None:
    grasps = sys.modules["mujoco_grasps"]
    labels = np.zeros((60, 80), dtype=np.int32)
    labels[10:40, 10:40], labels[10:40, 40:60] = 1, 2
    first, second = grasps._middles(labels).tolist()
    assert first == [24, 24]
    assert second[1] == 49, "in the middle of its width"
    assert 19 <= second[0] <= 30
    assert {tuple(spot) for spot in grasps._borders(labels)} == {
        (row, column) for row in range(11, 39) for column in (39, 40)
    }
    rims = grasps._rims(labels)
    assert (labels[rims[:, 0], rims[:, 1]] == 0).all()
    assert rims[:, 0].min() == 4


def test_nothing_in_the_package_leans_on_the_second_engine() -> None:
    package = Path(pscover.__file__).parent
    readers = [path.name for path in package.rglob("*.py") if "sim.mujoco_jaw import" in path.read_text(encoding="utf-8")]
    assert readers == [], "what plans or simulates episodes must not know it"


def test_without_mujoco_the_extra_is_named(monkeypatch: pytest.MonkeyPatch) -> None:
    pytest.importorskip("numba")
    from pscover.sim import World, WorldSettings
    from pscover.sim.mujoco_jaw import replay

    world = World.of(wardrobe(0.65)[SOCK : SOCK + 1], WorldSettings())
    monkeypatch.setattr("importlib.util.find_spec", lambda name, package=None: None)
    with pytest.raises(MissingDependency, match=r"pscover\[mujoco\]"):
        replay(world, 0.5, 0.3, 0.0)


def test_a_glove_is_carried_over_and_lifted() -> None:
    mujoco = pytest.importorskip("mujoco")
    pytest.importorskip("numba")
    from pscover.sim import World, WorldSettings
    from pscover.sim.mujoco_jaw import Shell, _lay, neighbours, replay, scene

    world = World.of(wardrobe(0.65)[GLOVE : SOCK + 1], WorldSettings())
    state = world.cloth
    glove = state.garment == 0
    state.position[:, 2] = 0.007
    state.position[glove, :2] += (0.3, 0.3)
    state.position[~glove, :2] += (0.7, 0.3)
    before = state.position.copy()
    middle_x, middle_y = before[glove, :2].mean(axis=0).tolist()
    assert neighbours(state, middle_x, middle_y, world.arm.law.thickness) == (0,)

    model = mujoco.MjModel.from_xml_string(scene(world, (0, 1), middle_x, middle_y, 0.0, Shell()))
    data = mujoco.MjData(model)
    _lay(model, data, before)
    np.testing.assert_allclose(data.flexvert_xpos, before, atol=1e-6)
    masses = model.body_mass[model.flex_vertbodyid]
    np.testing.assert_allclose(masses, state.mass, rtol=1e-5)

    made = replay(world, middle_x, middle_y, 0.4)
    assert made.steady
    assert made.garments == (0,)
    assert (state.position == before).all(), "the world itself stays as it is"
    assert (made.after[~glove] == before[~glove]).all()
    assert held(state, before, made.after, made.jaw, Gripper()) == (0,)
    assert made.jaw.z == pytest.approx(Gripper().lift, abs=0.002)
    again = replay(world, middle_x, middle_y, 0.4)
    assert (again.after == made.after).all()

    nothing = replay(world, 0.5, 0.1, 0.0)
    assert nothing.garments == ()
    assert held(state, before, nothing.after, nothing.jaw, Gripper()) == ()
