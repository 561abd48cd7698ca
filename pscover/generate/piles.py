"""Piles of garments each of which can be reached: what is buried too deep for any plan is taken away."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from pscover.grasping.candidates import candidates
from pscover.grasping.sampling import Sampling
from pscover.infeasibility import unreachable
from pscover.scene import Scene


def reachable(scene: Scene, required: float, points: Sequence[int] = (5,)) -> Scene:
    """The scene without the garments that no plan covers often enough.

    In a dense pile a garment may show too little for any plan. Without it others stay as they are, for what lay under it
    stays hidden; but parts merge, so that it is looked again until all that are left can be reached.

    Parameters
    ----------
    scene
        Garments on a surface.
    required
        Probability with which each must be reached.
    points
        Points drawn from a part; every garment must be reached with each of these numbers.

    Returns
    -------
    Scene
        Perhaps without any garment.

    Examples
    --------
    >>> labels = np.zeros((60, 100), dtype=int)
    >>> labels[10:40, 10:40], labels[50:52, 60:62] = 1, 2
    >>> reachable(Scene.of(labels), required=0.7).garments
    1
    """
    while True:
        hopeless: set[int] = set()
        for count in points:
            instance = candidates(scene, sampling=Sampling(points=count), required=required)
            hopeless |= {found.element for found in unreachable(instance)}
        if not hopeless:
            return scene
        gone = [scene.values[j] for j in hopeless]
        labels = np.where(np.isin(scene.labels, gone), 0, scene.labels)
        names = [name for j, name in enumerate(scene.names) if j not in hopeless]
        scene = Scene.of(labels, names=names, source=f"{scene.source}, {len(gone)} taken away")
