"""From a scene to an instance: candidate grasps, what each removes, and which exclude each other."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike, NDArray

from pscover.grasping.conflicts import Conflicts, joined, rule
from pscover.grasping.ellipse import Ellipse
from pscover.grasping.predictor import Predictor
from pscover.grasping.sampling import Sampling
from pscover.instance import Instance, Meta
from pscover.scene import Scene

SAMPLING = Sampling()
ELLIPSE = Ellipse()


def candidates(
    scene: Scene,
    *,
    sampling: Sampling = SAMPLING,
    predictor: Predictor = ELLIPSE,
    conflicts: str | Conflicts | Sequence[str | Conflicts] = "partition",
    required: ArrayLike = 0.7,
    seed: int = 0,
) -> Instance:
    """The grasp-planning problem of a scene: garments are the elements, grasps the candidates (paper, sections 2 and 4).

    Parameters
    ----------
    scene
        What lies on the surface.
    sampling
        How grasps are drawn.
    predictor
        What a grasp will probably remove.
    conflicts
        Which grasps exclude each other: a rule's name ("partition", the paper's; "ellipse"; "distance"), a rule with
        parameters, or several of them, all of which then hold.
    required
        q_j in [0, 1): one number for all garments or one each, in the order of `scene.values`.
    seed
        Of the draw.

    Returns
    -------
    Instance
        `meta.elements` are the garments' names, `meta.poses` the grasps. A grasp that removes nothing is left out. A
        scene without garments gives an instance without elements and candidates.

    Raises
    ------
    InvalidInstance
        If `required` does not fit the garments.
    UnknownName
        For an unknown rule.

    Examples
    --------
    >>> labels = np.zeros((60, 100), dtype=int)
    >>> labels[10:40, 10:40], labels[10:40, 60:90] = 1, 2
    >>> instance = candidates(Scene.of(labels))
    >>> instance.elements, instance.candidates, len(instance.conflicts)
    (2, 60, 2)
    """
    grasps = sampling.draw(scene, seed)
    probability = predictor.probability(scene, grasps.poses)
    useful: NDArray[np.bool_] = np.diff(probability.indptr) > 0
    grasps = grasps.only(useful)
    several = [conflicts] if isinstance(conflicts, str) or not isinstance(conflicts, Sequence) else conflicts
    rules = [rule(given) if isinstance(given, str) else given for given in several]
    return Instance.of(
        probability[:, useful],
        required,
        conflicts=joined(given.cliques(grasps, predictor.axes) for given in rules),
        meta=Meta(name=scene.source, source=scene.source, elements=scene.names, poses=grasps.poses),
    )
