"""What is not cloth: the table, the basket and the fingers, as triangles."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from pscover.sim.cloth import FloatArray, IntArray
from pscover.sim.fabric import Texture, plain, table_texture
from pscover.sim.fingers import COSINE, GAP, SINE, Hand, X, Y, Z
from pscover.sim.settings import TABLE

DEEP = 0.35
"""Metres from the table down to the floor, as far as it is drawn."""
BASKET = (0.24, 0.20)
"""Half the basket's width, and its height, metres."""
CUBE = np.array([[x, y, z] for z in (0, 1) for y in (-1, 1) for x in (-1, 1)], dtype=float)
QUADS = np.array([(0, 2, 3, 1), (4, 5, 7, 6), (0, 1, 5, 4), (2, 6, 7, 3), (0, 4, 6, 2), (1, 3, 7, 5)])


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Solid:
    """Triangles of one texture; each has corners of its own, so that edges are sharp.

    Parameters
    ----------
    corners, normals
        Shape (3 * triangles, 3).
    texture
        Index into `textures()`.
    """

    corners: FloatArray
    normals: FloatArray
    texture: int


def textures() -> tuple[Texture, ...]:
    """Of the table, the floor, the table's sides, the basket, the fingers."""
    return (table_texture(), plain((72, 74, 80)), plain((120, 96, 70)), plain((228, 226, 220)), plain((44, 46, 52)))


def _quad(points: NDArray[np.float64], outwards: NDArray[np.float64], texture: int) -> Solid:
    corners = points[[0, 1, 2, 0, 2, 3]]
    return Solid(corners=corners, normals=np.tile(outwards / np.linalg.norm(outwards), (6, 1)), texture=texture)


def _box(
    middle: FloatArray, half: tuple[float, float], z: tuple[float, float], turn: FloatArray, texture: int
) -> list[Solid]:
    corners = CUBE * np.array([*half, 1.0])
    corners[:, 2] = np.where(CUBE[:, 2] > 0, z[1], z[0])
    corners[:, :2] = corners[:, :2] @ turn.T + middle
    centre = corners.mean(axis=0)
    return [_quad(corners[quad], corners[quad].mean(axis=0) - centre, texture) for quad in QUADS]


def furniture(basket: tuple[float, float]) -> list[Solid]:
    """The table, the floor and the basket."""
    width, depth = TABLE
    top = np.array([[0, 0, 0], [width, 0, 0], [width, depth, 0], [0, depth, 0]], dtype=float)
    up = np.array([0.0, 0.0, 1.0])
    floor = np.array([[-4, -4, -DEEP], [5, -4, -DEEP], [5, 4, -DEEP], [-4, 4, -DEEP]], dtype=float)
    straight = np.eye(2)
    solids = [_quad(top, up, 0), _quad(floor, up, 1)]
    solids += _box(np.array([width / 2, depth / 2]), (width / 2, depth / 2), (-0.04, -0.0005), straight, 2)
    half, height = BASKET
    middle = np.array(basket)
    for direction in ((1, 0), (-1, 0), (0, 1), (0, -1)):
        across = np.array(direction) * half
        thin = (0.006, half) if direction[0] else (half, 0.006)
        solids += _box(middle + across, thin, (-DEEP, -DEEP + height), straight, 3)
    return solids


def fingers(hand: Hand) -> list[Solid]:
    """Two fingers and the palm above them."""
    state = hand.state
    turn = np.array([[state[COSINE], -state[SINE]], [state[SINE], state[COSINE]]])
    tip, top = float(state[Z]), float(state[Z] + hand.size[2])
    middle = state[[X, Y]]
    solids: list[Solid] = []
    for side in (-1, 1):
        offset = turn @ np.array([side * (state[GAP] / 2 + hand.size[0]), 0.0])
        solids += _box(middle + offset, (float(hand.size[0]), float(hand.size[1])), (tip, top), turn, 4)
    solids += _box(middle, (0.065, 0.03), (top, top + 0.05), turn, 4)
    return solids + _box(middle, (0.03, 0.03), (top + 0.05, top + 0.14), turn, 1)


def joined(solids: list[Solid]) -> tuple[FloatArray, FloatArray, IntArray]:
    """Corners, normals and the texture of each triangle."""
    return (
        np.concatenate([solid.corners for solid in solids]),
        np.concatenate([solid.normals for solid in solids]),
        np.repeat([solid.texture for solid in solids], [len(solid.corners) // 3 for solid in solids]).astype(np.int32),
    )
