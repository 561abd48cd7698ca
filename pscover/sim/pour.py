"""How a scene begins: garments hang as somebody holds them, and are let fall over the table."""

from __future__ import annotations

import math

import numpy as np

from pscover.sim.arm import Arm
from pscover.sim.cloth import Cloth, FloatArray
from pscover.sim.settings import TABLE, Pour

HANGING = 0.5
"""Seconds for which a garment hangs by one particle, alone, before it falls."""
CLEAR = 0.03
"""Metres between a garment that is let go and what lies or falls below."""
ROOM = (0.08, 0.92)
"""Where over the table a garment's middle may be let go, as a part of its size."""


def pour(arm: Arm, settings: Pour, generator: np.random.Generator) -> None:
    """Let all garments fall over the table in random order, and wait until they rest."""
    middle = np.array(TABLE) / 2
    shapes = [_hung(arm, g, generator) for g in range(len(arm.cloth.present))]
    arm.cloth.present[:] = 1
    height = CLEAR
    for g in generator.permutation(len(shapes)).tolist():
        at = middle + generator.uniform(-1, 1, 2) * settings.spread
        height = _put(arm.cloth, g, shapes[g], at, height)
    arm.pairs.found[0] = -1
    arm.settle(0.8, 3.0)


def drop(arm: Arm, g: int, generator: np.random.Generator) -> None:
    """Let one garment that is gone fall over the table again."""
    present = arm.cloth.present.copy()
    shape = _hung(arm, g, generator)
    arm.cloth.present[:] = present
    others = arm.cloth.position[arm.cloth.present[arm.cloth.garment] == 1]
    low, high = ROOM
    at = np.array(TABLE) * generator.uniform(low, high, 2)
    arm.cloth.present[g] = 1
    _put(arm.cloth, g, shape, at, float(others[:, 2].max(initial=0.0)) + CLEAR)
    arm.pairs.found[0] = -1
    arm.settle(0.6, 2.0)


def _hung(arm: Arm, g: int, generator: np.random.Generator) -> FloatArray:
    """The shape of a garment that hangs by a random particle and swings, around its middle."""
    cloth = arm.cloth
    own = slice(int(cloth.start[g]), int(cloth.start[g + 1]))
    cloth.present[:] = 0
    cloth.present[g] = 1
    turn = generator.uniform(0, 2 * math.pi)
    rotation = np.array([[math.cos(turn), -math.sin(turn)], [math.sin(turn), math.cos(turn)]])
    lying = cloth.flat[own] @ rotation.T
    point = int(generator.integers(len(lying)))
    cloth.hinge_length[cloth.hinge_start[g] : cloth.hinge_start[g + 1]] = cloth.hinge_flat[
        cloth.hinge_start[g] : cloth.hinge_start[g + 1]
    ]
    # High enough that nothing touches the table.
    cloth.position[own, :2] = lying - lying[point]
    cloth.position[own, 2] = 2.0 + generator.normal(0.0, 0.003, len(lying))
    cloth.velocity[own] = 0.0
    cloth.before[own] = cloth.position[own]
    cloth.mobility[own] = 1.0 / cloth.mass[own]
    cloth.asleep[g] = 0
    cloth.mobility[own.start + point] = 0.0
    arm.pairs.found[0] = -1
    arm.wait(HANGING)
    cloth.mobility[own] = 1.0 / cloth.mass[own]
    shape: FloatArray = cloth.position[own] - cloth.position[own].mean(axis=0)
    return shape


def _put(cloth: Cloth, g: int, shape: FloatArray, at: FloatArray, height: float) -> float:
    """Put a garment's lowest point at a height, at rest; returns where the next one may be."""
    own = slice(int(cloth.start[g]), int(cloth.start[g + 1]))
    cloth.position[own] = shape
    cloth.position[own, :2] += at
    cloth.position[own, 2] += height - shape[:, 2].min()
    cloth.before[own] = cloth.position[own]
    cloth.velocity[own] = 0.0
    cloth.mobility[own] = 1.0 / cloth.mass[own]
    cloth.asleep[g] = 0
    return height + float(np.ptp(shape[:, 2])) + CLEAR
