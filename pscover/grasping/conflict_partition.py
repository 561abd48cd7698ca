"""Grasps of one part of the partition exclude each other: the paper's rule (section 4)."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from pscover.cliques import Cliques
from pscover.grasping.sampling import Grasps


@dataclass(frozen=True, slots=True, kw_only=True)
class SamePart:
    """One clique a part: all grasps drawn from it."""

    def cliques(self, grasps: Grasps, axes: tuple[float, float]) -> Cliques:
        """The parts with at least two grasps.

        Examples
        --------
        >>> grasps = Grasps(poses=np.zeros((4, 3)), part=np.array([3, 5, 3, 3], dtype=np.int32))
        >>> [clique.tolist() for clique in SamePart().cliques(grasps, (40, 12))]
        [[0, 2, 3]]
        """
        order = np.argsort(grasps.part, kind="stable")
        sizes = np.bincount(grasps.part)
        members = order[np.repeat(sizes, sizes) >= 2]
        shared = sizes[sizes >= 2]
        return Cliques.flat(np.concatenate(([0], np.cumsum(shared))), members)
