"""Masks that show several garments as one: dropped where the garments themselves were found.

A model that is asked for whole, part and sub-part answers with a shirt's sleeve, the shirt, and the shirt with its
neighbour; nothing but its own scores and the colours tells which of them is a garment. Each mask is worth

    cells of its main colour x (score - floor)

and a mask goes if the masks inside it are worth more together: a tree of nested masks, solved from the leaves. Masks inside
one that stays are kept, for the clean-up to judge.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from pscover.perception.promptable import FloatArray
from pscover.perception.proposals import areas, shared

NESTED = 0.85
"""From this share of its cells a mask lies inside another."""


def without_unions(
    inside: NDArray[np.bool_], score: FloatArray, colour: FloatArray, floor: float, alike: float
) -> NDArray[np.intp]:
    """The indices of the masks that are not worth less than what lies inside them, largest first.

    Parameters
    ----------
    inside
        Which cells belong to each mask, shape (n, rows, columns).
    score
        Quality of each mask, shape (n,).
    colour
        Of each cell, shape (rows, columns, 3).
    floor
        The score at which a mask is worth nothing.
    alike
        Cells within this distance of a mask's median colour have its main colour.

    Examples
    --------
    >>> pair = np.array([[[1, 1, 1, 1]], [[1, 1, 0, 0]], [[0, 0, 1, 1]]], dtype=bool)
    >>> grey = np.zeros((1, 4, 3), dtype=np.float32)
    >>> without_unions(pair, np.array([0.95, 0.99, 0.98], dtype=np.float32), grey, 0.8, 20.0).tolist()
    [1, 2]
    >>> without_unions(pair, np.array([0.99, 0.95, 0.98], dtype=np.float32), grey, 0.8, 20.0).tolist()
    [0, 1, 2]
    """
    order = np.argsort(-areas(inside), kind="stable")
    inside, score = inside[order], score[order]
    own = [_main(cells, colour, alike) for cells in inside] * np.maximum(score - floor, 0)
    common = shared(inside)
    nested = common >= NESTED * np.diag(common)[:, None]
    within = np.zeros(len(order))
    kept = []
    for k in reversed(range(len(order))):
        if own[k] >= within[k]:
            kept.append(k)
        around = np.flatnonzero(nested[k, :k])
        if len(around):
            within[around[-1]] += max(own[k], within[k])
    return np.asarray(order[kept[::-1]], dtype=np.intp)


def _main(cells: NDArray[np.bool_], colour: FloatArray, alike: float) -> int:
    """How many of a mask's cells have its main colour."""
    colours = colour[cells]
    if len(colours) == 0:
        return 0
    return int(np.count_nonzero(np.linalg.norm(colours - np.median(colours, axis=0), axis=1) <= alike))
