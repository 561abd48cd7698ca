"""What a closed jaw holds: cloth that bridges the gap between the pads."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from pscover.sim.cloth import Cloth, Law
from pscover.sim.fingers import CAPACITY, COSINE, GAP, SINE, Hand, X, Y, Z

SLACK = 0.35
"""Of a particle's thickness: how much of the gap may stay empty where cloth counts as pinched."""


def grasp(cloth: Cloth, hand: Hand, law: Law, grip: float) -> NDArray[np.int64]:
    """Hold what is pinched: particles between the pads at a place where they and their neighbours fill the gap.

    Parameters
    ----------
    cloth, hand, law
        The world, the jaw just closed.
    grip
        Newtons that the whole pinch carries; each held particle gets an equal share.

    Returns
    -------
    particles
        Those held now.
    """
    gap, d = float(hand.state[GAP]), law.thickness
    offset = cloth.position - hand.state[[X, Y, Z]]
    cosine, sine = float(hand.state[COSINE]), float(hand.state[SINE])
    along, across = cosine * offset[:, 0] + sine * offset[:, 1], cosine * offset[:, 1] - sine * offset[:, 0]
    up = offset[:, 2]
    between = (cloth.present[cloth.garment] == 1) & (np.abs(along) < gap / 2 + 0.25 * d)
    between &= (np.abs(across) < hand.size[1] + 0.1 * d) & (up > -0.1 * d) & (up < hand.size[2])
    inside = np.flatnonzero(between)
    held = inside[_bridges(along[inside], across[inside], up[inside], gap, d)]
    hand.held[held] = 1
    hand.place[held] = np.column_stack((along, across, up))[held]
    hand.load[:] = 0.0
    hand.state[CAPACITY] = grip / max(1, len(held))
    cloth.mobility[held] = 0.0
    return held


def _bridges(
    along: NDArray[np.float64], across: NDArray[np.float64], up: NDArray[np.float64], gap: float, d: float
) -> NDArray[np.bool_]:
    """Whether each particle, with those at its height and depth, reaches from pad to pad without a gap."""
    row = np.hypot(across[:, None] - across, up[:, None] - up) < 0.75 * d
    left = np.where(row, along, np.inf).min(axis=1, initial=np.inf) - d / 2 <= SLACK * d - gap / 2
    right = np.where(row, along, -np.inf).max(axis=1, initial=-np.inf) + d / 2 >= gap / 2 - SLACK * d
    filled = row.sum(axis=1) * d >= gap - SLACK * d
    return np.asarray(left & right & filled)


def let_go(cloth: Cloth, hand: Hand) -> None:
    """Hold nothing."""
    held = hand.held == 1
    cloth.mobility[held] = 1.0 / cloth.mass[held]
    cloth.velocity[held] = 0.0
    hand.held[:] = 0
    hand.load[:] = 0.0
