"""The cloth against mechanics that has answers: lengths, slopes, falls, energies, orders."""

from __future__ import annotations

import math

import numpy as np
import pytest

pytest.importorskip("numba")
from pscover.sim.arm import Arm
from pscover.sim.cloth import Cloth, Law, cloth, law
from pscover.sim.contact import near
from pscover.sim.fingers import hand
from pscover.sim.settings import Gripper, Material
from pscover.sim.step import FLOOR, energy
from pscover.sim.wardrobe import Fabric, Garment

SPACING = 0.03
FABRIC = Fabric(colour=(90, 90, 90))


def napkin(width: float, length: float) -> Garment:
    x, y = width / 2, length / 2
    outline = np.array([(-x, -y), (x, -y), (x, y), (-x, y)])
    return Garment(name="napkin", outline=outline, density=0.4, fabric=FABRIC)


def arm_over(state: Cloth, laws: Law, gripper: Gripper | None = None) -> Arm:
    jaw = gripper or Gripper()
    n = len(state.mass)
    fingers = hand(n, (jaw.finger / 2, jaw.width / 2, jaw.height), jaw.opening)
    return Arm(cloth=state, pairs=near(n), hand=fingers, law=laws, gripper=jaw, watch=lambda seconds: None)


def lay(state: Cloth, g: int, x: float, y: float, z: float) -> slice:
    """A garment flat and at rest, its middle at a place."""
    own = slice(int(state.start[g]), int(state.start[g + 1]))
    state.position[own, :2] = state.flat[own] - state.flat[own].mean(axis=0) + (x, y)
    state.position[own, 2] = z
    state.before[own] = state.position[own]
    state.velocity[own] = 0.0
    return own


def laws_of(**changes: float) -> Law:
    return law(Material(spacing=SPACING, **changes))


def test_a_free_fall_keeps_the_shape_and_falls_as_galilei_says() -> None:
    state, laws = cloth([napkin(0.15, 0.15)], SPACING), laws_of(drag=0.0)
    lay(state, 0, 0.5, 0.3, 3.0)
    state.velocity[:, 0] = 0.3
    arm_over(state, laws).wait(0.4)
    middle = state.mass @ state.position / state.mass.sum()
    # Velocity first, then position: half a step further than in continuous time.
    np.testing.assert_allclose(middle, [0.5 + 0.3 * 0.4, 0.3, 3.0 - 9.81 * 0.4 * (0.4 + laws.dt) / 2], atol=1e-9)
    momentum = state.mass @ state.velocity / state.mass.sum()
    np.testing.assert_allclose(momentum, [0.3, 0.0, -9.81 * 0.4], atol=1e-9)


def test_crumpled_cloth_in_free_space_keeps_its_momentum() -> None:
    state, laws = cloth([napkin(0.15, 0.15), napkin(0.12, 0.2)], SPACING), laws_of(drag=0.0)._replace(gravity_z=0.0)
    lay(state, 0, 0.5, 0.3, 3.0)
    lay(state, 1, 0.52, 0.3, 3.05)
    state.velocity[:] = np.random.default_rng(0).normal(0, 0.3, state.velocity.shape)
    state.velocity[state.garment == 1, 2] -= 0.5
    before = state.mass @ state.velocity
    arm_over(state, laws).wait(0.4)
    np.testing.assert_allclose(state.mass @ state.velocity, before, atol=1e-9)


def test_hanging_cloth_settles_to_its_length() -> None:
    length = 0.45
    state, laws = cloth([napkin(0.12, length)], SPACING), laws_of()
    own = lay(state, 0, 0.5, 0.3, 3.0)
    top = state.flat[:, 1] < state.flat[:, 1].min() + 1e-6
    state.position[own, 2] = 3.0 - (state.flat[:, 1] - state.flat[:, 1].min())
    state.position[own, 1] = 0.3
    state.mobility[top] = 0.0
    arm_over(state, laws).wait(2.0)
    hangs = 3.0 - state.position[:, 2].min()
    assert length * 0.99 < hangs < length * 1.06


@pytest.mark.parametrize("friction", [0.3, 0.6])
def test_a_napkin_on_a_slope_slides_beyond_the_angle_of_friction_only(friction: float) -> None:
    def slid(angle: float) -> float:
        laws = laws_of(table_friction=friction, drag=0.0)
        laws = laws._replace(gravity_x=9.81 * math.sin(angle), gravity_z=-9.81 * math.cos(angle))
        state = cloth([napkin(0.15, 0.15)], SPACING)
        lay(state, 0, 0.3, 0.3, laws.thickness / 2)
        arm_over(state, laws).wait(0.5)
        return float(state.position[:, 0].mean()) - 0.3

    angle = math.atan(friction)
    assert abs(slid(angle * 0.9)) < 1e-3
    steep = angle * 1.25
    expected = 9.81 * (math.sin(steep) - friction * math.cos(steep)) * 0.5**2 / 2
    assert slid(steep) == pytest.approx(expected, rel=0.2)


