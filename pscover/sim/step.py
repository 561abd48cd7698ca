"""One step of the physics: fall, keep lengths, bend, touch, stand on the table, meet the fingers.

Extended position-based dynamics with many small steps of one iteration each (Macklin et al., "Small steps in physics
simulation", SCA 2019): positions are moved by velocity and gravity, then constraint by constraint to where they are allowed,
and the velocity is what became of the step. Friction is Coulomb's, on positions (Macklin, Müller, Chentanez, Kim, "Unified
particle physics for real-time applications", 2014): the way slid in a step is taken back up to the coefficient times the
way pushed out.
"""

from __future__ import annotations

import math

import numpy as np

from pscover.engine.jit import inner, kernel
from pscover.sim.cloth import Cloth, Law
from pscover.sim.contact import STIR, Near, look, touch
from pscover.sim.fingers import PULL, Hand, Move, carry, meet_fingers, move_hand, slip

FLOOR = -0.4
"""Metres: cloth that leaves the table lands here, so that it needs no time to fall further."""
BUCKLING = 0.3
"""Part of a compressed edge's error that is corrected: cloth buckles rather than carrying compression."""
PLASTIC = 0.02
"""Part of the bend beyond the yield that a hinge keeps, each time."""
SHARPEST = 0.35
"""Least rest length of a hinge, as a part of its flat length."""
FASTEST = 0.45
"""Greatest way in a step, as a part of the thickness: no particle can jump through another."""
WATCH = 80
"""Steps between two looks at whether garments lie still."""
STILL = 0.0003
"""Metres, in the mean square over a garment, by which it may have moved since the last look to count as lying still."""


@kernel
def advance(cloth: Cloth, pairs: Near, hand: Hand, law: Law, move: Move, first: int, last: int) -> None:
    """The steps `first` to `last` of a motion of `move.steps`."""
    for s in range(first, last):
        move_hand(hand, move, (s + 1.0) / move.steps, law.dt)
        _fall(cloth, law)
        carry(cloth, hand)
        look(cloth, pairs, law)
        _stretch(cloth, hand, law)
        if cloth.age[0] % 2 == 0:
            _bend(cloth, hand, law)
        touch(cloth, pairs, law)
        _stand(cloth, law)
        if move.solid > 0.0:
            meet_fingers(cloth, pairs, hand, law)
        _finish(cloth, law)
        slip(cloth, hand)


@inner
def _asleep(cloth: Cloth, g: int) -> bool:
    return bool(cloth.present[g] == 0 or cloth.asleep[g] == 1)


@inner
def _fall(cloth: Cloth, law: Law) -> None:
    most = FASTEST * law.thickness
    for g in range(len(cloth.present)):
        if _asleep(cloth, g):
            continue
        for i in range(cloth.start[g], cloth.start[g + 1]):
            for k in range(3):
                cloth.before[i, k] = cloth.position[i, k]
            if cloth.mobility[i] == 0.0:
                continue
            vx = (cloth.velocity[i, 0] + law.gravity_x * law.dt) * law.kept
            vy = (cloth.velocity[i, 1] + law.gravity_y * law.dt) * law.kept
            vz = (cloth.velocity[i, 2] + law.gravity_z * law.dt) * law.kept
            way = math.sqrt(vx * vx + vy * vy + vz * vz) * law.dt
            scale = law.dt if way < most else law.dt * most / way
            cloth.position[i, 0] += vx * scale
            cloth.position[i, 1] += vy * scale
            cloth.position[i, 2] += vz * scale


@inner
def _draw_together(
    cloth: Cloth, hand: Hand, i: int, j: int, apart: tuple[float, float, float], part: float, newtons: float
) -> None:
    """Move two joined particles by a part of what is between them; one that is held pulls at the fingers instead."""
    dx, dy, dz = apart
    wi, wj = cloth.mobility[i], cloth.mobility[j]
    cloth.position[i, 0] -= wi * part * dx
    cloth.position[i, 1] -= wi * part * dy
    cloth.position[i, 2] -= wi * part * dz
    cloth.position[j, 0] += wj * part * dx
    cloth.position[j, 1] += wj * part * dy
    cloth.position[j, 2] += wj * part * dz
    if wi == 0.0:
        hand.load[i, 0] -= newtons * part * dx
        hand.load[i, 1] -= newtons * part * dy
        hand.load[i, 2] -= newtons * part * dz
    if wj == 0.0:
        hand.load[j, 0] += newtons * part * dx
        hand.load[j, 1] += newtons * part * dy
        hand.load[j, 2] += newtons * part * dz


@inner
def _stretch(cloth: Cloth, hand: Hand, law: Law) -> None:
    newtons = PULL / (law.dt * law.dt)
    for g in range(len(cloth.present)):
        if _asleep(cloth, g):
            continue
        for e in range(cloth.edge_start[g], cloth.edge_start[g + 1]):
            i, j = cloth.edge[e, 0], cloth.edge[e, 1]
            wi, wj = cloth.mobility[i], cloth.mobility[j]
            if wi + wj == 0.0:
                continue
            dx = cloth.position[i, 0] - cloth.position[j, 0]
            dy = cloth.position[i, 1] - cloth.position[j, 1]
            dz = cloth.position[i, 2] - cloth.position[j, 2]
            length = math.sqrt(dx * dx + dy * dy + dz * dz) + 1e-12
            error = length - cloth.edge_length[e]
            if error < 0.0:
                error *= BUCKLING
            part = error / ((wi + wj) * length)
            _draw_together(cloth, hand, i, j, (dx, dy, dz), part, newtons)


