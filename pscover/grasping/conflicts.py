"""Which grasps exclude each other: the contract, and the rules by name."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Literal, Protocol, get_args

import numpy as np

from pscover.cliques import Cliques
from pscover.errors import UnknownName
from pscover.grasping.conflict_distance import CloserThan
from pscover.grasping.conflict_ellipse import Overlapping
from pscover.grasping.conflict_partition import SamePart
from pscover.grasping.sampling import Grasps

Rule = Literal["partition", "ellipse", "distance"]
RULES: dict[Rule, type[SamePart | Overlapping | CloserThan]] = {
    "partition": SamePart,
    "ellipse": Overlapping,
    "distance": CloserThan,
}


class Conflicts(Protocol):
    """A rule that says which grasps must not be in one plan."""

    def cliques(self, grasps: Grasps, axes: tuple[float, float]) -> Cliques:
        """Groups of grasps, at most one of each of which may be chosen; `axes` is the gripper's footprint in pixels."""
        ...


def rule(name: str) -> Conflicts:
    """The rule of a name, with its default parameters.

    Examples
    --------
    >>> rule("distance")
    CloserThan(pixels=40.0)
    >>> rule("elipse")
    Traceback (most recent call last):
    ...
    pscover.errors.UnknownName: unknown conflict rule 'elipse'; did you mean 'ellipse'? Known: distance, ellipse, partition
    """
    for known in get_args(Rule):
        if known == name:
            return RULES[known]()
    raise UnknownName.among("conflict rule", name, get_args(Rule))


def joined(groups: Iterable[Cliques]) -> Cliques:
    """The cliques of several rules together."""
    listed = list(groups)
    sizes = np.concatenate([np.zeros(1, dtype=np.int64), *(np.diff(cliques.starts) for cliques in listed)])
    members = np.concatenate([np.zeros(0, dtype=np.int32), *(cliques.members for cliques in listed)])
    return Cliques.flat(np.cumsum(sizes), members)
