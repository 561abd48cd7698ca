"""The colour that most of a region's border has: the surface's, for garments touch the border here and there at most."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from pscover.perception.colour import FloatImage

BoolImage = NDArray[np.bool_]
FloatArray = NDArray[np.float64]
BAND = 0.06
"""Width of the border as a share of the region's shorter side."""
SECTORS = 24
"""The border is divided by direction from the region's middle."""
BIN = 6.0
"""Colours within so much are counted together at first."""
NEAR = 12.0
"""Colours within so much of the middle belong to it."""
PRESENT, SPREAD = 0.1, 0.5
"""A colour of the surface has a tenth of the pixels in each of half the sectors."""
SAMPLES = 20_000


def border_colours(
    image: FloatImage, inside: BoolImage, explained: BoolImage, weights: NDArray[np.float32], *, spread: float = SPREAD
) -> FloatArray | None:
    """The Lab colour that is spread most widely along the border, or None.

    Each direction from the middle of the region has one vote, however many pixels it has, so a garment that touches
    the border has no more say than the part of the border it covers.

    Parameters
    ----------
    image
        Lab, shape (H, W, 3).
    inside
        The region, shape (H, W).
    explained
        Pixels whose colour is known already, shape (H, W).
    weights
        Of L, a and b in a colour distance.
    spread
        The share of directions in which the colour must be present; 0 takes the best one, whatever it is.

    Returns
    -------
    FloatArray or None
        Shape (3,); None if nothing is left or nothing is spread widely enough.
    """
    rows, columns, sector = _border(inside)
    share = np.bincount(sector, minlength=SECTORS).clip(min=1)
    left = ~explained[rows, columns]
    if not left.any():
        return None
    values = image[rows[left], columns[left]].astype(float)
    votes = (1 / share)[sector[left]]
    colour = _densest(values * weights, votes) / weights
    near = np.linalg.norm((values - colour) * weights, axis=1) < NEAR
    present = np.bincount(sector[left][near], minlength=SECTORS) / share >= PRESENT
    used = np.bincount(sector, minlength=SECTORS) > 0
    return np.asarray(colour, dtype=float) if present.sum() >= spread * used.sum() else None


def _border(inside: BoolImage) -> tuple[NDArray[np.intp], NDArray[np.intp], NDArray[np.intp]]:
    """Rows, columns and sectors of (a subset of) the pixels near the region's border."""
    from scipy.ndimage import binary_erosion

    rows, columns = np.flatnonzero(inside.any(axis=1)), np.flatnonzero(inside.any(axis=0))
    box = inside[rows[0] : rows[-1] + 1, columns[0] : columns[-1] + 1]
    width = max(1, round(BAND * min(box.shape)))
    step = max(1, width // 4)
    thin = box[::step, ::step]
    band = thin & ~binary_erosion(thin, iterations=max(1, width // step))
    y, x = np.nonzero(band)
    every = max(1, len(y) // SAMPLES)
    y, x = y[::every], x[::every]
    tall, wide = thin.shape
    angle = np.arctan2((y + 0.5) / tall - 0.5, (x + 0.5) / wide - 0.5)
    sector = np.minimum((angle + np.pi) / (2 * np.pi) * SECTORS, SECTORS - 1).astype(np.intp)
    return y * step + rows[0], x * step + columns[0], sector


def _densest(points: FloatArray, votes: FloatArray) -> FloatArray:
    """The middle of the densest colours: the fullest cell of a histogram with its neighbours, then a few trimmed medians."""
    from scipy.ndimage import uniform_filter

    low = points.min(axis=0)
    cells = ((points - low) / BIN).astype(np.intp)
    size = tuple(cells.max(axis=0) + 1)
    count = np.zeros(size)
    np.add.at(count, tuple(cells.T), votes)
    full = uniform_filter(count, size=3, mode="constant")
    peak = np.array(np.unravel_index(int(full.argmax()), size))
    middle = low + (peak + 0.5) * BIN
    for _ in range(4):
        near = np.linalg.norm(points - middle, axis=1) < NEAR
        if not near.any():
            break
        middle = np.median(points[near], axis=0)
    return np.asarray(middle)
