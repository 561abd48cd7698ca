"""The contract of a predictor: what a grasp will probably remove."""

from __future__ import annotations

from typing import Protocol

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csc_array

from pscover.scene import Scene


class Predictor(Protocol):
    """Anything that says with which probability a grasp removes a garment: a formula or a learned model."""

    @property
    def axes(self) -> tuple[float, float]:
        """The gripper's footprint: length along theta and width across it, in pixels."""
        ...

    def probability(self, scene: Scene, poses: NDArray[np.float64]) -> csc_array:
        """p_ij for grasps at `poses` (x, y in pixels, theta in radians; shape (grasps, 3)).

        Returns
        -------
        csc_array
            Shape (garments, grasps), values in (0, 1]; what is not stored is 0.
        """
        ...
