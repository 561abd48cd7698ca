"""What an input shows: a scene, how it lies over the picture that it came from, and how it was made."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from pscover.perception.grid import Grid
from pscover.perception.segmenter import Stage
from pscover.scene import Scene


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Seen:
    """A scene and where it comes from.

    A photo finer than the gripper needs is looked at on a coarser grid: then the scene is smaller than the photo. What this
    class says is in pixels of the photo; what `scene` says is in pixels of the grid.

    Parameters
    ----------
    scene
        One label a pixel of the grid.
    grid
        How it lies over the photo, or over the label image.
    origin
        What the input was taken for, and how the scene was made of it.
    scores
        How sure the segmenter was of each garment, in [0, 1]; empty where nobody says.
    stages
        Where the time went.
    roi
        Corners of the region of interest in pixels of the photo; empty for the whole photo.
    """

    scene: Scene
    grid: Grid
    origin: str
    scores: tuple[float, ...] = ()
    stages: tuple[Stage, ...] = ()
    roi: tuple[tuple[float, float], ...] = ()

    @classmethod
    def whole(cls, scene: Scene, origin: str = "labels") -> Seen:
        """A scene that is as large as what it came from.

        Examples
        --------
        >>> seen = Seen.whole(Scene.of(np.ones((20, 30), dtype=int), basket=(5, 6)))
        >>> seen.basket, seen.pixels_per_cm, seen.grid.factor
        ((5.0, 6.0), 4.7, 1.0)
        """
        return cls(scene=scene, grid=Grid(photo_shape=scene.shape, shape=scene.shape), origin=origin)

    @property
    def pixels_per_cm(self) -> float:
        """Scale of the photo."""
        return self.scene.pixels_per_cm / self.grid.factor

    @property
    def basket(self) -> tuple[float, float]:
        """Where garments are taken, (x, y) in pixels of the photo."""
        same = self.grid.shape == self.grid.photo_shape
        return self.scene.basket if same else self.grid.to_photo(*self.scene.basket)

    @property
    def labels(self) -> NDArray[np.int32]:
        """The label image at the photo's size."""
        return self.grid.enlarged(self.scene.labels)

    @property
    def seconds(self) -> float:
        """Wall seconds of all stages."""
        return sum(stage.seconds for stage in self.stages)
