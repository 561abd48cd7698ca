"""Connected pieces of a label image, and who touches whom."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

LabelImage = NDArray[np.int32]
IntArray = NDArray[np.int64]


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Contacts:
    """Pairs of labels that lie side by side.

    Parameters
    ----------
    first, second
        Labels, first < second, each pair once, shape (pairs,).
    length
        Pixel edges along which they touch, shape (pairs,).
    """

    first: IntArray
    second: IntArray
    length: IntArray


def pieces(labels: LabelImage) -> LabelImage:
    """The 4-connected pieces of equal labels, numbered from 1; 0 stays 0. Shape (H, W).

    Examples
    --------
    >>> pieces(np.array([[5, 0, 5], [5, 7, 5]], dtype=np.int32)).tolist()
    [[1, 0, 2], [1, 3, 2]]
    """
    from skimage.measure import label

    return np.asarray(label(labels, background=0, connectivity=1), dtype=np.int32)


def sizes(labels: LabelImage) -> IntArray:
    """Pixels of each label from 0 to the highest."""
    return np.bincount(labels.ravel()).astype(np.int64)


def contacts(labels: LabelImage) -> Contacts:
    """Which labels touch, and along how many pixel edges; 0 is a label like any other.

    Examples
    --------
    >>> touching = contacts(np.array([[1, 1, 2], [0, 0, 2]], dtype=np.int32))
    >>> [*zip(touching.first.tolist(), touching.second.tolist(), touching.length.tolist())]
    [(0, 1, 2), (0, 2, 1), (1, 2, 1)]
    """
    sides = ((labels[:, :-1], labels[:, 1:]), (labels[:-1], labels[1:]))
    first = np.concatenate([a[a != b] for a, b in sides]).astype(np.int64)
    second = np.concatenate([b[a != b] for a, b in sides]).astype(np.int64)
    base = int(labels.max(initial=0)) + 1
    keys, length = np.unique(np.minimum(first, second) * base + np.maximum(first, second), return_counts=True)
    return Contacts(first=keys // base, second=keys % base, length=length.astype(np.int64))


def absorb(labels: LabelImage, fragment: NDArray[np.bool_]) -> LabelImage:
    """Give each fragment the label of the neighbour it touches most; fragments that touch none become 0.

    Fragments touch through each other: those next to a segment go first, then those next to what they became. Of
    equally long contacts the lower label wins.

    Parameters
    ----------
    labels
        Shape (H, W).
    fragment
        Which labels are fragments, shape (highest label + 1,).
    """
    becomes = np.arange(len(fragment))
    becomes[fragment] = 0
    touching = contacts(labels)
    known = ~fragment
    known[0] = False
    ends = (
        np.concatenate([touching.first, touching.second]),
        np.concatenate([touching.second, touching.first]),
        np.concatenate([touching.length, touching.length]),
    )
    while True:
        use = fragment[ends[0]] & (becomes[ends[0]] == 0) & (becomes[ends[1]] > 0)
        if not use.any():
            return becomes[labels].astype(np.int32)
        source, target = ends[0][use], becomes[ends[1][use]]
        pairs, back = np.unique(np.stack([source, target]), axis=1, return_inverse=True)
        total = np.bincount(back.ravel(), ends[2][use])
        order = np.lexsort((-pairs[1], total))
        becomes[pairs[0][order]] = pairs[1][order]


def renumbered(labels: LabelImage) -> tuple[LabelImage, IntArray]:
    """Labels 1, 2, ... by decreasing area, and the old label of each; of equal areas the lower old label goes first.

    Examples
    --------
    >>> renumbered(np.array([[9, 4, 4, 0]], dtype=np.int32))
    (array([[2, 1, 1, 0]], dtype=int32), array([4, 9]))
    """
    area = sizes(labels)
    area[0] = 0
    order = np.argsort(-area, kind="stable")
    order = order[area[order] > 0]
    table = np.zeros(len(area), dtype=np.int32)
    table[order] = np.arange(1, len(order) + 1)
    return table[labels], order
