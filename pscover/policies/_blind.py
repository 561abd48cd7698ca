"""A grasp somewhere on the cloth: the random baseline, and what is left when a policy sees nothing to do."""

from __future__ import annotations

import math

import numpy as np

from pscover.execution.sight import Sight
from pscover.robot import Pose


def anywhere(sight: Sight, random: np.random.Generator) -> Pose | None:
    """A uniform cloth pixel and a uniform angle (paper, section 6); None if no grasp may be tried anywhere."""
    rows, columns = np.nonzero(sight.free)
    if len(rows) == 0:
        return None
    which = int(random.integers(len(rows)))
    theta = float(random.uniform(-math.pi / 2, math.pi / 2))
    return Pose(x=float(columns[which]), y=float(rows[which]), theta=theta)
