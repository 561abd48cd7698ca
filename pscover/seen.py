"""What an input shows: a scene, how it lies over the picture that it came from, and how it was made."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from pscover.perception.depth import GarmentHeight, HeightMap, garment_heights
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
    heights
        Above the table, of the scene's shape, where depth was given.
    """

    scene: Scene
    grid: Grid
    origin: str
    scores: tuple[float, ...] = ()
    stages: tuple[Stage, ...] = ()
    roi: tuple[tuple[float, float], ...] = ()
    heights: HeightMap | None = None

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
    def garment_heights(self) -> tuple[GarmentHeight, ...] | None:
        """How high each garment lies, in metres; None without depth."""
        return None if self.heights is None else garment_heights(self.heights, self.scene.segments, self.scene.garments)

    @property
    def table_distance(self) -> float:
        """Depth of the table in the middle of the photo in metres; NaN without depth."""
        height, width = self.grid.photo_shape
        return math.nan if self.heights is None else self.heights.table.depth_at((width - 1) / 2, (height - 1) / 2)

    @property
    def depth_origin(self) -> str:
        """What was used of a depth image; empty without.

        Examples
        --------
        >>> from dataclasses import replace
        >>> from pscover.perception.depth import height_map
        >>> seen = Seen.whole(Scene.of(np.ones((20, 30), dtype=int)))
        >>> replace(seen, heights=height_map(np.full((20, 30), 0.8))).depth_origin
        'depth, 1 m a unit; table found 0.800 m away, flat to 0.0 mm'
        """
        heights = self.heights
        if heights is None:
            return ""
        how = "found" if heights.fitted else "given"
        flat = f", flat to {1000 * heights.spread:.1f} mm" if math.isfinite(heights.spread) else ", but not seen there"
        lens = "; heights perpendicular to it" if heights.camera is not None else ""
        share = heights.hole_share
        holes = f"; {'<1' if share < 0.01 else round(100 * share)} % of the pixels without depth, filled" if share else ""
        unit = f"{heights.metres_per_unit:g} m a unit"
        return f"{heights.source}, {unit}; table {how} {self.table_distance:.3f} m away{flat}{lens}{holes}"

    @property
    def seconds(self) -> float:
        """Wall seconds of all stages."""
        return sum(stage.seconds for stage in self.stages)