@inner
def _bend(cloth: Cloth, hand: Hand, law: Law) -> None:
    newtons = PULL / (law.dt * law.dt)
    for g in range(len(cloth.present)):
        if _asleep(cloth, g):
            continue
        for e in range(cloth.hinge_start[g], cloth.hinge_start[g + 1]):
            i, j = cloth.hinge[e, 0], cloth.hinge[e, 1]
            wi, wj = cloth.mobility[i], cloth.mobility[j]
            if wi + wj == 0.0:
                continue
            dx = cloth.position[i, 0] - cloth.position[j, 0]
            dy = cloth.position[i, 1] - cloth.position[j, 1]
            dz = cloth.position[i, 2] - cloth.position[j, 2]
            length = math.sqrt(dx * dx + dy * dy + dz * dz) + 1e-12
            flat, error = cloth.hinge_flat[e], length - cloth.hinge_length[e]
            bound = law.fold * flat
            if error > bound:
                cloth.hinge_length[e] = min(flat, cloth.hinge_length[e] + PLASTIC * (error - bound))
            elif error < -bound:
                cloth.hinge_length[e] = max(SHARPEST * flat, cloth.hinge_length[e] + PLASTIC * (error + bound))
            part = law.bending * error / ((wi + wj) * length)
            _draw_together(cloth, hand, i, j, (dx, dy, dz), part, newtons)


@inner
def _stand(cloth: Cloth, law: Law) -> None:
    """Keep cloth above the table, or beside it, and above the floor; rub it there."""
    radius = law.thickness / 2
    for g in range(len(cloth.present)):
        if _asleep(cloth, g):
            continue
        for i in range(cloth.start[g], cloth.start[g + 1]):
            z = cloth.position[i, 2]
            if z >= radius or cloth.mobility[i] == 0.0:
                continue
            x, y = cloth.position[i, 0], cloth.position[i, 1]
            inwards = min(min(x, law.table_x - x), min(y, law.table_y - y))
            if inwards >= 0.0 and inwards >= -z:
                _rub(cloth, law, i, 0.0, 0.0, 1.0, radius - z)
            elif z < FLOOR + radius:
                _rub(cloth, law, i, 0.0, 0.0, 1.0, FLOOR + radius - z)
            elif inwards > -radius:
                _beside(cloth, law, i, inwards)


@inner
def _beside(cloth: Cloth, law: Law, i: int, inwards: float) -> None:
    """Push a particle at the table's rim away from its side or from its upper edge."""
    x, y, z = cloth.position[i, 0], cloth.position[i, 1], cloth.position[i, 2]
    nx, ny, nz = 0.0, 0.0, 0.0
    if inwards == law.table_x - x:
        nx = 1.0
    elif inwards == x:
        nx = -1.0
    elif inwards == y:
        ny = -1.0
    else:
        ny = 1.0
    distance = -inwards
    if z > 0.0:
        distance = math.sqrt(inwards * inwards + z * z) + 1e-9
        nx, ny, nz = -nx * inwards / distance, -ny * inwards / distance, z / distance
    depth = law.thickness / 2 - distance
    if depth > 0.0:
        _rub(cloth, law, i, nx, ny, nz, min(depth, 0.1 * law.thickness))


@inner
def _rub(cloth: Cloth, law: Law, i: int, nx: float, ny: float, nz: float, depth: float) -> None:
    """Push a particle out along a normal, and take back what it slid across it."""
    tx = cloth.position[i, 0] - cloth.before[i, 0]
    ty = cloth.position[i, 1] - cloth.before[i, 1]
    tz = cloth.position[i, 2] - cloth.before[i, 2]
    normal = tx * nx + ty * ny + tz * nz
    tx, ty, tz = tx - normal * nx, ty - normal * ny, tz - normal * nz
    rub = min(1.0, law.table_friction * depth / (math.sqrt(tx * tx + ty * ty + tz * tz) + 1e-12))
    cloth.position[i, 0] += depth * nx - rub * tx
    cloth.position[i, 1] += depth * ny - rub * ty
    cloth.position[i, 2] += depth * nz - rub * tz


@inner
def _finish(cloth: Cloth, law: Law) -> None:
    """Velocities: what became of the step."""
    for g in range(len(cloth.present)):
        if _asleep(cloth, g):
            continue
        for i in range(cloth.start[g], cloth.start[g + 1]):
            for k in range(3):
                cloth.velocity[i, k] = (cloth.position[i, k] - cloth.before[i, k]) / law.dt
    cloth.age[0] += 1
    if cloth.age[0] % WATCH == 0:
        _doze(cloth)


@inner
def _doze(cloth: Cloth) -> None:
    """Garments that have hardly moved since the last look fall asleep."""
    for g in range(len(cloth.present)):
        if _asleep(cloth, g):
            continue
        first, last = cloth.start[g], cloth.start[g + 1]
        total, most, held = 0.0, 0.0, False
        for i in range(first, last):
            square = 0.0
            for k in range(3):
                square += (cloth.position[i, k] - cloth.anchor[i, k]) ** 2
                cloth.anchor[i, k] = cloth.position[i, k]
            total += square
            most = max(most, square)
            held = held or cloth.mobility[i] == 0.0
        if not held and total < STILL * STILL * (last - first) and most < STIR * STIR:
            cloth.asleep[g] = 1
            for i in range(first, last):
                cloth.mobility[i] = 0.0
                for k in range(3):
                    cloth.velocity[i, k] = 0.0


def energy(cloth: Cloth, law: Law) -> float:
    """Joules of motion and height of what is present."""
    live = cloth.present[cloth.garment] == 1
    speed = np.square(cloth.velocity[live]).sum(axis=1)
    height = cloth.position[live, 2]
    return float((cloth.mass[live] * (speed / 2 - law.gravity_z * height)).sum())
