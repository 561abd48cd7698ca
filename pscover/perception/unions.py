"""Masks that show several garments as one: dropped where the garments themselves were found.

A model that is asked for whole, part and sub-part answers with a shirt's sleeve, the shirt, and the shirt with its
neighbour; nothing but its own scores and the colours tells which of them is a garment. So this is for masks that come with
scores, whoever made them. Of two that nearly agree the worse one goes. Of the rest each is worth

    cells of its main colour x score

and a mask goes if the masks inside it are worth more together, where cells that several of them share count once: a tree of
nested masks, solved from the leaves. Masks inside one that stays are kept, for the clean-up to judge.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from pscover.perception.colour import FloatImage
from pscover.perception.mask import Mask
from pscover.perception.proposals import areas, distinct, shared

ALIKE = 20.0
"""Within this distance of a mask's median colour (Lab, half the weight on L) a cell has its main colour."""
LIGHTNESS = 0.5
DUPLICATE = 0.75
"""Of two masks with a greater intersection over union the worse one goes."""
NESTED = 0.85
"""From this share of its cells a mask lies inside another."""
CELLS, ALL_CELLS = 256, 2**24
"""Masks are compared on a grid of at most so many cells along a side, and so many cells of all masks together."""


def without_unions(masks: Sequence[Mask], shape: tuple[int, int], image: FloatImage | None = None) -> list[Mask]:
    """The masks that are neither the worse of two alike nor worth less than what lies inside them, in the order given.

    Parameters
    ----------
    masks
        With scores.
    shape
        Height and width of their image.
    image
        Lab of the photo, shape (H, W, 3). Without it every mask is of one colour.

    Examples
    --------
    >>> pair, left, right = [[1, 1, 1, 1]], [[1, 1, 0, 0]], [[0, 0, 1, 1]]
    >>> def kept(*scores):
    ...     masks = [Mask.of(bits, score=score) for bits, score in zip([pair, left, right], scores, strict=True)]
    ...     return [mask.score for mask in without_unions(masks, (1, 4))]
    >>> kept(0.95, 0.99, 0.98), kept(0.99, 0.95, 0.98)
    ([0.99, 0.98], [0.99, 0.95, 0.98])
    """
    if not masks:
        return []
    height, width = shape
    step = max(math.ceil(max(shape) / CELLS), math.ceil(math.sqrt(len(masks) * height * width / ALL_CELLS)))
    # Copies: views would keep every whole image alive.
    inside = np.array([mask.pixels(shape)[::step, ::step].copy() for mask in masks])
    score = np.array([mask.score for mask in masks], dtype=np.float32)
    colour = np.zeros((*inside.shape[1:], 3), dtype=np.float32) if image is None else image[::step, ::step].copy()
    colour[:, :, 0] *= LIGHTNESS
    single = distinct(inside, score, DUPLICATE)
    return [masks[k] for k in sorted(single[_worthy(inside[single], score[single], colour)].tolist())]


def _worthy(inside: NDArray[np.bool_], score: NDArray[np.float32], colour: FloatImage) -> NDArray[np.intp]:
    """The indices of the masks that are worth no less than those inside them; cells (n, rows, columns), scores (n,)."""
    order = np.argsort(-areas(inside), kind="stable")
    inside, score = inside[order], score[order]
    own = [_main(cells, colour) for cells in inside] * score
    common = shared(inside)
    nested = common >= NESTED * np.diag(common)[:, None]
    within, free = np.zeros(len(order)), inside.copy()
    kept = []
    for k in reversed(range(len(order))):
        if own[k] >= within[k]:
            kept.append(k)
        around = np.flatnonzero(nested[k, :k])
        if len(around):
            parent = around[-1]
            new = np.count_nonzero(inside[k] & free[parent]) / max(1, int(common[k, k]))
            within[parent] += max(own[k], within[k]) * new
            free[parent] &= ~inside[k]
    return np.asarray(order[kept], dtype=np.intp)


def _main(cells: NDArray[np.bool_], colour: FloatImage) -> int:
    """How many of a mask's cells have its main colour."""
    colours = colour[cells]
    if len(colours) == 0:
        return 0
    return int(np.count_nonzero(np.linalg.norm(colours - np.median(colours, axis=0), axis=1) <= ALIKE))
