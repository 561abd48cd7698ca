"""Cloth against cloth: which particles are near each other, and how they push and rub."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from pscover.engine.jit import inner
from pscover.sim.cloth import Cloth, FloatArray, IntArray, Law

BUCKETS = 8192
PAIRS = 40
"""Room for pairs, a particle."""
PUSH = 0.5
"""Metres a second at which particles that already overlap are driven apart: faster, they would gain energy."""
YIELD = 0.7
"""Part of an overlap that one step removes; a particle has several neighbours that all push."""
STIR = 0.0015
"""Metres by which a particle has moved lately that wakes the sleeping garment that it touches."""


class Near(NamedTuple):
    """Pairs of particles that may touch before they are looked for again.

    Parameters
    ----------
    first, second
        Shape (room,).
    found
        Shape (2,): how many pairs there are, or -1 when they must be looked for; how often they were looked for.
    seen
        Where particles were when they were looked for, shape (particles, 3).
    bucket, following, cell
        Lists of particles by cell: the first of a bucket, the next in its list, and the cell, shape (particles, 3).
    """

    first: IntArray
    second: IntArray
    found: IntArray
    seen: FloatArray
    bucket: IntArray
    following: IntArray
    cell: IntArray


def near(particles: int) -> Near:
    """Nothing looked for yet."""
    return Near(
        first=np.zeros(PAIRS * particles, dtype=np.int32),
        second=np.zeros(PAIRS * particles, dtype=np.int32),
        found=np.array([-1, 0], dtype=np.int32),
        seen=np.zeros((particles, 3)),
        bucket=np.zeros(BUCKETS, dtype=np.int32),
        following=np.zeros(particles, dtype=np.int32),
        cell=np.zeros((particles, 3), dtype=np.int32),
    )


@inner
def _bucket(x: int, y: int, z: int) -> int:
    return ((x * 73856093) ^ (y * 19349663) ^ (z * 83492791)) & (BUCKETS - 1)


@inner
def look(cloth: Cloth, pairs: Near, law: Law) -> None:
    """Find the pairs again if a particle has moved by half the skin."""
    moved = 0.0
    if pairs.found[0] >= 0:
        for g in range(len(cloth.present)):
            if cloth.present[g] == 0 or cloth.asleep[g] == 1:
                continue
            for i in range(cloth.start[g], cloth.start[g + 1]):
                square = 0.0
                for k in range(3):
                    square += (cloth.position[i, k] - pairs.seen[i, k]) ** 2
                moved = max(moved, square)
        if moved <= 0.25 * law.skin * law.skin:
            return
    _search(cloth, pairs, law)


@inner
def _search(cloth: Cloth, pairs: Near, law: Law) -> None:
    reach = law.thickness + law.skin
    pairs.bucket[:] = -1
    count = 0
    # Sleeping garments first: they are found by those awake, not by each other.
    for asleep in (1, 0):
        for g in range(len(cloth.present)):
            if cloth.present[g] == 0 or cloth.asleep[g] != asleep:
                continue
            for i in range(cloth.start[g], cloth.start[g + 1]):
                for k in range(3):
                    pairs.cell[i, k] = math.floor(cloth.position[i, k] / reach)
                    pairs.seen[i, k] = cloth.position[i, k]
                if asleep == 0:
                    count = _pair(cloth, pairs, law, i, count)
                place = _bucket(pairs.cell[i, 0], pairs.cell[i, 1], pairs.cell[i, 2])
                pairs.following[i] = pairs.bucket[place]
                pairs.bucket[place] = i
    pairs.found[0] = count
    pairs.found[1] += 1


@inner
def _pair(cloth: Cloth, pairs: Near, law: Law, i: int, count: int) -> int:
    """Pair a particle with those before it; returns the new number of pairs."""
    reach2, apart2 = (law.thickness + law.skin) ** 2, law.apart * law.apart
    cx, cy, cz = pairs.cell[i, 0], pairs.cell[i, 1], pairs.cell[i, 2]
    x, y, z = cloth.position[i, 0], cloth.position[i, 1], cloth.position[i, 2]
    for ox in range(-1, 2):
        for oy in range(-1, 2):
            for oz in range(-1, 2):
                j = pairs.bucket[_bucket(cx + ox, cy + oy, cz + oz)]
                while j >= 0:
                    # Several cells share a bucket.
                    if pairs.cell[j, 0] == cx + ox and pairs.cell[j, 1] == cy + oy and pairs.cell[j, 2] == cz + oz:
                        dx, dy, dz = x - cloth.position[j, 0], y - cloth.position[j, 1], z - cloth.position[j, 2]
                        if dx * dx + dy * dy + dz * dz < reach2:
                            fx, fy = cloth.flat[i, 0] - cloth.flat[j, 0], cloth.flat[i, 1] - cloth.flat[j, 1]
                            other = cloth.garment[i] != cloth.garment[j]
                            if (other or fx * fx + fy * fy > apart2) and count < len(pairs.first):
                                pairs.first[count] = i
                                pairs.second[count] = j
                                count += 1
                    j = pairs.following[j]
    return count


@inner
def wake(cloth: Cloth, pairs: Near, g: int) -> None:
    """Let a garment move again."""
    if cloth.asleep[g] == 1:
        cloth.asleep[g] = 0
        pairs.found[0] = -1
        for i in range(cloth.start[g], cloth.start[g + 1]):
            cloth.mobility[i] = 1.0 / cloth.mass[i]
            for k in range(3):
                cloth.before[i, k] = cloth.position[i, k]


@inner
def touch(cloth: Cloth, pairs: Near, law: Law) -> None:
    """Push overlapping particles apart along the line between them, and rub them across it."""
    d2 = law.thickness * law.thickness
    push = PUSH * law.dt
    for p in range(pairs.found[0]):
        i, j = pairs.first[p], pairs.second[p]
        dx = cloth.position[i, 0] - cloth.position[j, 0]
        dy = cloth.position[i, 1] - cloth.position[j, 1]
        dz = cloth.position[i, 2] - cloth.position[j, 2]
        square = dx * dx + dy * dy + dz * dz
        if square >= d2:
            continue
        wi, wj = cloth.mobility[i], cloth.mobility[j]
        total = wi + wj
        if total == 0.0:
            continue
        distance = math.sqrt(square) + 1e-9
        nx, ny, nz = dx / distance, dy / distance, dz / distance
        bx = cloth.before[i, 0] - cloth.before[j, 0]
        by = cloth.before[i, 1] - cloth.before[j, 1]
        bz = cloth.before[i, 2] - cloth.before[j, 2]
        old = max(0.0, law.thickness - math.sqrt(bx * bx + by * by + bz * bz))
        overlap = law.thickness - distance
        depth = min(YIELD * overlap, max(0.0, overlap - old) + push)
        # Motion across the line during this step, relative to each other.
        tx, ty, tz = dx - bx, dy - by, dz - bz
        along = tx * nx + ty * ny + tz * nz
        tx, ty, tz = tx - along * nx, ty - along * ny, tz - along * nz
        slip = math.sqrt(tx * tx + ty * ty + tz * tz) + 1e-12
        rub = min(1.0, law.cloth_friction * depth / slip)
        mx, my, mz = depth * nx - rub * tx, depth * ny - rub * ty, depth * nz - rub * tz
        a, b = wi / total, wj / total
        cloth.position[i, 0] += a * mx
        cloth.position[i, 1] += a * my
        cloth.position[i, 2] += a * mz
        cloth.position[j, 0] -= b * mx
        cloth.position[j, 1] -= b * my
        cloth.position[j, 2] -= b * mz
        if cloth.asleep[cloth.garment[i]] != cloth.asleep[cloth.garment[j]]:
            moving = j if cloth.asleep[cloth.garment[i]] == 1 else i
            square = 0.0
            for k in range(3):
                square += (cloth.position[moving, k] - cloth.anchor[moving, k]) ** 2
            if square > STIR * STIR:
                wake(cloth, pairs, cloth.garment[i])
                wake(cloth, pairs, cloth.garment[j])
