"""The contract of a segmenter: a file in `pscover/perception/segmenters/` that finds garments in a photo."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar, Protocol

import numpy as np
from numpy.typing import NDArray

from pscover.perception.mask import Mask


@dataclass(frozen=True, slots=True, kw_only=True)
class Stage:
    """Where time went: a stage's name, its wall and its CPU seconds."""

    name: str
    seconds: float
    cpu_seconds: float


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Segmentation:
    """What a segmenter found.

    Parameters
    ----------
    masks
        In any order; they may overlap, nest and leave gaps. Clean-up turns them into one label a pixel.
    stages
        Where the time went.
    """

    masks: tuple[Mask, ...]
    stages: tuple[Stage, ...] = ()


class Segmenter(Protocol):
    """Finds garments. Implementations are frozen dataclasses whose fields are their parameters, each with a default.

    Attributes
    ----------
    name
        As used on the command line; the file's name with hyphens.
    requires
        Importable names of the optional packages it needs.
    extra
        The extra of pscover that brings them.
    """

    name: ClassVar[str]
    requires: ClassVar[tuple[str, ...]]
    extra: ClassVar[str]

    def segment(self, photo: NDArray[np.uint8], cloth: NDArray[np.bool_]) -> Segmentation:
        """Masks of the garments.

        Parameters
        ----------
        photo
            RGB, shape (H, W, 3).
        cloth
            Which pixels show cloth rather than surface, shape (H, W); False outside the region of interest.
        """
        ...
