"""Two fingers: boxes that push cloth aside, drag it along, and hold what they pinch."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from pscover.engine.jit import inner
from pscover.sim.cloth import Cloth, FloatArray, Law
from pscover.sim.contact import Near, wake

# Places in Hand.state.
X, Y, Z, GAP, COSINE, SINE, RESISTANCE, CAPACITY = range(8)
SMOOTH = 0.1
"""Part of a step's force that enters the average that the jaw feels."""
PULL = 0.04
"""Part of a step's force that enters the average at which a held particle slips."""


class Hand(NamedTuple):
    """The jaw.

    Parameters
    ----------
    state, before
        Shape (8,): middle between the tips, gap between the pads, cosine and sine of the jaw's length against x, newtons
        with which cloth resists the pads, newtons that a held particle bears; now and at the beginning of the step.
    size
        Shape (3,): half the length of a finger along the jaw, half its width across, its height; metres.
    held
        Shape (particles,): 1 between the fingers.
    place
        Of held particles, in the frame of the jaw, shape (particles, 3).
    load
        Newtons on held particles, averaged, shape (particles, 3).
    """

    state: FloatArray
    before: FloatArray
    size: FloatArray
    held: NDArray[np.uint8]
    place: FloatArray
    load: FloatArray


class Move(NamedTuple):
    """One motion of the hand.

    Parameters
    ----------
    from_x, from_y, from_z, x, y, z
        From where to where the tips go.
    steps
        In how many steps.
    gap
        To which the jaw opens or closes.
    speed
        Metres a second at which it does.
    force
        Newtons at which it stops closing.
    closed
        Metres between the pads below which it never goes.
    solid
        1.0 if cloth meets the fingers; 0.0 where they are out of reach.
    """

    from_x: float
    from_y: float
    from_z: float
    x: float
    y: float
    z: float
    steps: int
    gap: float
    speed: float
    force: float
    closed: float
    solid: float


def hand(particles: int, size: tuple[float, float, float], gap: float) -> Hand:
    """An open hand high above the table."""
    state = np.array([0.5, 0.3, 1.0, gap, 1.0, 0.0, 0.0, 0.0])
    shape = (particles, 3)
    return Hand(state, state.copy(), np.array(size), np.zeros(particles, np.uint8), np.zeros(shape), np.zeros(shape))


@inner
def move_hand(hand: Hand, move: Move, u: float, dt: float) -> None:
    """The hand at the part u of its motion, with no jerk at its ends; the jaw moves until cloth stops it."""
    for k in range(4):
        hand.before[k] = hand.state[k]
    smooth = u * u * u * (10.0 + u * (6.0 * u - 15.0))
    hand.state[X] = move.from_x + (move.x - move.from_x) * smooth
    hand.state[Y] = move.from_y + (move.y - move.from_y) * smooth
    hand.state[Z] = move.from_z + (move.z - move.from_z) * smooth
    step = move.speed * dt
    gap = hand.state[GAP]
    if move.gap > gap:
        hand.state[GAP] = min(move.gap, gap + step)
    elif hand.state[RESISTANCE] < move.force:
        hand.state[GAP] = max(max(move.gap, move.closed), gap - step)


@inner
def meet_fingers(cloth: Cloth, pairs: Near, hand: Hand, law: Law) -> None:
    """Push particles out of both fingers, and let these drag them."""
    radius = law.thickness / 2
    half_x, half_y, height = hand.size[0], hand.size[1], hand.size[2]
    gap, cosine, sine = hand.state[GAP], hand.state[COSINE], hand.state[SINE]
    reach = gap / 2 + 2 * half_x + radius
    resistance = 0.0
    for g in range(len(cloth.present)):
        if cloth.present[g] == 0:
            continue
        for i in range(cloth.start[g], cloth.start[g + 1]):
            z = cloth.position[i, 2] - hand.state[Z]
            if z < -radius or z > height + radius or hand.held[i] == 1:
                continue
            x, y = cloth.position[i, 0] - hand.state[X], cloth.position[i, 1] - hand.state[Y]
            along, across = cosine * x + sine * y, cosine * y - sine * x
            if abs(across) >= half_y + radius or abs(along) >= reach:
                continue
            wake(cloth, pairs, g)
            if cloth.mobility[i] > 0.0:
                side = 1.0 if along > 0 else -1.0
                resistance += _push(cloth, hand, law, i, side)
                if gap < law.thickness:
                    resistance += _push(cloth, hand, law, i, -side)
    hand.state[RESISTANCE] += SMOOTH * (resistance / 2 - hand.state[RESISTANCE])