def test_layers_laid_on_each_other_keep_their_order() -> None:
    napkins = [napkin(0.2, 0.2), napkin(0.18, 0.2), napkin(0.2, 0.16), napkin(0.16, 0.16)]
    state, laws = cloth(napkins, SPACING), laws_of()
    for g in range(4):
        lay(state, g, 0.5 + 0.01 * g, 0.3, 0.02 + 0.05 * g)
    arm = arm_over(state, laws)
    arm.settle(1.0, 3.0)
    heights = [float(state.position[state.garment == g, 2].mean()) for g in range(4)]
    assert heights == sorted(heights)
    for g in range(3):
        lower, upper = state.position[state.garment == g], state.position[state.garment == g + 1]
        apart = np.hypot(*(upper[:, None, :2] - lower[None, :, :2]).transpose(2, 0, 1))
        on = apart.min(axis=1) < 0.6 * SPACING
        assert on.sum() > 20
        assert (upper[on, 2] > lower[apart.argmin(axis=1)[on], 2]).all()


def dropped(seed: int) -> tuple[Cloth, Arm]:
    """Three napkins that fall on one another, tilted and rough."""
    state, laws = cloth([napkin(0.25, 0.2), napkin(0.15, 0.3), napkin(0.2, 0.2)], SPACING), laws_of()
    generator = np.random.default_rng(seed)
    for g in range(3):
        own = lay(state, g, 0.5 + generator.uniform(-0.05, 0.05), 0.3, 0.25 + 0.25 * g)
        state.position[own, 0] -= 0.2 * state.flat[own, 0]
        state.position[own, 2] += 0.6 * state.flat[own, 0] + generator.normal(0, 0.0005, own.stop - own.start)
    state.before[:] = state.position
    return state, arm_over(state, laws)


def test_energy_never_grows_and_a_heap_comes_to_rest_on_the_table() -> None:
    state, arm = dropped(1)
    seen = [energy(state, arm.law)]
    for _ in range(60):
        arm.wait(0.04)
        seen.append(energy(state, arm.law))
    fell = seen[0] - seen[-1]
    assert max(np.diff(seen)) < 0.01 * fell
    arm.settle(0.0, 3.0)
    assert state.asleep.all()
    assert not state.velocity.any()
    radius = arm.law.thickness / 2
    assert state.position[:, 2].min() > 0.9 * radius
    assert state.position[:, 2].max() < 0.25


def test_no_two_layers_share_a_place() -> None:
    state, arm = dropped(2)
    arm.settle(1.0, 4.0)
    for g in range(3):
        for other in range(g + 1, 3):
            apart = state.position[state.garment == g][:, None] - state.position[state.garment == other][None]
            assert np.linalg.norm(apart, axis=2).min() > 0.75 * arm.law.thickness


def test_nothing_stands_in_the_table_and_what_hangs_over_too_far_falls() -> None:
    state, laws = cloth([napkin(0.2, 0.2), napkin(0.2, 0.2)], SPACING), laws_of()
    lay(state, 0, 1.07, 0.3, 0.02)
    lay(state, 1, 0.97, 0.1, 0.02)
    arm_over(state, laws).wait(1.2)
    assert state.position[state.garment == 0, 2].max() < -0.2
    assert state.position[:, 2].min() >= FLOOR
    assert state.position[state.garment == 1, 2].max() > 0.0
    deep = (state.position[:, 2] < 0) & (state.position[:, 0] < 1.0)
    assert not deep.any()


def test_the_same_seed_gives_the_same_heap_bit_by_bit() -> None:
    (a, one), (b, two) = dropped(3), dropped(3)
    one.wait(0.5)
    # Whoever watches slice by slice sees the same physics.
    for _ in range(5):
        two.wait(0.1)
    np.testing.assert_array_equal(a.position, b.position)


def pinched(force: float = 8.0, grip: float = 4.0, x: float = 0.5) -> tuple[Cloth, Arm, int]:
    state = cloth([napkin(0.24, 0.24)], SPACING)
    # Tips at the table, so that the jaw gathers coarse cloth that lies flat.
    arm = arm_over(state, laws_of(), Gripper(force=force, grip=grip, tip=0.004))
    lay(state, 0, 0.5, 0.3, arm.law.thickness / 2)
    held = len(arm.close_at(x, 0.3, 0.4))
    return state, arm, held


def test_a_pinch_gathers_cloth_and_lifts_it_with_its_weight() -> None:
    state, arm, held = pinched()
    assert held >= 3
    assert arm.hand.state[3] < 0.05
    arm.lift(0.45)
    assert arm.held == (0,)
    assert state.position[:, 2].min() > 0.1
    arm.wait(0.5)
    assert arm.weight == pytest.approx(state.mass.sum(), rel=0.1)


def test_a_pinch_beside_the_cloth_holds_nothing() -> None:
    _, arm, held = pinched(x=0.8)
    assert held == 0
    assert arm.weight == 0.0


def test_a_weak_grip_slips_and_what_is_let_go_falls_back() -> None:
    state, arm, held = pinched(grip=0.01)
    assert held > 0
    arm.lift(0.45)
    assert arm.held == ()
    arm.settle(0.8, 2.0)
    assert state.position[:, 2].max() < 0.15


def test_a_weak_jaw_stops_further_open() -> None:
    gaps = [float(pinched(force=force)[1].hand.state[3]) for force in (0.02, 8.0)]
    assert gaps[0] > gaps[1] + 0.01


def test_fingers_push_cloth_aside() -> None:
    state = cloth([napkin(0.12, 0.12)], SPACING)
    arm = arm_over(state, laws_of())
    lay(state, 0, 0.5, 0.3, arm.law.thickness / 2)
    arm.hand.state[:3] = 0.36, 0.3, 0.004
    arm.move(0.56, 0.3, 0.004)
    assert state.position[:, 0].mean() > 0.55
