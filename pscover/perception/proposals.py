"""Masks as logits of low resolution: judging, thinning out and enlarging them.

All of it happens on the decoder's grid of 256 cells; only what survives is enlarged to the photo.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pscover.perception.mask import Mask
from pscover.perception.promptable import Frame

FloatArray = NDArray[np.float32]


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Proposals:
    """Masks that may be garments.

    Parameters
    ----------
    logits
        Positive inside, shape (n, rows, columns).
    score
        The model's guess of each mask's quality, shape (n,).
    """

    logits: FloatArray
    score: FloatArray

    @classmethod
    def none(cls, frame: Frame) -> Proposals:
        """No masks."""
        return cls(logits=np.zeros((0, *frame.cells), dtype=np.float32), score=np.zeros(0, dtype=np.float32))

    def __len__(self) -> int:
        return len(self.score)

    def __getitem__(self, which: NDArray[np.bool_] | NDArray[np.intp]) -> Proposals:
        return Proposals(logits=self.logits[which], score=self.score[which])

    def __add__(self, other: Proposals) -> Proposals:
        return Proposals(logits=np.concatenate([self.logits, other.logits]), score=np.concatenate([self.score, other.score]))

    def inside(self) -> NDArray[np.bool_]:
        """Which cells belong to each mask, shape (n, rows, columns)."""
        return self.logits > 0

    def enlarged(self, frame: Frame) -> Iterator[Mask]:
        """The masks in pixels of the photo, one at a time; those that vanish are left out."""
        for logits, score in zip(self.logits, self.score, strict=True):
            top, left, pixels = frame.enlarge(logits)
            if pixels.any():
                mask = Mask.of(pixels, score=float(np.clip(score, 0, 1)))
                yield Mask(top=top + mask.top, left=left + mask.left, bits=mask.bits, score=mask.score)


def areas(inside: NDArray[np.bool_]) -> NDArray[np.intp]:
    """Cells of each mask, shape (n, rows, columns) to (n,)."""
    return np.asarray(np.count_nonzero(_flat(inside), axis=1), dtype=np.intp)


def shared(inside: NDArray[np.bool_]) -> FloatArray:
    """Cells that each two masks share, shape (n, rows, columns) to (n, n)."""
    flat = _flat(inside).astype(np.float32)
    return np.asarray(flat @ flat.T, dtype=np.float32)


def stability(logits: FloatArray, offset: float = 1.0) -> FloatArray:
    """How little each mask depends on where the logits are cut: |logits > offset| / |logits > -offset|, shape (n,).

    Source: Kirillov et al. 2023 (Segment Anything), section 5.

    Examples
    --------
    >>> stability(np.array([[[5.0, 5.0, 0.5, 0.5]], [[5.0, 5.0, 5.0, -5.0]]], dtype=np.float32)).tolist()
    [0.5, 1.0]
    """
    # Reducing the flattened cells is several times faster than reducing two axes.
    flat = _flat(logits)
    certain = np.count_nonzero(flat > offset, axis=1)
    possible = np.count_nonzero(flat > -offset, axis=1)
    return np.asarray(certain / np.maximum(possible, 1), dtype=np.float32)


def distinct(inside: NDArray[np.bool_], score: FloatArray, overlap: float) -> NDArray[np.intp]:
    """Non-maximum suppression by masks: the indices kept, best first.

    Boxes would not do: a garment that lies on another often has the same box.

    Parameters
    ----------
    inside
        Shape (n, rows, columns).
    score
        Shape (n,).
    overlap
        A mask goes if its intersection over union with a better one that is kept exceeds this.

    Examples
    --------
    >>> masks = np.array([[[1, 1, 0, 0]], [[1, 1, 1, 0]], [[0, 0, 0, 1]]], dtype=bool)
    >>> distinct(masks, np.array([0.8, 0.9, 0.7], dtype=np.float32), 0.6).tolist()
    [1, 2]
    """
    common = shared(inside)
    own = np.diag(common)
    iou = common / np.maximum(own[:, None] + own - common, 1)
    kept: list[int] = []
    for i in np.argsort(-score, kind="stable"):
        if not np.any(iou[i, kept] > overlap):
            kept.append(int(i))
    return np.array(kept, dtype=np.intp)


def _flat(cells: NDArray[Any]) -> NDArray[Any]:
    """One row a mask; the size is named because that of nothing cannot be inferred."""
    return cells.reshape(len(cells), cells.shape[1] * cells.shape[2])