@inner
def _push(cloth: Cloth, hand: Hand, law: Law, i: int, side: float) -> float:
    """Push one particle out of the finger on one side by its nearest face; returns the newtons on the pad."""
    radius = law.thickness / 2
    cosine, sine = hand.state[COSINE], hand.state[SINE]
    x, y = cloth.position[i, 0] - hand.state[X], cloth.position[i, 1] - hand.state[Y]
    along, across, up = cosine * x + sine * y, cosine * y - sine * x, cloth.position[i, 2] - hand.state[Z]
    middle = side * (hand.state[GAP] / 2 + hand.size[0])
    ex = hand.size[0] + radius - abs(along - middle)
    ey = hand.size[1] + radius - abs(across)
    ez = up + radius
    if ex <= 0.0 or ey <= 0.0 or ez <= 0.0:
        return 0.0
    most = 0.3 * law.thickness
    nx, ny, nz = 0.0, 0.0, 0.0
    # Downwards only where there is room above the table.
    if ez < ex and ez < ey and cloth.position[i, 2] - ez > 0.3 * radius:
        nz = -1.0
        depth = min(ez, most)
    elif ex < ey:
        nx = 1.0 if along > middle else -1.0
        depth = min(ex, most)
    else:
        ny = 1.0 if across > 0 else -1.0
        depth = min(ey, most)
    # The normal and the motion against the finger, both in the frame of the table.
    wx, wy = cosine * nx - sine * ny, sine * nx + cosine * ny
    closing = side * (hand.state[GAP] - hand.before[GAP]) / 2
    tx = cloth.position[i, 0] - cloth.before[i, 0] - (hand.state[X] - hand.before[X] + cosine * closing)
    ty = cloth.position[i, 1] - cloth.before[i, 1] - (hand.state[Y] - hand.before[Y] + sine * closing)
    tz = cloth.position[i, 2] - cloth.before[i, 2] - (hand.state[Z] - hand.before[Z])
    normal = tx * wx + ty * wy + tz * nz
    tx, ty, tz = tx - normal * wx, ty - normal * wy, tz - normal * nz
    slip = math.sqrt(tx * tx + ty * ty + tz * tz) + 1e-12
    rub = min(1.0, law.finger_friction * depth / slip)
    cloth.position[i, 0] += depth * wx - rub * tx
    cloth.position[i, 1] += depth * wy - rub * ty
    cloth.position[i, 2] += depth * nz - rub * tz
    return cloth.mass[i] * depth / (law.dt * law.dt) if nx * side < 0.0 else 0.0


@inner
def carry(cloth: Cloth, hand: Hand) -> None:
    """Held particles go where the hand goes."""
    cosine, sine = hand.state[COSINE], hand.state[SINE]
    for i in range(len(hand.held)):
        if hand.held[i] == 1:
            x, y = hand.place[i, 0], hand.place[i, 1]
            cloth.position[i, 0] = hand.state[X] + cosine * x - sine * y
            cloth.position[i, 1] = hand.state[Y] + sine * x + cosine * y
            cloth.position[i, 2] = hand.state[Z] + hand.place[i, 2]


@inner
def slip(cloth: Cloth, hand: Hand) -> None:
    """A garment that pulls harder than the friction on all its held particles bears slips off the one that bears most."""
    for g in range(len(cloth.present)):
        count, worst, most = 0, -1, -1.0
        x, y, z = 0.0, 0.0, 0.0
        for i in range(cloth.start[g], cloth.start[g + 1]):
            if hand.held[i] == 1:
                lx, ly, lz = hand.load[i, 0], hand.load[i, 1], hand.load[i, 2]
                x, y, z = x + lx, y + ly, z + lz
                count += 1
                square = lx * lx + ly * ly + lz * lz
                if square > most:
                    worst, most = i, square
                for k in range(3):
                    hand.load[i, k] *= 1.0 - PULL
        if count > 0:
            bears = count * hand.state[CAPACITY]
            if x * x + y * y + z * z > bears * bears:
                hand.held[worst] = 0
                cloth.mobility[worst] = 1.0 / cloth.mass[worst]
